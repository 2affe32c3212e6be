"""synthesize law, harmonic and polydyne: computed laws and lifts, files for cases, and refused input."""

# ruff: noqa: E501 - tables, a row to a line

import io
import math
import re
import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from flexcam import read_case, run
from flexcam.cams import SplineFamily, minimax
from flexcam.case.builder import build_model
from flexcam.case.curves import read_law
from flexcam.cli.synthesize import synthesis_table
from tests.command import facts

module = sys.modules["flexcam.cams.minimax"]  # the function has the same name
ROOT = Path(__file__).parents[2]
MODEL = ROOT / "cases/tayeb/model-3-shm.toml"
POLYDYNE, HARMONIC = (("synthesize", kind, MODEL) for kind in ("polydyne", "harmonic"))
MIN_ACCELERATION = ("synthesize", "law", "--minimize", "Ca")
POLYNOMIAL = (*MIN_ACCELERATION, "--family", "polynomial")
SMOOTH = ("--set=cams.intake.law=4-5-6-7", "--set=run.speed=1200rpm")
SHORT = (*HARMONIC, "--set=cams.intake.law=3-4-5", "--set=cams.intake.rise=80 deg", "--set=cams.intake.return=80 deg", "--set=run.speed=600rpm")  # fmt: skip
LAW_KEYS = [
    "family",
    "objective",
    "family_bound",
    "gap",
    "bound_over_all_laws",
    "Cv",
    "Ca",
    "Cj",
    "Cm",
    "rms",
    "broken",
    "converged",
    "not_converged",
]
ANGLE = np.linspace(0.0, 2 * math.pi, 7201)


def case_with_lift(folder, lift, rpm):
    """Return published model 3 at another speed, with a lift file instead of its law."""
    text = MODEL.read_text(encoding="utf-8").replace("../../meshes", str(ROOT / "meshes"))
    text = re.sub(r"law = .*\nlift = .*\nrise = .*\nreturn = .*\n", f'lift_table = "{lift}"\n', text)
    (folder / "case.toml").write_text(text.replace('"3000 rpm"', f'"{rpm} rpm"'), encoding="utf-8")
    return read_case(folder / "case.toml")


def model_with_overrides(words):
    return read_case(MODEL, [word.removeprefix("--set=") for word in words])


@pytest.mark.slow
def test_valve_follows_lift_of_polydyne_cam(wide_flexcam, tmp_path):
    """Valve motion is 1.6 times the lift to 1 um (second-order time steps: 0.02 um); with the plain cam to 3.6 mm."""
    assert facts(wide_flexcam, *POLYDYNE, *SMOOTH, "-o", "polydyne.toml")["files"] == ["polydyne.toml"]
    nominal_lift = build_model(model_with_overrides(SMOOTH)).cams["intake"].event
    deviations = []
    for case in (case_with_lift(tmp_path, "polydyne.toml", 1200), model_with_overrides(SMOOTH)):
        response = run(case)
        deviations.append(np.abs(response["valve"].displacement.ravel() - 1.6 * nominal_lift(response.angle)).max())
    assert deviations[0] < 1e-6 < 1e-3 < deviations[1]


@pytest.mark.slow
def test_deviation_equals_that_of_valve_in_run(wide_flexcam):
    """A damped run reaches the steady motion of the table, after a rocker with ratio 1.6."""
    words = (*SMOOTH, "--set=run.damping={ modal = 0.1 }", "--set=run.revolutions=6")
    found, response = facts(wide_flexcam, *POLYDYNE, *words), run(model_with_overrides(words))
    nominal_lift, last = build_model(model_with_overrides(words)).cams["intake"].event, response.angle > 10 * math.pi
    deviation = np.abs(response["valve"].displacement.ravel() - 1.6 * nominal_lift(response.angle))[last].max()
    assert [found["ratio"], found["plain"][4]] == pytest.approx([1.6, deviation], rel=1e-3)


@pytest.mark.slow
def test_resonant_speeds_have_no_deviation(wide_flexcam):
    """150 Hz is the third harmonic at 3000 rpm, which the polydyne cam omits; other harmonics match at other speeds."""
    words = (*POLYDYNE, "--frequency", "150Hz", "--set=cams.intake.law=4-5-6-7", "--set=cams.intake.rise=60 deg")
    found = facts(wide_flexcam, *words)
    assert [i for i, value in enumerate(found["plain"]) if value is None] == [0, 1, 2, 4]
    assert [i for i, value in enumerate(found["polydyne"]) if value is None] == [0, 1, 2]
    output = wide_flexcam(*words).out
    assert "resonance" in output
    low, high = found["lift"]
    assert f"{1e3 * high:.6g} mm" in output
    assert ("warning" in output) == (low < 0.0)


def test_polydyne_cam_of_flexible_train(wide_flexcam):
    found = facts(wide_flexcam, *POLYDYNE, "--set=cams.intake.law=4-5-6-7", "--speed", "1200 rpm")
    assert list(found) == [
        "status",
        "design_speed_rpm",
        "probe",
        "left_out",
        "lift",
        "acceleration",
        "ratio",
        "speeds_rpm",
        "plain",
        "polydyne",
        "files",
    ]
    assert found["speeds_rpm"] == pytest.approx([300.0, 600.0, 900.0, 1080.0, 1200.0, 1320.0])
    # The fourth derivative steps by 840/pi^4 of 6 mm, so harmonics fall as 66 mm/n^5: beyond 60 they sum to 1.3 nm.
    assert found["left_out"] < 1.3e-9
    assert found["polydyne"][4] < 1e-12
    assert found["polydyne"][0] > 10 * found["plain"][0], "worse than a plain one far below its speed"


OSCILLATING = """
format = 1
[nodes]
cam = [0, 0, 0]
pivot = [0, 0, 0.19]
roller = [0, 0.13, 0.19]
load = [0.3, 0, 0.19]
[materials]
steel = { E = "208 GPa", nu = 0.3, density = "7850 kg/m^3" }
[sections]
arm = { shape = "circle", diameter = "70 mm" }
shaft = { shape = "circle", diameter = "50 mm" }
[members]
arm = { nodes = ["pivot", "roller"], elements = 1, material = "steel", section = "arm" }
shaft = { nodes = ["pivot", "load"], elements = 2, material = "steel", section = "shaft" }
[supports]
pivot = ["ux", "uy", "uz", "ry", "rz"]
load = ["uy", "uz", "ry", "rz"]
[masses]
load = { at = "load", mass = "20 kg", inertia = ["2 kg m^2", "1 kg m^2", "1 kg m^2"] }
[springs]
return = { at = "load", direction = "rx", stiffness = "200 N m/rad" }
[cams]
main = { at = "cam", axis = [1, 0, 0], LIFT }
[contacts.main]
cam = "main"
follower = "roller"
direction = "uz"
model = "bilateral"
stiffness = "300 MN/m"
[run]
speed = "300 rpm"
revolutions = 4
steps_per_revolution = 720
start = "equilibrium"
damping = { modal = "2 %" }
[output]
probes = ["load", "roller"]
"""
CYCLOIDAL = 'law = "4-5-6-7", lift = "40 mm", rise = "100 deg", dwell = "80 deg", return = "100 deg"'


def test_polydyne_cam_of_rotating_load(wide_flexcam, tmp_path):
    """The first probe is an inertia at the end of an output shaft; in a run it follows the motion of the rigid train."""
    path, deviations = tmp_path / "case.toml", []
    path.write_text(OSCILLATING.replace("LIFT", CYCLOIDAL), encoding="utf-8")
    command = ("synthesize", "polydyne", path)
    assert "Max deviation of load.rx" in wide_flexcam(*command, "-o", tmp_path / "lift.toml").out
    assert facts(wide_flexcam, *command)["ratio"] == pytest.approx(1.0 / 0.13)
    nominal_lift = build_model(read_case(path)).cams["main"].event
    for lift in (CYCLOIDAL, 'lift_table = "lift.toml"'):
        path.write_text(OSCILLATING.replace("LIFT", lift), encoding="utf-8")
        response = run(read_case(path))
        error = response["load.rx"].displacement.ravel() - nominal_lift(response.angle) / 0.13
        deviations.append(np.abs(error[response.angle > 6.0 * math.pi]).max())
    assert deviations[1] < 1e-2 * deviations[0]
    assert "expected a point and component that the cam moves" in wide_flexcam(*command, "--probe", "load.uy").err


def test_polydyne_cam_without_probe_is_for_its_follower(wide_flexcam):
    """Only one of the four cylinders has a probe."""
    camshaft = ROOT / "cases/camshaft-4cyl/camshaft.toml"
    found = facts(wide_flexcam, "synthesize", "polydyne", camshaft, "--cam", "exhaust-2", "--speed", "2000rpm")
    assert found["probe"] == "exhaust-2-follower"
    refused = wide_flexcam("synthesize", "polydyne", camshaft, "--cam", "exhaust-2", "--probe", "sprocket.uy")
    assert refused.code == 2
    assert "cams.exhaust-2 does not move it" in refused.err


def test_polydyne_cam_of_single_mass(wide_flexcam, tmp_path):
    """The lift is y + (w/w0)^2 y'': the cosine of 3 mm (1 - cos) is multiplied by 1 - (w/w0)^2."""
    done = wide_flexcam(*POLYDYNE, "--frequency", "397 Hz", "--speed", "3000 rpm", "--count", "7", "-o", "mass.toml")
    assert 'lift_table = "mass.toml"' in done.out
    lift = tomllib.loads((tmp_path / "mass.toml").read_text(encoding="utf-8"))["lift"]
    assert lift["mean"] == pytest.approx(0.003, rel=1e-12)
    expected = [-0.003 * (1 - (50 / 397) ** 2)] + [0.0] * 13
    assert lift["cosine"] + lift["sine"] == pytest.approx(expected, rel=1e-12, abs=1e-15)


CAMS = """
format = 1
[cams.intake]
law = "shm"
lift = "6 mm"
rise = "180 deg"
return = "180 deg"
"""


@pytest.mark.slow
def test_negative_polydyne_lift_is_reported_with_remedy(wide_flexcam):
    """A larger base circle has no effect; a lower speed and, in this case, more harmonics remove it."""
    cam = ("synthesize", "polydyne", ROOT / "cases/pushrod-engine/intake.toml", "--frequency", "400 Hz")
    for more in ((), ("--set", "cams.intake.base_radius=30 mm")):
        output = " ".join(wide_flexcam(*cam, *more).out.split())
        assert "inside its base circle. A lower design speed (--speed) reduces this depth" in output
    for words in (("--speed", "500 rpm"), ("--count", "200")):
        assert "base circle" not in wide_flexcam(*cam, *words).out


@pytest.mark.parametrize(("line", "words"), [("", ("--speed", "3000 rpm")), ('speed = "3000 rpm"', ())])
def test_polydyne_cam_of_single_mass_needs_no_train(wide_flexcam, tmp_path, line, words):
    """A file with cams only is sufficient; the speed is an option or that of the file."""
    path = tmp_path / "cams.toml"
    path.write_text(line + CAMS, encoding="utf-8")
    found = facts(wide_flexcam, "synthesize", "polydyne", path, "--frequency", "397 Hz", "--count", "7", *words)
    from_model = facts(wide_flexcam, *POLYDYNE, "--frequency", "397 Hz", "--speed", "3000 rpm", "--count", "7")
    assert found == from_model
    assert found["lift"][1] - found["lift"][0] == pytest.approx(0.006 * (1 - (50 / 397) ** 2), rel=1e-9)


@pytest.mark.parametrize(
    ("words", "where", "more"),
    [(("--frequency", "397 Hz"), "--speed", "3000rpm"), (("--speed", "3000 rpm"), "cams.toml", "--frequency")],
)
def test_polydyne_cam_requires_train_or_frequency_and_speed(wide_flexcam, tmp_path, words, where, more):
    path = tmp_path / "cams.toml"
    path.write_text(CAMS, encoding="utf-8")
    done = wide_flexcam("synthesize", "polydyne", path, *words)
    assert done.code == 2
    assert where in done.err
    assert more in done.err


def test_number_of_harmonics_below_first_mode(wide_flexcam, tmp_path):
    """First mode at 67.11 Hz, cam at 10 Hz: six harmonics. In the dwell of 200 deg the lift is within 20 um."""
    found = facts(wide_flexcam, *SHORT, "-o", "few.toml")
    assert list(found) == ["status", "harmonics", "harmonics_below_first_mode", "first_mode_hz", "dwell_deviation", "deviation", "rms_deviation", "lift", "files"]  # fmt: skip
    assert (found["harmonics"], found["harmonics_below_first_mode"], found["files"]) == (6, 6, ["few.toml"])
    assert found["first_mode_hz"] == pytest.approx(67.11, abs=0.005)
    lift = tomllib.loads((tmp_path / "few.toml").read_text(encoding="utf-8"))["lift"]
    phases = np.outer(ANGLE, np.arange(1, 7))
    value = lift["mean"] + np.cos(phases) @ lift["cosine"] + np.sin(phases) @ lift["sine"]
    deviation = np.abs(value - build_model(model_with_overrides(SHORT[3:])).cams["intake"].event(ANGLE))
    # Between fit points at h = 0.5 deg it increases by h^2/8 of the acceleration, 40 mm/rad^2: 0.4 um.
    assert deviation[3200:].max() <= 20.4e-6
    assert deviation.max() == pytest.approx(found["deviation"], abs=0.4e-6)
    assert run(case_with_lift(tmp_path, "few.toml", 600)).status.ok


def test_harmonics_below_first_mode_with_bilateral_contact(wide_flexcam):
    """Li's train of three masses on k1, which its cam moves: 316 Hz by his equation (12); twelve at 25 Hz."""
    found = facts(wide_flexcam, "synthesize", "harmonic", ROOT / "cases/li/valve-train.toml", "--tolerance", "60um")
    k = np.diag([8e6, 8e6, 4e6 + 23e3]) - 4e6 * (np.eye(3, k=1) + np.eye(3, k=-1))
    root = np.diag(np.array([0.25, 0.18, 0.21]) ** -0.5)
    assert found["first_mode_hz"] == pytest.approx(np.sqrt(np.linalg.eigvalsh(root @ k @ root)[0]) / (2.0 * np.pi))
    assert (found["harmonics"], found["deviation"] < 60e-6) == (12, True)


def test_harmonics_with_hertz_contact_use_compressed_stiffness(wide_flexcam):
    """The valve spring of 60 g has fixed ends while the contact is closed: surge near sqrt(k/m)/2 = 456 Hz."""
    found = facts(
        wide_flexcam, "synthesize", "harmonic", ROOT / "cases/pushrod-engine/intake.toml", "--tolerance", "60um"
    )
    assert found["first_mode_hz"] == pytest.approx(0.5 * np.sqrt(50e3 / 0.06), rel=0.02)


@pytest.mark.parametrize(
    "design",
    [
        ("harmonic", "--tolerance", "60um"),
        pytest.param(("polydyne", "--frequency", "9000Hz"), marks=pytest.mark.slow),
    ],
)
def test_written_lift_keeps_cam_angle_of_case_with_phase(wide_flexcam, tmp_path, design):
    """The file must not repeat the phase of 105 deg: the valve would open 210 deg of the crank too late."""
    kind, *words = design
    command_output = wide_flexcam(
        "synthesize", kind, ROOT / "cases/pushrod-engine/intake.toml", *words, "-o", "lift.toml"
    ).out
    output = " ".join(command_output.split())
    assert 'centreline and timing with: lift_table = "lift.toml", phase = "105 deg")' in output
    text = (ROOT / "cases/pushrod-engine/intake.toml").read_text(encoding="utf-8")
    lines = 'law = "4-5-6-7"\nlift = "6 mm"\nrise = "75 deg"\nreturn = "75 deg"\n'
    assert lines in text
    text = re.sub(r"ramps = .*\n", "", text.replace(lines, 'lift_table = "lift.toml"\n'))
    (tmp_path / "made.toml").write_text(text, encoding="utf-8")
    original, written = (
        build_model(read_case(path)).cams["intake"].event
        for path in (ROOT / "cases/pushrod-engine/intake.toml", tmp_path / "made.toml")
    )
    assert np.abs(original(ANGLE) - written(ANGLE)).max() < 0.3e-3  # shifted by the phase: 6.3 mm


def test_refusal_states_tolerance_of_few_harmonics(wide_flexcam):
    done = wide_flexcam(*SHORT, "--count", "3", "--tolerance", "1 um")
    assert (done.code, done.out) == (2, "")
    tolerance = re.search(r"\(--tolerance\) of at least ([\d.]+) um\.", done.err)[1]
    assert wide_flexcam(*SHORT, "--count", "3", "--tolerance", f"{tolerance} um").code == 0
    assert wide_flexcam(*SHORT, "--count", "3", "--tolerance", f"{0.98 * float(tolerance)} um").code == 2


@pytest.mark.slow
def test_law_of_minimum_acceleration(wide_flexcam, tmp_path, monkeypatch):
    """As in docs/motion.md: splines on 24 pieces, jerk bound 52.5, no law below 8/(1 + sqrt(1 - 32/J))."""
    found = facts(wide_flexcam, *MIN_ACCELERATION, "--bound", "Cj=52.5", "-o", "new/best.toml", "--plot", "best.svg")
    assert (list(found), found["files"]) == (["status", "laws", "files"], ["new/best.toml", "best.svg"])
    (law,) = found["laws"]
    assert list(law) == LAW_KEYS
    assert law["objective"] == law["Ca"] == pytest.approx(5.024, abs=5e-4)
    assert law["Cj"] <= 52.5
    assert 0.0 <= law["gap"] == law["objective"] - law["family_bound"] < 1e-6
    assert law["bound_over_all_laws"] == pytest.approx(8 / (1 + math.sqrt(1 - 32 / 52.5)), rel=1e-12)
    assert "C_m: max product of velocity and acceleration" in " ".join(wide_flexcam(*MIN_ACCELERATION).out.split())
    criteria = facts(wide_flexcam, "law", "new/best.toml")
    assert [criteria[key] for key in LAW_KEYS[5:9]] == [law[key] for key in LAW_KEYS[5:9]]
    monkeypatch.setenv("FLEXCAM_FILES", str(tmp_path))
    case = model_with_overrides([f"cams.intake.law={tmp_path}/new/best.toml"])
    lift = build_model(case).cams["intake"].event(np.array([math.pi / 4]))
    assert lift == 0.006 * read_law(tmp_path / "new/best.toml").law(np.array([0.25]))
    assert run(case).status.ok


@pytest.mark.slow
def test_law_conditions_and_families(wide_flexcam, tmp_path):
    facts(wide_flexcam, *POLYNOMIAL, "--condition", "0.5,1,1.8", "--condition", "0.25,0,0.1", "-o", "a.toml")
    law = read_law(tmp_path / "a.toml").law
    assert [law(np.array([0.5]), 1)[0], law(np.array([0.25]))[0]] == pytest.approx([1.8, 0.1], rel=1e-9)
    for condition, allowed in (("--condition=0.3,1,-0.2", "--turning-back"), ("--condition=0.5,0,0.6", "--asymmetric")):
        assert (wide_flexcam(*POLYNOMIAL, condition).code, wide_flexcam(*POLYNOMIAL, condition, allowed).code) == (2, 0)
    (result,) = facts(wide_flexcam, *MIN_ACCELERATION, "--family=harmonic", "--orders=1", "--orders=3", "-o", "b.toml")[
        "laws"
    ]
    assert result["Ca"] == pytest.approx(2 * math.pi / 9 * 1.5**1.5 * 4, rel=2e-8)  # Gutman's
    assert [n for n, _ in read_law(tmp_path / "b.toml").law.harmonics] == [1, 3]
    (result,) = facts(wide_flexcam, "synthesize", "law", "--family=harmonic", "--minimize=Cm")["laws"]
    assert (result["family_bound"], result["gap"]) == (None, None), "not convex: no bound is claimed"


@pytest.mark.slow
def test_pareto_front_of_laws(wide_flexcam, tmp_path):
    """Two plots, the criteria and the laws; an existing plot is refused before the computation of laws."""
    found = facts(
        wide_flexcam, *POLYNOMIAL, "--pareto", "Cj", "--count", "3", "-o", "front.toml", "--plot", "front.svg"
    )
    assert found["files"] == [*(f"front-{i}.toml" for i in range(1, 4)), "front.svg"]
    jerk, acceleration = ([law[key] for law in found["laws"]] for key in ("Cj", "Ca"))
    assert (jerk, acceleration) == (sorted(jerk), sorted(acceleration, reverse=True))
    assert (
        'law = "front-3.toml"'
        in wide_flexcam(*POLYNOMIAL, "--pareto=Cj", "--count=3", "-o=front.toml", "--overwrite").out
    )
    drawn = (tmp_path / "front.svg").read_text(encoding="utf-8")
    titles = ("Pareto front of polynomials of degree 11", "Its laws, lift 1 over angle 1")
    axes = ("C_a, max acceleration, lift 1 over angle 1", "C_j, max jerk, lift 1 over angle 1")
    assert all(f"<!-- {text} -->" in drawn for text in (*titles, *axes))
    assert wide_flexcam(*POLYNOMIAL, "--pareto=Cj", "--count=3", "--plot=front.svg", "-o", "law.toml").code == 2
    assert not list(tmp_path.glob("law-*.toml"))


@pytest.mark.parametrize(
    "words", [POLYNOMIAL, pytest.param(POLYDYNE, marks=pytest.mark.slow), HARMONIC], ids=["law", "polydyne", "harmonic"]
)
def test_synthesize_output_file(words, wide_flexcam, tmp_path):
    (tmp_path / "x.toml").write_text("mine")
    done = wide_flexcam(*words, "-o", "x.toml")
    assert (done.code, "--overwrite" in done.err, done.out) == (2, True, "")
    assert (tmp_path / "x.toml").read_text() == "mine"
    assert wide_flexcam(*words, "-o", "x.txt").code == wide_flexcam(*words, "-o", "x").code == 2
    assert [path.name for path in tmp_path.iterdir()] == ["x.toml"]
    assert wide_flexcam(*words, "-o", "x.toml", "--overwrite").code == 0
    assert tomllib.loads((tmp_path / "x.toml").read_text(encoding="utf-8"))["about"]["flexcam"]


def test_bound_over_all_laws_with_free_ends(wide_flexcam):
    """12 as for the 2-3 polynomial; a bound of zero, as for zero jerk, is printed as unknown."""
    (law,) = facts(wide_flexcam, *MIN_ACCELERATION[:-1], "Cj", "--rest", "1")["laws"]
    assert (law["bound_over_all_laws"], law["Cj"]) == (12.0, pytest.approx(12.0, rel=1e-9))
    assert "12; the law" in wide_flexcam(*MIN_ACCELERATION[:-1], "Cj", "--rest", "1").out
    found = minimax(SplineFamily(7, 1), {"Ca": 1.0})
    for unknown_bound in (None, 0.0):
        assert "unknown" in render(synthesis_table(replace(found, bound_all=unknown_bound)))


def test_search_without_convergence_is_reported(wide_flexcam, monkeypatch):
    """Between the initial points of the program the curve exceeds its bound."""
    monkeypatch.setattr(module, "_ROUNDS", 0)
    monkeypatch.setattr(module, "_START", np.linspace(0.0, 1.0, 14))
    words = (*MIN_ACCELERATION, "--bound", "Cj=52.5")
    (law,) = facts(wide_flexcam, *words)["laws"]
    assert law["converged"] is False
    assert law["Cj"] > 52.5 * (1.0 + 1e-6)
    (missed, *_) = law["not_converged"]
    assert missed.startswith("Cj is ")
    assert "not converged" in wide_flexcam(*words).out
    found = minimax(SplineFamily(7, 1), {"Ca": 1.0})
    assert "lies 1.0e-03 below it" in render(synthesis_table(replace(found, bound=found.objective + 1e-3)))
    assert "lies 1.0e-03 above it" in render(synthesis_table(replace(found, bound=found.objective - 1e-3)))
    assert "the law attains it" in render(synthesis_table(replace(found, bound=found.objective * (1.0 + 1e-14))))


def render(table):
    page = io.StringIO()
    Console(file=page, width=200).print(table)
    return page.getvalue()


P = " ".join(POLYNOMIAL[1:])
REFUSED = {  # arguments, location, part of the message
    "unknown criterion": ("law --minimize Cq", "--minimize", "Cv, Ca, Cj, rms, Cm"),
    "bound without a value": (f"{P} --bound Cj", "--bound", "CRITERION=VALUE"),
    "bound that no law meets": (f"{P} --bound Cj=10", "--bound", "a wider bound"),
    "one harmonic": ("law --minimize Ca --family harmonic --orders 1", "--orders", "two or more"),
    "count without a front": (f"{P} --count 5", "--count", "--pareto"),
    "degree of harmonic laws": ("law --minimize Ca --family harmonic --degree 7", "--degree", "--family spline"),
    "asymmetric harmonic laws": ("law --minimize Ca --family harmonic --asymmetric", "--asymmetric", "--family spline"),
    "orders of polynomials": (f"{P} --orders 1 --orders 3", "--orders", "--family harmonic"),
    "pieces of polynomials": (f"{P} --pieces 3", "--pieces", "--family spline"),
    "two numbers": (f"{P} --condition 0.5,1", "--condition", "0.5,1,1.8"),
    "condition that none meets": (f"{P} --condition 0.5,0,0.7", "--condition", "0.5,0,0.7"),
    "condition against the ends": ("law --minimize rms --condition 0,2,0.6", "--condition", "or --rest 1"),
    "tolerance in kg": ("harmonic MODEL --tolerance 20kg", "--tolerance", "a length"),
    "no harmonic below the first mode": ("harmonic MODEL --set=run.speed=30000rpm", "count", "--count"),
    "cam that is not there": ("harmonic MODEL --cam intak", "--cam", "did you mean 'intake'"),
    "no cam": (f"polydyne {ROOT}/cases/checks/cantilever.toml", "--cam", "a cam in the case"),
    "speed without a unit": ("polydyne MODEL --speed 3000", "--speed", "write '3000 rpm'"),
    "frequency without a unit": ("polydyne MODEL --frequency 4e2", "--frequency", "write '4e2 Hz'"),
    "tolerance without a unit": ("harmonic MODEL --tolerance 20", "--tolerance", "write '20 um'"),
    "bound without a unit": ("harmonic MODEL --bound .2", "--bound", "write '.2 mm'"),
    "speed below zero": ("polydyne MODEL --speed=-3rpm", "--speed", "above zero"),
    "damping below zero": ("polydyne MODEL --frequency 400Hz --damping=-1", "--damping", "zero or more"),
    "harmonics of a polydyne cam": ("polydyne MODEL --count 0", "--count", "from 1"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_synthesize_refuses_invalid_input(name, wide_flexcam):
    words, where, expected = REFUSED[name]
    done = wide_flexcam("synthesize", *words.replace("MODEL", str(MODEL)).split(), "--json")
    assert (done.code, done.err) == (2, "")
    errors = done.json["errors"]
    assert errors[0]["where"] == where
    assert expected in " ".join(errors[0].values())
