"""Figures of merit of a run against closed forms: one mass on a spring under a harmonic cam, and energy balances."""

import math

import numpy as np
import pytest

from flexcam import prepare, read_case, solve
from flexcam.analysis.run import open_result_file
from flexcam.analysis.run_metrics import SPRING_MARGIN, compute_margins, compute_metrics, figures_of_merit
from flexcam.analysis.stability import lift_harmonics
from flexcam.case.builder import build_model
from flexcam.case.starters import new_case
from flexcam.core.units import RPM

MASS, SPRING, INSTALLED, DAMPING, LIFT, CONTACT = 0.25, 20e3, 300.0, 6.0, 8e-3, 2e9
CASE = f"""
format = 1
[nodes]
cam = [0.0, 0.0, 0.0]
valve = [0.0, 0.03, 0.0]
[supports]
cam = ["ux", "uy", "uz", "rx", "ry", "rz"]
valve = ["ux", "uz", "rx", "ry", "rz"]
[masses]
valve = {{ at = "valve", mass = {MASS} }}
[springs]
coil = {{ at = "valve", direction = "uy", stiffness = {SPRING}, installed_force = {INSTALLED}, damping = {DAMPING}, clash_travel = 0.01 }}
[cams.one]
at = "cam"
axis = [1, 0, 0]
law = "shm"
lift = {LIFT}
rise = "180 deg"
return = "180 deg"
[contacts]
one = {{ cam = "one", follower = "valve", direction = "uy", model = "unilateral", stiffness = {CONTACT} }}
seat = {{ at = "valve", direction = "uy", model = "seat", stiffness = "2 GN/m" }}
[run]
speed = "600 rpm"
revolutions = 2
steps_per_revolution = 3600
start = "equilibrium"
"""  # noqa: E501 - a table to a line


@pytest.fixture
def merit(tmp_path):
    """Return a function for the figures of merit of the case at a speed, by metric, or name for the spring margin."""

    def compute_merit(rpm, *overrides, text=CASE):
        (tmp_path / "one.toml").write_text(text, encoding="utf-8")
        case = read_case(tmp_path / "one.toml", [f"run.speed={rpm}rpm", *overrides])
        ready = prepare(case)
        response = solve(ready.problem, ready.scheme, save=ready.save)
        assert response.status.ok
        return {one.metric or one.name: one.value for one in figures_of_merit(case, compute_metrics(ready, response))}

    return compute_merit


@pytest.mark.parametrize("rpm", [300.0, 3000.0])
def test_rigid_train_matches_closed_form(merit, rpm):
    """Lift h/2 (1 - cos t): F = F0 + k s + c s' w + m s'' w^2, torque s' F, work of the damper c w (h/2)^2 pi."""
    found, speed = merit(rpm, 'fidelity.model="rigid"'), rpm * RPM
    nose = np.linspace(0.5 * math.pi, 1.5 * math.pi, 18_001)
    lift, slope, bend = 0.5 * LIFT * np.array([1.0 - np.cos(nose), np.sin(nose), np.cos(nose)])
    force = INSTALLED + SPRING * lift + DAMPING * slope * speed + MASS * bend * speed**2
    assert found["contacts.one.nose_force.least"] == pytest.approx(force.min(), rel=5e-4)  # the nearest instant
    mean = DAMPING * speed * LIFT**2 / 8.0
    assert found["contacts.one.torque.mean"] == pytest.approx(mean, rel=1e-9)
    assert found["contacts.one.power.mean"] == pytest.approx(mean * speed, rel=1e-9)
    margin = (INSTALLED + SPRING * LIFT) / (0.5 * MASS * LIFT * speed**2) - 1.0
    assert found[SPRING_MARGIN] == pytest.approx(margin, rel=1e-6)


def test_spring_margin_between_coarse_angles(merit):
    """Angles near the minimum margin are 0.05 deg apart: 0.025 deg from it the force differs by 1e-7."""
    found = merit(3000.0, 'fidelity.model="rigid"', 'cams.one.phase="1.23 deg"')
    margin = (INSTALLED + SPRING * LIFT) / (0.5 * MASS * LIFT * (3000.0 * RPM) ** 2) - 1.0
    assert found[SPRING_MARGIN] == pytest.approx(margin, rel=1e-6)


def test_cam_angle_of_extreme(tmp_path):
    """At low speed the rigid contact force is maximum at full lift, half a revolution after the base circle."""
    (tmp_path / "one.toml").write_text(CASE, encoding="utf-8")
    ready = prepare(read_case(tmp_path / "one.toml", ["run.speed=60rpm", 'fidelity.model="rigid"']))
    found = {one.name: one for one in compute_metrics(ready, solve(ready.problem, ready.scheme, save=ready.save))}
    assert found["contacts.one.force.largest"].angle == pytest.approx(math.pi, abs=0.01)
    assert found["contacts.one.torque.mean"].angle is None


def test_stiff_train_has_no_valve_loft(merit):
    """The valve is below the rigid lift by the compression of the contact, which is minimum where its force is."""
    found = merit(60.0)
    pressed = found["contacts.one.nose_force.least"] / CONTACT
    assert found["contacts.seat.valve_loft"] == pytest.approx(-pressed, rel=2e-2)
    assert abs(found["contacts.seat.valve_loft"]) < 1e-4 * LIFT
    assert found["springs.coil.clearance.least"] == pytest.approx(0.01 - LIFT, abs=1e-6)


def test_valve_loft_above_limit_speed(merit):
    """Where the inertia exceeds the spring force, the valve leaves the cam at the nose: m u'' = -(F0 + k u)."""
    found = merit(9000.0, "run.revolutions=1")
    assert found[SPRING_MARGIN] < 0.0
    assert found["contacts.one.nose_force.least"] == 0.0
    assert found["contacts.seat.valve_loft"] > 0.1e-3


ENERGIES = ("work", "dissipated", "numerical")


def test_drive_power_equals_dissipation():
    """Over a periodic revolution the work of the drive equals that of the energy balance; friction is a part of it."""
    words = ['run.start="periodic"', "run.steps_per_revolution=1440"]
    case = read_case("tests/golden/models/friction.toml", words)
    ready = prepare(case)
    response = solve(ready.problem, ready.scheme, save=ready.save)
    found = {one.name: one.value for one in compute_metrics(ready, response)}
    gained = {name: float(np.diff(response.channels[f"energy.{name}"][[0, -1]])[0]) for name in ENERGIES}
    work = found["supports.drive.power.mean"] * ready.revolution
    assert work == pytest.approx(gained["work"], rel=1e-4)
    assert work == pytest.approx(gained["dissipated"] + gained["numerical"], rel=1e-4)
    assert 0.5 < found["contacts.intake.friction_power.mean"] * ready.revolution / work < 1.0
    assert found["supports.drive.torque.mean"] == pytest.approx(work / math.tau, rel=1e-9)


def test_rigid_cam_power_is_friction_and_damping():
    """Friction and the damper at the valve, c (1.6 s' w)^2, of a rigid train dissipate all work of the cam."""
    case = read_case("tests/golden/models/friction.toml", ['fidelity.model="rigid"', "run.damping.beta=0"])
    ready = prepare(case)
    response = solve(ready.problem, ready.scheme, save=ready.save)
    found = {one.name: one.value for one in compute_metrics(ready, response)}
    slope = ready.model.cams["intake"].event(response.angle, 1)
    damped = 5.0 * 1.6**2 * np.trapezoid(slope**2, response.angle) / math.tau * case.speed**2
    rubbed = found["contacts.intake.friction_power.mean"]
    assert found["contacts.intake.power.mean"] == pytest.approx(damped + rubbed, rel=1e-5)
    assert rubbed > damped > 0.0


def test_spring_margin_matches_compute_margins(merit, tmp_path):
    found = merit(2000.0)
    case = read_case(tmp_path / "one.toml", ["run.speed=2000rpm"])
    assert found[SPRING_MARGIN] == compute_margins(case).spring_margin


def test_friction_does_not_change_spring_margin(merit):
    """The margin is the excess of the spring force over the inertia, at any speed."""
    guide = 'friction.guide={ at = "valve", direction = "uy", force = 20, breakaway_force = 60, damping = 30 }'
    assert merit(2000.0, guide)[SPRING_MARGIN] == pytest.approx(merit(2000.0)[SPRING_MARGIN], rel=1e-9)


@pytest.mark.parametrize("travel", ["0.01", "0.005"])
def test_coil_bind_does_not_change_spring_margin(merit, travel):
    """A spring that becomes solid below the lift of 8 mm does not increase the margin."""
    margin = (INSTALLED + SPRING * LIFT) / (0.5 * MASS * LIFT * (2000.0 * RPM) ** 2) - 1.0
    solid = CASE.replace("clash_travel = 0.01", f"clash_travel = {travel}")
    assert merit(2000.0, text=solid)[SPRING_MARGIN] == pytest.approx(margin, rel=1e-6)


def test_no_spring_margin_with_load_over_time(merit, tmp_path):
    (tmp_path / "push.csv").write_text("time [s],force [N]\n0,0\n1,100\n")
    assert SPRING_MARGIN not in merit(2000.0, 'loads.push={ at = "valve", direction = "-uy", table = "push.csv" }')


def test_no_spring_margin_with_bilateral_contact(merit):
    found = merit(600.0, text=CASE.replace("unilateral", "bilateral"))
    assert SPRING_MARGIN not in found
    assert "contacts.one.nose_force.least" in found


def test_margins_do_not_depend_on_initial_state(tmp_path):
    """The margins of the rigid train do not depend on the initial state, here at the opposite cam angle."""
    (tmp_path / "one.toml").write_text(CASE, encoding="utf-8")
    overrides = ["run.steps_per_revolution=360", "run.revolutions=1.5"]
    ready = prepare(read_case(tmp_path / "one.toml", overrides))
    solve(ready.problem, ready.scheme, save=ready.save, sinks=[open_result_file(ready, tmp_path)])
    start = 'run.start={ result = "one.vtkhdf" }'
    own, other = (read_case(tmp_path / "one.toml", [*more, "run.speed=800rpm"]) for more in ((), (start,)))
    assert compute_margins(other).rigid_rpm == pytest.approx(compute_margins(own).rigid_rpm, rel=1e-9)


def test_margins_without_static_equilibrium(tmp_path):
    """There is no static equilibrium at full lift, but the margins of the rigid train exist."""
    case = read_case(new_case("gear-drive", tmp_path / "gear.toml")[0])
    found = compute_margins(case)
    assert found.rigid_rpm is not None
    assert (dict(found.buckling_margins), found.unknown[:29]) == ({}, "the stiffness is not positive")


def test_significant_harmonics_of_acceleration(tmp_path):
    """Order 24 has 2e-4 of the maximum lift and 5 % of the maximum acceleration; order 16 has 0.9 %."""
    model = build_model(read_case(new_case("pushrod-engine", tmp_path / "engine.toml")[0]))
    kept = lift_harmonics(model.cams["intake"].event, 24)
    assert 24 in kept
    assert 16 not in kept


def test_closing_lash_is_not_counted_as_bounce(tmp_path):
    """The lash closes with a jump of 4 um before the valve opens, and the valve closes without a bounce."""
    ready = prepare(read_case(new_case("pushrod-engine", tmp_path / "engine.toml")[0]))
    response = solve(ready.problem, ready.scheme, save=ready.save)
    found = {one.name: one.value for one in compute_metrics(ready, response)}
    assert found["contacts.seat.bounces"] == 0
