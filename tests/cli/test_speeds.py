"""Commands over speed: limits and parting."""

from __future__ import annotations

from pathlib import Path

import pytest

CASE = Path(__file__).resolve().parents[2] / "cases/pushrod-engine/intake.toml"
QUICK = ("--set", "run.steps_per_revolution=360", "--set", "run.revolutions=1")

pytestmark = pytest.mark.usefixtures("machine_code")


def test_limits_as_json(flexcam):
    told = ("--lowest", "6000rpm", "--highest", "8000rpm", "--tolerance", "2500rpm", *QUICK)
    answer = flexcam("limits", CASE, *told, "--json").json
    assert {"loss_of_contact_rpm", "bounce_rpm", "buckling_rpm", "first", "spring_margin"} <= set(answer)
    assert answer["shaft"] == "crank"
    assert answer["first"] == "loss_of_contact"
    assert answer["buckling_margins"]["pushrod"] > 1.0


def test_parting_draws_and_tells(flexcam, tmp_path):
    picture = tmp_path / "parting.svg"
    told = ("--lowest", "2000rpm", "--highest", "7000rpm", "--count", "2", "--plot", picture, *QUICK)
    answer = flexcam("parting", CASE, *told, "--json").json
    assert answer["rpm"] == [2000.0, 7000.0]
    assert answer["bilateral_unilateral_part_rpm"] == 7000.0
    assert answer["forces_n"]["bilateral"][1][0] < 0.0
    assert picture.read_text(encoding="utf-8").count("<path") > 10
    assert flexcam("parting", CASE, *told).code == 2  # the picture is there


def test_parting_refuses(flexcam):
    for told in (("--count", "1"), ("--contact", "nosuch"), ("--highest", "100rpm")):
        assert flexcam("parting", CASE, *told).code == 2
