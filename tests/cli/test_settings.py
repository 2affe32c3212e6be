"""The command `settings`: table, words, JSON, overrides, refusals."""

from __future__ import annotations

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CASE = ROOT / "cases/petrescu/valve-spring.toml"


def test_table_and_words(flexcam):
    told = flexcam("settings", CASE)
    assert told.code == 0
    row = next(line.split() for line in told.out.splitlines() if line.startswith("figure-7"))
    assert row == ["figure-7", "50000", "900", "600", "175687", "-53691", "6323", "-6002", "0.317", "94.7%"]
    words = " ".join(told.out.split())
    assert "what limits the acceleration is lost lift" in words
    assert "opens 0.317 of 6 mm" in words
    assert "A valve on a seat would not open at all" in words


def test_json_has_the_lost_lift_beside_the_acceleration(flexcam):
    found = flexcam("settings", CASE, "--json").json
    assert found["shaft"] == "crank"
    assert [one["name"] for one in found["settings"]] == ["valve-spring", *(f"figure-{n}" for n in range(3, 8))]
    assert found["settings"][3]["lost"] == pytest.approx(0.8347, abs=1e-4)
    assert [one["lifts_off"] for one in found["settings"]] == [True, True, False, False, False, False]


@pytest.mark.parametrize(
    ("given", "key", "factor"),
    [("run.crank_speed=10000rpm", "speed", 2.0), ("springs.valve.stiffness=80kN/m", "stiffness", 2.0),
     ("springs.valve.installed_compression=180mm", "compression", 2.0)],
)  # fmt: skip
def test_sweeps(flexcam, given, key, factor):
    one, other = (flexcam("settings", CASE, *words, "--json").json["settings"][0] for words in ((), ("--set", given)))
    assert other[key] == pytest.approx(factor * one[key], rel=1e-12)
    if key == "speed":
        assert other["kinematic"][0] == pytest.approx(4.0 * one["kinematic"][0], rel=1e-9)
    else:
        assert other["opening"] < one["opening"]


def test_a_row_may_be_added_and_short_cams_run(flexcam):
    rises = ("--set", "cams.valve.rise=45deg", "--set", "cams.valve.return=45deg")
    found = flexcam("settings", CASE, *rises, "--set", 'settings.mine={ stiffness = "60 kN/m" }', "--json").json
    mine = found["settings"][-1]
    assert (mine["name"], mine["compression"]) == ("mine", pytest.approx(0.09))
    assert mine["kinematic"][0] > 3.9 * 1757


REFUSED = [
    (ROOT / "cases/tayeb/model-3-shm.toml", (), "contacts of a cam in true contact"),
    (
        CASE,
        ("--set", 'contacts.train={ cam = "valve", follower = "valve", model = "unilateral", stiffness = "hertz" }'),
        "closed form",
    ),
    (ROOT / "cases/li/valve-train.toml", (), "one at 'tappet'"),
    (CASE, ("--set", 'settings.figure-3={ speed = "1 rpm", crank_speed = "2 rpm" }'), "either speed or crank_speed"),
    (CASE, ("--set", 'settings.figure-3={ stiffness = "0 N/m" }'), "above zero"),
]


@pytest.mark.parametrize(("case", "sets", "words"), REFUSED)
def test_refused(flexcam, case, sets, words):
    told = flexcam("settings", case, *sets)
    assert told.code == 2
    assert words in told.err
