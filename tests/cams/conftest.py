"""Followers of every kind, reference geometry of their cams, and the error of derivatives.

The geometry is derived independently from the definitions of the followers: a translating follower moves up; the
pivot of a swinging follower is at (distance, 0), its arm at an angle to the line of centres, above it where ``side``
is 1.
"""

import math
from itertools import pairwise

import numpy as np
import pytest

from flexcam.cams import (
    LAWS,
    FlatFollower,
    HarmonicLift,
    LiftEvent,
    RollerFollower,
    SwingFlatFollower,
    SwingRollerFollower,
)

POINTS, WEIGHTS = np.polynomial.legendre.leggauss(16)
ROUNDING = 1e-2
"""Weight of the rounding of the underlying curve relative to the derivative's integral: see `derivative_error`."""

FOLLOWERS = {
    "flat": FlatFollower(0.018),
    "roller": RollerFollower(0.018, 0.008),
    "roller right of the axis": RollerFollower(0.018, 0.008, 0.006),
    "roller left of the axis": RollerFollower(0.018, 0.008, -0.006),
    "swinging roller above": SwingRollerFollower(0.020, 0.009, 0.055, 0.060, 1),
    "swinging roller below": SwingRollerFollower(0.020, 0.009, 0.055, 0.060, -1),
    "swinging face above, pivot behind it": SwingFlatFollower(0.018, 0.050, 0.055, 0.004, 1),
    "swinging face below, pivot before it": SwingFlatFollower(0.018, 0.050, 0.055, -0.003, -1),
}


@pytest.fixture(scope="session", params=FOLLOWERS.values(), ids=FOLLOWERS.keys())
def follower(request):
    return request.param


@pytest.fixture(scope="session", params=[1, -1], ids=["counterclockwise", "clockwise"])
def turn(request):
    return request.param


def pytest_itemcollected(item):
    """Run every follower with one sense of rotation in the normal suite, and mark the other one as slow."""
    given = item.callspec.params if hasattr(item, "callspec") else {}
    if {"follower", "turn"} <= given.keys():
        first = list(FOLLOWERS.values()).index(given["follower"]) % 2
        if given["turn"] != (1, -1)[first]:
            item.add_marker(pytest.mark.slow)


@pytest.fixture(scope="session")
def smooth_event():
    """Return a lift with different rise and return, so that a mirrored result is wrong; no cam of it is undercut."""
    return LiftEvent(LAWS["4-5-6-7"], lift=0.003, rise=1.5, fall=1.7, dwell=0.4, phase=0.3)


@pytest.fixture(scope="session")
def harmonic_event():
    """Return a smooth lift without symmetry, whose derivatives follow exactly from its Fourier series."""
    return HarmonicLift(0.003, (-0.0015, 0.0004, -0.0001), (0.0010, -0.0003, 0.0002))


@pytest.fixture(scope="session")
def slope():
    """Return a function that differentiates equally spaced samples of one revolution by Fourier series."""

    def evaluate(values):
        order = np.fft.fftfreq(len(values), 1.0 / len(values))
        derived = np.fft.ifft(1j * order * np.fft.fft(values))
        return derived if np.iscomplexobj(values) else derived.real

    return evaluate


def _arm_angle(follower, lift):
    """Return the angle of the arm or face to the line of centres at a lift, rad."""
    a, r, arm = follower.distance, follower.base_radius, follower.arm
    if isinstance(follower, SwingFlatFollower):
        # The cam's centre is the base radius away from the face and the pivot its offset: a sin psi = r - e.
        return math.asin((r - follower.face) / a) + lift / arm
    pitch = r + follower.roller_radius  # the cosine law
    return math.acos((a**2 + arm**2 - pitch**2) / (2 * a * arm)) + lift / arm


def _centre(follower, lift):
    """Return the centre of the roller in the fixed frame."""
    if isinstance(follower, RollerFollower):
        reach = follower.base_radius + follower.roller_radius
        return follower.offset + 1j * (math.sqrt(reach**2 - follower.offset**2) + lift)
    psi = _arm_angle(follower, lift)
    return follower.distance - follower.arm * np.cos(psi) + 1j * follower.side * follower.arm * np.sin(psi)


def _face_normal(follower, lift):
    """Return the unit normal of a flat face, away from the cam."""
    if isinstance(follower, FlatFollower):
        return 1j * np.ones_like(lift)
    psi = _arm_angle(follower, lift)
    return np.sin(psi) + 1j * follower.side * np.cos(psi)


@pytest.fixture(scope="session")
def arm_angle():
    """Return the angle of a swinging follower to the line of centres, rad."""
    return _arm_angle


@pytest.fixture(scope="session")
def centre():
    """Return the roller's centre in the fixed frame."""
    return _centre


@pytest.fixture(scope="session")
def gap():
    """Return the distance of points of the fixed frame from the follower, m; negative inside of it."""

    def evaluate(follower, lift, point):
        if isinstance(follower, RollerFollower | SwingRollerFollower):
            return np.abs(point - _centre(follower, lift)) - follower.roller_radius
        normal = _face_normal(follower, lift)
        if isinstance(follower, FlatFollower):
            return follower.base_radius + lift - (point * np.conj(normal)).real
        return follower.face - ((point - follower.distance) * np.conj(normal)).real

    return evaluate


@pytest.fixture(scope="session")
def outward():
    """Return the unit normal from the cam into the follower at contact points, in the fixed frame."""

    def evaluate(follower, lift, point):
        if isinstance(follower, RollerFollower | SwingRollerFollower):
            return (_centre(follower, lift) - point) / follower.roller_radius
        return _face_normal(follower, lift)

    return evaluate


@pytest.fixture(scope="session")
def lift_on_circle():
    """Return the lift of a follower on a circle by closed form, from the circle's centre in the fixed frame."""

    def evaluate(follower, middle, radius):
        if isinstance(follower, FlatFollower):
            return middle.imag + radius - follower.base_radius
        if isinstance(follower, RollerFollower):
            reach = np.sqrt((radius + follower.roller_radius) ** 2 - (follower.offset - middle.real) ** 2)
            return middle.imag + reach - _centre(follower, 0.0).imag
        away = follower.distance - middle.real + 1j * follower.side * middle.imag
        if isinstance(follower, SwingRollerFollower):
            reach = radius + follower.roller_radius
            cosine = (follower.arm**2 + np.abs(away) ** 2 - reach**2) / (2 * follower.arm * np.abs(away))
            psi = np.angle(away) + np.arccos(cosine)
        else:
            psi = np.angle(away) + np.arcsin((radius - follower.face) / np.abs(away))
        return follower.arm * (psi - _arm_angle(follower, 0.0))

    return evaluate


def panel_error(curve, order, start, end):
    """Return the maximum difference of integral and rise over panels of one smooth piece, and the scales of both."""
    edges = np.linspace(start, end, 2 + int(40 * (end - start)))
    edges[-1] = np.nextafter(end, start)  # the left limit: the value at a joint is the right limit
    half = 0.5 * np.diff(edges)
    within = (edges[:-1] + half)[:, None] + half[:, None] * POINTS
    derivative, below = curve(within, order), curve(edges, order - 1)
    error = np.abs(derivative @ WEIGHTS * half - np.diff(below)).max()
    return error, np.array([2.0 * half[0] * np.abs(derivative).max(), np.abs(below).max()])


@pytest.fixture(scope="session")
def derivative_error():
    """Return the relative error of a derivative against the next lower one, between joints.

    The integral of the derivative over a short panel is the rise of the lower derivative, independent of any step:
    sixteen Gauss points are exact to rounding for all laws here. A central difference has six digits only. The
    remaining error is rounding: 1e-16 of the lower derivative on each panel, hence 1e-14 in these units.
    """

    def error(curve, order, joints):
        found = [panel_error(curve, order, a, b) for a, b in pairwise(joints)]
        size = np.array([1.0, ROUNDING]) @ np.max([scale for _, scale in found], axis=0)
        return max(e for e, _ in found) / size if size else 0.0

    return error
