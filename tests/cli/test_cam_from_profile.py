"""cam --from-profile: the lift from profile points, bridged hollows and unreadable files."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from flexcam.cams import FlatFollower, HarmonicLift, RollerFollower, cam_profile
from flexcam.case.reader import read_cams

ROOT = Path(__file__).parents[2]
FB2 = ROOT / "cases/cams/li-fb2.toml"
ROLLER = ("--follower", '{ type = "roller", radius = "10 mm" }', "--base-radius", "20 mm")
FLAT = ("--follower", '{ type = "flat" }', "--base-radius", "18 mm")


def write_profile(tmp_path, event, follower, head="x [mm], y [mm]"):
    points = 1e3 * cam_profile(event, follower, count=360).points
    np.savetxt(tmp_path / "p.csv", points, fmt="%.12g", delimiter=",", header=head, comments="")


@pytest.mark.slow
def test_profile_to_lift_round_trip(wide_flexcam, tmp_path):
    """The profile written by `cam` gives the original lift; a case accepts the lift table."""
    assert wide_flexcam("cam", FB2, "-o", ".", "--format", "csv").code == 0
    done = wide_flexcam("cam", "--from-profile", "li-fb2-exhaust.csv", *ROLLER, "-o", "back.csv", "--json")
    assert (done.code, done.err) == (0, "")
    report, event = json.loads(done.out), read_cams(FB2).cams["exhaust"].part.event
    np.testing.assert_allclose(report["lift"], event(np.array(report["angle"])), rtol=0, atol=1e-7)
    assert (report["points"], report["bridged"], report["files"]) == (720, None, ["back.csv"])
    (tmp_path / "case.toml").write_text('format = 1\n[cams.c]\nlift_table = "back.csv"\n')
    event_from_table = read_cams(tmp_path / "case.toml").cams["c"].part.event
    assert event_from_table.height == pytest.approx(0.0055, abs=1e-6)


@pytest.mark.slow
def test_bridged_hollow_is_reported(wide_flexcam, tmp_path):
    """Under a roller of 4 mm the cam is hollow at its waist; a flat face cannot enter."""
    write_profile(tmp_path, HarmonicLift(0.006, (0.0, -0.006), (0.0, 0.0)), RollerFollower(0.014, 0.004))
    found = json.loads(wide_flexcam("cam", "--from-profile", "p.csv", *FLAT, "--json").out)["bridged"]
    assert found["depth"] > 1e-4
    assert abs(math.remainder(math.atan2(*found["point"][::-1]) - math.pi / 2, math.pi)) < math.radians(2.0)
    words = " ".join(wide_flexcam("cam", "--from-profile", "p.csv", *FLAT).out.split())
    assert "bridges a hollow" in words
    assert "only a roller smaller than the hollow follows the profile" in words
    small = ("--follower", '{ type = "roller", radius = "4 mm" }', "--base-radius", "14 mm")
    assert json.loads(wide_flexcam("cam", "--from-profile", "p.csv", *small, "--json").out)["bridged"] is None


def test_profile_inside_base_circle_is_reported(wide_flexcam, tmp_path):
    eccentric = HarmonicLift(0.003, (-0.003,), (0.0,))
    write_profile(tmp_path, eccentric, FlatFollower(0.017), "")
    assert "check its radius" in wide_flexcam("cam", "--from-profile", "p.csv", "--unit", "mm", *FLAT).out
    assert wide_flexcam("cam", "--from-profile", "p.csv", *FLAT).code == 2
    write_profile(tmp_path, eccentric, FlatFollower(0.017), "x_mm, y_mm")  # headers as in lift tables
    assert "check its radius" in wide_flexcam("cam", "--from-profile", "p.csv", *FLAT).out


@pytest.mark.parametrize(("text", "words", "message"), [
    ("x [mm], y [mm]\n1, 2\nnull, 3\n2, 3\n1\n", FLAT, ["line 3", "line 5"]),
    ("x [mm], z\n1, 2\n", FLAT, ["one column x and one y"]),
    ("x, y\n1, 2\n", FLAT, ["--unit mm"]),
    ("", FLAT, ["empty"]),
    ("x [mm], y [mm]\n1, 2\n", (*FLAT, "--unit", "um"), ["got um and mm, expected one unit"]),
    ("x [mm], y [m]\n1, 2\n", FLAT, ["got mm and m, expected one unit"]),
    (None, FLAT, ["readable text file"]),
    ("1, 2\n", ("--follower", "flat", "--base-radius", "18 mm"), ["quotes around each string"]),
    ("1, 2\n", ("--follower", '{ type = "flat" }'), ["--base-radius"]),
    ("1, 2\n", ("--follower", '{ type = "flat" }', "--base-radius", "18"), ["write '18 mm'"]),
    ("1, 2\n", ("--follower", '{ type = "rolle" }', "--base-radius", "18 mm"), ["did you mean 'roller'"]),
    ("1, 2\n", ("--follower", '{ type = "roller", radios = 3 }'), ["follower.radios", "did you mean 'radius'"]),
    ("1, 2\n", (*FLAT, "--points", "3"), ["--points"]),
])  # fmt: skip
def test_invalid_profile_is_refused(text, words, message, wide_flexcam, tmp_path):
    if text is not None:
        (tmp_path / "p.csv").write_text(text)
    done = wide_flexcam("cam", "--from-profile", "p.csv", *words)
    assert (done.code, done.out) == (2, "")
    assert [part for part in message if part.lower() not in done.err.lower()] == []


def test_existing_lift_table_is_not_overwritten(wide_flexcam, tmp_path):
    write_profile(tmp_path, HarmonicLift(0.003, (-0.003,), (0.0,)), FlatFollower(0.018))
    (tmp_path / "a.csv").write_text("mine")
    assert "--overwrite" in wide_flexcam("cam", "--from-profile", "p.csv", *FLAT, "-o", "a.csv").err
    assert "ends in .csv" in wide_flexcam("cam", "--from-profile", "p.csv", *FLAT, "-o", "a.txt").err
    assert (tmp_path / "a.csv").read_text() == "mine"


def test_header_without_unit_is_refused(wide_flexcam, tmp_path):
    write_profile(tmp_path, HarmonicLift(0.003, (-0.003,), (0.0,)), FlatFollower(0.018), "x, y")
    refused = wide_flexcam("cam", "--from-profile", "p.csv", *FLAT)
    assert refused.err.startswith("p.csv, unit: got 'x, y', expected a header line with a unit. Add --unit mm")
    assert wide_flexcam("cam", "--from-profile", "p.csv", "--unit", "thou", *FLAT).code == 0


def test_rounded_points_on_base_circle_give_no_warning(wide_flexcam, tmp_path):
    angle = np.radians(np.arange(0.0, 360.0, 5.0))
    circle = 18.0 * np.column_stack([np.cos(angle), np.sin(angle)])
    np.savetxt(tmp_path / "p.csv", circle, fmt="%.4f", delimiter=",", header="x [mm], y [mm]", comments="")
    assert "base circle" not in wide_flexcam("cam", "--from-profile", "p.csv", *FLAT).out
