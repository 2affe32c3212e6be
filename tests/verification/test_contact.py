"""Contact and springs against closed forms.

- A mass that falls on a spring without adhesion: t = 2/w (pi - atan(v0 w/g)) in contact and 2 v0/g in flight, for a
  fall from v0^2/2g; without dissipation it returns to its height. W. Goldsmith, Impact (1960), ch. 4 for the spring.
- A bar that hits a stiff stop at the speed v: by d'Alembert the end has the contact force v sqrt(E rho) A for 2 L/c and
  rebounds with v. K. F. Graff, Wave Motion in Elastic Solids (1975), ch. 2.
- Surge of a spring fixed at both ends: f = 1/2 sqrt(k/m).
- A rigid follower leaves its cam if its deceleration exceeds the spring force over the mass.
"""

import math

import numpy as np
import pytest

from flexcam import read_case, run
from flexcam.core import Triplets
from flexcam.dynamics import (
    AngleVector,
    Channel,
    ConstantSpeed,
    Load,
    LocalForce,
    Probe,
    Problem,
    State,
    System,
    constant,
    elastic_stop,
    force_sum,
    hunt_crossley_contact,
    newmark,
    solve,
)
from flexcam.dynamics.force_laws import line_load
from flexcam.valvetrain.cam_contact import HertzLine

SOURCE = "Contact and springs, closed-form solutions"
G, W, V0 = 9.81, 2000.0, 1.2
"""Gravity, circular frequency of the mass on the stop, speed of the fall."""


def run_bouncing_mass(law, steps, periods=1.0):
    """Return the response of a unit mass over a bounce (contact and flight) that starts at touchdown with V0."""
    contact = 2.0 / W * (math.pi - math.atan(V0 * W / G))
    cycle = contact + 2.0 * V0 / G
    one = Triplets.from_dense([[1.0]])
    force = LocalForce("stop", (AngleVector.constant(np.array([-1.0])),), (AngleVector.constant(np.array([1.0])),), law,
                       (constant(0.0),))  # fmt: skip
    weight = Load("weight", np.array([-G]), lambda motion: np.ones_like(motion.angle))
    system = System(
        one, Triplets.zeros(1), Triplets.zeros(1), ("y",), (weight,),
        (force,), (Probe("y", ("y",), np.eye(1), (None,)),), (Channel("force", "N", force_sum(0)),),
    )  # fmt: skip
    start = State(np.zeros(1), np.array([-V0]))
    response = solve(Problem(system, ConstantSpeed(1.0), cycle * periods / steps, steps, start), newmark())
    return response, contact, cycle


def test_contact_time_of_bouncing_mass(record):
    response, contact, cycle = run_bouncing_mass(elastic_stop(W**2), 40_000)
    force = response.channels["force"]
    pressed = np.flatnonzero(force > 0.0)
    record(source=SOURCE, case="bouncing mass", quantity="time in contact", unit="s", reference=contact,
           computed=float(response.time[pressed[-1]] - response.time[pressed[0]]), tolerance=2.0 * cycle / 40_000,
           absolute=True, reason="a step at either end")  # fmt: skip


def test_speed_after_bounce(record):
    """The mass returns to touchdown with its initial speed."""
    response, *_ = run_bouncing_mass(elastic_stop(W**2), 40_000)
    record(source=SOURCE, case="bouncing mass", quantity="speed after a bounce", unit="m/s", reference=V0,
           computed=float(np.abs(response["y"].velocity).max()), tolerance=1e-5,
           reason="G and V0 step at the ends of contact: (w dt)^2 of it")  # fmt: skip


@pytest.mark.parametrize("law", [elastic_stop(W**2), hunt_crossley_contact(W**2, 0.0)])
def test_energy_balance_of_bounce(record, law):
    residuals = []
    for count in (2500, 20_000):
        channels = run_bouncing_mass(law, count)[0].channels
        residuals.append(np.abs(channels["energy.residual"]).max() / channels["energy.kinetic"].max())
    record(source=SOURCE, case=f"bouncing mass, {type(law).__name__}", quantity="largest energy residual over kinetic",
           unit="1", reference=0.0, computed=max(residuals), tolerance=1e-8, absolute=True,
           reason="touchdown and separation end a step: within the steps the contact is linear")  # fmt: skip


@pytest.mark.parametrize("dissipation", [0.2, 0.6])
def test_hunt_crossley_restitution(record, dissipation):
    """For small chi v the restitution is 1 - 2/3 chi v for a linear spring (Hunt and Crossley 1975, first order)."""
    small = 0.05 * dissipation
    response, *_ = run_bouncing_mass(hunt_crossley_contact(W**2, small), 40_000)
    after = float(response["y"].velocity.max())
    record(source=SOURCE, case=f"Hunt-Crossley, chi v = {small * V0:.3f}", quantity="restitution", unit="1",
           reference=1.0 - 2.0 / 3.0 * small * V0, computed=after / V0, absolute=True,
           tolerance=(small * V0) ** 2 + 1e-5, reason="next term of the series, and the time step")  # fmt: skip
    gone = response.channels["energy.dissipated"][int(np.argmax(response["y"].velocity))]
    assert gone == pytest.approx(0.5 * (V0**2 - after**2), rel=0.02)


def run_bar_impact(elements, stiffness, speed, law=None):
    """Return the run of a steel bar, 1 m, 1 cm^2, against a stop, the theoretical force, and the speed of sound."""
    E, rho, A, L = 207e9, 7800.0, 1e-4, 1.0
    n, h = elements + 1, L / elements
    K, M = np.zeros((n, n)), np.zeros((n, n))
    for i in range(elements):
        K[i : i + 2, i : i + 2] += E * A / h * np.array([[1.0, -1.0], [-1.0, 1.0]])
        M[i : i + 2, i : i + 2] += rho * A * h / 2.0 * np.eye(2)
    row = np.zeros(n)
    row[-1] = 1.0
    own = law or elastic_stop(stiffness)
    force = LocalForce("stop", (AngleVector.constant(row),), (AngleVector.constant(-row),), own,
                       (constant(0.0),))  # fmt: skip
    names = tuple(f"x{i}" for i in range(n))
    system = System(
        Triplets.from_dense(M), Triplets.zeros(n), Triplets.from_dense(K), names, (), (force,),
        (Probe("back", ("x",), np.eye(n)[:1], (None,)),), (Channel("force", "N", force_sum(0)),),
    )  # fmt: skip
    c = math.sqrt(E / rho)
    end = 3.0 * L / c
    steps = 4000
    start = State(np.zeros(n), np.full(n, speed))
    return (
        solve(Problem(system, ConstantSpeed(1.0), end / steps, steps, start), newmark()),
        speed * math.sqrt(E * rho) * A,
        c,
    )


@pytest.mark.slow
def test_impact_force_of_bar(record):
    response, force, c = run_bar_impact(200, 2e10, 1.0)
    found = response.channels["force"]
    inside = (response.time > 0.4 / c) & (response.time < 1.6 / c)
    record(source=SOURCE, case="bar against a stop", quantity="mean force", unit="N", reference=force,
           computed=float(found[inside].mean()), tolerance=0.005,
           reason="200 elements follow the front with ripples about its mean")  # fmt: skip
    impulse = float(np.sum(0.5 * (found[1:] + found[:-1]) * np.diff(response.time)))
    record(source=SOURCE, case="bar against a stop", quantity="impulse", unit="N s", reference=2.0 * 0.78,
           computed=impulse, tolerance=0.02, reason="a little motion stays in the ripples")  # fmt: skip


@pytest.mark.parametrize("parts", [8, 16])
def test_surge_frequency_of_spring(record, parts):
    """The matrices are those of the spring of a case; a consistent mass converges from above, (pi/n)^2/24 too high."""
    from scipy.linalg import eigh

    from flexcam import read_case
    from flexcam.case.builder import build_model
    from flexcam.valvetrain import build_structure

    case = read_case("cases/pushrod-engine/intake.toml", [f"springs.valve.elements={parts}"])
    structure = build_structure(build_model(case))
    inner = [i for i, name in enumerate(structure.dofs.names) if name.startswith("springs.valve.")]
    K, M = (matrix.part(np.array(inner)).dense() for matrix in (structure.stiffness, structure.mass))
    exact = 0.5 * math.sqrt(50e3 / 0.06)
    found = math.sqrt(eigh(K, M, eigvals_only=True)[0]) / (2.0 * math.pi)
    record(source=SOURCE, case=f"valve spring of {parts} elements", quantity="first surge frequency", unit="Hz",
           reference=exact * (1.0 + (math.pi / parts) ** 2 / 24.0), computed=found,
           tolerance=0.02 * (math.pi / parts) ** 4, reason="next term of the series")  # fmt: skip


def line_contact_load(contact, approach, relative):
    """Return load per length and its slope for a line contact of a relative radius of curvature."""
    _, give, rest, depth, _, limit = contact.law().constants
    return line_load(approach, limit * relative, give, rest, depth)


def test_hertz_line_load_inverts_approach():
    law = HertzLine(0.012, 207e9, 0.29, constant(0.02), 0.03)
    for approach in (1e-9, 1e-7, 1e-5, 1e-4):
        load, slope = line_contact_load(law, approach, 0.02)
        one = (1.0 - 0.29**2) / (math.pi * 207e9)
        a = math.sqrt(8.0 * load * 0.02 * one)
        terms = 2 * math.log(4 * 0.02 / a) - 1 + 2 * math.log(2 * 0.03 / a) - 0.29 / 0.71
        assert one * load * terms == pytest.approx(approach, rel=1e-12)
        step = 1e-6 * approach
        around = [line_contact_load(law, approach + side * step, 0.02)[0] for side in (-1, 1)]
        assert slope == pytest.approx((around[1] - around[0]) / (2 * step), rel=1e-6)


@pytest.mark.parametrize(("R1", "R2", "load"), [(0.016, 0.0085, 1.2e5), (0.2, 0.06, 2e6), (1e-3, 4e-4, 800.0)])
def test_approach_of_two_cylinders_by_johnson(record, R1, R2, load):
    """K. L. Johnson, Contact Mechanics (1985), eq. 5.57 for either cylinder, with the half width of both."""
    compliance, relative = (1.0 - 0.3**2) / (math.pi * 207e9), R1 * R2 / (R1 + R2)
    a = math.sqrt(8.0 * load * relative * compliance)
    approach = compliance * load * sum(2.0 * math.log(4.0 * R / a) - 1.0 for R in (R1, R2))
    law = HertzLine(0.01, 207e9, 0.3, constant(relative), 2.0 * (R1 + R2), rolls=True)
    found = line_contact_load(law, approach, relative)[0]
    record(source=SOURCE, case=f"cylinders of {1e3 * R1:g} and {1e3 * R2:g} mm", quantity="load of a line contact",
           unit="N/m", reference=load, computed=found, tolerance=1e-9, reason="Newton's iteration")  # fmt: skip


def test_approach_of_two_cylinders_by_young():
    """W. C. Young, Roark's Formulas for Stress and Strain (1989), table 33, 2a: 2/3 for Johnson's 2 ln 2 - 1."""
    one, other, load = 0.016, 0.0085, 1.2e5
    compliance = (1.0 - 0.3**2) / (math.pi * 207e9)
    wide = 2.0 * math.sqrt(8.0 * load * one * other / (one + other) * compliance)
    approach = 2.0 * compliance * load * (2.0 / 3.0 + math.log(4.0 * one / wide) + math.log(4.0 * other / wide))
    law = HertzLine(0.01, 207e9, 0.3, constant(0.006), 2.0 * (one + other), rolls=True)
    assert line_contact_load(law, approach, 0.006)[0] == pytest.approx(load, rel=0.04)


def test_conforming_roller_has_increasing_contact_load():
    """A concave flank of nearly the roller radius has an unbounded relative radius; the load still increases."""
    from flexcam.valvetrain.cam_contact import STRAIGHT

    for rolls, depth in ((True, 0.05), (False, 0.018)):
        law = HertzLine(0.01, 207e9, 0.3, constant(STRAIGHT * depth), depth, rolls=rolls)
        load, slope = np.transpose(
            [line_contact_load(law, x, STRAIGHT * depth) for x in np.geomspace(1e-8, 0.1 * depth, 50)]
        )
        assert (slope > 0.0).all()
        assert (np.diff(load) > 0.0).all()
        assert load[0] < 1e5


SEATED_VALVE = """
format = 1
nodes = { valve = [0.0, 0.0, 0.0] }
supports = { valve = ["ux", "uz"] }
masses.valve = { at = "valve", mass = "20 mg" }
contacts.seat = { at = "valve", model = "seat", direction = "uy", stiffness = "80 kN/m", damping = "0.3 N s/m" }
loads.spring = { at = "valve", direction = "-uy", force = "16 mN" }
[run]
speed = "6000 rpm"
revolutions = 0.02
steps_per_revolution = 36000
start = { displacement = { "valve.uy" = "-0.3 um" } }
[output]
probes = ["valve"]
"""
"""Part of a watch: the spring presses it 0.2 um into the seat, and it oscillates by half of that."""


def test_contact_damping_of_small_part(tmp_path):
    """The oscillator is m u'' + c u' + k u = -F, with full damping at the given depth, and little by default."""
    path = tmp_path / "seated.toml"
    path.write_text(SEATED_VALVE, encoding="utf-8")
    response = run(read_case(path, ['contacts.seat.damping_depth="1 nm"']))
    decay, still = 0.3 / 2.0 / 20e-6, -16e-3 / 80e3
    swing = math.sqrt(80e3 / 20e-6 - decay**2)
    t = response.time
    around = np.cos(swing * t) + decay / swing * np.sin(swing * t)
    expected = still - 0.1e-6 * np.exp(-decay * t) * around
    # Average acceleration: a phase error of (w dt)^2/12 per radian, (63 246 x 0.28 us)^2/12 x 12.6 = 3e-4 of the
    # amplitude.
    np.testing.assert_allclose(response["valve.uy"].displacement, expected, rtol=0, atol=5e-4 * 0.1e-6)
    assert np.ptp(expected[-400:]) < 0.15e-6 < np.ptp(run(read_case(path))["valve.uy"].displacement[-400:])
