"""synthesize law, harmonic and polydyne: what is found, files that a case can name, what is refused and how."""

# ruff: noqa: E501 - tables, a row to a line

from __future__ import annotations

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

module = sys.modules["flexcam.cams.minimax"]  # the function hides it
ROOT = Path(__file__).parents[2]
MODEL = ROOT / "cases/tayeb/model-3-shm.toml"
POLYDYNE, HARMONIC = (("synthesize", kind, MODEL) for kind in ("polydyne", "harmonic"))
LEAST = ("synthesize", "law", "--minimize", "Ca")
POLYNOMIAL = (*LEAST, "--family", "polynomial")
SMOOTH = ("--set=cams.intake.law=4-5-6-7", "--set=run.speed=1200rpm")
SHORT = (*HARMONIC, "--set=cams.intake.law=3-4-5", "--set=cams.intake.rise=80 deg", "--set=cams.intake.return=80 deg", "--set=run.speed=600rpm")  # fmt: skip
LAW = [
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


def train(folder, lift, rpm):
    """Return published model 3 at another speed, with a lift file in the place of its law."""
    text = MODEL.read_text(encoding="utf-8").replace("../../meshes", str(ROOT / "meshes"))
    text = re.sub(r"law = .*\nlift = .*\nrise = .*\nreturn = .*\n", f'lift_table = "{lift}"\n', text)
    (folder / "case.toml").write_text(text.replace('"3000 rpm"', f'"{rpm} rpm"'), encoding="utf-8")
    return read_case(folder / "case.toml")


def plain(words):
    return read_case(MODEL, [word.removeprefix("--set=") for word in words])


@pytest.mark.slow
def test_the_valve_follows_a_polydyne_cam(told, tmp_path):
    """It makes 1.6 of the lift, to 1 um; the time steps, of second order, take 0.02 um. The plain cam is off by 3.6 mm."""
    assert facts(told, *POLYDYNE, *SMOOTH, "-o", "polydyne.toml")["files"] == ["polydyne.toml"]
    wanted = build_model(plain(SMOOTH)).cams["intake"].event
    off = []
    for case in (train(tmp_path, "polydyne.toml", 1200), plain(SMOOTH)):
        response = run(case)
        off.append(np.abs(response["valve"].displacement.ravel() - 1.6 * wanted(response.angle)).max())
    assert off[0] < 1e-6 < 1e-3 < off[1]


@pytest.mark.slow
def test_distances_are_those_of_the_valve(told):
    """Damped, a run comes to the steady motion that the table is about, behind a rocker of 1.6."""
    words = (*SMOOTH, "--set=run.damping={ modal = 0.1 }", "--set=run.revolutions=6")
    found, response = facts(told, *POLYDYNE, *words), run(plain(words))
    wanted, last = build_model(plain(words)).cams["intake"].event, response.angle > 10 * math.pi
    off = np.abs(response["valve"].displacement.ravel() - 1.6 * wanted(response.angle))[last].max()
    assert [found["ratio"], found["plain"][4]] == pytest.approx([1.6, off], rel=1e-3)


def test_a_speed_in_resonance_is_one_row(told):
    """150 Hz is three times 3000 rpm: the third harmonic at the design speed, which the new cam leaves out, others at others."""
    words = (*POLYDYNE, "--frequency", "150Hz", "--set=cams.intake.law=4-5-6-7", "--set=cams.intake.rise=60 deg")
    found = facts(told, *words)
    assert [i for i, value in enumerate(found["plain"]) if value is None] == [0, 1, 2, 4]
    assert [i for i, value in enumerate(found["polydyne"]) if value is None] == [0, 1, 2]
    output = told(*words).out
    assert "resonance" in output
    low, high = found["lift"]
    assert f"{1e3 * high:.6g} mm" in output
    assert ("warning" in output) == (low < 0.0)


def test_polydyne_of_the_train(told):
    found = facts(told, *POLYDYNE, "--set=cams.intake.law=4-5-6-7", "--speed", "1200 rpm")
    assert list(found) == [
        "status",
        "design_speed_rpm",
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


def test_polydyne_of_one_mass(told, tmp_path):
    """Its lift is y + (w/w0)^2 y'': of 3 mm (1 - cos), the cosine shrinks by 1 - (w/w0)^2."""
    done = told(*POLYDYNE, "--frequency", "397 Hz", "--speed", "3000 rpm", "--count", "7", "-o", "mass.toml")
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


@pytest.mark.parametrize("words", [("--speed", "500 rpm"), ("--count", "200")])
def test_a_negative_lift_of_a_polydyne_cam_is_reported_with_what_reduces_it(told, words):
    """A larger base circle does not reduce it; a lower speed and more harmonics do, here to below the tolerance."""
    cam = ("synthesize", "polydyne", ROOT / "cases/pushrod-engine/intake.toml", "--frequency", "400 Hz")
    for more in ((), ("--set", "cams.intake.base_radius=30 mm")):
        output = " ".join(told(*cam, *more).out.split())
        assert "inside its base circle. A lower design speed (--speed) or more harmonics (--count) can reduce" in output
    assert "base circle" not in told(*cam, *words).out


@pytest.mark.parametrize(("line", "words"), [("", ("--speed", "3000 rpm")), ('speed = "3000 rpm"', ())])
def test_polydyne_of_one_mass_needs_no_train(told, tmp_path, line, words):
    """A file with cams alone will do; the speed is asked for, or its own."""
    path = tmp_path / "cams.toml"
    path.write_text(line + CAMS, encoding="utf-8")
    found = facts(told, "synthesize", "polydyne", path, "--frequency", "397 Hz", "--count", "7", *words)
    alike = facts(told, *POLYDYNE, "--frequency", "397 Hz", "--speed", "3000 rpm", "--count", "7")
    assert found == alike
    assert found["lift"][1] - found["lift"][0] == pytest.approx(0.006 * (1 - (50 / 397) ** 2), rel=1e-9)


@pytest.mark.parametrize(
    ("words", "where", "more"),
    [(("--frequency", "397 Hz"), "--speed", "3000rpm"), (("--speed", "3000 rpm"), "cams.toml", "--frequency")],
)
def test_a_polydyne_cam_without_a_train_or_a_speed(told, tmp_path, words, where, more):
    path = tmp_path / "cams.toml"
    path.write_text(CAMS, encoding="utf-8")
    done = told("synthesize", "polydyne", path, *words)
    assert done.code == 2
    assert where in done.err
    assert more in done.err


def test_harmonics_below_the_first_mode(told, tmp_path):
    """Of 67.11 Hz, at 10 Hz: six. In the dwell of 200 deg the lift stays within 20 um."""
    found = facts(told, *SHORT, "-o", "few.toml")
    assert list(found) == ["status", "harmonics", "harmonics_below_first_mode", "first_mode_hz", "dwell_deviation", "deviation", "rms_deviation", "lift", "files"]  # fmt: skip
    assert (found["harmonics"], found["harmonics_below_first_mode"], found["files"]) == (6, 6, ["few.toml"])
    assert found["first_mode_hz"] == pytest.approx(67.11, abs=0.005)
    lift = tomllib.loads((tmp_path / "few.toml").read_text(encoding="utf-8"))["lift"]
    turned = np.outer(ANGLE, np.arange(1, 7))
    value = lift["mean"] + np.cos(turned) @ lift["cosine"] + np.sin(turned) @ lift["sine"]
    off = np.abs(value - build_model(plain(SHORT[3:])).cams["intake"].event(ANGLE))
    # Between the points of the fit, h = 0.5 deg apart, it rises by h^2/8 of the acceleration, 40 mm/rad^2: 0.4 um.
    assert off[3200:].max() <= 20.4e-6
    assert off.max() == pytest.approx(found["deviation"], abs=0.4e-6)
    assert run(train(tmp_path, "few.toml", 600)).status.ok


def test_harmonics_below_the_first_mode_of_a_train_held_to_its_cam(told):
    """Li's train of three masses on k1, which its cam moves: 316 Hz, as its equation (12) has it; at 25 Hz, twelve."""
    found = facts(told, "synthesize", "harmonic", ROOT / "cases/li/valve-train.toml", "--tolerance", "60um")
    k = np.diag([8e6, 8e6, 4e6 + 23e3]) - 4e6 * (np.eye(3, k=1) + np.eye(3, k=-1))
    root = np.diag(np.array([0.25, 0.18, 0.21]) ** -0.5)
    assert found["first_mode_hz"] == pytest.approx(np.sqrt(np.linalg.eigvalsh(root @ k @ root)[0]) / (2.0 * np.pi))
    assert (found["harmonics"], found["deviation"] < 60e-6) == (12, True)


def test_harmonics_under_a_hertz_contact_count_the_train_as_it_is_pressed(told):
    """The spring of 60 g, on ground and on a valve that is held to its cam, surges near sqrt(k/m)/2 = 456 Hz."""
    found = facts(told, "synthesize", "harmonic", ROOT / "cases/pushrod-engine/intake.toml", "--tolerance", "60um")
    assert found["first_mode_hz"] == pytest.approx(0.5 * np.sqrt(50e3 / 0.06), rel=0.02)


@pytest.mark.parametrize("design", [("harmonic", "--tolerance", "60um"), ("polydyne", "--frequency", "9000Hz")])
def test_a_written_lift_keeps_its_angle_in_a_case_with_a_phase(told, tmp_path, design):
    """The case's phase of 105 deg is not in the file too: the valve would open 210 crank degrees late."""
    kind, *words = design
    made = told("synthesize", kind, ROOT / "cases/pushrod-engine/intake.toml", *words, "-o", "lift.toml").out
    said = " ".join(made.split())
    assert 'centreline and timing with: lift_table = "lift.toml", phase = "105 deg")' in said
    text = (ROOT / "cases/pushrod-engine/intake.toml").read_text(encoding="utf-8")
    lines = 'law = "4-5-6-7"\nlift = "6 mm"\nrise = "75 deg"\nreturn = "75 deg"\n'
    assert lines in text
    text = re.sub(r"ramps = .*\n", "", text.replace(lines, 'lift_table = "lift.toml"\n'))
    (tmp_path / "made.toml").write_text(text, encoding="utf-8")
    one, other = (
        build_model(read_case(path)).cams["intake"].event
        for path in (ROOT / "cases/pushrod-engine/intake.toml", tmp_path / "made.toml")
    )
    assert np.abs(one(ANGLE) - other(ANGLE)).max() < 0.3e-3  # late by the phase it is 6.3 mm


def test_too_few_harmonics_are_told_what_they_can_hold(told):
    done = told(*SHORT, "--count", "3", "--tolerance", "1 um")
    assert (done.code, done.out) == (2, "")
    held = re.search(r"\(--tolerance\) of at least ([\d.]+) um\.", done.err)[1]
    assert told(*SHORT, "--count", "3", "--tolerance", f"{held} um").code == 0
    assert told(*SHORT, "--count", "3", "--tolerance", f"{0.98 * float(held)} um").code == 2


def test_a_law_of_least_acceleration(told, tmp_path, monkeypatch):
    """The numbers of docs/motion.md: splines on 24 pieces, a jerk of 52.5, no law at all below 8/(1 + sqrt(1 - 32/J))."""
    found = facts(told, *LEAST, "--bound", "Cj=52.5", "-o", "new/best.toml", "--plot", "best.svg")
    assert (list(found), found["files"]) == (["status", "laws", "files"], ["new/best.toml", "best.svg"])
    (law,) = found["laws"]
    assert list(law) == LAW
    assert law["objective"] == law["Ca"] == pytest.approx(5.024, abs=5e-4)
    assert law["Cj"] <= 52.5
    assert 0.0 <= law["gap"] == law["objective"] - law["family_bound"] < 1e-6
    assert law["bound_over_all_laws"] == pytest.approx(8 / (1 + math.sqrt(1 - 32 / 52.5)), rel=1e-12)
    assert "C_m: max product of velocity and acceleration" in " ".join(told(*LEAST).out.split())
    said = facts(told, "law", "new/best.toml")
    assert [said[key] for key in LAW[5:9]] == [law[key] for key in LAW[5:9]]
    monkeypatch.setenv("FLEXCAM_FILES", str(tmp_path))
    case = plain([f"cams.intake.law={tmp_path}/new/best.toml"])
    lift = build_model(case).cams["intake"].event(np.array([math.pi / 4]))
    assert lift == 0.006 * read_law(tmp_path / "new/best.toml").law(np.array([0.25]))
    assert run(case).status.ok


@pytest.mark.slow
def test_conditions_and_families(told, tmp_path):
    facts(told, *POLYNOMIAL, "--condition", "0.5,1,1.8", "--condition", "0.25,0,0.1", "-o", "a.toml")
    law = read_law(tmp_path / "a.toml").law
    assert [law(np.array([0.5]), 1)[0], law(np.array([0.25]))[0]] == pytest.approx([1.8, 0.1], rel=1e-9)
    for condition, allowed in (("--condition=0.3,1,-0.2", "--turning-back"), ("--condition=0.5,0,0.6", "--asymmetric")):
        assert (told(*POLYNOMIAL, condition).code, told(*POLYNOMIAL, condition, allowed).code) == (2, 0)
    (found,) = facts(told, *LEAST, "--family=harmonic", "--orders=1", "--orders=3", "-o", "b.toml")["laws"]
    assert found["Ca"] == pytest.approx(2 * math.pi / 9 * 1.5**1.5 * 4, rel=2e-8)  # Gutman's
    assert [n for n, _ in read_law(tmp_path / "b.toml").law.harmonics] == [1, 3]
    (found,) = facts(told, "synthesize", "law", "--family=harmonic", "--minimize=Cm")["laws"]
    assert (found["family_bound"], found["gap"]) == (None, None), "not convex: no bound is claimed"


@pytest.mark.slow
def test_a_front(told, tmp_path):
    """Drawn criterion over criterion, with its laws; a picture that is there is refused before any law."""
    found = facts(told, *POLYNOMIAL, "--pareto", "Cj", "--count", "3", "-o", "front.toml", "--plot", "front.svg")
    assert found["files"] == [*(f"front-{i}.toml" for i in range(1, 4)), "front.svg"]
    jerk, acceleration = ([law[key] for law in found["laws"]] for key in ("Cj", "Ca"))
    assert (jerk, acceleration) == (sorted(jerk), sorted(acceleration, reverse=True))
    assert 'law = "front-3.toml"' in told(*POLYNOMIAL, "--pareto=Cj", "--count=3", "-o=front.toml", "--overwrite").out
    drawn = (tmp_path / "front.svg").read_text(encoding="utf-8")
    titles = ("Pareto front of polynomials of degree 11", "Its laws, lift 1 over angle 1")
    axes = ("C_a, max acceleration, lift 1 over angle 1", "C_j, max jerk, lift 1 over angle 1")
    assert all(f"<!-- {one} -->" in drawn for one in (*titles, *axes))
    assert told(*POLYNOMIAL, "--pareto=Cj", "--count=3", "--plot=front.svg", "-o", "law.toml").code == 2
    assert not list(tmp_path.glob("law-*.toml"))


@pytest.mark.parametrize(
    "words", [POLYNOMIAL, pytest.param(POLYDYNE, marks=pytest.mark.slow), HARMONIC], ids=["law", "polydyne", "harmonic"]
)
def test_output(words, told, tmp_path):
    (tmp_path / "x.toml").write_text("mine")
    done = told(*words, "-o", "x.toml")
    assert (done.code, "--overwrite" in done.err, done.out) == (2, True, "")
    assert (tmp_path / "x.toml").read_text() == "mine"
    assert told(*words, "-o", "x.txt").code == told(*words, "-o", "x").code == 2
    assert [path.name for path in tmp_path.iterdir()] == ["x.toml"]
    assert told(*words, "-o", "x.toml", "--overwrite").code == 0
    assert tomllib.loads((tmp_path / "x.toml").read_text(encoding="utf-8"))["about"]["flexcam"]


def test_a_bound_over_all_laws_with_free_ends(told):
    """12 of the 2-3 polynomial; a bound of zero, such as of no jerk at all, is shown as unknown."""
    (law,) = facts(told, *LEAST[:-1], "Cj", "--rest", "1")["laws"]
    assert (law["bound_over_all_laws"], law["Cj"]) == (12.0, pytest.approx(12.0, rel=1e-9))
    assert "12; the law" in told(*LEAST[:-1], "Cj", "--rest", "1").out
    found = minimax(SplineFamily(7, 1), {"Ca": 1.0})
    for nothing in (None, 0.0):
        assert "unknown" in rendered(synthesis_table(replace(found, bound_all=nothing)))


def test_a_search_that_does_not_converge_says_so(told, monkeypatch):
    """Between the first places of the program the curve rises above its bound."""
    monkeypatch.setattr(module, "_ROUNDS", 0)
    monkeypatch.setattr(module, "_START", np.linspace(0.0, 1.0, 14))
    words = (*LEAST, "--bound", "Cj=52.5")
    (law,) = facts(told, *words)["laws"]
    assert law["converged"] is False
    assert law["Cj"] > 52.5 * (1.0 + 1e-6)
    (missed, *_) = law["not_converged"]
    assert missed.startswith("Cj is ")
    assert "not converged" in told(*words).out
    found = minimax(SplineFamily(7, 1), {"Ca": 1.0})
    assert "lies 1.0e-03 below it" in rendered(synthesis_table(replace(found, bound=found.objective + 1e-3)))
    assert "lies 1.0e-03 above it" in rendered(synthesis_table(replace(found, bound=found.objective - 1e-3)))
    assert "the law attains it" in rendered(synthesis_table(replace(found, bound=found.objective * (1.0 + 1e-14))))


def rendered(table):
    page = io.StringIO()
    Console(file=page, width=200).print(table)
    return page.getvalue()


P = " ".join(POLYNOMIAL[1:])
REFUSED = {  # words, where, a part of the message
    "unknown criterion": ("law --minimize Cq", "--minimize", "Cv, Ca, Cj, rms, Cm"),
    "bound without a value": (f"{P} --bound Cj", "--bound", "CRITERION=VALUE"),
    "bound that no law meets": (f"{P} --bound Cj=10", "bounds", "a wider bound"),
    "one harmonic": ("law --minimize Ca --family harmonic --orders 1", "--orders", "two or more"),
    "count without a front": (f"{P} --count 5", "--count", "--pareto"),
    "degree of harmonic laws": ("law --minimize Ca --family harmonic --degree 7", "--degree", "--family spline"),
    "asymmetric harmonic laws": ("law --minimize Ca --family harmonic --asymmetric", "--asymmetric", "--family spline"),
    "orders of polynomials": (f"{P} --orders 1 --orders 3", "--orders", "--family harmonic"),
    "pieces of polynomials": (f"{P} --pieces 3", "--pieces", "--family spline"),
    "two numbers": (f"{P} --condition 0.5,1", "--condition", "0.5,1,1.8"),
    "condition that none meets": (f"{P} --condition 0.5,0,0.7", "conditions", "0.5,0,0.7"),
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
def test_refused(name, told):
    words, where, said = REFUSED[name]
    done = told("synthesize", *words.replace("MODEL", str(MODEL)).split(), "--json")
    assert (done.code, done.err) == (2, "")
    found = done.json["errors"]
    assert found[0]["where"] == where
    assert said in " ".join(found[0].values())
