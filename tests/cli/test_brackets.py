"""What stands in brackets is printed as it is: units, and whatever a title holds."""

from __future__ import annotations


def test_units_and_titles_in_brackets(flexcam, tmp_path):
    case = tmp_path / "train.toml"
    assert flexcam("new", "lumped-train", "-o", case).code == 0
    text = case.read_text(encoding="utf-8").replace("Lumped valve train", "[red]A[/red] [m] [/x]", 1)
    case.write_text(text.replace("3600", "360"), encoding="utf-8")
    title = "[red]A[/red] [m] [/x]"
    for command in (("check", case), ("run", case, "-o", tmp_path), ("info", tmp_path / "train.vtkhdf")):
        done = flexcam(*command)
        assert done.code == 0, done.err
        assert title in done.out


def test_compare_takes_the_lift_of_a_train_of_masses(flexcam, tmp_path):
    """A probe of six components is compared along the follower's direction, as by all other commands."""
    case = tmp_path / "train.toml"
    assert flexcam("new", "lumped-train", "-o", case).code == 0
    done = flexcam("compare", case, "--set", "run.steps_per_revolution=360")
    assert done.code == 0, done.err
    assert "at valve.uy" in done.out
