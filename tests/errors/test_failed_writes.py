"""A picture, page or table that cannot be written: a message and an exit code, and what stood there before stays."""

from __future__ import annotations

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

ASKED = {
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
    """Let no file grow beyond a size: the system refuses as it does on a full disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    writes, sys.dont_write_bytecode = sys.dont_write_bytecode, True  # a module imported meanwhile would stay cut off
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        sys.dont_write_bytecode = writes
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("name", mostly_slow(ASKED, 2))
def test_a_disk_that_is_full(tmp_path, capsys, result, name):
    words = [{"RESULT": str(result), "CASE": str(result.with_suffix(".toml"))}.get(one, one) for one in ASKED[name]]
    target = tmp_path / name
    target.parent.mkdir(exist_ok=True)
    target.write_text("what stood there before")
    with full_disk(), pytest.raises(SystemExit) as ended:
        main([*words, str(target if target.parent == tmp_path else target.parent), "--overwrite"])
    told = capsys.readouterr().err
    assert ended.value.code == 3, told
    assert told.startswith("not-saved: ")
    assert "could not be written" in told
    assert "free space" in told
    assert target.read_text() == "what stood there before"
    assert not [one for one in tmp_path.rglob("*") if one.name.startswith(".flexcam")]


def test_a_movie_whose_writer_keeps_silent(tmp_path):
    """Writers of movies may end without a word on a full disk."""
    (tmp_path / "movie.mp4").write_text("what stood there before")

    def opened(path, **options):
        Path(path).write_bytes(b"ftyp")

    plotter = SimpleNamespace(open_movie=opened, write_frame=lambda: None, close=lambda: None)
    stage = SimpleNamespace(plotter=plotter, show=lambda instant: None)
    with pytest.raises(RunFailedError, match="its end is missing"):
        save_view(stage, tmp_path / "movie.mp4", [0, 1], 0)
    assert [one.read_text() for one in tmp_path.iterdir()] == ["what stood there before"]


class Filmed:
    """A plotter of noise, whose pictures take room; like that of pyvista it passes over what its writer says."""

    def open_gif(self, path, **options):
        self.mwriter = get_writer(path, mode="I")

    def write_frame(self):
        self.mwriter.append_data(np.random.default_rng(1).integers(0, 255, (60, 80, 3), dtype=np.uint8))

    def close(self):
        with suppress(OSError):
            self.mwriter.close()


def test_a_movie_of_pictures_on_a_full_disk(tmp_path, capfd):
    """Its writer's own words, lines of Python's, are nothing to tell a user."""
    (tmp_path / "movie.gif").write_text("what stood there before")
    stage = SimpleNamespace(plotter=Filmed(), show=lambda instant: None)
    with (
        full_disk(),
        pytest.raises(RunFailedError, match=r"movie\.gif could not be written: File too large; free space"),
    ):
        save_view(stage, tmp_path / "movie.gif", [0, 1, 2], 0)
    del stage
    gc.collect()
    assert capfd.readouterr() == ("", "")
    assert [one.read_text() for one in tmp_path.iterdir()] == ["what stood there before"]


def test_a_folder_is_no_result(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        main(["report", "."])
    assert ended.value.code == 2
    assert "got ." in capsys.readouterr().err
