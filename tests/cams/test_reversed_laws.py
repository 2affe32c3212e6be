"""Laws reversed about their middle."""

import numpy as np
import pytest

from flexcam.cams import LAWS, CompoundCycloid, ReversedLaw, Scca

Z = np.linspace(0.0, 1.0, 1001)
LAWS_AND_MORE = dict(LAWS) | {"fb2, dyadic split": CompoundCycloid(0.375), "trapezoid": Scca(0.5, 0.5, 0.0)}


def points_off_breaks(law):
    """Return points away from jumps, where rounding decides the side."""
    return np.array([z for z in Z if all(abs(z - at) > 1e-9 for at in law.breaks)])


@pytest.mark.parametrize("name", sorted(LAWS_AND_MORE))
def test_reversed_law_is_one_minus_law_from_other_end(name):
    law = LAWS_AND_MORE[name]
    z = points_off_breaks(ReversedLaw(law))
    for order in range(5):
        expected = (order == 0) - (-1.0) ** order * law(1.0 - z, order)
        size = 1 + np.abs(expected).max()
        np.testing.assert_allclose(ReversedLaw(law)(z, order), expected, rtol=0, atol=1e-15 * size)


@pytest.mark.parametrize("name", ["fb2, dyadic split", "parabolic", "trapezoid", "modified-trapezoid"])
def test_reversed_twice_is_original_law_at_jumps(name):
    """Breaks of few binary digits are reversed without rounding: values there are right limits, before and after."""
    law = LAWS_AND_MORE[name]
    at = np.array(law.breaks)
    for order in range(5):
        size = np.abs(law(Z, order)).max()
        np.testing.assert_allclose(ReversedLaw(ReversedLaw(law))(at, order), law(at, order), rtol=0, atol=1e-14 * size)


@pytest.mark.parametrize("split", [0.3, 0.35, 0.1, 0.77])
def test_one_sided_limits_at_reversed_jump(split):
    """The right limit at the reversed break is the left limit of the law, with the same sign of the jerk: -A pi/p."""
    law = CompoundCycloid(split)
    turned = ReversedLaw(law)
    (at,) = turned.breaks
    assert at == pytest.approx(1.0 - split)
    right, left = turned(np.array([at, np.nextafter(at, 0.0)]), 3)
    below, above = law(np.array([np.nextafter(split, 0.0), split]), 3)
    assert right == pytest.approx(below, rel=1e-12)
    assert left == pytest.approx(above, rel=1e-12)
