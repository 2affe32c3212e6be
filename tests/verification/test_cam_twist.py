"""Twist of a cam behind an elastic drive: the lift depends on the angle of the shaft, s(theta + phi).

A cam with inertia on a rotational spring lifts a mass on a spring. The reference integrates ``J phi'' = -c phi' - k phi
- f s'(theta + phi)`` and ``m y'' = f - k_s y - F`` by scipy, with f of Hunt and Crossley at the penetration ``s(theta +
phi) - y``. A lift that is linear in the twist, ``s + s' phi``, serves for comparison.
"""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from flexcam import build_model, prepare, solve
from flexcam.cams import LAWS, LiftEvent
from flexcam.dynamics import SaveAt, State, Variation, equilibrium, floquet, newmark, tangent_run
from flexcam.dynamics.law_data import ForceLaw
from flexcam.valvetrain.cam_functions import lift_polynomials
from tests.verification.test_drive_lash import solve_case

SOURCE = "Twist of a cam"
OMEGA, J, CHAIN, DAMPING = 20.0 * math.pi, 1e-3, 120.0, 0.06
MASS, SPRING, PRELOAD, STIFF, CHI = 0.1, 40e3, 300.0, 5e6, 0.5
CASE = """
format = 1
[nodes]
shaft = [0, 0, 0]
mass = [0, "40 mm", 0]
[supports]
shaft = ["ux", "uy", "uz", "rx", "ry"]
mass = ["ux", "uz"]
[masses]
shaft = { at = "shaft", mass = "2 kg", inertia = [1e-3, 1e-3, 1e-3] }
mass = { at = "mass", mass = "0.1 kg" }
[springs]
one = { at = "mass", direction = "uy", stiffness = "40 kN/m", installed_force = "300 N" }
chain = { at = "shaft", direction = "rz", stiffness = 120, damping = 0.06 }
[cams]
c = { at = "shaft", axis = [0, 0, 1], law = "4-5-6-7", lift = "6 mm", rise = "70 deg", return = "70 deg" }
[contacts]
k = { cam = "c", follower = "mass", direction = "uy", model = "unilateral", stiffness = "5 MN/m", dissipation = 0.5 }
[run]
speed = "600 rpm"
revolutions = 0.45
steps_per_revolution = 7200
start = "equilibrium"
engine = "kernel"
integrator = { method = "newmark" }
[output]
probes = ["mass", "shaft"]
"""
JUMPS = ("run.speed=3000rpm", "springs.one.stiffness=15 kN/m", "springs.one.installed_force=100 N",
         "springs.chain.stiffness=400", "run.steps_per_revolution=1440")  # fmt: skip
"""Overrides with which the follower loses contact with the cam."""


@pytest.fixture
def case(case_of):
    return partial(case_of, CASE)


@pytest.mark.parametrize("name", LAWS)
def test_lift_polynomials_match_laws(name):
    """Lift and slope of every law agree at any angle, also where the acceleration jumps."""
    event = LiftEvent(LAWS[name], lift=0.008, rise=1.13, fall=1.26, dwell=0.09, phase=0.3)
    angle = np.random.default_rng(1).uniform(-7.0, 13.0, 4000)
    for order, tolerance in ((0, 1e-11), (1, 1e-8)):
        np.testing.assert_allclose(lift_polynomials(event)(angle, order), event(angle, order), rtol=0, atol=tolerance)
    still = np.array([0.0, 0.2, 0.3 + 1.14, 6.2])
    assert not lift_polynomials(event)(still, 2).any()


def integrate(event, found, *, linear):
    """Return twist, force and torque over the times of a response, from its initial state."""

    def contact(t, phi, y, turning, v):
        at = OMEGA * t if linear else OMEGA * t + phi
        s, slope = event(at), event(at, 1)
        depth, rate = s - y, slope * (OMEGA + turning) - v
        if linear:
            depth, rate = depth + slope * phi, rate + event(at, 2) * OMEGA * phi
        force = STIFF * np.maximum(depth, 0.0) * np.maximum(1.0 + CHI * rate, 0.0)
        return force, force * slope

    def rates(t, state):
        phi, y, turning, v = state
        force, torque = contact(t, *state)
        return [turning, v, (-CHAIN * phi - DAMPING * turning - torque) / J, (force - SPRING * y - PRELOAD) / MASS]

    start = [getattr(found[node], order)[0, i] for order in ("displacement", "velocity")
             for node, i in (("shaft", 5), ("mass", 1))]  # fmt: skip
    exact = solve_ivp(rates, (0.0, found.time[-1]), start, t_eval=found.time, method="DOP853", rtol=1e-8, atol=1e-12).y
    return exact[0], *contact(found.time, *exact)


@pytest.mark.parametrize("law", ["4-5-6-7", pytest.param("parabolic", marks=pytest.mark.slow)])
def test_response_matches_equations_of_motion(record, case, law):
    made = case(f"cams.c.law={law}")
    found, event = solve_case(made), build_model(made).cams["c"].event
    reference, linear = integrate(event, found, linear=False), integrate(event, found, linear=True)
    twist = found["shaft"].displacement[:, 5]
    assert np.abs(twist).max() > math.radians(2.5)
    histories = (twist, found.channels["contacts.k.force"], found.channels["contacts.k.torque"])
    names = ("twist", "force", "torque")
    for name, one, exact, other in zip(names, histories, reference, linear, strict=True):
        missed = np.abs(one - exact).max() / np.abs(exact).max()
        record(source=SOURCE, case=f"cam on a soft chain, {law}", quantity=f"largest error of the {name}", unit="1",
               reference=0.0, computed=missed, tolerance=1e-4 if law == "parabolic" else 2e-5, absolute=True,
               reason="steps of 1/20 deg")  # fmt: skip
        assert np.abs(other - exact).max() > 100.0 * missed * np.abs(exact).max()
    np.testing.assert_allclose(
        found.channels["contacts.k.gap"],
        found["mass"].displacement[:, 1] - event(OMEGA * found.time + twist),
        atol=1e-15,
    )


@pytest.mark.parametrize("phase", [-20.0, -50.0, -90.0, -120.0])
def test_static_twist(record, case, phase):
    """The torque of the chain equals that of the contact force at the angle of the shaft."""
    made = case(f"cams.c.phase={phase}deg", 'run.start="equilibrium"', "run.revolutions=0.001")
    found, event = solve_case(made), build_model(made).cams["c"].event

    def force(phi):
        s = float(event(np.array([phi]))[0])
        return (SPRING * s + PRELOAD) / (1.0 + SPRING / STIFF)

    def excess(phi):
        return CHAIN * phi + force(phi) * float(event(np.array([phi]), 1)[0])

    twist = found["shaft"].displacement[0, 5]
    record(source=SOURCE, case=f"at rest, {-phase:g} deg after the beginning of the rise", quantity="twist", unit="rad",
           reference=brentq(excess, -0.2, 0.2, xtol=1e-15), computed=twist, tolerance=1e-8,
           reason="tolerance of the equilibrium")  # fmt: skip
    arm = float(event(np.array([twist]), 1)[0])
    assert found.channels["contacts.k.torque"][0] == pytest.approx(
        found.channels["contacts.k.force"][0] * arm, rel=1e-8
    )


@pytest.mark.parametrize("phase", [-20.0, -60.0, -80.0])
def test_shaft_with_lash_rests_on_flank(case, phase):
    """Near the nose the torque of the follower grows with the twist, so the cam tips to one side."""
    lash = "model = 'lash', direction = 'rz', gap = '1 deg', stiffness = '20 kN m/rad'"
    found = solve_case(case(
        f"cams.c.phase={phase}deg", "run.revolutions=0.001", "nodes.gear=[0, 0, 0.01]", "supports.gear=['rz']",
        "springs.chain.stiffness=0", f"contacts.driving={{ from = 'gear', to = 'shaft', {lash} }}",
        f"contacts.coasting={{ from = 'shaft', to = 'gear', {lash} }}",
    ))  # fmt: skip
    assert np.degrees(found["shaft"].displacement[0, 5]) == pytest.approx(math.copysign(1.0, -70.0 - phase), rel=0.02)


def test_energy_balance_over_revolution(record, case):
    """In periodic motion the work of the cam equals the dissipation, with both integrators."""
    for method in ("newmark", "collocation"):
        found = solve_case(case('run.start="periodic"', "run.revolutions=1", f"run.integrator.method={method}"))
        work, lost = found.channels["energy.work"], found.channels["energy.dissipated"][-1]
        turned = np.trapezoid(found.channels["contacts.k.torque"], found.time) * OMEGA
        record(source=SOURCE, case=f"periodic motion, {method}", quantity="work over dissipation", unit="1",
               reference=1.0, computed=work[-1] / lost, tolerance=1e-4, reason="steps of 1/20 deg")  # fmt: skip
        assert turned == pytest.approx(lost, rel=2e-4)
        assert np.abs(found.channels["energy.residual"]).max() < 1e-8 * np.abs(work).max()
        assert np.abs(found.channels["energy.numerical"]).max() < 1e-4 * np.abs(work).max()


def test_engines_agree(case):
    one, other = (solve_case(case(*JUMPS, f"run.engine={name}"))
                  for name in ("direct", "kernel"))  # fmt: skip
    assert one.channels["contacts.k.gap"].max() > 1e-4
    for node in ("shaft", "mass"):
        np.testing.assert_allclose(other[node].displacement, one[node].displacement, atol=1e-9)


@pytest.mark.parametrize("restitution", [False, True])
def test_twist_dependent_lift_needs_free_shaft(case, restitution):
    def lifts(*overrides):
        forces = prepare(case(*overrides)).problem.system.local_forces
        return [isinstance(one.law, ForceLaw) and one.law.lift is not None for one in forces]

    if restitution:
        assert not any(lifts("contacts.k.restitution=0.5"))
    else:
        assert any(lifts())
        assert not any(lifts("supports.shaft=['ux', 'uy', 'uz', 'rx', 'ry', 'rz']"))
        assert not any(lifts("fidelity.model=rigid"))


@pytest.mark.parametrize("key", ["cams.c.lift", "springs.chain.stiffness", "run.speed"])
def test_derivatives_match_finite_differences(record, case, key):
    """Twist, lift and speed change the times at which the follower loses contact."""
    value = {"cams.c.lift": 0.006, "springs.chain.stiffness": 400.0, "run.speed": 100.0 * math.pi}[key]

    def problem(change):
        return prepare(case(*JUMPS, 'run.start="rest"', f"{key}={value * (1.0 + change)!r}")).problem

    e = 1e-6
    found = tangent_run(problem(0.0), newmark(), [Variation(problem(width), width) for width in (-e, e)])
    assert found.response.channels["contacts.k.gap"].max() > 1e-4
    for node, i in (("shaft", 5), ("mass", 1)):
        slopes = [
            (high[node].displacement[-1, i] - low[node].displacement[-1, i]) / e for low, high in found.neighbours
        ]
        far = [solve(problem(10.0 * k * e), newmark())[node].displacement[-1, i] for k in (-2, -1, 1, 2)]
        record(source=SOURCE, case=f"follower that leaves its cam, by {key}", quantity=f"change of the {node}", unit="",
               reference=(far[0] - 8.0 * far[1] + 8.0 * far[2] - far[3]) / (120.0 * e),
               computed=0.5 * (slopes[1] - slopes[0]), tolerance=1e-4, reason="differences over 1e-5")  # fmt: skip


@pytest.mark.slow
def test_floquet_multipliers_match_finite_differences(record, case):
    """The reference is the derivative of the map over a part of a revolution with contact loss."""
    problem = prepare(case(*JUMPS, 'run.start="rest"', "run.steps_per_revolution=720")).problem
    problem = replace(problem, start=equilibrium(problem.system, problem.drive), engine="direct")
    found, n = floquet(problem), problem.system.size
    state = np.concatenate([problem.start.displacement, problem.start.velocity])

    def after(x):
        start = State(x[:n], x[n:], problem.start.time)
        done = solve(replace(problem, start=start), newmark(), save=SaveAt(field_every=problem.steps))
        return np.concatenate([done.fields.displacement[-1], done.fields.velocity[-1]])

    units = np.diag([1e-8] * n + [1e-6] * n)
    slopes = np.array([(after(state + unit) - after(state - unit)) / (2.0 * unit.max()) for unit in units]).T
    assert found.events > 0
    exact = np.abs(np.linalg.eigvals(slopes))
    record(source=SOURCE, case="follower that leaves its cam", quantity="largest multiplier", unit="1",
           reference=exact.max(), computed=np.abs(found.multipliers).max(), tolerance=1e-4,
           reason="differences of the map")  # fmt: skip
