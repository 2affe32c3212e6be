"""Plots, reports and tables that cannot be written: message, exit code, and the unchanged earlier file."""

import gc
import resource
import sys
from contextlib import contextmanager, suppress
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from imageio.v2 import get_writer

from flexcam import prepare, read_case, solve
from flexcam.analysis.run import open_result_file
from flexcam.cli.main import main
from flexcam.dynamics import RunFailedError
from flexcam.plotting.rendering import save_view
from tests.thinning import mostly_slow

OUTPUT_COMMANDS = {
    "motion.svg": ("plot", "RESULT", "-o"),
    "motion.png": ("plot", "RESULT", "-o"),
    "page.html": ("report", "RESULT", "-o"),
    "tables/free.pvd": ("export", "RESULT", "--format", "pvd", "-o"),
    "tables/free.csv": ("export", "RESULT", "--format", "csv", "-o"),
    "tables/free-modes.vtkhdf": ("modes", "CASE", "-o"),
    "starter.toml": ("new", "pushrod-engine", "-o"),
}


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    (folder / "free.toml").write_text("""
format = 1
nodes = { a = [0, 0, 0], b = [0, "0.1 m", 0] }
materials = { steel = { E = "207 GPa", nu = 0.3, density = 7800 } }
sections = { rod = { shape = "circle", diameter = "10 mm" } }
members = { rod = { nodes = ["a", "b"], material = "steel", section = "rod" } }
supports = { a = ["ux", "uy", "uz", "rx", "ry", "rz"] }
run = { speed = "3000 rpm", revolutions = 0.1, steps_per_revolution = 360 }
output = { probes = ["b"] }
""")
    ready = prepare(read_case(folder / "free.toml"))
    file = open_result_file(ready, folder)
    assert solve(ready.problem, ready.scheme, save=ready.save, sinks=[file]).status.ok
    return file.path


@contextmanager
def full_disk(size=500):
    """Limit the size of written files, so that the system reports a full disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    # A module imported under the limit would stay truncated.
    writes, sys.dont_write_bytecode = sys.dont_write_bytecode, True
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        sys.dont_write_bytecode = writes
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("name", mostly_slow(OUTPUT_COMMANDS, 2))
def test_full_disk_leaves_earlier_output_unchanged(tmp_path, capsys, result, name):
    words = [
        {"RESULT": str(result), "CASE": str(result.with_suffix(".toml"))}.get(one, one) for one in OUTPUT_COMMANDS[name]
    ]
    target = tmp_path / name
    target.parent.mkdir(exist_ok=True)
    target.write_text("what stood there before")
    with full_disk(), pytest.raises(SystemExit) as ended:
        main([*words, str(target if target.parent == tmp_path else target.parent), "--overwrite"])
    message = capsys.readouterr().err
    assert ended.value.code == 3, message
    assert message.startswith("not-saved: ")
    assert "could not be written" in message
    assert "free space" in message
    assert target.read_text() == "what stood there before"
    assert not [one for one in tmp_path.rglob("*") if one.name.startswith(".flexcam")]


def test_incomplete_movie_is_detected(tmp_path):
    """Movie writers may end without an error on a full disk."""
    (tmp_path / "movie.mp4").write_text("what stood there before")

    def write_header(path, **options):
        Path(path).write_bytes(b"ftyp")

    plotter = SimpleNamespace(open_movie=write_header, write_frame=lambda: None, close=lambda: None)
    stage = SimpleNamespace(plotter=plotter, show=lambda instant: None)
    with pytest.raises(RunFailedError, match="its end is missing"):
        save_view(stage, tmp_path / "movie.mp4", [0, 1], 0)
    assert [one.read_text() for one in tmp_path.iterdir()] == ["what stood there before"]


class NoisePlotter:
    """Plotter of random images, which need disk space; like pyvista it ignores errors of its writer on closing."""

    def open_gif(self, path, **options):
        self.mwriter = get_writer(path, mode="I")

    def write_frame(self):
        self.mwriter.append_data(np.random.default_rng(1).integers(0, 255, (60, 80, 3), dtype=np.uint8))

    def close(self):
        with suppress(OSError):
            self.mwriter.close()


def test_full_disk_during_gif_prints_no_library_output(tmp_path, capfd):
    (tmp_path / "movie.gif").write_text("what stood there before")
    stage = SimpleNamespace(plotter=NoisePlotter(), show=lambda instant: None)
    with (
        full_disk(),
        pytest.raises(RunFailedError, match=r"movie\.gif could not be written: File too large; free space"),
    ):
        save_view(stage, tmp_path / "movie.gif", [0, 1, 2], 0)
    del stage
    gc.collect()
    assert capfd.readouterr() == ("", "")
    assert [one.read_text() for one in tmp_path.iterdir()] == ["what stood there before"]


def test_report_of_folder_is_refused(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        main(["report", "."])
    assert ended.value.code == 2
    assert "got ." in capsys.readouterr().err
