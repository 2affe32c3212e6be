"""Edge cases of cam geometry and synthesis that an earlier version got wrong."""

import math

import numpy as np
import pytest

from flexcam.cams import (
    LAWS,
    FlatFollower,
    HarmonicLift,
    LiftEvent,
    Polydyne,
    RollerFollower,
    SingleMass,
    SplineFamily,
    cam_profile,
    find_profile_faults,
    harmonic_fit,
    lift_from_profile,
    minimax,
    off_design_deviation,
    polydyne,
)
from flexcam.core.errors import InputError
from tests.thinning import mostly_slow

AROUND = np.linspace(0.0, 2 * math.pi, 12, endpoint=False)
CIRCLE = 0.02 * np.column_stack([np.cos(AROUND), np.sin(AROUND)])
WANTED = LiftEvent(LAWS["3-4-5"], lift=0.006, rise=1.5, fall=1.3, dwell=1.0, phase=0.4)


def test_bound_over_all_laws_with_one_free_end():
    found = minimax(SplineFamily(degree=5, pieces=24, rest=1, symmetric=False), {"Cj": 1.0}, conditions=[(0.0, 2, 0.0)])
    assert found.bound_all == 12.0
    assert found.objective >= found.bound_all


@pytest.mark.parametrize(
    ("least", "bounds", "rest", "pieces"),
    [
        pytest.param("Cv", {"Ca": 7.0}, 2, 96, marks=pytest.mark.slow),
        ("Ca", {"Cv": 1.3}, 1, 24),
        pytest.param("Cj", {"Ca": 5.0}, 2, 96, marks=pytest.mark.slow),
        ("Cj", {"Ca": 4.3}, 1, 24),
    ],
)
def test_splines_approach_bound_over_all_laws(least, bounds, rest, pieces):
    """The optimum is a trapezoid of velocity or acceleration; 2 % because splines round off its corners."""
    found = minimax(SplineFamily(degree=5, pieces=pieces, rest=rest), {least: 1.0}, bounds=bounds)
    assert 1.0 <= found.objective / found.bound_all <= 1.02


@pytest.mark.slow
@pytest.mark.parametrize("pieces", [48, 72])
def test_minimum_moment_with_many_pieces(pieces):
    """Splines of 24 pieces are a subset of those of 72, whose moment is at most 2.55."""
    assert minimax(SplineFamily(degree=5, pieces=pieces), {"Cm": 1.0}).objective < 2.55


@pytest.mark.slow
def test_minimum_moment_with_free_ends():
    """A local optimum: 16 pieces reach 2.365, 24 pieces 2.325."""
    assert minimax(SplineFamily(degree=5, pieces=16, rest=1), {"Cm": 1.0}).objective < 2.37


def test_minimum_rms_of_default_family():
    found = minimax(SplineFamily(), {"rms": 1.0})
    assert found.objective == pytest.approx(3.5063734769, rel=1e-7)  # linear least squares
    assert found.gap < 1e-6


def test_resonance_within_rounding_is_detected():
    train, speed = SingleMass(2000.0), 2000.0 / 103  # 103*speed/2000 = 1 - 1.1e-16
    made = polydyne(LiftEvent(LAWS["4-5-6-7"], 0.008, 1.5, 1.5), train, speed, count=120)
    plain = Polydyne(made.target, made.target, 0.0)
    assert off_design_deviation(plain, train, [speed]).tolist() == [math.inf]
    assert np.isfinite(off_design_deviation(made, train, [speed])).all(), "which the cam leaves out"


def test_strict_section_ending_between_two_angles():
    fit = harmonic_fit(WANTED, 6, strict=[(6.0, 6.9)], tolerance=1e-6)
    angle = np.linspace(6.0, 6.9, 2001)
    worst = np.abs(fit.event(angle) - WANTED(angle)).max()
    assert worst <= 1.05e-6
    assert fit.strict_deviation == pytest.approx(worst, rel=0.02)


@pytest.mark.parametrize(
    ("event", "tolerance"), [(WANTED, 1e-3), (LiftEvent(LAWS["3-4-5"], 0.006, math.pi, math.pi), 1e-5)]
)
def test_unreachable_bound_is_named_with_valid_remedy(event, tolerance):
    with pytest.raises(InputError) as refusal:
        harmonic_fit(event, 3, tolerance=tolerance, bound=1e-7)
    fault = refusal.value.faults[0]
    assert "bound" in fault.where + fault.given
    assert "allow -0 um" not in fault.remedy
    assert not fault.remedy.startswith("allow 6")  # less than the given tolerance


def test_lift_from_profile_without_angles():
    assert lift_from_profile(CIRCLE, FlatFollower(0.018), []).shape == (0,)


def test_roller_between_two_points():
    lift = lift_from_profile(CIRCLE, RollerFollower(0.018, 0.004), np.linspace(0.0, 1.0, 7))
    np.testing.assert_allclose(lift, 0.002, atol=1e-7)


@pytest.mark.parametrize("count", mostly_slow([90, 180, 360]))
def test_two_contacts_of_almost_equal_height(count):
    """A flat face over a hollow, near the angle where the contact jumps from one flank to the other."""
    p, m = 0.0031, 0.006
    event = HarmonicLift(m, (0.0, -m * math.cos(2 * p)), (0.0, -m * math.sin(2 * p)))
    coarse, fine = (cam_profile(event, RollerFollower(0.018, 0.004), count=n).points for n in (count, 200_000))
    angle = p + np.linspace(-5e-4, 5e-4, 401)
    z = fine[:, 0] + 1j * fine[:, 1]
    brute = np.array([(z * np.exp(1j * a)).imag.max() - 0.018 for a in angle])
    np.testing.assert_allclose(lift_from_profile(coarse, FlatFollower(0.018), angle), brute, atol=1e-9)


def test_spline_family_without_free_coefficients_raises_error():
    with pytest.raises(InputError):
        SplineFamily(degree=6, pieces=1, rest=2, symmetric=True)  # size 0


@pytest.mark.parametrize(
    "condition", [(0.5, 7, 0.6), (1.5, 1, 0.6), (0.5, -1, 0.6), (math.nan, 0, 0.6), (0.3, 0, math.nan)]
)
def test_conditions_out_of_range_raise_error(condition):
    with pytest.raises(InputError):
        minimax(SplineFamily(degree=5, pieces=8), {"Ca": 1.0}, conditions=[condition])


def test_infinite_static_response_raises_error():
    with pytest.raises(InputError, match="harmonic 0"):
        polydyne(WANTED, lambda omega: np.where(omega == 0.0, np.inf, 1.0 + 0j), 100.0)


def test_cutter_is_checked_on_undercut_profile():
    with pytest.raises(InputError, match="cutter"):
        find_profile_faults(
            cam_profile(HarmonicLift(0.006, (0.0, -0.006), (0.0, 0.0)), FlatFollower(0.005)), cutter=-1.0
        )


def test_nan_angle_raises_error():
    with pytest.raises(InputError, match="angle"):
        lift_from_profile(CIRCLE, FlatFollower(0.018), [math.nan])
