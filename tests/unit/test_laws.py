"""Motion laws: end values, derivatives, characteristic numbers C_v, C_a, C_j.

Table "Motion laws" of the project's brief; R. L. Norton, Cam Design and Manufacturing Handbook, 2nd ed. (2009).
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from flexcam.motion import LAWS

PEAKS = {
    "parabolic": (2.0, 4.0, None),
    "shm": (math.pi / 2, math.pi**2 / 2, math.pi**3 / 2),
    "cycloidal": (2.0, 2 * math.pi, 4 * math.pi**2),
}
"""None: infinite."""

Z = np.linspace(0.0, 1.0, 2001)


@pytest.fixture(params=sorted(LAWS))
def name(request):
    return request.param


def test_ends(name):
    np.testing.assert_allclose(LAWS[name](np.array([0.0, 0.5, 1.0])), [0.0, 0.5, 1.0], atol=1e-15)
    np.testing.assert_allclose(LAWS[name](np.array([0.0, 1.0]), 1), 0.0, atol=1e-14)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_peaks(name, order):
    peak = PEAKS[name][order - 1]
    if peak is not None:
        assert np.abs(LAWS[name](Z, order)).max() == pytest.approx(peak, rel=1e-12)  # the peaks lie on the grid


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_derivatives(name, order):
    # Central differences of the derivative below, h = 1e-5: error h^2/6 of the third derivative above, and eps/h.
    h = 1e-5
    z = Z[(np.abs(Z - 0.5) > 2 * h) & (h < Z) & (1 - h > Z)]
    law = LAWS[name]
    difference = (law(z + h, order - 1) - law(z - h, order - 1)) / (2 * h)
    assert np.abs(law(z, order) - difference).max() <= 1e-6 * (2 * math.pi) ** order


def test_symmetry(name):
    law = LAWS[name]
    np.testing.assert_allclose(law(Z) + law(1 - Z), 1.0, atol=1e-15)


def test_jump_takes_the_right_side():
    law = LAWS["parabolic"]
    assert law.breaks == (0.5,)
    np.testing.assert_array_equal(law(np.array([np.nextafter(0.5, 0), 0.5]), 2), [4.0, -4.0])


@pytest.mark.parametrize("order", [0, 1, 2, 3, 4])
def test_argument_untouched_and_shape_kept(name, order, readonly):
    assert LAWS[name](readonly(Z.reshape(3, 667)), order).shape == (3, 667)
