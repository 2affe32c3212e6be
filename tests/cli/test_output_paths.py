"""Paths of output files: folders that cannot be written, broken links, and files that would replace each other."""

import errno
import os
from pathlib import Path

import pytest

from flexcam import InputError
from flexcam.io import check_folder, check_folder_name, check_writable, create_folder

INLINE = Path(__file__).parents[1] / "data/inline.toml"
STIFF = "springs.valve.stiffness"
WORDS = {
    "trade": (),
    "campbell": ("--response",),
    "sensitivity": ("--of", "frequency.1", "--to", STIFF),
    "optimize": ("--vary", f"{STIFF}=30:60kN/m", "--least", "frequency.1"),
}

CHECKS = {
    "folder": create_folder,
    "try": check_folder,
}


@pytest.mark.parametrize("check", CHECKS)
def test_a_link_that_leads_nowhere(check, tmp_path):
    link = tmp_path / "link"
    link.symlink_to("nowhere")
    with pytest.raises(InputError, match="link is not a folder"):
        CHECKS[check](link)
    assert link.is_symlink()
    assert not link.exists()


@pytest.mark.parametrize("check", CHECKS)
@pytest.mark.parametrize("below", ["", "x", "x/y"])
def test_a_file_in_the_place_of_a_folder(check, below, tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match=f"{tmp_path}/file is not a folder"):
        CHECKS[check](tmp_path / "file" / below)


def test_a_folder_is_tried_and_none_is_left(tmp_path, monkeypatch):
    check_folder(tmp_path / "a/b/c")
    assert not list(tmp_path.iterdir())
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a").mkdir()
    check_folder(Path("a/b"))
    assert [path.name for path in tmp_path.rglob("*")] == ["a"]


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="a folder that takes no files, even of root's")
def test_a_folder_that_takes_no_file(flexcam, case):
    """Before the budget, which is none there."""
    for given in ("/proc", "/proc/x/y.vtkhdf"):
        stderr = flexcam("run", case, "-o", given).err
        assert f"folder: got {given}" in stderr
        assert "[Errno" not in stderr


def test_a_folder_named_like_a_file(flexcam, case, tmp_path):
    """It is refused with the name that was likely meant; one that is there already is taken."""
    stderr = flexcam("sweep", case, "--set", "run.speed=1000,2000rpm", "-o", "sub/grid.h5").err
    assert "folder: got sub/grid.h5" in stderr
    assert "such as sub/grid" in stderr
    (tmp_path / "mine.h5").mkdir()
    for name in ("mine.h5", "results.v2", "0.5"):
        assert check_folder_name(tmp_path / name) == tmp_path / name


def test_an_ordinary_link_to_a_folder_is_followed(tmp_path):
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to("real")
    check_folder(tmp_path / "link/below")
    assert os.path.lexists(create_folder(tmp_path / "link/below"))
    assert (tmp_path / "real/below").is_dir()


@pytest.mark.parametrize("words", [
    ("trade", "--csv"), ("trade", "--plot"), ("campbell", "--response", "--csv"),
    ("optimize", "--vary", "springs.valve.stiffness=30:60kN/m", "--least", "frequency.1", "-o"),
])  # fmt: skip
def test_a_folder_that_may_not_be_written_is_told_before_anything_is_computed(
    flexcam, case, tmp_path, monkeypatch, words
):
    """Root may write everywhere: an error stands for what anybody else would get."""
    locked = tmp_path / "locked"
    locked.mkdir()

    def refused(**folder):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    monkeypatch.setattr("tempfile.TemporaryFile", refused)
    name = {"--csv": "x.csv", "--plot": "x.svg", "-o": "x.toml"}[words[-1]]
    command, *options = words
    for below in (locked, locked / "deeper"):
        done = flexcam(command, case, *options, below / name)
        assert done.code == 2
        assert f"folder: got {below}, expected a folder with write permission. Permission denied" in done.err
    assert not list(locked.iterdir())


def test_a_device_takes_what_is_written():
    """Whatever may be made beside it."""
    check_writable("output", Path("/dev/null"), overwrite=True)


@pytest.mark.parametrize("command", WORDS)
def test_two_files_of_one_name(flexcam, case, command):
    done = flexcam(command, case, *WORDS[command], "--csv", "one.svg", "--plot", "./one.svg")
    assert done.code == 2
    assert "--plot: got one.svg, expected a file other than --csv. One would replace the other" in done.err
    assert not Path("one.svg").exists()


@pytest.mark.parametrize("command", WORDS)
def test_the_case_itself_is_never_written_over(flexcam, case, command):
    """Not by a link to it either, and whatever else is asked for."""
    Path("link.toml").symlink_to(case)
    done = flexcam(command, case, *WORDS[command], "--csv", "link.toml", "--overwrite")
    assert done.code == 2
    assert "--csv: got link.toml, expected a file other than the input. It would be lost" in done.err
    assert case.read_bytes() == INLINE.read_bytes()


@pytest.mark.parametrize("words", [("harmonic",), ("polydyne",), ("polydyne", "--frequency", "400Hz")])
def test_a_lift_is_not_written_over_its_case(flexcam, case, words):
    done = flexcam("synthesize", *words, case, "-o", case, "--overwrite")
    assert done.code == 2
    assert "a file other than the input" in done.err
    assert case.read_bytes() == INLINE.read_bytes()


def test_the_best_variant_is_another_file(flexcam, case):
    done = flexcam(
        "optimize", case, *WORDS["optimize"], "-o", case, "--csv", "t.toml", "--plot", "t.svg", "--overwrite"
    )
    assert done.code == 2
    assert "--output: got" in done.err
    done = flexcam("optimize", case, *WORDS["optimize"], "-o", "best.toml", "--csv", "best.toml")
    assert done.code == 2
    assert "--csv: got best.toml, expected a file other than --output" in done.err
    assert not Path("best.toml").exists()


def test_a_profile_is_not_written_over_by_its_lift(flexcam, tmp_path):
    profile = tmp_path / "profile.csv"
    profile.write_text("x,y\n", encoding="utf-8")
    words = ("--follower", '{ type = "flat" }', "--base-radius", "18 mm", "-o", profile, "--overwrite")
    done = flexcam("cam", "--from-profile", profile, *words)
    assert done.code == 2
    assert "a file other than the input" in done.err


def test_pictures_of_a_law(flexcam):
    assert flexcam("law", "3-4-5", "--plot", "p.svg", "--spectrum", "p.svg").code == 2
    assert not Path("p.svg").exists()
    Path("taken.svg").touch()
    assert flexcam("law", "3-4-5", "--plot", "p.svg", "--spectrum", "taken.svg").code == 2
    assert not Path("p.svg").exists()  # none is written where not all can be


@pytest.mark.slow
def test_laws_of_a_front_are_written_together_or_not_at_all(flexcam):
    Path("best-3.toml").touch()
    words = ("--family", "harmonic", "--orders", "1", "--orders", "3", "--minimize", "Ca", "--pareto", "Cv")
    done = flexcam("synthesize", "law", *words, "--count", "3", "-o", "best.toml")
    assert done.code == 2
    assert "output: best-3.toml already exists" in done.err
    assert not Path("best-1.toml").exists()


@pytest.mark.parametrize(
    "words", [("--minimize", "Ca", "--minimize", "Ca=2"), ("--minimize", "Ca", "--bound", "Cj=50", "--bound", "Cj=60")]
)
def test_a_criterion_is_given_once(flexcam, words):
    done = flexcam("synthesize", "law", *words)
    assert done.code == 2
    assert "every criterion once" in done.err
