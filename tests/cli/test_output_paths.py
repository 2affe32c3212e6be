"""Paths of output files: folders without write permission, broken links, and files that would overwrite each other."""

import errno
import os
from pathlib import Path

import pytest

from flexcam import InputError
from flexcam.io import check_folder, check_folder_name, check_writable, create_folder

INLINE = Path(__file__).parents[1] / "data/inline.toml"
STIFF = "springs.valve.stiffness"
STUDY_OPTIONS = {
    "trade": (),
    "campbell": ("--response",),
    "sensitivity": ("--of", "frequency.1", "--to", STIFF),
    "optimize": ("--vary", f"{STIFF}=30:60kN/m", "--least", "frequency.1"),
}

CHECKS = {"folder": create_folder, "try": check_folder}


@pytest.mark.parametrize("check", CHECKS)
def test_broken_link_is_refused_as_folder(check, tmp_path):
    link = tmp_path / "link"
    link.symlink_to("nowhere")
    with pytest.raises(InputError, match="link is not a folder"):
        CHECKS[check](link)
    assert link.is_symlink()
    assert not link.exists()


@pytest.mark.parametrize("check", CHECKS)
@pytest.mark.parametrize("below", ["", "x", "x/y"])
def test_file_is_refused_as_folder(check, below, tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match=f"{tmp_path}/file is not a folder"):
        CHECKS[check](tmp_path / "file" / below)


def test_check_folder_creates_no_folder(tmp_path, monkeypatch):
    check_folder(tmp_path / "a/b/c")
    assert not list(tmp_path.iterdir())
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a").mkdir()
    check_folder(Path("a/b"))
    assert [path.name for path in tmp_path.rglob("*")] == ["a"]


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="a folder that takes no files, even of root's")
def test_unwritable_folder_is_refused(flexcam, case):
    """The folder is checked before the disk space, which is unknown there."""
    for given in ("/proc", "/proc/x/y.vtkhdf"):
        stderr = flexcam("run", case, "-o", given).err
        assert f"folder: got {given}" in stderr
        assert "[Errno" not in stderr


def test_folder_with_file_suffix_is_refused(flexcam, case, tmp_path):
    """The message suggests a name; an existing folder with such a suffix is accepted."""
    stderr = flexcam("sweep", case, "--set", "run.speed=1000,2000rpm", "-o", "sub/grid.h5").err
    assert "folder: got sub/grid.h5" in stderr
    assert "such as sub/grid" in stderr
    (tmp_path / "mine.h5").mkdir()
    for name in ("mine.h5", "results.v2", "0.5"):
        assert check_folder_name(tmp_path / name) == tmp_path / name


def test_link_to_folder_is_followed(tmp_path):
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to("real")
    check_folder(tmp_path / "link/below")
    assert os.path.lexists(create_folder(tmp_path / "link/below"))
    assert (tmp_path / "real/below").is_dir()


@pytest.mark.parametrize("words", [
    ("trade", "--csv"), ("trade", "--plot"), ("campbell", "--response", "--csv"),
    ("optimize", "--vary", "springs.valve.stiffness=30:60kN/m", "--least", "frequency.1", "-o"),
])  # fmt: skip
def test_study_refuses_folder_without_write_permission(flexcam, case, tmp_path, monkeypatch, words):
    """Root can write everywhere: a patched error replaces the missing permission."""
    locked = tmp_path / "locked"
    locked.mkdir()

    def deny_write(**folder):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    monkeypatch.setattr("tempfile.TemporaryFile", deny_write)
    name = {"--csv": "x.csv", "--plot": "x.svg", "-o": "x.toml"}[words[-1]]
    command, *options = words
    for folder in (locked, locked / "deeper"):
        done = flexcam(command, case, *options, folder / name)
        assert done.code == 2
        assert f"folder: got {folder}, expected a folder with write permission. Permission denied" in done.err
    assert not list(locked.iterdir())


def test_device_is_valid_output():
    """A device needs no new file in its folder."""
    check_writable("output", Path("/dev/null"), overwrite=True)


@pytest.mark.parametrize("command", STUDY_OPTIONS)
def test_csv_and_plot_require_distinct_files(flexcam, case, command):
    done = flexcam(command, case, *STUDY_OPTIONS[command], "--csv", "one.svg", "--plot", "./one.svg")
    assert done.code == 2
    assert "--plot: got one.svg, expected a file other than --csv. One would replace the other" in done.err
    assert not Path("one.svg").exists()


@pytest.mark.parametrize("command", STUDY_OPTIONS)
def test_study_does_not_overwrite_case(flexcam, case, command):
    """Neither through a link to the case nor with --overwrite."""
    Path("link.toml").symlink_to(case)
    done = flexcam(command, case, *STUDY_OPTIONS[command], "--csv", "link.toml", "--overwrite")
    assert done.code == 2
    assert "--csv: got link.toml, expected a file other than the input. It would be lost" in done.err
    assert case.read_bytes() == INLINE.read_bytes()


@pytest.mark.parametrize("words", [("harmonic",), ("polydyne",), ("polydyne", "--frequency", "400Hz")])
def test_synthesize_does_not_overwrite_case(flexcam, case, words):
    done = flexcam("synthesize", *words, case, "-o", case, "--overwrite")
    assert done.code == 2
    assert "a file other than the input" in done.err
    assert case.read_bytes() == INLINE.read_bytes()


def test_best_variant_requires_distinct_file(flexcam, case):
    done = flexcam(
        "optimize", case, *STUDY_OPTIONS["optimize"], "-o", case, "--csv", "t.toml", "--plot", "t.svg", "--overwrite"
    )
    assert done.code == 2
    assert "--output: got" in done.err
    done = flexcam("optimize", case, *STUDY_OPTIONS["optimize"], "-o", "best.toml", "--csv", "best.toml")
    assert done.code == 2
    assert "--csv: got best.toml, expected a file other than --output" in done.err
    assert not Path("best.toml").exists()


def test_lift_does_not_overwrite_profile(flexcam, tmp_path):
    profile = tmp_path / "profile.csv"
    profile.write_text("x,y\n", encoding="utf-8")
    words = ("--follower", '{ type = "flat" }', "--base-radius", "18 mm", "-o", profile, "--overwrite")
    done = flexcam("cam", "--from-profile", profile, *words)
    assert done.code == 2
    assert "a file other than the input" in done.err


def test_law_plots_require_distinct_new_files(flexcam):
    assert flexcam("law", "3-4-5", "--plot", "p.svg", "--spectrum", "p.svg").code == 2
    assert not Path("p.svg").exists()
    Path("taken.svg").touch()
    assert flexcam("law", "3-4-5", "--plot", "p.svg", "--spectrum", "taken.svg").code == 2
    assert not Path("p.svg").exists()  # no plot is written unless all plots can be written


@pytest.mark.slow
def test_pareto_laws_are_written_all_or_none(flexcam):
    Path("best-3.toml").touch()
    words = ("--family", "harmonic", "--orders", "1", "--orders", "3", "--minimize", "Ca", "--pareto", "Cv")
    done = flexcam("synthesize", "law", *words, "--count", "3", "-o", "best.toml")
    assert done.code == 2
    assert "output: best-3.toml already exists" in done.err
    assert not Path("best-1.toml").exists()


@pytest.mark.parametrize(
    "words", [("--minimize", "Ca", "--minimize", "Ca=2"), ("--minimize", "Ca", "--bound", "Cj=50", "--bound", "Cj=60")]
)
def test_repeated_criterion_is_refused(flexcam, words):
    done = flexcam("synthesize", "law", *words)
    assert done.code == 2
    assert "every criterion once" in done.err
