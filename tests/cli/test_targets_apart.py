"""Files that would take each other's place, or that of what is read, are refused before anything is computed."""

from __future__ import annotations

from pathlib import Path

import pytest

INLINE = Path(__file__).parents[1] / "data/inline.toml"
STIFF = "springs.valve.stiffness"
WORDS = {
    "trade": (),
    "campbell": ("--response",),
    "sensitivity": ("--of", "frequency.1", "--to", STIFF),
    "optimize": ("--vary", f"{STIFF}=30:60kN/m", "--least", "frequency.1"),
}


@pytest.fixture
def case(tmp_path):
    path = tmp_path / "case.toml"
    path.write_bytes(INLINE.read_bytes())
    return path


@pytest.mark.parametrize("command", WORDS)
def test_two_files_of_one_name(flexcam, case, command):
    done = flexcam(command, case, *WORDS[command], "--csv", "one.svg", "--plot", "./one.svg")
    assert done.code == 2
    assert "--plot: given one.svg; allowed: a file other than --csv; one would replace the other" in done.err
    assert not Path("one.svg").exists()


@pytest.mark.parametrize("command", WORDS)
def test_the_case_itself_is_never_written_over(flexcam, case, command):
    """Not by a link to it either, and whatever else is asked for."""
    Path("link.toml").symlink_to(case)
    done = flexcam(command, case, *WORDS[command], "--csv", "link.toml", "--overwrite")
    assert done.code == 2
    assert "--csv: given link.toml; allowed: a file other than the input; it would be lost" in done.err
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
    assert "--output: given" in done.err
    done = flexcam("optimize", case, *WORDS["optimize"], "-o", "best.toml", "--csv", "best.toml")
    assert done.code == 2
    assert "--csv: given best.toml; allowed: a file other than --output" in done.err
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


def test_laws_of_a_front_are_written_together_or_not_at_all(flexcam):
    Path("best-3.toml").touch()
    words = ("--family", "harmonic", "--orders", "1", "--orders", "3", "--minimize", "Ca", "--pareto", "Cv")
    done = flexcam("synthesize", "law", *words, "--count", "3", "-o", "best.toml")
    assert done.code == 2
    assert "output: given best-3.toml" in done.err
    assert not Path("best-1.toml").exists()


@pytest.mark.parametrize(
    "words", [("--minimize", "Ca", "--minimize", "Ca=2"), ("--minimize", "Ca", "--bound", "Cj=50", "--bound", "Cj=60")]
)
def test_a_criterion_is_given_once(flexcam, words):
    done = flexcam("synthesize", "law", *words)
    assert done.code == 2
    assert "every criterion once" in done.err
