"""Impacts with closed forms, each as a case file: a mass on a spring, a bar, a forced oscillator, a falling ball.

- A mass between a spring and a stop, after SDND101 of code_aster (VPCS, impact of a system of one degree of freedom):
  half a period of the stiffness K + k in contact, half a period of k in free flight.
- A bar that strikes a rigid wall: v sqrt(E rho) A for 2 L/c. K. F. Graff, Wave Motion in Elastic Solids (1975), ch. 2.
- Orbits of x'' + x = cos(w t + phi) below a wall at sigma with one impact every n periods: S. W. Shaw and P. J. Holmes,
  J. Sound Vib. 90 (1983) 129. With T = 2 pi n/w, gamma = 1/(1 - w^2) and the speed V before an impact,
  sin(phi) = -(1 - r) V/(2 w gamma) and sigma = gamma cos(phi) - (1 + r) V/(2 tan(T/2)).
- A ball that falls on a floor: the derivative of its state by initial height and speed.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from flexcam import prepare, read_case, run, solve
from flexcam.dynamics import State, floquet, generalized_alpha, newmark
from flexcam.dynamics.engine_selection import select_engine
from flexcam.dynamics.periodic import period_map
from tests.thinning import slow_if

BODY_TEXT = """
format = 1
nodes = { ground = [0.0, -1.0, 0.0], body = [0.0, 0.0, 0.0] }
supports = { body = ["ux", "uz"] }
output = { probes = ["body"] }
"""


@pytest.fixture
def case_of(tmp_path):
    def write(text, *overrides):
        path = tmp_path / "case.toml"
        path.write_text(text, encoding="utf-8")
        return read_case(path, list(overrides))

    return write


def test_mass_between_spring_and_stop(record, case_of):
    case = case_of(
        BODY_TEXT
        + """
        masses.body = { at = "body", mass = "100 kg" }
        springs.spring = { at = "body", direction = "uy", stiffness = "10 kN/m" }
        contacts.stop = { at = "body", model = "seat", direction = "uy", stiffness = "1 MN/m" }
        [run]
        speed = "1 rad/s"
        step = "10 us"
        revolutions = 0.057
        start = { velocity = { "body.uy" = "-1 m/s" } }
        """
    )
    response = run(case)
    force, time = response.channels["contacts.stop.force"], response.time
    pressed = (force[1:] > 0.0) | (force[:-1] > 0.0)
    ends = np.flatnonzero(np.diff(pressed.astype(int)))
    w = math.sqrt((1e6 + 1e4) / 100.0)
    apart = math.pi / math.sqrt(1e4 / 100.0)
    for quantity, unit, reference, computed, tolerance in (
        ("largest force", "N", 1e6 / w, force.max(), 1e-6),
        ("time in contact", "s", math.pi / w, time[ends[0] + 1], 5e-4),
        ("impulse", "N s", 2e6 / w**2, np.trapezoid(force[time < 0.1], time[time < 0.1]), 1e-6),
        ("second contact", "s", math.pi / w + apart, time[ends[1] + 1], 5e-5),
    ):
        record(source="SDND101 of code_aster, closed form", case="mass on a spring at a stop", quantity=quantity,
               unit=unit, reference=reference, computed=float(computed), tolerance=tolerance,
               reason="a time is known to a step of 10 us; (w dt)^2/12 of a force")  # fmt: skip


def test_impact_of_bar_on_rigid_wall(record, case_of):
    E, rho, A, v, gap = 210e9, 7800.0, 3.14e-4, 0.1, 50e-6
    side = math.sqrt(A)
    ready = prepare(case_of(f"""
        format = 1
        nodes = {{ back = [0.0, 0.0, 0.0], front = [1.0, 0.0, 0.0] }}
        materials.steel = {{ E = {E}, nu = 0.0, density = {rho} }}
        sections.bar = {{ shape = "rectangle", width_y = {side!r}, width_z = {side!r} }}
        supports = {{ back = ["uy", "uz", "rx", "ry", "rz"], front = ["uy", "uz", "ry", "rz"] }}
        contacts.wall = {{ at = "front", model = "seat", direction = "-ux", stiffness = "20 GN/m" }}
        run = {{ speed = "1 rad/s", step = "0.2 us", revolutions = 1.6e-4 }}
        output.probes = ["front"]
        [members.bar]
        nodes = ["back", "front"]
        elements = 200
        material = "steel"
        section = "bar"
        mass = "lumped"
        """))  # fmt: skip
    along = np.array([float(name.endswith("ux")) for name in ready.problem.system.names])
    start = State(-gap * along, v * along)
    response = solve(replace(ready.problem, start=start), generalized_alpha(rho_inf=0.5))
    force, time = response.channels["contacts.wall.force"], response.time
    c = math.sqrt(E / rho)
    plateau = (time > gap / v + 0.2 / c) & (time < gap / v + 1.8 / c)
    pressed = time[force > 0.0]
    source, case = "One-dimensional wave theory", "bar of 1 m on a rigid wall"
    record(source=source, case=case, quantity="force of the plateau", unit="N", reference=v * math.sqrt(E * rho) * A,
           computed=float(force[plateau].mean()), tolerance=0.002,
           reason="200 elements follow the front with ripples about its mean")  # fmt: skip
    record(source=source, case=case, quantity="time in contact", unit="s", reference=2.0 / c,
           computed=float(np.ptp(pressed)), tolerance=0.01,
           reason="the front is spread over about two elements of 1 us")  # fmt: skip
    record(source=source, case=case, quantity="impulse", unit="N s", reference=2.0 * rho * A * v,
           computed=float(np.trapezoid(force, time)), tolerance=0.005,
           reason="a little motion stays in the ripples")  # fmt: skip


ORBITS = [(2.6, 0.8, 1, 1.0, -1), (2.6, 0.8, 2, 1.0, 1), (0.7, 0.5, 1, 0.3, 1), (3.3, 0.5, 3, 1.0, 1)]
"""Frequency, restitution, periods per impact, speed before the impact, sign of cos(phi)."""


class ImpactOrbit:
    """Orbit of the forced oscillator below the wall; time is measured from an impact."""

    def __init__(self, w, r, n, V, side):
        self.w, self.r, self.V, self.T = w, r, V, 2.0 * math.pi * n / w
        self.gamma = 1.0 / (1.0 - w**2)
        sin = -(1.0 - r) * V / (2.0 * w * self.gamma)
        self.phi = math.atan2(sin, side * math.sqrt(1.0 - sin**2))
        self.amount = -(1.0 + r) * V / 2.0 * np.array([1.0 / math.tan(self.T / 2.0), 1.0])
        self.sigma = self.gamma * math.cos(self.phi) + self.amount[0]

    def __call__(self, t):
        """Return distance from the wall and velocity."""
        (A, B), turn = self.amount, self.w * t + self.phi
        x = A * np.cos(t) + B * np.sin(t) + self.gamma * np.cos(turn) - self.sigma
        return x, -A * np.sin(t) + B * np.cos(t) - self.w * self.gamma * np.sin(turn)

    def multipliers(self):
        c, s = math.cos(self.T), math.sin(self.T)
        a = math.cos(self.phi) - self.sigma
        jump = np.array([[-self.r, 0.0], [(1.0 + self.r) * a / self.V, -self.r]])
        return np.linalg.eigvals(np.array([[c, s], [-s, c]]) @ jump)


def test_closed_form_orbits_satisfy_equation():
    """The closed form hits the wall with V, leaves it with r V, and stays below it in between."""
    for parameters in ORBITS:
        orbit = ImpactOrbit(*parameters)
        np.testing.assert_allclose(orbit(0.0), (0.0, -orbit.r * orbit.V), atol=1e-12)
        np.testing.assert_allclose(orbit(orbit.T), (0.0, orbit.V), atol=1e-12)
        assert orbit(np.linspace(0.0, orbit.T, 4001)[1:-1])[0].max() < 0.0, parameters
        assert np.abs(orbit.multipliers()).max() < 1.0, parameters


@pytest.mark.parametrize("parameters", slow_if(lambda one: one[2] > 2, ORBITS))
def test_forced_oscillator_at_wall(record, case_of, parameters):
    """A cam of simple harmonic motion drives the mass through a spring; a constant load shifts it below the wall."""
    orbit = ImpactOrbit(*parameters)
    half = 0.4 * orbit.T
    x, v = orbit(half)
    turn = math.pi - orbit.phi - orbit.w * half
    ready = prepare(case_of(
        BODY_TEXT
        + f"""
        masses.body = {{ at = "body", mass = "1 kg" }}
        loads.shift = {{ at = "body", direction = "uy", force = {-1.0 - orbit.sigma} }}
        contacts.drive = {{ cam = "cam", follower = "body", direction = "uy", model = "bilateral", stiffness = 1.0 }}
        contacts.wall = {{ at = "body", model = "seat", direction = "-uy", stiffness = 1e9, restitution = {orbit.r} }}
        [cams.cam]
        at = "ground"
        axis = [1, 0, 0]
        law = "shm"
        lift = "2 m"
        rise = "180 deg"
        return = "180 deg"
        phase = {turn % (2.0 * math.pi)}
        [run]
        speed = {orbit.w}
        revolutions = {60 * parameters[2]}
        steps_per_revolution = 2000
        start = {{ displacement = {{ "body.uy" = {0.99 * x} }}, velocity = {{ "body.uy" = {1.01 * v} }} }}
        """
    ))  # fmt: skip
    case = f"w = {orbit.w:g}, r = {orbit.r:g}, impact every {parameters[2]} periods"
    body = solve(ready.problem, newmark())["body.uy"]
    reason = "average acceleration: (w dt)^2/12 per radian; 1 % of disturbance dies away in 60 impacts"
    for quantity, unit, reference, computed in (
        ("position after 60 impacts", "m", x, body.displacement[-1]),
        ("velocity after 60 impacts", "m/s", v, body.velocity[-1]),
    ):  # fmt: skip
        record(source="Orbits of the impact oscillator", case=case, quantity=quantity, unit=unit, reference=reference,
               computed=float(computed), tolerance=2e-4, reason=reason)  # fmt: skip
    steps = 2000 * parameters[2]
    found = floquet(replace(ready.problem, start=State(np.array([x]), np.array([v])), steps=steps))
    record(source="Orbits of the impact oscillator", case=case, quantity="largest multiplier", unit="1",
           reference=float(np.abs(orbit.multipliers()).max()), computed=float(abs(found.multipliers[0])),
           tolerance=2e-4, reason="average acceleration at 2000 steps per period")  # fmt: skip


def test_derivative_of_bounce_by_initial_height(record, case_of):
    """The state at T after one bounce is y = e u (T - t) - g (T - t)^2/2 with u = sqrt(2 g h), t = u/g."""
    g, h, e, T = 9.81, 1.25, 0.7, 0.75
    u = math.sqrt(2.0 * g * h)
    after = T - u / g
    by_height = e * g / u * after - (e * u - g * after) / u
    fall, rise = (np.array([[1.0, t], [0.0, 1.0]]) for t in (u / g, after))
    impact = np.array([[-e, 0.0], [(1.0 + e) * -g / -u, -e]])
    assert (rise @ impact @ fall)[0, 0] == pytest.approx(by_height, rel=1e-12)
    ready = prepare(case_of(
        BODY_TEXT
        + f"""
        masses.body = {{ at = "body", mass = "2 kg" }}
        contacts.floor = {{ at = "body", model = "seat", direction = "uy", stiffness = 1e9, restitution = {e} }}
        [run]
        speed = "1 rad/s"
        gravity = [0, {-g}, 0]
        step = {T / 1000}
        revolutions = {T / (2.0 * math.pi)}
        start = {{ displacement = {{ "body.uy" = {h} }} }}
        """
    ))  # fmt: skip
    selected = select_engine(replace(ready.problem, engine="direct"), newmark())
    found = period_map(selected, newmark(), lambda: False)
    source, case = "Ball on a floor", f"fall from {h:g} m, restitution {e:g}, {T:g} s"
    reason = "motion under gravity is exact; the time of the impact is found to rounding"
    for quantity, unit, reference, computed in (
        ("height at the end", "m", e * u * after - 0.5 * g * after**2, found.end[0]),
        ("d(height at the end)/d(initial height)", "1", by_height, found.derivative[0, 0]),
        ("product of the multipliers", "1", e**2, np.linalg.det(found.derivative)),
        ("largest multiplier", "1", np.abs(np.linalg.eigvals(rise @ impact @ fall)).max(),
         np.abs(np.linalg.eigvals(found.derivative)).max()),
    ):  # fmt: skip
        record(source=source, case=case, quantity=quantity, unit=unit, reference=float(reference),
               computed=float(computed), tolerance=1e-8, reason=reason)  # fmt: skip


@pytest.mark.parametrize("method", slow_if(lambda name: name == "dop853", ["bathe", "dop853"]))
def test_rebounds_within_a_step_obey_restitution(case_of, method):
    """Half an oscillation on the stiffness of the floor is shorter than a step: no end of a step lies in contact."""
    case = case_of(
        BODY_TEXT
        + f"""
        masses.body = {{ at = "body", mass = "0.1 kg" }}
        contacts.floor = {{ at = "body", model = "seat", direction = "uy", stiffness = "60 MN/m", restitution = 0.8 }}
        [run]
        speed = "1 rad/s"
        step = "0.5 ms"
        revolutions = 0.05
        gravity = [0.0, -9.81, 0.0]
        start = {{ displacement = {{ "body.uy" = "20 mm" }} }}
        integrator = {{ method = "{method}" }}
        """
    )
    motion = run(case)["body.uy"]
    height = motion.displacement
    highest = np.flatnonzero((height[1:-1] > height[:-2]) & (height[1:-1] >= height[2:])) + 1
    tops = height[highest] + motion.velocity[highest] ** 2 / (2.0 * 9.81)  # by energy, between the saved instants
    exact = [0.02 * 0.8 ** (2 * bounce) for bounce in (1, 2, 3)]
    assert tops[:3] == pytest.approx(exact, abs=1e-9)  # flight is exact; the time of impacts is known to rounding
