"""Mirror symmetry and scaling of cam profiles."""

from dataclasses import fields, replace

import numpy as np
import pytest

from flexcam.cams import (
    FlatFollower,
    RollerFollower,
    SwingFlatFollower,
    cam_profile,
    find_profile_faults,
    lift_from_profile,
    minimum_base_radius,
)
from tests.thinning import mostly_slow

ANGLES = np.linspace(0.0, 6.2, 63)


def mirror_follower(follower):
    """Return the mirrored follower and the mirror: across the line of motion, or of centres."""
    if isinstance(follower, FlatFollower):
        return follower, np.array([-1.0, 1.0])
    if isinstance(follower, RollerFollower):
        return replace(follower, offset=-follower.offset), np.array([-1.0, 1.0])
    return replace(follower, side=-follower.side), np.array([1.0, -1.0])


def scale_follower(follower, factor):
    given = {field.name: getattr(follower, field.name) for field in fields(follower) if field.init}
    lengths = {name: value for name, value in given.items() if name != "side" and value is not None}
    return replace(follower, **{name: factor * value for name, value in lengths.items()})


def test_mirrored_follower_has_mirrored_profile(follower, turn, smooth_event):
    other, mirror = mirror_follower(follower)
    made = cam_profile(smooth_event, follower, turn=turn)
    image = cam_profile(smooth_event, other, turn=-turn)
    np.testing.assert_allclose(image.points, made.points * mirror, atol=1e-16)
    np.testing.assert_allclose(image.pitch, made.pitch * mirror, atol=1e-16)
    np.testing.assert_allclose(image.normals, made.normals * mirror, atol=1e-14)
    np.testing.assert_allclose(image.radius, made.radius, rtol=1e-13)
    np.testing.assert_allclose(image.pressure_angle, -made.pressure_angle, atol=1e-14)
    np.testing.assert_allclose(image.touch.sliding, -made.touch.sliding, rtol=1e-13)
    np.testing.assert_allclose(
        lift_from_profile(image.points, other, ANGLES, turn=-turn),
        lift_from_profile(made.points, follower, ANGLES, turn=turn),
        atol=1e-15,
    )


@pytest.mark.parametrize("factor", mostly_slow([1e-3, 1e3]))
def test_profile_scales_with_follower(factor, follower, turn, smooth_event):
    event, large = replace(smooth_event, lift=factor * smooth_event.lift), scale_follower(follower, factor)
    made = cam_profile(smooth_event, follower, turn=turn)
    other = cam_profile(event, large, turn=turn)
    np.testing.assert_allclose(other.points, factor * made.points, atol=1e-16 * factor)
    np.testing.assert_allclose(other.radius, factor * made.radius, rtol=1e-12)
    np.testing.assert_allclose(other.touch.sliding, factor * made.touch.sliding, rtol=1e-12)
    np.testing.assert_allclose(other.normals, made.normals, atol=1e-14)
    np.testing.assert_allclose(other.pressure_angle, made.pressure_angle, atol=1e-14)
    np.testing.assert_allclose(
        lift_from_profile(other.points, large, ANGLES, turn=turn),
        factor * lift_from_profile(made.points, follower, ANGLES, turn=turn),
        atol=1e-15 * factor,
    )


@pytest.mark.parametrize("factor", mostly_slow([1e-3, 1e3], 2))
@pytest.mark.parametrize(
    "kind", mostly_slow([FlatFollower(0.018), SwingFlatFollower(0.018, 0.05, 0.055)], 2), ids=["flat", "swing"]
)
def test_limits_scale_with_follower(factor, kind, smooth_event):
    event, large = replace(smooth_event, lift=factor * smooth_event.lift), scale_follower(kind, factor)
    small = minimum_base_radius(smooth_event, kind, radius=0.004)
    assert minimum_base_radius(event, large, radius=0.004 * factor) == pytest.approx(factor * small, rel=1e-12)
    # Half that base circle is undercut at both scales.
    found = [
        find_profile_faults(cam_profile(e, f.with_base(0.3 * size)))
        for e, f, size in ((smooth_event, kind, small), (event, large, factor * small))
    ]
    assert [one.what for one in found[0]] == [one.what for one in found[1]] != []
    assert [one.angle for one in found[0]] == pytest.approx([one.angle for one in found[1]], abs=1e-6)
    assert found[1][0].value == pytest.approx(factor * found[0][0].value, rel=1e-9)
