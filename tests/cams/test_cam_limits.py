"""Profile faults and the minimum base circle, for lifts whose limits have a closed form."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flexcam.cams import (
    LAWS,
    FlatFollower,
    HarmonicLift,
    LiftEvent,
    RollerFollower,
    SwingFlatFollower,
    SwingRollerFollower,
    cam_profile,
    curve_minimum,
    find_profile_faults,
    minimum_base_radius,
)
from flexcam.core.errors import InputError
from tests.thinning import mostly_slow

M = 0.002
SECOND_HARMONIC = HarmonicLift(M, (0.0, -M), (0.0, 0.0))
"""s = m (1 - cos 2 theta): s'' = 4 m at the bottom, 0 and 180 deg, and -4 m at the top, 90 and 270 deg."""

FIRST_HARMONIC = HarmonicLift(M, (-M,), (0.0,))
"""s = m (1 - cos theta): the cam is an eccentric circle under a flat face, and nearly one under a roller."""

STEEP = math.radians(89.0)
"""Limit of the pressure angle that no cam here exceeds."""


def find_undercuts(profile):
    return [one for one in find_profile_faults(profile, pressure_angle=STEEP) if "undercut" in one.what]


@pytest.mark.parametrize(("base", "cut"), [(2 * M * 0.999, True), (2 * M * 1.001, False)])
def test_undercut_under_flat_face(base, cut, turn):
    """The radius r0 + m + 3 m cos 2 theta has its minimum r0 - 2 m at the top."""
    found = find_undercuts(cam_profile(SECOND_HARMONIC, FlatFollower(base), turn=turn))
    assert bool(found) == cut
    for one in found:
        assert min(abs(one.angle - at) for at in (math.pi / 2, 3 * math.pi / 2)) < 1e-6
        assert one.value == pytest.approx(base - 2 * M, rel=1e-9)
        assert one.limit == 0.0


@pytest.mark.parametrize(("part", "cut"), [(1.001, True), (0.999, False)])
def test_undercut_under_roller(part, cut, turn):
    """At the top the radius of the pitch curve is (R + s)^2/(R + s - s''); the roller must be smaller."""
    reach = 0.020
    pitch = (reach + 2 * M) ** 2 / (reach + 6 * M)
    follower = RollerFollower(reach - part * pitch, part * pitch)
    found = find_undercuts(cam_profile(SECOND_HARMONIC, follower, turn=turn))
    assert bool(found) == cut
    for one in found:
        assert min(abs(one.angle - at) for at in (math.pi / 2, 3 * math.pi / 2)) < 1e-6
        assert one.value == pytest.approx(pitch * (1 - part), rel=1e-6)


def test_hollow_is_undercut_for_flat_face_only(turn):
    """In the hollow the pitch curve has radius R^2/(4 m - R) and its centre outside: any roller fits."""
    deep = HarmonicLift(0.006, (0.0, -0.006), (0.0, 0.0))
    made = cam_profile(deep, RollerFollower(0.016, 0.004), turn=turn)
    assert made.radius.min() < -0.02
    assert not find_undercuts(made)
    assert find_undercuts(cam_profile(deep, FlatFollower(0.010), turn=turn))


@pytest.mark.parametrize(("part", "steep"), [(0.999, True), (1.001, False)])
def test_pressure_angle_of_eccentric(part, steep, turn):
    """The ratio s'/(R + s) = m sin t/(R + m - m cos t) has its maximum at cos t = m/(R + m): sin phi = m/(R + m)."""
    follower, k = RollerFollower(0.002, 0.004), M / (0.006 + M)
    made = cam_profile(FIRST_HARMONIC, follower, turn=turn, count=12)
    found = find_profile_faults(made, pressure_angle=part * math.asin(k))
    assert [one.what for one in found] == ["pressure angle too large"] * steep
    for one in found:
        # On rise or return, at the same distance from the top.
        assert min(one.angle, 2 * math.pi - one.angle) == pytest.approx(math.acos(k), abs=1e-6)
        assert one.value == pytest.approx(math.asin(k), rel=1e-10)
        assert one.limit == part * math.asin(k)


@pytest.mark.parametrize(("part", "large"), [(1.001, True), (0.999, False)])
def test_cutter_larger_than_hollow_is_fault(part, large, turn):
    """The hollow is at the bottom; its radius is R^2/(4 m - R) plus that of the roller."""
    deep = HarmonicLift(0.006, (0.0, -0.006), (0.0, 0.0))
    hollow = 0.020**2 / (0.024 - 0.020) + 0.004
    made = cam_profile(deep, RollerFollower(0.016, 0.004), turn=turn)
    found = find_profile_faults(made, pressure_angle=STEEP, cutter=part * hollow)
    assert [one.what for one in found] == ["the concave radius is smaller than the cutter"] * large
    for one in found:
        assert min(abs(one.angle - at) for at in (0.0, math.pi)) < 1e-6
        assert one.value == pytest.approx(hollow, rel=1e-9)
        assert one.limit == part * hollow


def test_convex_cam_fits_any_cutter():
    assert not find_profile_faults(cam_profile(FIRST_HARMONIC, FlatFollower(0.018)), cutter=10.0)


@pytest.mark.parametrize("cutter", [0.0, -0.01, math.nan])
def test_invalid_cutter_raises_error(cutter):
    with pytest.raises(InputError, match="cutter"):
        find_profile_faults(cam_profile(FIRST_HARMONIC, FlatFollower(0.018)), cutter=cutter)


@given(m=st.floats(0.0005, 0.003), n=st.integers(2, 4), radius=st.floats(0.0002, 0.01))
@settings(max_examples=10, deadline=None)
def test_minimum_base_circle_of_flat_face(m, n, radius):
    """The radius is r0 + s + s'': r0 = radius - min(s + s''), here n^2 m - 2 m at the top, a point of the grid."""
    event = HarmonicLift(m, (0.0,) * (n - 1) + (m,), (0.0,) * n)
    least = radius + (n**2 - 2) * m
    assert minimum_base_radius(event, FlatFollower(0.018), radius=radius) == pytest.approx(least, rel=1e-12)


def test_minimum_base_circle_of_flat_face_with_base_dwell():
    event = LiftEvent(LAWS["3-4-5"], lift=0.006, rise=1.2, fall=1.5)
    least = 0.003 - curve_minimum(lambda angle: event(angle) + event(angle, 2), event.joints).value
    assert minimum_base_radius(event, FlatFollower(0.018), radius=0.003) == pytest.approx(least, rel=1e-10)


@pytest.mark.parametrize("limit", [10.0, 15.0, 25.0])
def test_minimum_base_circle_from_pressure_angle(limit, turn):
    """The closed form of the eccentric is sin phi = m/(R + m)."""
    alpha = math.radians(limit)
    reach = M / math.sin(alpha) - M
    found = minimum_base_radius(FIRST_HARMONIC, RollerFollower(0.018, 0.001), pressure_angle=alpha, turn=turn)
    assert found == pytest.approx(reach - 0.001, rel=1e-9)


FOLLOWERS = {
    "flat": FlatFollower(0.018),
    "roller beside the axis": RollerFollower(0.018, 0.006, 0.003),
    "swinging roller": SwingRollerFollower(0.020, 0.009, 0.055, 0.060, 1),
    "swinging roller below": SwingRollerFollower(0.020, 0.009, 0.055, 0.060, -1),
    "swinging face": SwingFlatFollower(0.018, 0.050, 0.055, 0.002, 1),
}


@pytest.mark.parametrize(("kind", "turn"), mostly_slow([(kind, turn) for kind in FOLLOWERS for turn in (-1, 1)], 3))
def test_minimum_base_circle_is_tight(kind, turn, smooth_event):
    follower, limit, radius = FOLLOWERS[kind], math.radians(28.0), 0.004

    def fits(base):
        made = cam_profile(smooth_event, follower.with_base(base), count=1440, turn=turn)
        convex = made.radius[made.radius > 0.0]
        return not find_profile_faults(made, pressure_angle=limit) and convex.min() >= radius

    least = minimum_base_radius(smooth_event, follower, pressure_angle=limit, radius=radius, turn=turn)
    assert fits(least)
    assert not fits(0.999 * least)


def test_unreachable_limits_raise_error():
    with pytest.raises(InputError, match="longer event or wider limits"):
        minimum_base_radius(FIRST_HARMONIC, RollerFollower(0.018, 0.004), radius=1.0)
    with pytest.raises(InputError, match="base_radius"):
        minimum_base_radius(FIRST_HARMONIC, RollerFollower(0.018, 0.004), pressure_angle=1e-4)
