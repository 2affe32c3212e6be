"""Cam geometry of two papers: Li's swinging roller follower and the profiles of Petrescu and Petrescu.

C. Li, Cam motion simulation and optimization based on matlab/simulink (2014), gives arm, centre distance, first angle,
roller, stroke and both senses of rotation, but neither the law nor the cam angles of the example. Here the law is the
first of the paper's harmonic laws, the cycloidal one, with 120 deg rise, 60 deg dwell and 120 deg return. Pitch circle
and top do not depend on that choice. F. I. T. Petrescu and R. V. V. Petrescu, Settings of the valve spring (2013),
print their formulas.
"""

import math

import numpy as np
import pytest

from flexcam.cams import LAWS, FlatFollower, LiftEvent, SwingRollerFollower, cam_profile, lift_from_profile, profile_at

LI = "Li, Cam motion simulation and optimization (2014)"
CASE = "swinging roller follower, l = 145, a = 140, R = 16 mm, 30 deg + 10 deg"
ARM, DISTANCE, ROLLER, FIRST, STROKE = 0.145, 0.140, 0.016, math.radians(30), math.radians(10)
CLOCKWISE_TURN = -1
FOLLOWER = SwingRollerFollower.from_angle(ROLLER, ARM, DISTANCE, FIRST, side=1)
"""Turns clockwise on the rise."""

RISE = 2 * math.pi / 3
EVENT = LiftEvent(LAWS["cycloidal"], lift=ARM * STROKE, rise=RISE, dwell=math.pi / 3, fall=RISE)


def roller_centre_distance(angle):
    """Return the distance of the roller centre from the cam axis, by the cosine law."""
    return math.sqrt(ARM**2 + DISTANCE**2 - 2 * ARM * DISTANCE * math.cos(angle))


def test_pitch_circle_and_top(record):
    made = profile_at(EVENT, FOLLOWER, np.array([0.0, RISE + 0.3]), CLOCKWISE_TURN)
    low, top = np.linalg.norm(made.pitch, axis=1)
    for quantity, reference, computed in (
        ("radius of the pitch circle", roller_centre_distance(FIRST), low),
        ("radius of the roller centre's path at the top", roller_centre_distance(FIRST + STROKE), top),
        ("base radius", roller_centre_distance(FIRST) - ROLLER, np.linalg.norm(made.points[0])),
        (
            "radius of the profile at the top",
            roller_centre_distance(FIRST + STROKE) - ROLLER,
            np.linalg.norm(made.points[1]),
        ),
    ):
        record(source=LI, case=CASE, quantity=quantity, unit="mm", reference=1e3 * reference, computed=1e3 * computed,
               tolerance=1e-12, reason="cosine law, rounding")  # fmt: skip


def test_roller_centre_at_the_top(record):
    """With the cam axis at 0 and the pivot at (a, 0) the centre is at (a - l cos 40 deg, l sin 40 deg)."""
    top = profile_at(EVENT, FOLLOWER, np.array([RISE + 0.3]), CLOCKWISE_TURN).touch.trace[0]
    for quantity, reference, computed in (
        ("roller centre at the top, along the line of centres", DISTANCE - ARM * math.cos(FIRST + STROKE), top.real),
        ("roller centre at the top, across it", ARM * math.sin(FIRST + STROKE), top.imag),
    ):
        record(source=LI, case=CASE, quantity=quantity, unit="mm", reference=1e3 * reference, computed=1e3 * computed,
               tolerance=1e-12, reason="trigonometry, rounding")  # fmt: skip


def test_pressure_angle(record):
    """The formula is tan alpha = (l (1 - psi') - a cos psi)/(a sin psi), for equal senses of rotation."""
    theta = np.linspace(0.0, 2 * math.pi, 720_001)
    z = np.where(
        theta < RISE, theta / RISE, np.where(theta < RISE + math.pi / 3, 1.0, (5 * math.pi / 3 - theta) / RISE)
    )
    z, down = np.clip(z, 0.0, 1.0), np.where(theta < RISE + 0.1, 1.0, -1.0)
    psi = FIRST + STROKE * (z - np.sin(2 * math.pi * z) / (2 * math.pi))
    rate = down * STROKE / RISE * (1 - np.cos(2 * math.pi * z))
    alpha = np.abs(np.arctan((ARM * (1 - rate) - DISTANCE * np.cos(psi)) / (DISTANCE * np.sin(psi))))
    made = cam_profile(EVENT, FOLLOWER, count=36_000, turn=CLOCKWISE_TURN)
    record(source=LI, case=CASE, quantity="largest pressure angle, cycloidal law, 120-60-120 deg", unit="deg",
           reference=math.degrees(alpha.max()), computed=math.degrees(np.abs(made.pressure_angle).max()),
           tolerance=1e-7, reason="a grid of 0.01 deg may miss the top")  # fmt: skip
    at = theta[np.argmax(alpha)]
    found = made.angle[np.argmax(np.abs(made.pressure_angle))]
    record(source=LI, case=CASE, quantity="cam angle of the largest pressure angle", unit="deg",
           reference=math.degrees(at), computed=math.degrees(found), tolerance=0.011, absolute=True,
           reason="grid of 0.01 deg")  # fmt: skip


def test_lift_round_trip_through_profile(record):
    points = cam_profile(EVENT, FOLLOWER, count=720, turn=CLOCKWISE_TURN).points
    angle = np.linspace(0.0, 2 * math.pi, 1001)
    miss = lift_from_profile(points, FOLLOWER, angle, turn=CLOCKWISE_TURN) - EVENT(angle)
    record(source=LI, case=CASE, quantity="largest deviation of the lift read from 720 points", unit="um",
           reference=0.0, computed=1e6 * np.abs(miss).max(), tolerance=1e-3, absolute=True,
           reason="spline of degree 5; the jerk steps at the ends of the law")  # fmt: skip
    stroke = lift_from_profile(points, FOLLOWER, [RISE + 0.3], turn=CLOCKWISE_TURN)[0] / ARM
    record(source=LI, case=CASE, quantity="stroke read from the profile", unit="deg", reference=10.0,
           computed=math.degrees(stroke), tolerance=1e-6, absolute=True, reason="1e-9 m at the arm's end")  # fmt: skip


PETRESCU = "Petrescu and Petrescu, Settings of the valve spring (2013)"
H, R0, U = 0.006, 0.013, math.pi / 2
COS = LiftEvent(LAWS["cos"], lift=H, rise=U, fall=U)


@pytest.mark.parametrize("degrees", [30.0, 45.0, 60.0, 90.0])
def test_classical_profile_of_petrescu(degrees, record):
    """Printed for the classical profile: x = s' cos phi + (r0 + s) sin phi, y = (r0 + s) cos phi - s' sin phi."""
    phi = math.radians(degrees)
    s, speed = H / 2 * (1 - math.cos(math.pi * phi / U)), H / 2 * math.pi / U * math.sin(math.pi * phi / U)
    x, y = profile_at(COS, FlatFollower(R0), np.array([phi])).points[0]
    sine, cosine = math.sin(phi), math.cos(phi)
    for quantity, reference, computed in (
        ("xc", speed * cosine + (R0 + s) * sine, x),
        ("yc", (R0 + s) * cosine - speed * sine, y),
        ("radius", math.hypot(R0 + s, speed), math.hypot(x, y)),
    ):
        record(source=PETRESCU, case="classical profile, COS law, h = 6, r0 = 13 mm, u = 90 deg",
               quantity=f"{quantity} at {degrees:g} deg", unit="mm", reference=1e3 * reference,
               computed=1e3 * computed, tolerance=1e-12, absolute=True, reason="printed formula, rounding")  # fmt: skip
