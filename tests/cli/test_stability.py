"""The command stability: each cause of instability in a separate test, on the published model and the engine."""

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


@pytest.mark.parametrize(("rpm", "verdict"), [(1000, []), (4000, ["resonance"])])
def test_published_instability_is_resonance_of_first_harmonic(flexcam, rpm, verdict):
    """The paper calls 4000 rpm unstable: the first harmonic excites the loaded mode at 67.11 Hz = 4027 rpm."""
    report = flexcam("stability", PUBLISHED, "--set", f"run.speed={rpm}rpm", *QUICK, "--json").json
    assert report["verdict"] == verdict
    resonances = [(resonance["rpm"], resonance["harmonic"]) for resonance in report["resonances"]]
    assert resonances == ([(pytest.approx(4026.9, abs=0.1), 1)] if rpm == 4000 else [])
    assert report["resonances_within"] == len(resonances)
    resonance_rpm = resonances[0][0] if resonances else report["next_resonance_rpm"]
    assert resonance_rpm == pytest.approx(4026.9, abs=0.1)
    assert abs(complex(*report["multipliers"][0])) == pytest.approx(1.0, abs=1e-6)  # undamped


def test_resonances_far_above_speed_are_only_counted(flexcam):
    """Modes near 10 kHz meet the first harmonic at hundreds of thousands of rpm, far above the speed of any train."""
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
def test_shaft_in_backlash_has_no_resonance_check(flexcam):
    """At the nose of the cam the shaft is unstable between the flanks: only the resonances are missing."""
    flexcam("new", "gear-drive")
    done = flexcam("stability", "gear-drive.toml", "--set", "run.revolutions=1", *QUICK, "--json")
    assert done.code == 0
    assert "no stable equilibrium at full lift" in done.json["note"]
    assert done.json["spectral_radius"] < 1.0


@pytest.mark.slow
def test_spring_surge_resonance_has_low_force(flexcam):
    """The first spring mode with fixed ends, (1/2) sqrt(k/m) = 456 Hz; 5200 rpm is between two harmonics."""
    run = ("--set", "run.revolutions=1", *QUICK)
    at_resonance, between = (
        flexcam("stability", ENGINE, "--set", f"run.crank_speed={rpm}rpm", *run, "--json").json for rpm in (4960, 5200)
    )
    nearest = at_resonance["resonances"][0]
    assert "spring valve" in nearest["moves"]
    assert nearest["harmonic"] == 11
    assert nearest["rpm"] == pytest.approx(
        2.0 * 60.0 * 0.5 * math.sqrt(50e3 / 0.06) / 11.0, rel=0.01
    )  # of the crankshaft
    assert nearest["load_share"] < 0.05, "its 38 N are no danger beside a force of 3 kN"
    assert "resonance" not in at_resonance["verdict"] + between["verdict"]


@pytest.mark.slow
def test_engine_with_impacts_has_verdict_chatter(flexcam):
    """Contacts chatter after the ramps at 2000 rpm; too coarse steps find no periodic motion."""
    output = flexcam("stability", ENGINE, "--set", "run.crank_speed=2000rpm").out
    assert re.search(r"verdict +chatter", output)
    assert re.search(r"has \d+ impacts, which amplify small disturbances \S+ times", " ".join(output.split()))


def test_train_with_decaying_disturbances_is_stable(flexcam):
    """Derivatives of Newmark steps are used; with a motion computed by collocation the multiplier was 1.3."""
    found = flexcam("stability", ROOT / "cases/direct-acting/bucket.toml", "--set", "run.revolutions=1", "--json").json
    assert found["verdict"] == []
    assert abs(complex(*found["multipliers"][0])) < 0.95


def test_step_above_stability_limit_is_numerical_instability(flexcam):
    args = ("--set", "run.integrator={method='newmark',beta=0.1667}", *QUICK)
    found = flexcam("stability", PUBLISHED, "--set", "run.speed=1000rpm", *args, "--json").json
    assert found["spectral_radius"] > 1.0
    assert "numerical" in found["verdict"]


@pytest.mark.slow
def test_contact_loss_is_in_verdict(flexcam):
    found = flexcam(
        "stability", ENGINE, "--set", "run.crank_speed=7000rpm", "--set", "run.revolutions=1", *QUICK, "--json"
    )
    assert "contact loss" in found.json["verdict"]
    assert "loss of contact" in flexcam("stability", PUBLISHED, *QUICK).out


def mathieu_exponent(a, q):
    """Return the characteristic exponent of x'' + (a - 2 q cos 2t) x = 0 by a separate integration over pi."""
    ends = [
        solve_ivp(
            lambda t, y: [y[1], -(a - 2 * q * math.cos(2 * t)) * y[0]], (0, math.pi), start, rtol=1e-11, atol=1e-13
        ).y[:, -1]
        for start in ([1.0, 0.0], [0.0, 1.0])
    ]
    return math.log(max(abs(np.linalg.eigvals(np.array(ends).T)))) / math.pi


@pytest.mark.slow
def test_mathieu_case_has_parametric_instability(flexcam):
    """The case with a = 1 is in the first instability region for q = 0.1; without the pulsation the case is stable."""
    report = flexcam("stability", MATHIEU, "--json").json
    assert report["verdict"] == ["parametric"]
    assert report["growth"] == pytest.approx(100.0 * mathieu_exponent(1.0, 0.1), rel=1e-4)
    constant = flexcam("stability", MATHIEU, "--set", "springs.mean.pulsation.amplitude=0", "--json").json
    assert constant["verdict"] == []
    assert abs(constant["growth"]) < 1e-6


@pytest.mark.parametrize("step", ["steps_per_revolution=1", "step=5 ms"])
def test_growth_is_independent_of_time_step_of_run(flexcam, tmp_path, step):
    """Two stiffness periods per revolution: 2 to 8 steps do not resolve them, and 5 ms does not divide 62.8 ms."""
    text = MATHIEU.read_text(encoding="utf-8").replace("steps_per_revolution = 720\n", "")
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    found = flexcam("stability", tmp_path / "case.toml", "--set", f"run.{step}", "--json").json
    assert found["verdict"] == ["parametric"]
    # 360 steps of second order: error (2 pi 2/360)^2/12 of the exponent, with a margin.
    assert found["growth"] == pytest.approx(100.0 * mathieu_exponent(1.0, 0.1), rel=1e-3)


@pytest.mark.parametrize(
    ("steps", "followed"), [(100, 360), (1000, 1000), pytest.param(40_000, 36_000, marks=pytest.mark.slow)]
)
def test_number_of_floquet_steps_is_bounded(monkeypatch, steps, followed):
    """Each step needs a linearization: a million would take minutes. A motion that is not periodic needs none."""
    step_counts: list[int] = []

    def solve_nonperiodic(one, method, *, tolerance):
        step_counts.append(one.steps)
        assert one.step * one.steps == pytest.approx(2.0 * math.pi / 100.0)
        return replace(State.rest(one.system.size), periodicity=0.5)

    monkeypatch.setattr(stability, "solve_periodic", solve_nonperiodic)
    monkeypatch.setattr(stability, "floquet", lambda *_: pytest.fail("disturbances of what does not repeat"))
    assessment = stability.assess_stability(
        read_case(MATHIEU, [f"run.steps_per_revolution={steps}", "run.revolutions=1"])
    )
    assert (step_counts, assessment.floquet, assessment.why_not) == (
        [followed],
        None,
        (
            "no periodic motion was found: the state after one revolution differs from that at its start by 50 % of "
            "the amplitude"
        ),
    )


@pytest.mark.parametrize("odd", [
    "springs.mean.pulsation.order=1.5",
    pytest.param("run.fluctuation={ orders=[0.5], amplitudes=['1 %'] }", marks=pytest.mark.slow),
])  # fmt: skip
def test_excitation_of_other_period_has_no_multipliers(flexcam, odd):
    """A stiffness with 1.5 periods per revolution repeats after two: multipliers of one revolution would be wrong."""
    found = flexcam("stability", MATHIEU, "--set", odd, "--json").json
    assert found["multipliers"] == []
    assert "does not repeat with the camshaft" in found["note"]
    assert "not assessed" in flexcam("stability", MATHIEU, "--set", odd).out
    done = flexcam("run", MATHIEU, "--set", odd, "--set", "run.start=periodic")
    assert (done.code, "The state repeats with the camshaft" in done.err) == (2, True)


@pytest.mark.slow
def test_stability_map_over_speed(flexcam, tmp_path):
    """Growth for 1 - q - q^2/8 < (954.93/rpm)^2 < 1 + q - q^2/8 and none outside."""
    options = ("--lowest", "880rpm", "--highest", "1040rpm", "--count", "5", "--plot", str(tmp_path / "map.svg"))
    done = flexcam("stability", MATHIEU, "--set", "run.steps_per_revolution=180", *options, "--json")
    speeds = {round(entry["rpm"]): entry["verdict"] for entry in done.json["speeds"]}
    assert speeds == {880: [], 920: ["parametric"], 960: ["parametric"], 1000: ["parametric"], 1040: []}
    assert (tmp_path / "map.svg").read_text(encoding="utf-8").count("parametric") >= 1
    table = flexcam("stability", MATHIEU, "--set", "run.steps_per_revolution=180", *options[:4], "--count", "2").out
    assert "growth" in table


def test_equal_speeds_are_bitwise_identical():
    """Rounding decides whether a chattering motion is periodic: 4500 rpm must be one number for every option."""
    case = read_case(ENGINE, ["run.crank_speed=5000rpm"])
    speeds = spaced_speeds(None, None, 11, case)
    assert speeds == spaced_speeds("2500rpm", "7500rpm", 11, case)
    assert speeds[4] == read_case(ENGINE, ["run.crank_speed=4500rpm"]).speed


def test_map_marks_growth_not_assessed(flexcam):
    table = flexcam(
        "stability", MATHIEU, "--set", "springs.mean.pulsation.order=1.5", "--count", "2", "--plot", "g.svg"
    )
    assert re.findall(r"not assessed +not assessed +not assessed$", table.out.replace(" \n", "\n"), re.MULTILINE)
    assert "rpm: the excitation does not repeat with the camshaft" in " ".join(table.out.split())


@pytest.mark.parametrize("words", [("--count", "1"), ("--lowest", "2000rpm", "--highest", "1000rpm")])
def test_invalid_speed_ranges_are_refused(flexcam, words):
    assert flexcam("stability", MATHIEU, "--lowest", "900rpm", *words).code == 2


@pytest.mark.slow
def test_critical_step_of_explicit_methods(flexcam):
    """Linear acceleration: 2 sqrt 3 over the highest frequency; above it the verdict is numerical, not resonance."""
    options = ("--set", "run.integrator={ method = 'newmark', beta = 0.16666666666666666 }", *QUICK, "--json")
    report = flexcam("stability", PUBLISHED, *options).json
    assert "numerical" in report["verdict"]
    assert report["critical_step_s"] == pytest.approx(
        2 * math.sqrt(3) / (2 * math.pi * report["endangered_mode_hz"]), rel=1e-4
    )
    explicit = flexcam(
        "stability", PUBLISHED, "--set", "run.integrator.method=central-difference", *QUICK, "--json"
    ).json
    assert explicit["critical_step_s"] == pytest.approx(report["critical_step_s"] / math.sqrt(3), rel=1e-6)


def test_critical_step_ignores_inactive_dofs(flexcam, tmp_path):
    """A cantilever after a lateral impact has no axial and torsional motion, whose modes limit no step of its run."""
    options = ("--set", "members.beam.mass=lumped", "--set", "run.integrator.method=central-difference",
             "--set", "run.speed=12000rpm", "--set", "run.start={velocity={'tip.ux'='0.1 m/s'}}")  # fmt: skip
    report = flexcam("stability", CANTILEVER, *options, "--set", "run.step=10 us", "--json").json
    critical = report["critical_step_s"]
    codes = [
        flexcam(
            "run", CANTILEVER, *options, "--set", f"run.step={part * critical} s", "-o", tmp_path, "--overwrite"
        ).code
        for part in (0.9999, 1.0001)
    ]
    assert codes == [0, 2]
    assert "numerical" not in report["verdict"]


def test_load_harmonics_are_stiffness_times_lift_harmonics(flexcam):
    """The published load is K_KE times the lift: each load harmonic is the stiffness times the lift harmonic."""
    resonances = flexcam("stability", PUBLISHED, "--set", "run.steps_per_revolution=720", "--json").json["resonances"]
    ratios = [resonance["load_n"] / resonance["amplitude_m"] for resonance in resonances if resonance["harmonic"] == 1]
    assert ratios
    assert ratios[0] == pytest.approx(1.02e5, rel=0.02)  # pushrod in series with 40 kN/m at (40/25)^2


TWO_TRAINS = """
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


def test_resonance_of_light_train_next_to_heavy_train(flexcam, tmp_path):
    """The second harmonic meets the 990 rad/s of the light train, with a thousandth of the force of the heavy one."""
    path = tmp_path / "two.toml"
    natural_frequency = math.sqrt(980.0 / 0.001)
    path.write_text(TWO_TRAINS.replace("SPEED", repr(natural_frequency / 2.0)), encoding="utf-8")
    report = flexcam("stability", path, "--json").json
    resonance = report["resonances"][0]
    assert (resonance["contact"], resonance["harmonic"]) == ("light", 2)
    assert resonance["load_n"] < 2e-3 * 10.0 * resonance["amplitude_m"] * natural_frequency**2
    assert "resonance" in report["verdict"]
    assert "harmonic 2, light" in flexcam("stability", path).out


@pytest.mark.parametrize("steps", [24, 48])
def test_few_steps_limit_number_of_harmonics(flexcam, steps):
    """24 harmonics need 50 steps; fewer steps neither end the command nor remove the force of the first harmonic."""
    found = flexcam("stability", PUBLISHED, "--set", f"run.steps_per_revolution={steps}", "--json").json["resonances"]
    assert found[0]["harmonic"] == 1
    # A smooth load pulse on 24 points: the trapezoidal rule aliases the harmonics above the 23rd, below 1 %.
    assert found[0]["load_n"] == pytest.approx(306.0, rel=0.01)


@pytest.mark.slow
def test_thousand_orders_fit_into_memory(flexcam):
    """Orders that the steps do not resolve have no amplitude; the other amplitudes are unchanged."""
    report = flexcam("campbell", PUBLISHED, "--orders", "1:1000", "--count", "2", *QUICK, "--json").json
    assert report["crossings"][0]["load"] == pytest.approx(306.0, rel=0.01)
    unresolved = {int(order) for order, sizes in report["force_amplitudes_n"].items() if None in sizes}
    assert all(order > 179 for order in unresolved)
