"""Profiles and efficiency as printed by F. I. T. and R. V. V. Petrescu, Settings of the valve spring (2013)."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flexcam.cams import (
    LAWS,
    FlatFollower,
    LiftEvent,
    cam_profile,
    petrescu_efficiency,
    petrescu_profile,
    relaxed_offset,
)
from flexcam.core.errors import InputError

H, R0, U = 0.006, 0.013, math.pi / 2
COS = LiftEvent(LAWS["cos"], lift=H, rise=U, fall=U)
PHI = np.linspace(0.0, U * (1 - 1e-9), 1001)
S = H / 2 * (1 - np.cos(math.pi * PHI / U))
V = H / 2 * math.pi / U * np.sin(math.pi * PHI / U)
RA = np.sqrt(2 * R0 * S + S**2)


@pytest.mark.parametrize(("relaxed", "arm"), [(True, RA), (False, V)])
def test_printed_formulas(relaxed, arm):
    x = arm * np.cos(PHI) + (R0 + S) * np.sin(PHI)
    y = (R0 + S) * np.cos(PHI) - arm * np.sin(PHI)
    # s near the base circle is the difference of two numbers near one; its root loses half of the digits.
    np.testing.assert_allclose(petrescu_profile(COS, R0, PHI, relaxed=relaxed), np.column_stack([x, y]), atol=1e-10)
    efficiency = arm**2 / ((R0 + S) ** 2 + arm**2)
    np.testing.assert_allclose(petrescu_efficiency(COS, R0, PHI, relaxed=relaxed), efficiency, atol=1e-13)


def test_the_arm_of_the_relaxed_profile():
    """The base circle's tangent up to the height of the follower: r_a^2 + r_0^2 = (r_0 + s)^2."""
    arm = relaxed_offset(COS, R0, PHI)
    np.testing.assert_allclose(arm**2 + R0**2, (R0 + S) ** 2, rtol=1e-14)
    assert arm[-1] == pytest.approx(math.sqrt(2 * 13 * 6 + 36) * 1e-3, rel=1e-12)


def test_radius_of_the_relaxed_profile():
    points = petrescu_profile(COS, R0, PHI)
    np.testing.assert_allclose((points**2).sum(axis=1), (R0 + S) ** 2 + RA**2, rtol=1e-12)
    assert np.hypot(*points[-1]) == pytest.approx(math.hypot(19.0, math.sqrt(192.0)) * 1e-3, rel=1e-9)


def test_the_classical_profile_is_that_of_a_flat_follower():
    made = cam_profile(COS, FlatFollower(R0), count=1440, turn=1)
    np.testing.assert_allclose(petrescu_profile(COS, R0, made.angle, relaxed=False), made.points, atol=1e-17)


def test_only_the_classical_profile_lifts_by_s():
    """The relaxed one stands clear of the face or cuts into it: its points are not where the face touches."""
    classical, relaxed = (petrescu_profile(COS, R0, PHI, relaxed=which) for which in (False, True))
    own = np.exp(1j * PHI[:, None])
    heights = [((p[:, 0] + 1j * p[:, 1])[None, :] * own).imag.max(axis=1) - R0 for p in (classical, relaxed)]
    np.testing.assert_allclose(heights[0], S, atol=1e-8)  # 1001 points: sag (spacing/2)^2/(2 r)
    assert np.abs(heights[1] - S).max() > 1e-3


def test_efficiency_at_the_top_and_on_the_base_circle():
    ends = np.array([0.0, U])
    np.testing.assert_allclose(petrescu_efficiency(COS, R0, ends), [0.0, 192 / (361 + 192)], atol=1e-12)
    np.testing.assert_allclose(petrescu_efficiency(COS, R0, ends, relaxed=False), 0.0, atol=1e-12)
    # The law's velocity is h pi/(2 u) in the middle: 6 mm over 16 mm.
    assert petrescu_efficiency(COS, R0, np.array([U / 2]), relaxed=False)[0] == pytest.approx(
        36 / (256 + 36), rel=1e-12
    )


@pytest.mark.parametrize("base", [0.0, -0.013])
def test_refused_base_circles(base):
    with pytest.raises(InputError, match="base_radius"):
        petrescu_profile(COS, base, PHI)
