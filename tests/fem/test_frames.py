"""Local axes: orthonormal, right-handed, local x along the member, documented default orientation."""

import numpy as np
import pytest

from flexcam.core.errors import InputError
from flexcam.fem.dofs import default_orientation, triads


@pytest.fixture(scope="module")
def random_axes():
    rng = np.random.default_rng(1)
    axes = rng.standard_normal((50, 3))
    return axes / np.linalg.norm(axes, axis=1, keepdims=True), rng.standard_normal((50, 3))


def test_triads_are_rotations(random_axes):
    R = triads(*random_axes)
    np.testing.assert_allclose(R @ R.swapaxes(1, 2), np.broadcast_to(np.eye(3), R.shape), atol=1e-14)
    np.testing.assert_allclose(np.linalg.det(R), 1.0, rtol=1e-13)


def test_x_is_along_member_and_y_towards_orientation(random_axes):
    axes, orientations = random_axes
    R = triads(axes, orientations)
    np.testing.assert_array_equal(R[:, 0], axes)
    assert (np.sum(R[:, 1] * orientations, axis=1) > 0.0).all()
    np.testing.assert_allclose(np.sum(R[:, 2] * orientations, axis=1), 0.0, atol=1e-14)


@pytest.mark.parametrize(
    ("axis", "y", "z"),
    [([1, 0, 0], [0, 1, 0], [0, 0, 1]), ([0, 1, 0], [-1, 0, 0], [0, 0, 1]), ([0, 0, 1], [0, 1, 0], [-1, 0, 0])],
)
def test_default_axes(axis, y, z):
    axis = np.array(axis, float)
    np.testing.assert_array_equal(triads(axis[None], default_orientation(axis)[None])[0], [axis, y, z])


def test_orientation_along_member_raises_error():
    with pytest.raises(InputError, match="element 1"):
        triads(np.eye(3)[[0, 0]], np.array([[0.0, 1.0, 0.0], [2.0, 0.0, 0.0]]))


def test_arguments_are_unchanged(readonly, random_axes):
    axes, orientations = map(readonly, random_axes)
    triads(axes, orientations)
