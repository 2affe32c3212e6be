"""cam: the cams of a file compared with closed forms; written profiles and figures; refused input."""

# ruff: noqa: E501 - tables, a row to a line

import csv
import math
import re
import xml.etree.ElementTree as ET  # the files are our own
from pathlib import Path

import numpy as np
import pytest

from flexcam import build_model, read_case
from flexcam.analysis.preparation import prepare
from flexcam.analysis.run_checks import check_input
from flexcam.cams import CompoundCycloid, LiftEvent, Ramp, RollerFollower, cam_profile
from flexcam.case.starters import new_case
from tests.command import facts
from tests.thinning import mostly_slow, slow_if

ROOT, DEG = Path(__file__).parents[2], math.pi / 180
FILES = {path.stem: path for part in ("cases/cams", "cases/tayeb") for path in sorted((ROOT / part).glob("*.toml"))}
FILES["every-cam"] = ROOT / "tests/data/every-cam.toml"
KEYS = ["lift", "least_lift", "velocity", "acceleration", "jerk", "harmonics", "joints", "valve_events", "follower_events", "profile", "findings", "smoothing", "centreline", "tdc", "ratio", "lash", "valve_lift", "after_tdc", "phaser"]  # fmt: skip
PROFILE = ["base_radius", "convex_radius", "convex_radius_at", "hollow_radius", "hollow_radius_at", "pressure_angle", "pressure_angle_at", "contact_offset", "sliding_velocity", "least_base_radius", "face_diameter", "min_face_diameter"]  # fmt: skip


@pytest.fixture
def run_cam(wide_flexcam):
    """Return a function that runs `flexcam cam` on a listed file, or on another path."""
    return lambda name, *words: wide_flexcam("cam", FILES.get(name, name), *words)


def first_cam(run_cam, *words):
    return next(iter(facts(run_cam, *words)["cams"].values()))


@pytest.mark.parametrize(
    "name",
    slow_if(lambda name: name not in ("every-cam", "petrescu-cos"), FILES),
)
def test_cam_report_of_every_file(name, run_cam):
    found, done = facts(run_cam, name), run_cam(name)
    assert list(found) == ["status", "cams", "overlaps", "lobe_separations", "files"]
    assert len(found["overlaps"]) == len(found["cams"]) * (len(found["cams"]) - 1)  # every pair at two lifts
    assert (done.code, done.err) == (0, "")
    for cam, values in found["cams"].items():
        assert (list(values), len(values["harmonics"])) == (KEYS, 10)
        assert all(list(joint["steps"]) == ["lift", *KEYS[2:5]] for joint in values["joints"])
        assert list(values["valve_events"]) == ["1 mm", "0.05 in"]
        assert values["profile"] is None or list(values["profile"]) == PROFILE
        expected = [
            f"Cam {cam}",
            f"{1e3 * values['lift']:.6g} mm",
            *(finding["what"] for finding in values["findings"]),
        ]
        assert [part for part in expected if part not in done.out] == []


def test_cosine_cam(run_cam):
    """Lift 3 mm (1 - cos 2 theta) on a circle of 13 mm under a flat face; the extremes are at examined angles."""
    cam = first_cam(run_cam, "petrescu-cos")
    close = {"rel": 1e-12, "abs": 1e-12}
    assert [cam[key] for key in KEYS[:4]] == pytest.approx([0.006, 0.0, 0.006, 0.012], **close)
    steps = {round(joint["angle"] / DEG): joint["steps"] for joint in cam["joints"]}
    assert {at: step["acceleration"] for at, step in steps.items()} == {0: pytest.approx(0.012), 90: 0.0, 180: pytest.approx(-0.012)}  # fmt: skip
    assert not any(value for step in steps.values() for key, value in step.items() if key != "acceleration")
    for event in cam["valve_events"].values():
        opens = math.acos(1 - event["lift"] / 0.003)  # crank angles
        assert list(event.values())[1:] == pytest.approx([opens, 2 * math.pi - opens, 2 * math.pi - 2 * opens, math.pi], rel=1e-12)  # fmt: skip
    profile = cam["profile"]
    assert profile.pop("contact_offset") == pytest.approx([-0.006, 0.006], **close)  # the velocity
    nose = 0.013 + 0.006 - 0.012  # base circle, lift, acceleration there
    assert (profile.pop("hollow_radius"), profile.pop("hollow_radius_at")) == (None, None)
    assert profile.pop("convex_radius_at") == pytest.approx(90 * DEG, abs=1e-6)
    assert (profile.pop("face_diameter"), profile.pop("min_face_diameter")) == (None, pytest.approx(0.012))
    assert list(profile.values()) == pytest.approx([0.013, nose, 0.0, 0.0, 0.019, 0.006], **close)


TAPPET = 'follower={{ type = "flat", face_diameter = "{}", axial_offset = "{}" }}'


@pytest.mark.parametrize(("offset", "smallest", "spare"), [
    pytest.param("0 mm", 20.0, -0.01, marks=pytest.mark.slow),
    pytest.param("1.5 mm", math.sqrt(12**2 + 19**2), 0.01, marks=pytest.mark.slow),
    ("-1.5 mm", math.sqrt(12**2 + 19**2), -0.01),
])  # fmt: skip
def test_edge_contact_of_round_face(run_cam, offset, smallest, spare):
    """The contact line, 16 mm wide, moves +-6 mm: its corner is at 10 mm if the cam is centred."""
    face = TAPPET.format(f"{smallest + spare} mm", offset)
    words = ("petrescu-cos", "--set", "cams.valve.width=16 mm", "--set", f"cams.valve.{face}")
    cam = first_cam(run_cam, *words)
    assert 1e3 * cam["profile"]["min_face_diameter"] == pytest.approx(smallest, rel=1e-9)
    assert 1e3 * cam["profile"]["face_diameter"] == pytest.approx(smallest + spare)
    what = "the distance from the contact line to the edge of the face is negative"
    assert [fault["what"] for fault in cam["findings"]] == [what] * (spare < 0)
    printed = " ".join(run_cam(*words).out.split())
    assert ("the tappet spins" in printed, "the tappet does not spin" in printed) == (
        offset != "0 mm",
        offset == "0 mm",
    )
    assert (f"min face diameter {smallest:.4g} mm, but" in printed, what in printed) == (spare < 0, spare < 0)
    if spare < 0:
        assert 1e3 * cam["findings"][0]["value"] == pytest.approx(0.5 * spare, rel=1e-6)


CROWN = 'follower={ type = "flat", face_diameter = "13.5 mm", crown_radius = "500 mm", taper = "-0.3 deg" }'


@pytest.mark.slow
def test_crowned_face_on_tapered_lobe(run_cam):
    """The contact point is 500 mm tan(0.3 deg) = 2.618 mm from the axis and moves +-6 mm."""
    words = ("petrescu-cos", "--set", "cams.valve.width=16 mm", "--set", f"cams.valve.{CROWN}")
    cam = first_cam(run_cam, *words)
    assert 1e3 * cam["profile"]["min_face_diameter"] == pytest.approx(2 * math.hypot(6, 2.61801), rel=1e-5)
    assert cam["findings"] == []
    assert "the contact is -2.6" in " ".join(run_cam(*words).out.split())


@pytest.mark.parametrize(("face", "message"), [
    ('crown_radius = "1.2 m", taper = "0.3 deg"', "6.28 mm from its middle"),  # 6 mm is half the width
    ('crown_radius = "1.2 m", taper = "0.3 deg", axial_offset = "-1 mm"', "7.28 mm from its middle"),
    ('taper = "0.1 deg"', "at the edge of the lobe"),
    ('crown_radius = "1 m"', ""),
])  # fmt: skip
def test_check_warns_of_contact_outside_lobe(tmp_path, face, message):
    (path,) = new_case("direct-acting", tmp_path / "case.toml")
    ready = prepare(read_case(path, [f'cams.intake.follower={{ type = "flat", {face} }}', "cams.intake.width=12 mm"]))
    warned = [warning for warning in check_input(ready) if "edge contact" in warning]
    assert (len(warned), message in "".join(warned)) == (bool(message), True)


@pytest.mark.parametrize(("face", "warns"), [("28 mm", True), ("28.2 mm", False)])
def test_check_warns_of_contact_at_face_edge(tmp_path, face, warns):
    """12.175 mm from the axis and half the width, 7 mm: a diameter of 28.09 mm."""
    (path,) = new_case("direct-acting", tmp_path / "case.toml")
    ready = prepare(read_case(path, [f"cams.intake.follower.face_diameter={face}"]))
    assert any("crosses the edge" in warning for warning in check_input(ready)) == warns


@pytest.mark.parametrize("model", [1, 2, 3])
def test_valve_events_with_rocker(model, run_cam):
    """The valve moves 1.6 times the cam lift 3 mm (1 - cos theta)."""
    cam = first_cam(run_cam, f"model-{model}-shm")
    assert cam["harmonics"] == pytest.approx([0.003] + [0.0] * 9, rel=1e-12, abs=1e-15)
    for event in cam["valve_events"].values():
        opens = 2 * math.acos(1 - event["lift"] / 1.6 / 0.003)
        assert [event["opens"], event["duration"]] == pytest.approx([opens, 4 * math.pi - 2 * opens], rel=1e-12)


def test_documented_properties_of_cam_files(run_cam):
    joints = first_cam(run_cam, "li-fb2")["joints"]
    assert {(len(joints), joint["steps"][key]) for joint in joints for key in ("lift", *KEYS[2:4])} == {(9, 0.0)}
    for cam in facts(run_cam, "roussev-single-dwell")["cams"].values():
        assert [any(joint["steps"].values()) for joint in cam["joints"]] == [False] * 3
    swing = first_cam(run_cam, "li-swing")
    pitch = math.sqrt(145**2 + 140**2 - 2 * 145 * 140 * math.cos(30 * DEG))  # law of cosines
    assert swing["profile"]["base_radius"] == pytest.approx(1e-3 * (pitch - 16), rel=1e-12)
    (finding,) = swing["findings"]
    assert "pressure angle too large" in finding["what"]
    assert 150 * DEG < finding["angle"] < 270 * DEG, "on the return"
    assert (finding["limit"], finding["value"]) == (pytest.approx(30 * DEG), swing["profile"]["pressure_angle"])


def test_valve_overlap(run_cam, tmp_path):
    """Two equal events, 100 deg of cam angle apart: the overlap is the duration less twice this angle."""
    cam = '[cams.{}]\nlaw = "shm"\nlift = "6 mm"\nrise = "90 deg"\nreturn = "90 deg"\nphase = "{} deg"\n'
    (tmp_path / "two.toml").write_text("format = 1\n" + cam.format("exhaust", 20) + cam.format("intake", 120))
    found = facts(run_cam, "two.toml")
    for pair, lift in zip(found["overlaps"], ("1 mm", "0.05 in"), strict=True):
        open_for = found["cams"]["intake"]["valve_events"][lift]["duration"]
        assert list(pair.values()) == ["exhaust", "intake", lift, pytest.approx(open_for - 200 * DEG)]


CYLINDER = """format = 1
[cams.exhaust]
law = "shm"
lift = "8 mm"
rise = "70 deg"
return = "70 deg"
centreline = "124 deg"
tdc = "180 deg"
[cams.intake]
law = "shm"
lift = "9 mm"
rise = "72 deg"
dwell = "4 deg"
return = "76 deg"
centreline = "234 deg"
tdc = "180 deg"
[cams.next]
law = "shm"
lift = "9 mm"
rise = "72 deg"
return = "72 deg"
centreline = "324 deg"
tdc = "270 deg"
"""


def test_cam_card_values(run_cam, tmp_path):
    """Centrelines 112 deg before and 108 deg after TDC; lift events of (1 - cos(pi z)) h/2 in closed form."""
    (tmp_path / "card.toml").write_text(CYLINDER)
    found = facts(run_cam, "card.toml", "--checking-lift", "0.25 mm", "--checking-lift", "4 mm")
    separations = {(pair["one"], pair["other"]): pair["angle"] / DEG for pair in found["lobe_separations"]}
    assert separations == pytest.approx({("exhaust", "intake"): 110, ("exhaust", "next"): 160, ("intake", "next"): 90})
    for name, middle, lift, rise, dwell, fall in (("exhaust", -112, 8, 70, 0, 70), ("intake", 108, 9, 72, 4, 76)):
        card = found["cams"][name]
        assert card["after_tdc"]["centreline"] / DEG == pytest.approx(middle, abs=1e-6)
        assert list(card["valve_events"]) == ["1 mm", "0.05 in", "0.25 mm", "4 mm"]
        for key, event in card["after_tdc"]["valve_events"].items():
            above = 1 - math.acos(1 - 2e3 * card["valve_events"][key]["lift"] / lift) / math.pi
            opens, closes = (middle - dwell - 2 * rise * above, middle + dwell + 2 * fall * above)
            assert [event["opens"] / DEG, event["closes"] / DEG] == pytest.approx([opens, closes], abs=1e-6)


@pytest.mark.slow
def test_cam_card_text_and_timing_plot(run_cam, tmp_path):
    (tmp_path / "card.toml").write_text(CYLINDER)
    done = run_cam("card.toml", "--checking-lift", "4 mm", "--plot", "pictures")
    rows = [" ".join(row.split()) for row in done.out.splitlines()]
    assert "lobe centreline cam 124.00 deg, crank 112.00 deg BTDC" in rows
    assert "valve open above 4 mm EVO 2.00 deg BBDC, EVC 42.00 deg BTDC, duration 140.00 deg" in rows
    rise_parts = {name: [1 - math.acos(1 - 2 * x / lift) / math.pi for x in (1, 1.27, 4)] for name, lift in (("exhaust", 8), ("intake", 9))}  # fmt: skip
    both = [
        max(0, -112 + 140 * exhaust_part - 104 + 144 * intake_part)
        for exhaust_part, intake_part in zip(*rise_parts.values(), strict=True)
    ]
    pairs = [f"exhaust and intake 110.00 {lift} {angle:.2f}" for lift, angle in zip(("1 mm", "0.05 in", "4 mm"), both, strict=True)]  # fmt: skip
    assert [row for row in rows if row.startswith("exhaust and")] == pairs
    files = {path.name for path in (tmp_path / "pictures").iterdir()}
    assert {"card-exhaust-intake-timing.svg", "card-next-timing.svg"} <= files
    picture = (tmp_path / "pictures/card-exhaust-intake-timing.svg").read_text()
    assert picture.startswith("<?xml")


@pytest.mark.slow
def test_valve_events_refer_to_dead_centres_of_stroke(run_cam, tmp_path):
    """A lobe of 170 + 170 deg has half its lift 170 crank deg from its centreline, nearer to firing TDC than BDC."""
    (tmp_path / "card.toml").write_text(CYLINDER)
    wide = [f"cams.next.{key}=170deg" for key in ("rise", "return")]
    for centre, expected in (("324", "IVO 62.00 deg BTDC, IVC 98.00 deg ABDC"), ("270", "IVO 170.00 deg BTDC, IVC 10.00 deg BBDC")):  # fmt: skip
        options = [word for key in (*wide, f"cams.next.centreline={centre}deg") for word in ("--set", key)]
        assert expected in run_cam("card.toml", "--checking-lift", "4.5 mm", *options).out


def test_cam_card_includes_lash_and_ratio(run_cam):
    card = first_cam(run_cam, ROOT / "cases/pushrod-engine/intake.toml")
    assert (card["ratio"], card["lash"]) == pytest.approx((1.6, 0.2e-3 / 1.6))
    assert card["valve_lift"] == pytest.approx(1.6 * 6.3e-3 - 0.2e-3)
    assert (card["tdc"], card["after_tdc"]) == (None, None)
    assert card["centreline"] == pytest.approx(math.pi, abs=1e-12)


def test_dead_centres_one_revolution_apart_are_equal(run_cam, tmp_path):
    (tmp_path / "card.toml").write_text(CYLINDER)
    both = [run_cam("card.toml", "--set", f"cams.intake.tdc={angle}deg").out for angle in (180, 540)]
    assert " and exhaust" in both[0] or "exhaust and " in both[0]
    assert both[0] == both[1]


@pytest.mark.slow
def test_cam_card_of_four_cylinder_camshaft(run_cam):
    """Only the cams of the same cylinder overlap in the table; the firing order rotates cylinders by 90 deg."""
    rows = run_cam(ROOT / "cases/camshaft-4cyl/camshaft.toml").out.splitlines()
    after = [row.partition("crank ")[2].strip() for row in rows if row.startswith("lobe centreline")]
    assert sorted(after) == [*["110.00 deg ATDC"] * 4, *["110.00 deg BTDC"] * 4]
    pairs = {row.partition("   ")[0] for row in rows if " and exhaust" in row}
    assert pairs == {f"intake-{i} and exhaust-{i}" for i in range(1, 5)}


def fb2_profile(base, count=720):
    """Return the profile of cases/cams/li-fb2.toml on the given base circle."""
    law, ramp = CompoundCycloid(0.3), Ramp(0.0002, 15 * DEG, 0.5)
    event = LiftEvent(law, 0.0053, 60 * DEG, 60 * DEG, phase=90 * DEG, ramp=ramp)
    return cam_profile(event, RollerFollower(base, 0.01), count=count)


@pytest.mark.slow
def test_undercut_and_cutter_findings(run_cam):
    """Undercut: r0 + s + s'' has its minimum at the nose, where s'' = -12 mm."""
    (undercut,) = first_cam(run_cam, "petrescu-cos", "--set=cams.valve.base_radius=5 mm")["findings"]
    assert "undercut" in undercut["what"]
    assert [undercut["angle"], undercut["value"]] == pytest.approx([90 * DEG, -0.001])
    words = ["li-fb2", "--set=cams.exhaust.base_radius=8 mm", "--pressure-angle=60 deg"]
    hollow = first_cam(run_cam, *words)["profile"]["hollow_radius"]
    assert hollow == pytest.approx(min(-r for r in fb2_profile(0.008, 72_000).radius if r < 0), rel=1e-5)
    assert not first_cam(run_cam, *words, "--cutter", f"{0.999 * hollow} m")["findings"]
    (large,) = first_cam(run_cam, *words, "--cutter", f"{1001 * hollow} mm")["findings"]
    assert "cutter" in large["what"]
    assert [large["value"], large["limit"]] == pytest.approx([hollow, 1.001 * hollow])


def test_negative_lift_is_reported(run_cam, tmp_path):
    """3 mm (1 - cos t) - 0.5 mm (1 - cos 3 t): with c = cos t, 2.5 - 4.5 c + 2 c^3 is minimum at c^2 = 3/4."""
    lift = "format = 1\n[lift]\nmean = 0.0025\ncosine = [-0.003, 0.0, 0.0005]\nsine = [0.0, 0.0, 0.0]\n"
    (tmp_path / "dips.toml").write_text(lift)
    (tmp_path / "cam.toml").write_text('format = 1\n[cams.c]\nlift_table = "dips.toml"\n')
    cam, minimum = first_cam(run_cam, "cam.toml"), 1e-3 * (2.5 - 1.5 * math.sqrt(3))
    assert cam["least_lift"] == pytest.approx(minimum, rel=1e-10)
    (finding,) = cam["findings"]
    assert ("negative" in finding["what"], finding["kind"]) == (True, "length")
    assert [finding["value"], finding["angle"]] == pytest.approx([minimum, 30 * DEG], rel=1e-6)
    output = run_cam("cam.toml").out
    assert "-0.0980762 to 5.09808 mm" in output
    assert "valve open above 1 mm" in output
    assert "never" not in output


@pytest.mark.parametrize(("shift", "message"), [("0.003", "never"), ("0.02", "always")])
def test_valve_that_never_opens_or_closes(run_cam, tmp_path, shift, message):
    lift = f"format = 1\n[lift]\nmean = {shift}\ncosine = [-0.0001]\nsine = [0.0]\n".replace("0.003", "0.0001")
    (tmp_path / "c.toml").write_text(lift)
    (tmp_path / "cam.toml").write_text('format = 1\n[cams.c]\nlift_table = "c.toml"\n')
    rows = [row for row in run_cam("cam.toml").out.splitlines() if row.startswith("valve open")]
    assert [row.split()[-1] for row in rows] == [message, message]


@pytest.mark.slow
def test_profile_files(run_cam, tmp_path):
    found = facts(run_cam, "li-fb2", "-o", "a/b", "--cutter", "40 mm", "--points", "36")
    assert found["files"] == [
        f"a/b/li-fb2-{name}" for name in ("exhaust.csv", "exhaust.dxf", "exhaust.vtp", "card.csv")
    ]
    table = np.genfromtxt(tmp_path / found["files"][0], delimiter=",", names=True, deletechars="", replace_space=" ")
    assert table["cam angle [deg]"].tolist() == [10.0 * i for i in range(36)]
    profile = np.column_stack([table[f"profile {axis} [mm]"] for axis in "xy"])
    np.testing.assert_allclose(profile, 1e3 * fb2_profile(0.02).points[::20], rtol=0.0, atol=1e-9)  # 12 digits of 26 mm
    assert {"pitch curve x [mm]", "cutter path y [mm]", "pressure angle [deg]"} <= set(table.dtype.names)
    single = facts(run_cam, "every-cam", "-o", "d", "--cam", "single", "--format", "dxf")
    assert single["files"] == ["d/every-cam-single.dxf"]


def test_cam_card_csv(run_cam, tmp_path):
    """The table contains the numbers of the printed card and the JSON, a row each with its unit."""
    (tmp_path / "card.toml").write_text(CYLINDER + 'base_radius = "20 mm"\nfollower = { type = "flat" }\n')
    found = facts(run_cam, "card.toml", "-o", "out", "--format", "csv")
    assert found["files"] == ["out/card-next.csv", "out/card-card.csv"]
    with (tmp_path / "out/card-card.csv").open(encoding="utf-8") as file:
        rows = {(row["cam"], row["quantity"]): (float(row["value"]), row["unit"]) for row in csv.DictReader(file)}
    card, inch = found["cams"]["exhaust"], "0.05 in"
    for name, value, unit in (
        ("lift", 8.0, "mm"),
        ("velocity", 1e3 * card["velocity"], "mm/rad"),
        ("centreline", 124.0, "deg"),
        (f"after tdc valve events {inch} opens", card["after_tdc"]["valve_events"][inch]["opens"] / DEG, "deg"),
        ("harmonics 1", 1e3 * card["harmonics"][0], "mm"),
        ("ratio", 1.0, ""),
    ):
        assert rows["exhaust", name] == (pytest.approx(value, rel=1e-9), unit)
    assert rows["next", "profile base radius"] == (20.0, "mm")
    run_cam("card.toml", "-o", "out", "--format", "csv", "--units", "imperial", "--overwrite")
    assert f"exhaust,lift,{8 / 25.4:.5f}" in (tmp_path / "out/card-card.csv").read_text()


def test_phaser_rows_of_cam_card(run_cam, tmp_path):
    """In the JSON and on the card; a cam without phaser has no rows."""
    new_case("cam-phaser", tmp_path / "phaser.toml")
    found = facts(run_cam, "phaser.toml", "-o", "out", "--format", "csv")["cams"]
    rows = [(row["drive_angle"] / DEG, row["shift"] / DEG) for row in found["intake"]["phaser"]]
    assert rows == [pytest.approx((360.0, 0.0)), pytest.approx((1560.0, 20.0))]
    assert found["exhaust"]["phaser"] is None
    card = (tmp_path / "out/phaser-card.csv").read_text()
    assert re.findall("intake,phaser (.*)", card)[2:] == ["2 drive angle,1560.0,deg", "2 shift,20.0,deg"]


def test_cam_does_not_overwrite_files(run_cam, tmp_path):
    """If one file exists, no file is written."""
    path = tmp_path / "li-fb2-exhaust.vtp"
    path.write_text("mine")
    done = run_cam("li-fb2", "-o", ".")
    assert (done.code, "--overwrite" in done.err, done.out, path.read_text()) == (2, True, "", "mine")
    assert list(tmp_path.iterdir()) == [path]
    assert (run_cam("li-fb2", "-o", ".", "--overwrite").code, path.stat().st_size > 1000) == (0, True)


@pytest.mark.slow
def test_cam_plots(run_cam, tmp_path):
    found = facts(run_cam, "li-fb2", "--plot", "p")["files"]
    assert found == [f"p/li-fb2-exhaust-{kind}.svg" for kind in ("lift", "profile", "pressure")]
    for path in found:
        paths = ET.parse(tmp_path / path).iter("{http://www.w3.org/2000/svg}path")  # noqa: S314
        assert sum(len(path.get("d", "")) for path in paths) > 5000
    assert "--overwrite" in run_cam("li-fb2", "--plot", "p").err
    other = facts(run_cam, "model-1-shm", "--plot", "q", "--plot-format", "png")["files"]
    assert other == ["q/model-1-shm-intake-lift.png"], "without a profile"
    assert (tmp_path / other[0]).read_bytes().startswith(b"\x89PNG")


def test_missing_base_circle_is_reported_with_remedy(run_cam):
    assert "base_radius and follower" in run_cam("model-2-cycloidal").out
    for option, value in (("-o", "x"), ("--cutter", "40 mm")):
        done = run_cam("model-2-cycloidal", option, value)
        assert (done.code, "base_radius and follower" in done.err, option in done.err) == (2, True, True)
    more = ("--set", "cams.intake.base_radius=20 mm", "--set", 'cams.intake.follower={ type = "flat" }')
    cam = first_cam(run_cam, "model-2-cycloidal", *more, "--set", "cams.intake.lift=7 mm")
    assert "no pressure angle" in run_cam("model-2-cycloidal", *more, "--pressure-angle", "5 deg").err
    assert (cam["lift"], cam["profile"]["base_radius"]) == (0.007, 0.02)
    assert cam["velocity"] == pytest.approx(0.007 * 2 / math.pi, rel=1e-12)
    assert "at camshaft 100 rpm" in run_cam("li-fb2", "--set", "speed=100 rpm").out


REFUSED = {  # argument, location, given value, part of the message
    "--cutter=40 kg": ("--cutter", "40 kg", "is not a unit of length"),
    "--pressure-angle=30 mm": ("--pressure-angle", "30 mm", "180 deg"),
    "--pressure-angle=30": ("--pressure-angle", "30", "write '30 deg'"),
    "--pressure-angle=90 deg": ("--pressure-angle", "90 deg", "below 90 deg"),
    "--pressure-angle=0": ("--pressure-angle", "0", "above zero"),
    "--cutter=40": ("--cutter", "40", "write '40 mm'"),
    "--checking-lift=0 mm": ("--checking-lift", "0 mm", "above zero"),
    "--cam=exhuast": ("--cam", "exhuast", "did you mean 'exhaust'"),
    "--points=11": ("--points", "11", "from 12"),
    "--set=cams.exhaust.lft=7 mm": ("cams.exhaust.lft", "lft", "did you mean 'lift'"),
    "--set=cams.exhaust.lift=7 kg": ("cams.exhaust.lift", "7 kg", "a length"),
    "--set=cams.exhuast.lift=7 mm": ("--set", "exhuast", "did you mean 'exhaust'"),
    f"-o={FILES['li-fb2']}/x": ("folder", "li-fb2.toml/x", "name another"),
}  # fmt: skip


@pytest.mark.parametrize("words", mostly_slow(REFUSED, 2))
def test_cam_refuses_invalid_options(words, run_cam):
    where, given, expected = REFUSED[words]
    done = run_cam("li-fb2", words, "--json")
    assert (done.code, done.err) == (2, "")
    (fault,) = done.json["errors"]
    assert where in fault["where"]
    assert given in fault["given"]
    assert expected in " ".join(fault.values())


def test_lash_delays_valve_events(run_cam, tmp_path):
    """With a lash of 1 mm the valve lift is 1 mm at a cam lift of 2 mm."""
    new_case("direct-acting", tmp_path / "train.toml")
    cam = facts(run_cam, "train.toml", "--set", "contacts.lash.gap=1mm")["cams"]["intake"]
    event = build_model(read_case(tmp_path / "train.toml")).cams["intake"].event
    opens, closes = cam["valve_events"]["1 mm"]["opens"] / 2.0, cam["valve_events"]["1 mm"]["closes"] / 2.0
    assert event(np.array([opens, closes])) == pytest.approx([2e-3, 2e-3], rel=1e-9)


@pytest.mark.slow
def test_durations_at_follower_and_valve(flexcam):
    """Durations at 0.050 in refer to the tappet; rocker and lash change the valve. A machine uses cam angles."""
    case = Path(__file__).parents[2] / "cases/pushrod-engine/intake.toml"
    done = flexcam("cam", case, "--json").json["cams"]["intake"]
    event = build_model(read_case(case)).cams["intake"].event
    for name, ratio, lash in (("follower_events", 1.0, 0.0), ("valve_events", 1.6, 0.2e-3)):
        found = done[name]["0.05 in"]
        ends = np.array([found["opens"], found["closes"]]) / 2.0
        assert ratio * event(ends) - lash == pytest.approx([1.27e-3] * 2, rel=1e-9)
    output = flexcam("cam", case).out
    assert "follower above 0.05 in" in output
    assert "crank 254.83 to 465.17 deg" in output
    machine = flexcam("cam", case, "--set", "run.speed=100rpm").out
    assert "output above 0.05 in" in machine
    assert "cam 127.42 to 232.58 deg, duration 105.17 deg" in machine
