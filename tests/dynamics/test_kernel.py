"""Parts of the compiled kernel, run as Python."""

import numpy as np
import pytest

from flexcam.dynamics.force_laws import LOCAL_ROWS, TRIAL
from flexcam.dynamics.kernel import FORCE_SIZE, LAST_FORCE, TREND, forget_trend, keep_forces

COUNT = 2  # local forces


def at_stages(force, step):
    """Return the forces at the middle and the end of a step of the collocation, which begins at `step`."""
    local = np.zeros((LOCAL_ROWS, 2 * COUNT))
    local[TRIAL] = np.concatenate([force(step + 0.5), force(step + 1.0)])
    return local


@pytest.mark.parametrize(("degree", "steps", "forgotten"), [(2, 1, False), (3, 2, False), (2, 2, True)])
def test_extrapolated_forces_lie_on_polynomial(degree, steps, forgotten):
    """A cubic after two steps; a parabola after the first one and after the first one since a contact opened."""
    coefficients = np.random.default_rng(1).normal(size=(degree + 1, COUNT))

    def force(time):
        return np.polynomial.polynomial.polyval(time, coefficients)

    forces = np.zeros((FORCE_SIZE, 2 * COUNT))
    forces[LAST_FORCE] = np.tile(force(0.0), 2)
    for step in range(steps):
        if forgotten:
            forget_trend(forces)
        keep_forces(2, forces, at_stages(force, step))
    following = at_stages(force, steps)[TRIAL]
    np.testing.assert_allclose(forces[LAST_FORCE] + forces[TREND], following, rtol=0, atol=1e-12 * abs(following).max())
