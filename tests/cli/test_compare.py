"""The command compare: a lumped train, a case with its result, and models over speed."""

import math
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from flexcam import compare, read_case, run

CASE = Path(__file__).resolve().parents[2] / "cases/pushrod-engine/intake.toml"
QUICK = ("--set", "run.steps_per_revolution=360", "--set", "run.revolutions=1")


def test_compare_uses_lift_of_lumped_train(flexcam, tmp_path):
    """A probe with six components is compared along the follower's direction, as in all other commands."""
    case = tmp_path / "train.toml"
    assert flexcam("new", "lumped-train", "-o", case).code == 0
    done = flexcam("compare", case, "--set", "run.steps_per_revolution=360")
    assert done.code == 0, done.err
    assert "at valve.uy" in done.out


def test_peak_acceleration_occurs_at_seating(flexcam):
    """The maximum acceleration of the valve occurs when it seats, after the lift."""
    response = run(read_case(CASE, QUICK[1::2]))
    output = flexcam("compare", CASE, *QUICK).out
    angle = float(re.search(r"at cam ([\d.]+) deg", " ".join(output.split()))[1])
    peak = int(np.argmax(np.abs(response["valve"].acceleration)))
    assert angle == pytest.approx(math.degrees(response.angle[peak]), abs=0.06)  # printed to 0.1 deg
    assert angle > 250.0


@pytest.mark.slow
def test_compare_models_over_speed_with_plot(flexcam, tmp_path):
    picture = tmp_path / "forces.svg"
    options = ("--lowest", "2000rpm", "--highest", "7000rpm", "--count", "2", "--plot", picture, *QUICK)
    answer = flexcam("compare", CASE, *options, "--json").json
    assert answer["rpm"] == [2000.0, 7000.0]
    assert answer["bilateral_unilateral_part_rpm"] == 7000.0
    assert answer["forces_n"]["bilateral"][1][0] < 0.0
    assert picture.read_text(encoding="utf-8").count("<path") > 10
    assert flexcam("compare", CASE, *options).code == 2  # the picture exists
    output = " ".join(flexcam("compare", CASE, *options, "--overwrite").out.split())
    assert "The bilateral and unilateral forces differ by more than 5% from 7000 crank rpm upward." in output


def test_probe_of_one_model_only_is_refused(flexcam):
    """The default probe is that of the first case; the message lists the probes that both models have."""
    quick = ("--set", "run.steps_per_revolution=90", "--set", "run.revolutions=0.1", "--set", "run.speed=2500rpm")
    done = flexcam("compare", CASE, "--against", CASE.parents[1] / "direct-acting/bucket.toml", *quick)
    assert done.code == 2
    assert "got 'valve', expected cam.ux" in done.err
    assert "tappet" not in done.err
    assert "One of the models has no such probe" in done.err


def test_compare_over_speed_refuses_invalid_options(flexcam):
    for options in (("--count", "1"), ("--contact", "nosuch"), ("--highest", "100rpm")):
        assert flexcam("compare", CASE, "--lowest", "2000rpm", *options).code == 2


@pytest.mark.slow
def test_compared_case_and_result_have_distinct_names(flexcam, tmp_path):
    """Both have the name `my`: the suffix distinguishes case and result, the folder two results."""
    shutil.copy(Path(__file__).parents[1] / "data/inline.toml", tmp_path / "my.toml")
    few = ("--set", "run.revolutions=0.1", "--set", "run.steps_per_revolution=360")
    for folder in ("a", "b"):
        assert flexcam("run", "my.toml", *few, "-o", folder).code == 0
    names = flexcam("compare", "my.toml", "--against", "a/my.vtkhdf", *few, "--json").json["compared"]
    assert names == ["my.toml", "my.vtkhdf"]
    names = flexcam("compare", "a/my.vtkhdf", "--against", "b/my.vtkhdf", "--json").json["compared"]
    assert names == ["a/my.vtkhdf", "b/my.vtkhdf"]


@pytest.mark.slow
def test_compare_reports_common_range_of_unequal_runs(flexcam, tmp_path):
    shutil.copy(Path(__file__).parents[1] / "data/inline.toml", tmp_path / "my.toml")
    for name, turns in (("short", 0.1), ("long", 0.2)):
        few = ("--set", f"run.revolutions={turns}", "--set", "run.steps_per_revolution=360")
        assert flexcam("run", "my.toml", *few, "-o", "out", "--name", name).code == 0
    short, long = "out/short.vtkhdf", "out/long.vtkhdf"
    for pair in ((short, long), (long, short)):
        output = " ".join(flexcam("compare", pair[0], "--against", pair[1]).out.split())
        assert "Compared: revolutions 0 to 0.1, which both runs have; 'long' continues to 0.2" in output
    assert "Compared:" not in flexcam("compare", long, "--against", long).out


def test_lift_at_peak_acceleration():
    """A cycloidal rise has its peak acceleration at 1/4 and 3/4 of its angle: 1/4 - 1/(2 pi) of the lift."""
    response = run(read_case(Path(__file__).parents[2] / "cases/tayeb/model-1-cycloidal.toml"), rigid=True)
    lift = compare(response, response, "valve", 2500.0).peak_lift
    assert min(lift, 1.0 - lift) == pytest.approx(0.25 - 0.5 / math.pi, abs=2e-3)  # of a step
