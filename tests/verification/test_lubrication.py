"""Film, flash temperature and wear of a cam contact against independent computations.

- Velocities of both surfaces relative to the contact point, by differences of the contact point in the frame of the cam
  and on the follower. A roller rolls on the cam.
- Film thickness: the formulas were fitted to solutions of Reynolds' equation with elastic surfaces (D. Dowson and G. R.
  Higginson, Elasto-Hydrodynamic Lubrication, 1966). `solve_film` solves the same equations by finite differences:
  Newtonian oil with Barus' viscosity, incompressible, without negative pressures.
- Flash temperature: J. C. Jaeger's moving source of heat on a half space (J. Proc. R. Soc. N.S.W. 76, 1942, p. 203)
  with Hertz's distribution, integrated numerically.
- Wear: Hertz's pressure times the sliding velocity, integrated at a point of the cam during the passage of the contact.
"""

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import k0e

from flexcam.cams import FlatFollower, HarmonicLift, RollerFollower, SwingFlatFollower, SwingRollerFollower, profile_at
from flexcam.valvetrain.lubrication import (
    Film,
    cam_surface_velocity,
    entrainment_velocity,
    flash_temperature,
    half_width,
    wear_depth,
)

SOURCE = "Film and wear of a cam contact"
EVENT = HarmonicLift(0.003, (-0.0015, 0.0004, -0.0001), (0.0010, -0.0003, 0.0002))
"""Asymmetric lift, so that a wrong sense of rotation changes the result."""

ANGLES = np.linspace(0.0, 2.0 * math.pi, 90, endpoint=False)
STEP = 1e-4
MODULUS = 207e9 / (1.0 - 0.29**2)

FOLLOWERS = {
    "flat face": FlatFollower(0.018),
    "swinging face above": SwingFlatFollower(0.018, 0.050, 0.055, 0.004, 1),
    "swinging face below": SwingFlatFollower(0.018, 0.050, 0.055, -0.003, -1),
    "roller": RollerFollower(0.018, 0.008, 0.004),
    "swinging roller": SwingRollerFollower(0.020, 0.009, 0.055, 0.060, -1),
}


def follower_velocity(follower, made, at, point):
    """Return the velocity of the follower material at the contact, m/rad, complex."""
    lifted = (at(STEP).lift - at(-STEP).lift) / (2.0 * STEP)
    if isinstance(follower, FlatFollower):
        return 1j * lifted
    return -1j * follower.side * lifted / follower.arm * (point - follower.distance)


@pytest.mark.parametrize("turn", [1, -1])
@pytest.mark.parametrize("name", FOLLOWERS)
def test_surface_velocities(record, name, turn):
    follower = FOLLOWERS[name]

    def at(step):
        return profile_at(EVENT, follower, ANGLES + step, turn)

    def in_cam(step):
        return at(step).touch.point * np.exp(-1j * turn * (ANGLES + step))

    made = at(0.0)
    tangent = -1j * made.touch.normal
    moved = (in_cam(STEP) - in_cam(-STEP)) / (2.0 * STEP)
    cam = -(np.conj(tangent * np.exp(-1j * turn * ANGLES)) * moved).real
    mean = cam
    if not np.isfinite(follower.roller_radius):
        fixed = (at(STEP).touch.point - at(-STEP).touch.point) / (2.0 * STEP)
        other = (np.conj(tangent) * (follower_velocity(follower, made, at, made.touch.point) - fixed)).real
        mean = 0.5 * (cam + other)
    way = "counterclockwise" if turn > 0 else "clockwise"
    for quantity, found, reference in (
        ("cam's surface past the contact", cam_surface_velocity(made), cam),
        ("entrainment velocity", entrainment_velocity(made), mean),
    ):
        record(source=SOURCE, case=f"{name}, cam {way}", quantity=f"{quantity}, largest difference over largest value",
               unit="1", reference=0.0, computed=np.abs(found - reference).max() / np.abs(reference).max(),
               tolerance=1e-6, absolute=True, reason="central differences of 1e-4 rad")  # fmt: skip


def test_entrainment_velocity_of_flat_face():
    """The magnitude is (r0 + s + 2 s'')/2, against the rotation on the base circle."""
    made = profile_at(EVENT, FlatFollower(0.018), ANGLES, 1)
    expected = -0.5 * (0.018 + EVENT(ANGLES) + 2.0 * EVENT(ANGLES, 2))
    np.testing.assert_allclose(entrainment_velocity(made), expected, rtol=1e-12)


def solve_film(U, G, W, count=300, left=-4.0, right=1.5):
    """Return central and minimum film thickness of a line contact over its radius, by Newton's method.

    In units of Hertz's half width b and pressure p_h: ``(H^3/(lambda exp(alpha p_h P)) P')' = H'`` where P > 0, with
    ``H = H0 + X^2/2 - (1/pi) int P ln|X - X'| dX'`` and the load ``int P dX = pi/2``.
    """
    b, peak = math.sqrt(8.0 * W / math.pi), math.sqrt(W / (2.0 * math.pi))
    slip, stiffening = 12.0 * U / (b**3 * peak), G * peak
    X = np.linspace(left, right, count)
    h = X[1] - X[0]
    ends = X[:, None] - X[None, :] + 0.5 * h, X[:, None] - X[None, :] - 0.5 * h
    K = -(ends[0] * np.log(np.abs(ends[0])) - ends[1] * np.log(np.abs(ends[1])) - h) / math.pi
    backward = (1.5 * np.eye(count) - 2.0 * np.eye(count, k=-1) + 0.5 * np.eye(count, k=-2)) / h
    difference = np.diff(np.eye(count), axis=0) / h
    P = np.sqrt(np.maximum(1.0 - X**2, 0.0))
    H0 = 3.0 * U**0.69 * G**0.56 * W**-0.1 / b**2 - (0.5 * X**2 + K @ P).min()
    for _ in range(100):
        H = H0 + 0.5 * X**2 + K @ P
        flow = H**3 * np.exp(-stiffening * P) / slip
        by_film = 3.0 * flow / H
        mean, slope = 0.5 * (flow[1:] + flow[:-1]), difference @ P
        change = np.column_stack([by_film[:, None] * K - np.diag(stiffening * flow), by_film])
        flux = mean[:, None] * np.column_stack([difference, np.zeros(count - 1)])
        flux += 0.5 * slope[:, None] * (change[1:] + change[:-1])
        residual, tangent = np.zeros(count + 1), np.zeros((count + 1, count + 1))
        residual[1:-2] = np.diff(mean * slope) / h - (backward @ H)[1:-1]
        tangent[1:-2] = np.diff(flux, axis=0) / h - np.column_stack([backward @ K, np.zeros(count)])[1:-1]
        dry = P + residual[:-1] / np.maximum(np.abs(np.diagonal(tangent)[:-1]), 1e-300) <= 0.0
        dry[:2] = dry[-1] = True
        residual[:-1][dry], tangent[:-1][dry] = P[dry], np.eye(count, count + 1)[dry]
        residual[-1], tangent[-1, :-1] = h * P.sum() - 0.5 * math.pi, h
        step = np.linalg.solve(tangent, -residual)
        share = min(1.0, 0.3 / np.abs(step[:-1]).max())
        P, H0 = np.maximum(P + share * step[:-1], 0.0), H0 + share * step[-1]
        if np.abs(step[:-1]).max() < 1e-9:
            break
    else:
        pytest.fail("Newton's method did not converge")
    H = H0 + 0.5 * X**2 + K @ P
    return b**2 * float(np.interp(0.0, X, H)), b**2 * float(H.min())


@pytest.mark.parametrize(
    ("U", "G", "W", "tolerance"),
    [
        (1e-11, 3390.0, 2e-5, 0.03), (3e-12, 3390.0, 2e-5, 0.03), (5e-11, 3390.0, 2e-5, 0.09),
        (1e-11, 3390.0, 1e-5, 0.06), (1e-11, 3390.0, 5e-5, 0.03), (1e-11, 2500.0, 2e-5, 0.04),
        (1e-11, 5000.0, 2e-5, 0.03),
    ],
)  # fmt: skip
def test_film_thickness_matches_reynolds_solution(record, U, G, W, tolerance):
    """The arguments of the formulas are those of a contact of 10 mm relative radius."""
    radius = np.array([0.010])
    film = Film(MODULUS, 0.01, G / MODULUS)
    velocity, load = U * MODULUS * radius / 0.01, W * MODULUS * radius
    formulas = film.central(velocity, load, radius), film.minimum(velocity, load, radius)
    for name, found, reference in zip(("central", "minimum"), formulas, solve_film(U, G, W), strict=True):
        record(source=SOURCE, case=f"Reynolds' equation, U {U:g}, G {G:g}, W {W:g}", quantity=f"{name} film thickness",
               unit="mm", reference=10.0 * reference, computed=1e3 * float(found[0]), tolerance=tolerance,
               reason="the formulas are powers fitted to such solutions")  # fmt: skip


def test_reduced_modulus_matches_hertz_contact(record):
    """Half width and pressure with the E' of the film give the load: p_max pi b/2 = p, with p_max of `HertzLine`."""
    from flexcam.dynamics import constant
    from flexcam.valvetrain.cam_contact import HertzLine

    line, load, radius = HertzLine(0.014, 207e9, 0.29, constant(0.01), 0.03), np.array([7e4]), np.array([0.01])
    found = 0.5 * math.pi * line.pressure(load * line.width, radius) * half_width(load, radius, line.plane_strain)
    record(source=SOURCE, case="Hertz's half width", quantity="load of the pressure", unit="N/m", reference=7e4,
           computed=float(found[0]), tolerance=1e-12, reason="closed form")  # fmt: skip


def jaeger_temperature(peclet):
    """Return the maximum temperature under a moving source of Hertz's distribution, in units of Blok's formula."""

    def temperature(x):
        def heat(t):
            return (
                math.sqrt(max(1.0 - t * t, 0.0))
                * k0e(abs(peclet * (x - t)))
                * math.exp(peclet * (x - t) - abs(peclet * (x - t)))
            )

        ends = [one for one in (-1.0, x - 5.0 / peclet, x, x + 5.0 / peclet, 1.0) if -1.0 <= one <= 1.0]
        return sum(quad(heat, *pair, limit=200)[0] for pair in pairwise(ends))

    # T = (1/(pi k)) int q exp(L s) K0(L |s|) b ds with q = 2 Q/(pi b) sqrt(1 - t^2) and L = u b/(2 kappa).
    largest = max(temperature(x) for x in np.linspace(0.0, 0.9, 91))
    return 2.0 / math.pi**2 * largest * math.sqrt(2.0 * peclet)


@pytest.mark.parametrize(("peclet", "tolerance"), [(1.0, 0.07), (10.0, 0.003), (100.0, 0.001)])
def test_flash_temperature_matches_jaeger(record, peclet, tolerance):
    """One surface moves, the other is at rest: all heat flows into the first."""
    conductivity, density, heat, b = 46.0, 7800.0, 470.0, 1e-4
    velocity = 2.0 * peclet * conductivity / (density * heat) / b
    effusivity, power = math.sqrt(conductivity * density * heat), 5e4
    arguments = (np.array([one]) for one in (power, b))
    found = flash_temperature(*arguments, effusivity, np.array([velocity]), np.array([0.0]))
    reference = jaeger_temperature(peclet) * power / (effusivity * math.sqrt(b * velocity))
    record(source=SOURCE, case=f"Jaeger's moving source, Peclet number {peclet:g}", quantity="flash temperature",
           unit="K", reference=reference, computed=float(found[0]), tolerance=tolerance,
           reason="conduction along the motion, which the formula neglects")  # fmt: skip


def test_wear_depth_matches_archard(record):
    """A point of the cam passes a flat face at 100 rad/s; load and radius are nearly constant during the passage."""
    speed, load, coefficient, at = 100.0, 5e4, 1e-18, 2.0
    angles = np.linspace(at - 0.03, at + 0.03, 20_001)
    made = profile_at(EVENT, FlatFollower(0.018), angles, 1)
    middle = len(angles) // 2
    points = made.points
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    b = half_width(np.full(len(angles), load), made.radius, MODULUS)
    pressure = 2.0 * load / (math.pi * b) * np.sqrt(np.maximum(1.0 - ((along - along[middle]) / b) ** 2, 0.0))
    rubbed = pressure * np.abs(made.touch.sliding) * speed
    reference = coefficient * np.trapezoid(rubbed, angles / speed)
    found = wear_depth(
        coefficient, np.array([load]), made.touch.sliding[[middle]], cam_surface_velocity(made)[[middle]]
    )
    record(source=SOURCE, case="Archard's law at a point of the cam", quantity="depth per revolution", unit="m",
           reference=float(reference), computed=float(found[0]), tolerance=1e-3,
           reason="the velocities change while the contact passes")  # fmt: skip
