"""Impacts of a follower on a cam with a jump in curvature: the periodic orbit, and chaos below the corner speed.

The follower of mass m flies on its spring k, from c = lift + preload/k at the cam angle of the impact back to it:

    w c'(theta)/c(theta) = (1 - e)/(1 + e) w_n tan(pi w_n/w),    speed after the impact w_n c tan(pi w_n/w).

The multipliers of this orbit have the product e^2; with c'' < 0 at the impact they are a complex pair of modulus e. R.
Alzate et al. report a corner-impact bifurcation with an abrupt change to chaos below that speed.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from flexcam import solve
from flexcam.core.units import RPM
from flexcam.dynamics import State, floquet
from tests.verification.corner_cam import (
    BASE,
    CORNER,
    EVENT,
    FLANK,
    LIFT,
    MASS,
    PRELOAD,
    RESTITUTION,
    START,
    STIFFNESS,
    prepared,
)

SOURCE = "Alzate, di Bernardo et al., corner impact of a cam follower"
NATURAL = math.sqrt(STIFFNESS / MASS)
STEPS = 720


def preloaded_lift(angle, order=0):
    """Return c or one of its derivatives."""
    return float(EVENT(np.array([angle]), order)[0]) + (PRELOAD / STIFFNESS if order == 0 else 0.0)


def flight_tangent(rpm):
    return NATURAL * math.tan(math.pi * NATURAL / (rpm * RPM))


def orbit_residual(rpm, angle):
    """Return the residual of the orbit equation."""
    loss = (1.0 - RESTITUTION) / (1.0 + RESTITUTION)
    return rpm * RPM * preloaded_lift(angle, 1) - loss * flight_tangent(rpm) * preloaded_lift(angle)


def impact_angle(rpm):
    return brentq(lambda angle: orbit_residual(rpm, angle), START + CORNER + 1e-9, START + CORNER + 0.17, xtol=1e-14)


def orbit_start(rpm, disturbance=0.0):
    """Return the state of the orbit at the cam angle 0, in flight, displaced by a disturbance."""
    at = impact_angle(rpm)
    flight = (2.0 * math.pi - at) / (rpm * RPM) * NATURAL
    c, s = math.cos(flight), math.sin(flight)
    A, B = preloaded_lift(at), preloaded_lift(at) * flight_tangent(rpm) / NATURAL
    displacement = A * c + B * s - PRELOAD / STIFFNESS + disturbance
    return State(np.array([displacement]), NATURAL * np.array([B * c - A * s]))


def last_impact(rpm):
    """Return cam angle and speed of the last impact of a run near the orbit, by parabolas on both sides."""
    ready = prepared(rpm, "run.revolutions=50", f"run.steps_per_revolution={STEPS}")
    response = solve(replace(ready.problem, start=orbit_start(rpm, 1e-5)), ready.scheme)
    follower, angle = response["follower.uy"], response.angle
    jump = len(angle) - STEPS + int(np.argmax(np.diff(follower.velocity[-STEPS:]))) + 1
    before, after = slice(jump - 3, jump), slice(jump, jump + 3)
    gap = np.polyfit(angle[before] - angle[jump], response.channels["contacts.cam.gap"][before], 2)
    at = max(np.roots(gap)) if gap[0] < 0.0 else min(root for root in np.roots(gap) if root > -2.0 * math.pi / STEPS)
    speed = np.polyval(np.polyfit(angle[after] - angle[jump], follower.velocity[after], 2), at)
    return float((angle[jump] + at) % (2.0 * math.pi)), float(speed)


def test_profile_of_arcs_is_smooth():
    """The three arcs have a continuous tangent, with the printed lift and preload."""
    assert pytest.approx(0.15393, abs=5e-6) == LIFT
    assert pytest.approx(PRELOAD) == STIFFNESS * (BASE - 0.3)
    for at in (START, START + CORNER):
        assert preloaded_lift(at - 1e-9) == pytest.approx(preloaded_lift(at), abs=1e-9)
        assert preloaded_lift(at - 1e-9, 1) == pytest.approx(preloaded_lift(at, 1), abs=1e-8)
    b, radius = 0.7, BASE + float(EVENT(np.array([START + 0.7]))[0])
    assert math.hypot(radius * math.cos(b) + FLANK[0], radius * math.sin(b)) == pytest.approx(FLANK[1], rel=1e-12)


def test_contact_loss_speed_of_rigid_follower(record):
    """The contact force m w^2 c'' + k c vanishes just after the corner."""
    corner = START + CORNER
    reference = math.sqrt(-STIFFNESS * preloaded_lift(corner) / (MASS * preloaded_lift(corner, 2))) / RPM
    lowest = []
    for rpm in (reference - 0.5, reference + 0.5):
        ready = prepared(rpm, "fidelity.model=rigid", "run.revolutions=1", "run.steps_per_revolution=36000")
        lowest.append(float(solve(ready.problem, ready.scheme).channels["contacts.cam.force"].min()))
    squares = [(reference - 0.5) ** 2, (reference + 0.5) ** 2]
    found = math.sqrt(np.interp(0.0, lowest[::-1], squares[::-1]))
    record(source=SOURCE, case="rigid follower", quantity="first loss of contact", unit="rpm", reference=reference,
           computed=found, tolerance=5e-5, reason="36 000 angles: one lies 0.0006 deg behind the corner")  # fmt: skip
    assert reference == pytest.approx(114.979, abs=5e-4)


@pytest.mark.slow
def test_periodic_orbit_with_one_impact(record):
    case = "700 rpm, one impact per turn"
    angle, speed = last_impact(700.0)
    expected = impact_angle(700.0)
    reason = "average acceleration at half a degree, and parabolas of three instants"
    for quantity, unit, reference, computed in (
        ("cam angle of the impact", "deg", math.degrees(expected), math.degrees(angle)),
        ("speed after the impact", "m/s", preloaded_lift(expected) * flight_tangent(700.0), speed),
    ):
        record(source=SOURCE, case=case, quantity=quantity, unit=unit, reference=reference, computed=computed,
               tolerance=1e-4, reason=reason)  # fmt: skip
    assert math.degrees(expected) == pytest.approx(155.3037, abs=5e-5)
    assert preloaded_lift(expected) * flight_tangent(700.0) == pytest.approx(81.854, abs=5e-4)
    ready = prepared(700.0, "run.revolutions=1", f"run.steps_per_revolution={8 * STEPS}")
    found = floquet(replace(ready.problem, start=orbit_start(700.0))).multipliers
    for one, name in zip(found, ("first", "second"), strict=True):
        record(source=SOURCE, case=case, quantity=f"modulus of the {name} multiplier", unit="1", reference=RESTITUTION,
               computed=float(abs(one)), tolerance=1e-5, reason="average acceleration at 5760 steps")  # fmt: skip


@pytest.mark.slow
def test_corner_impact_bifurcation_speed(record):
    """The speed is extrapolated from the impact angles at three higher speeds."""
    corner = START + CORNER
    reference = brentq(lambda rpm: orbit_residual(rpm, corner), 660.0, 690.0)
    speeds = np.array([674.0, 676.0, 678.0])
    angles = np.array([last_impact(rpm)[0] for rpm in speeds])
    found = float(np.polyval(np.polyfit(angles - corner, speeds, 2), 0.0))
    record(source=SOURCE, case="corner-impact bifurcation", quantity="speed", unit="rpm", reference=reference,
           computed=found, tolerance=5e-5, reason="extrapolated by a parabola over 3 rpm")  # fmt: skip
    assert reference == pytest.approx(673.2344, abs=5e-5)


def run_two_starts(rpm, starts):
    """Return the positions at the cam angle 0 over 150 turns from two starts, and the distance between both runs."""
    ready = prepared(rpm, "run.revolutions=150", f"run.steps_per_revolution={STEPS}")
    runs = [solve(replace(ready.problem, start=start), ready.scheme)["follower.uy"] for start in starts]
    first, second = (run.displacement[::STEPS] for run in runs)
    return first, np.abs(second - first)


@pytest.mark.slow
def test_chaos_below_bifurcation_speed():
    """A disturbance of 1e-9 m of the start at rest grows to centimetres, and turns do not repeat."""
    positions, apart = run_two_starts(672.0, [State(np.array([x]), np.zeros(1)) for x in (0.0, 1e-9)])
    assert apart[100:].max() > 1e-2
    assert np.unique(positions[50:].round(4)).size > 90


@pytest.mark.slow
def test_stable_orbit_above_bifurcation_speed():
    """A disturbance of 1e-5 m decreases by a factor e per turn: to rounding in 100 turns."""
    positions, apart = run_two_starts(674.0, [orbit_start(674.0, x) for x in (0.0, 1e-5)])
    assert apart[100:].max() < 1e-10
    assert np.abs(positions - positions[0]).max() < 1e-3
