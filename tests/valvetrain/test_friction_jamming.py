"""Friction that bears all that a rigid follower needs: it jams, and no force of the contact balances it."""

from __future__ import annotations

import numpy as np
import pytest

from flexcam.dynamics import constant
from flexcam.valvetrain.rigid_model import RigidFriction


def slid(angle, order):
    """Return the path of a face on a round cam of 10 mm."""
    return 0.01 * angle if order == 0 else np.full_like(angle, 0.01 if order == 1 else 0.0)


@pytest.mark.parametrize(("arm", "jams"), [(0.5, False), (9.9, False), (10.1, True), (-20.0, False)])
def test_a_face_jams_where_friction_alone_holds_it(arm, jams):
    """``f (1 - a mu) = needed`` with mu = 0.1; pushed the other way, friction helps."""
    law = RigidFriction(constant(0.0), 0.1, 1e-3, np.ones(1), (constant(arm),), slid)
    assert law.jams() is jams
