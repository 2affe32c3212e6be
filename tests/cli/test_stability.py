"""What endangers a speed, each cause by its own test, on the published model and the engine."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from flexcam import read_case
from flexcam.analysis import stability
from flexcam.cli.app import spaced_speeds
from flexcam.dynamics import State

ROOT = Path(__file__).resolve().parents[2]
PUBLISHED = ROOT / "cases/tayeb/model-3-shm.toml"
ENGINE = ROOT / "cases/pushrod-engine/intake.toml"
MATHIEU = ROOT / "cases/checks/mathieu.toml"
CANTILEVER = ROOT / "cases/checks/cantilever.toml"
QUICK = ("--set", "run.steps_per_revolution=360")


@pytest.mark.parametrize(("rpm", "verdict"), [(1000, []), (2000, []), (4000, ["resonance"])])
def test_published_claim(flexcam, rpm, verdict):
    """Unstable at 4000 rpm, says the paper: it is the loaded mode at 67.11 Hz = 4027 rpm, met by the first harmonic."""
    found = flexcam("stability", PUBLISHED, "--set", f"run.speed={rpm}rpm", *QUICK, "--json").json
    assert found["verdict"] == verdict
    told = [(one["rpm"], one["harmonic"]) for one in found["resonances"]]
    assert told == ([(pytest.approx(4026.9, abs=0.1), 1)] if rpm == 4000 else [])
    assert found["resonances_within"] == len(told)
    met = told[0][0] if told else found["next_resonance_rpm"]
    assert met == pytest.approx(4026.9, abs=0.1)
    assert abs(complex(*found["multipliers"][0])) == pytest.approx(1.0, abs=1e-6)  # undamped


def test_resonances_far_above_are_only_counted(flexcam):
    """Modes of some 10 kHz meet the first harmonic at hundreds of thousands of rpm, where no train turns."""
    output = flexcam("stability", PUBLISHED, *QUICK).out
    assert "67.114 Hz (mass valve" in output
    assert "at 4026.9 camshaft rpm" in " ".join(output.split())
    assert re.search(
        r"resonances +1 at or below 6000 camshaft rpm; \d+ above, the lowest at 159545 camshaft rpm", output
    )
    low = flexcam("stability", PUBLISHED, "--set", "run.speed=1000rpm", *QUICK).out
    assert "harmonic 1" not in low
    assert re.search(r"resonances +none at or below 2000 camshaft rpm; \d+ above, the lowest at 4026\.86 camshaft", low)


@pytest.mark.slow
def test_a_shaft_behind_a_gear_with_backlash(flexcam):
    """At the nose of its cam the shaft is unstable between the flanks: only the resonances are missing."""
    flexcam("new", "gear-drive")
    done = flexcam("stability", "gear-drive.toml", "--set", "run.revolutions=1", *QUICK, "--json")
    assert done.code == 0
    assert "no stable equilibrium at full lift" in done.json["note"]
    assert done.json["spectral_radius"] < 1.0


@pytest.mark.slow
def test_the_surge_of_the_spring_is_met(flexcam):
    """Its first mode is that between fixed ends, (1/2) sqrt(k/m) = 456 Hz; 5200 rpm lie between two harmonics."""
    run = ("--set", "run.revolutions=1", *QUICK)
    near, between = (
        flexcam("stability", ENGINE, "--set", f"run.crank_speed={rpm}rpm", *run, "--json").json for rpm in (4960, 5200)
    )
    nearest = near["resonances"][0]
    assert "spring valve" in nearest["moves"]
    assert nearest["harmonic"] == 11
    assert nearest["rpm"] == pytest.approx(
        2.0 * 60.0 * 0.5 * math.sqrt(50e3 / 0.06) / 11.0, rel=0.01
    )  # of the crankshaft
    assert nearest["load_share"] < 0.05, "its 38 N are no danger beside a force of 3 kN"
    assert "resonance" not in near["verdict"] + between["verdict"]


@pytest.mark.slow
def test_a_sound_train_chatters(flexcam):
    """Contacts chatter behind the ramps at 2000 rpm: two revolutions differ by a few per cent of the force."""
    output = flexcam("stability", ENGINE, "--set", "run.crank_speed=2000rpm", *QUICK).out
    assert re.search(r"verdict +chatter:", output)
    assert re.search(r"has \d+ impacts, which amplify small disturbances \S+ times", " ".join(output.split()))


def test_a_train_whose_disturbances_decay_is_not_called_unstable(flexcam):
    """Derivatives are those of Newmark's steps: along a motion of the collocation they gave a multiplier of 1.3."""
    found = flexcam("stability", ROOT / "cases/direct-acting/bucket.toml", "--set", "run.revolutions=1", "--json").json
    assert found["verdict"] == []
    assert abs(complex(*found["multipliers"][0])) < 0.95


def test_a_step_too_long_for_the_integrator(flexcam):
    args = ("--set", "run.integrator={method='newmark',beta=0.1667}", *QUICK)
    found = flexcam("stability", PUBLISHED, "--set", "run.speed=1000rpm", *args, "--json").json
    assert found["spectral_radius"] > 1.0
    assert "numerical" in found["verdict"]


def test_contact_lost(flexcam):
    found = flexcam(
        "stability", ENGINE, "--set", "run.crank_speed=7000rpm", "--set", "run.revolutions=1", *QUICK, "--json"
    )
    assert "contact loss" in found.json["verdict"]
    assert "loss of contact" in flexcam("stability", PUBLISHED, *QUICK).out


def exponent(a, q):
    """Return the characteristic exponent of x'' + (a - 2 q cos 2t) x = 0 by an independent integration over pi."""
    ends = [
        solve_ivp(
            lambda t, y: [y[1], -(a - 2 * q * math.cos(2 * t)) * y[0]], (0, math.pi), start, rtol=1e-11, atol=1e-13
        ).y[:, -1]
        for start in ([1.0, 0.0], [0.0, 1.0])
    ]
    return math.log(max(abs(np.linalg.eigvals(np.array(ends).T)))) / math.pi


def test_mathieus_case(flexcam):
    """A case of a = 1 inside the first tongue for q = 0.1; without the swing it is stable."""
    found = flexcam("stability", MATHIEU, "--json").json
    assert found["verdict"] == ["parametric"]
    assert found["growth"] == pytest.approx(100.0 * exponent(1.0, 0.1), rel=1e-4)
    still = flexcam("stability", MATHIEU, "--set", "springs.mean.pulsation.amplitude=0", "--json").json
    assert still["verdict"] == []
    assert abs(still["growth"]) < 1e-6
    assert "parametric" in flexcam("stability", MATHIEU).out


@pytest.mark.parametrize("step", ["steps_per_revolution=1", "steps_per_revolution=8", "step=100 ms", "step=5 ms"])
def test_growth_does_not_depend_on_the_steps_of_the_run(flexcam, tmp_path, step):
    """Two swings of the stiffness per revolution: two to eight steps pass over them, and 5 ms do not fill 62.8 ms."""
    text = MATHIEU.read_text(encoding="utf-8").replace("steps_per_revolution = 720\n", "")
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    found = flexcam("stability", tmp_path / "case.toml", "--set", f"run.{step}", "--json").json
    assert found["verdict"] == ["parametric"]
    # By 360 steps of second order, (2 pi 2/360)^2/12 of the exponent and some.
    assert found["growth"] == pytest.approx(100.0 * exponent(1.0, 0.1), rel=1e-3)


@pytest.mark.parametrize(("steps", "followed"), [(100, 360), (1000, 1000), (40_000, 36_000)])
def test_disturbances_are_followed_by_a_bounded_number_of_steps(monkeypatch, steps, followed):
    """Each takes a linearization, so that a million would take minutes; and none is taken of what does not repeat."""
    asked: list[int] = []

    def found(one, method, *, tolerance):
        asked.append(one.steps)
        assert one.step * one.steps == pytest.approx(2.0 * math.pi / 100.0)
        return replace(State.rest(one.system.size), periodicity=0.5)

    monkeypatch.setattr(stability, "solve_periodic", found)
    monkeypatch.setattr(stability, "floquet", lambda *_: pytest.fail("disturbances of what does not repeat"))
    told = stability.assess_stability(read_case(MATHIEU, [f"run.steps_per_revolution={steps}", "run.revolutions=1"]))
    assert (asked, told.floquet, told.why_not) == (
        [followed],
        None,
        (
            "no periodic motion was found: the state after one revolution differs from that at its start by 50 % of "
            "the amplitude"
        ),
    )


@pytest.mark.parametrize("odd", [
    "springs.mean.pulsation.order=1.5", "run.fluctuation={ orders=[0.5], amplitudes=['1 %'] }",
])  # fmt: skip
def test_what_does_not_return_with_the_camshaft_has_no_multipliers(flexcam, odd):
    """A stiffness that swings 1.5 times per revolution repeats after two: those of one would be wrong."""
    found = flexcam("stability", MATHIEU, "--set", odd, "--json").json
    assert found["multipliers"] == []
    assert "does not repeat with the camshaft" in found["note"]
    assert "not assessed" in flexcam("stability", MATHIEU, "--set", odd).out
    done = flexcam("run", MATHIEU, "--set", odd, "--set", "run.start=periodic")
    assert (done.code, "The state repeats with the camshaft" in done.err) == (2, True)


@pytest.mark.slow
def test_map_over_speed(flexcam, tmp_path):
    """Growth within the tongue 1 - q - q^2/8 < (954.93/rpm)^2 < 1 + q - q^2/8 and none outside."""
    about = ("--lowest", "880rpm", "--highest", "1040rpm", "--count", "5", "--plot", str(tmp_path / "map.svg"))
    done = flexcam("stability", MATHIEU, "--set", "run.steps_per_revolution=180", *about, "--json")
    speeds = {round(one["rpm"]): one["verdict"] for one in done.json["speeds"]}
    assert speeds == {880: [], 920: ["parametric"], 960: ["parametric"], 1000: ["parametric"], 1040: []}
    assert (tmp_path / "map.svg").read_text(encoding="utf-8").count("parametric") >= 1
    table = flexcam("stability", MATHIEU, "--set", "run.steps_per_revolution=180", *about[:4], "--count", "2").out
    assert "growth" in table


def test_the_same_speeds_have_the_same_verdict():
    """Rounding decides whether a chattering motion is periodic; 4500 rpm is one speed, however it is given."""
    case = read_case(ENGINE, ["run.crank_speed=5000rpm"])
    speeds = spaced_speeds(None, None, 11, case)
    assert speeds == spaced_speeds("2500rpm", "7500rpm", 11, case)
    assert speeds[4] == read_case(ENGINE, ["run.crank_speed=4500rpm"]).speed


def test_growth_that_is_not_assessed_is_no_verdict(flexcam):
    table = flexcam(
        "stability", MATHIEU, "--set", "springs.mean.pulsation.order=1.5", "--count", "2", "--plot", "g.svg"
    )
    assert re.findall(r"not assessed +not assessed +not assessed$", table.out.replace(" \n", "\n"), re.MULTILINE)
    assert "rpm: the excitation does not repeat with the camshaft" in " ".join(table.out.split())


@pytest.mark.parametrize("wrong", [("--count", "1"), ("--lowest", "2000rpm", "--highest", "1000rpm")])
def test_wrong_ranges_are_refused(flexcam, wrong):
    done = flexcam("stability", MATHIEU, "--lowest", "900rpm", *wrong)
    assert done.code == 2


def test_critical_step_is_told(flexcam):
    """Linear acceleration: 2 sqrt 3 over the highest frequency; beyond it the verdict is numerical, not resonance."""
    about = ("--set", "run.integrator={ method = 'newmark', beta = 0.16666666666666666 }", *QUICK, "--json")
    found = flexcam("stability", PUBLISHED, *about).json
    assert "numerical" in found["verdict"]
    assert found["critical_step_s"] == pytest.approx(
        2 * math.sqrt(3) / (2 * math.pi * found["endangered_mode_hz"]), rel=1e-4
    )
    explicit = flexcam(
        "stability", PUBLISHED, "--set", "run.integrator.method=central-difference", *QUICK, "--json"
    ).json
    assert explicit["critical_step_s"] == pytest.approx(found["critical_step_s"] / math.sqrt(3), rel=1e-6)


def test_the_critical_step_is_that_of_what_is_integrated(flexcam, tmp_path):
    """Struck across, a cantilever neither stretches nor twists: those faster motions bound no step of a run."""
    about = ("--set", "members.beam.mass=lumped", "--set", "run.integrator.method=central-difference",
             "--set", "run.speed=12000rpm", "--set", "run.start={velocity={'tip.ux'='0.1 m/s'}}")  # fmt: skip
    found = flexcam("stability", CANTILEVER, *about, "--set", "run.step=10 us", "--json").json
    critical = found["critical_step_s"]
    codes = [
        flexcam("run", CANTILEVER, *about, "--set", f"run.step={part * critical} s", "-o", tmp_path, "--overwrite").code
        for part in (0.9999, 1.0001)
    ]
    assert codes == [0, 2]
    assert "numerical" not in found["verdict"]


def test_harmonics_in_the_load(flexcam):
    """The published load is K_KE times the lift: each harmonic is that stiffness times the one of the lift."""
    found = flexcam("stability", PUBLISHED, "--set", "run.steps_per_revolution=720", "--json").json["resonances"]
    ratios = [one["load_n"] / one["amplitude_m"] for one in found if one["harmonic"] == 1]
    assert ratios
    assert ratios[0] == pytest.approx(1.02e5, rel=0.02)  # pushrod in series with 40 kN/m at (40/25)^2


TWO = """
format = 1
[nodes]
shaft = [0.0, 0.0, 0.0]
heavy = [0.0, 0.05, 0.0]
light = [0.0, 0.0, 0.05]
[masses]
heavy = { at = "heavy", mass = 10.0 }
light = { at = "light", mass = 0.001 }
[springs]
heavy = { at = "heavy", direction = "uy", stiffness = 4e5, installed_force = 9e4 }
light = { at = "light", direction = "uz", stiffness = 80.0, installed_force = 2.0 }
[cams]
heavy = { at = "shaft", axis = [1, 0, 0], law = "4-5-6-7", lift = "10 mm", rise = "90 deg", return = "90 deg" }
light = { at = "shaft", axis = [1, 0, 0], law = "4-5-6-7", lift = "10 mm", rise = "90 deg", return = "90 deg" }
[contacts]
heavy = { cam = "heavy", follower = "heavy", direction = "uy", model = "bilateral", stiffness = 1e9 }
light = { cam = "light", follower = "light", direction = "uz", model = "bilateral", stiffness = 900.0 }
[run]
speed = "SPEED rad/s"
revolutions = 2
steps_per_revolution = 720
start = "equilibrium"
damping = { alpha = 20.0 }
"""


def test_a_light_train_beside_a_heavy_one_is_heard(flexcam, tmp_path):
    """The second harmonic meets its own 990 rad/s with a thousandth of the force that the same lift asks beside it."""
    path = tmp_path / "two.toml"
    own = math.sqrt(980.0 / 0.001)
    path.write_text(TWO.replace("SPEED", repr(own / 2.0)), encoding="utf-8")
    found = flexcam("stability", path, "--json").json
    met = found["resonances"][0]
    assert (met["contact"], met["harmonic"]) == ("light", 2)
    assert met["load_n"] < 2e-3 * 10.0 * met["amplitude_m"] * own**2
    assert "resonance" in found["verdict"]
    assert "harmonic 2, light" in flexcam("stability", path).out


@pytest.mark.parametrize("steps", [24, 30, 48])
def test_harmonics_of_few_steps_are_those_that_these_have(flexcam, steps):
    """Twenty-four harmonics take fifty steps; fewer neither end the command nor tell that the first has no force."""
    found = flexcam("stability", PUBLISHED, "--set", f"run.steps_per_revolution={steps}", "--json").json["resonances"]
    assert found[0]["harmonic"] == 1
    # A load of one bump on 24 points: the trapezoidal rule misses what its harmonics above the 23rd have, below 1 %.
    assert found[0]["load_n"] == pytest.approx(306.0, rel=0.01)


@pytest.mark.slow
def test_a_thousand_orders_fit_into_memory(flexcam):
    """Those that the steps do not resolve have no number; the others keep theirs."""
    found = flexcam("campbell", PUBLISHED, "--orders", "1:1000", "--count", "2", *QUICK, "--json").json
    assert found["crossings"][0]["load"] == pytest.approx(306.0, rel=0.01)
    unknown = {int(order) for order, sizes in found["force_amplitudes_n"].items() if None in sizes}
    assert all(order > 179 for order in unknown)
