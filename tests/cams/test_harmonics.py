"""Periodic lifts, and the harmonics of any lift."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from flexcam.cams import LAWS, HarmonicLift, LiftEvent, PeriodicSpline, Ramp, harmonics
from flexcam.core.errors import InputError

TURN = 2 * math.pi
GRID = np.linspace(0.0, TURN, 721)
AMPLITUDES = st.lists(st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)), min_size=1, max_size=9)
COEFFICIENTS = st.lists(st.floats(-1.0, 1.0), min_size=12, max_size=40)


def smooth_event(**changes):
    return LiftEvent(LAWS["4-5-6-7"], 0.008, 1.1, 1.3, **({"dwell": 0.2, "phase": 0.5} | changes))


class TestHarmonicLift:
    @settings(max_examples=40, deadline=None)
    @given(AMPLITUDES, st.integers(0, 4))
    def test_derivatives_term_by_term(self, amplitudes, order):
        """The derivative of cos(n x) is n^k cos(n x + k pi/2), and so with sin."""
        lift = HarmonicLift(0.3, tuple(a for a, _ in amplitudes), tuple(b for _, b in amplitudes))
        expected = np.full(GRID.shape, 0.3 if order == 0 else 0.0)
        for n, (a, b) in enumerate(amplitudes, start=1):
            turn = n * GRID + order * math.pi / 2
            expected += n**order * (a * np.cos(turn) + b * np.sin(turn))
        np.testing.assert_allclose(lift(GRID, order), expected, rtol=0, atol=1e-14 * 9**order * 20)

    def test_height(self):
        assert HarmonicLift(0.003, (-0.003,), (0.0,)).height == pytest.approx(0.006, rel=1e-12)
        assert HarmonicLift(0.0, (0.3,), (0.4,)).height == pytest.approx(0.5, rel=1e-12)

    @pytest.mark.parametrize(
        ("mean", "cosine", "sine"),
        [(0.0, (1.0,), ()), (0.0, (), ()), (math.nan, (1.0,), (1.0,)), (0.0, (math.inf,), (0.0,))],
    )
    def test_invalid_amplitudes_raise_error(self, mean, cosine, sine):
        with pytest.raises(InputError):
            HarmonicLift(mean, cosine, sine)


class TestPeriodicSpline:
    @settings(max_examples=25, deadline=None)
    @given(COEFFICIENTS, st.integers(0, 4))
    def test_equals_periodic_spline_of_scipy(self, coefficients, order):
        """Same coefficients, with knots continued beyond both ends."""
        n = len(coefficients)
        knots = TURN / n * np.arange(-5, n + 6)
        reference = BSpline(knots, np.array(coefficients + coefficients[:5]), 5)
        found = PeriodicSpline(np.array(coefficients))
        inside = np.linspace(0.0, TURN, 300)[:-1]
        expected = reference(inside, order) if order else reference(inside)
        np.testing.assert_allclose(found(inside, order), expected, rtol=0, atol=1e-12 * float(n) ** order)

    @settings(max_examples=25, deadline=None)
    @given(coefficients=COEFFICIENTS, order=st.integers(1, 4))
    def test_derivatives(self, coefficients, order, derivative_error):
        spline, n = PeriodicSpline(np.array(coefficients)), len(coefficients)
        if np.abs(spline(GRID, order)).max() > 1e-6:
            edges = TURN / n * np.arange(n + 1)
            assert derivative_error(spline, order, edges.tolist()) < 1e-10

    @settings(max_examples=25, deadline=None)
    @given(COEFFICIENTS, st.integers(0, 4), st.integers(-5, 5))
    def test_is_periodic(self, coefficients, order, turns):
        spline, n = PeriodicSpline(np.array(coefficients)), len(coefficients)
        here, there = spline(GRID, order), spline(GRID + turns * TURN, order)
        np.testing.assert_allclose(here, there, rtol=0, atol=1e-12 * float(n) ** (order + 1))

    def test_fourth_derivative_is_continuous_at_knots(self):
        spline = PeriodicSpline(np.random.default_rng(1).standard_normal(20))
        knots = TURN / 20 * np.arange(20)
        np.testing.assert_allclose(
            spline(knots - 1e-9, 4), spline(knots + 1e-9, 4), rtol=0, atol=1e-6 * np.abs(spline(GRID, 4)).max()
        )

    def test_rolled_coefficients_shift_lift_by_one_knot(self):
        c = np.random.default_rng(2).standard_normal(24)
        np.testing.assert_allclose(
            PeriodicSpline(np.roll(c, 1))(GRID + TURN / 24), PeriodicSpline(c)(GRID), rtol=0, atol=1e-13
        )

    @pytest.mark.parametrize("values", [np.ones(11), np.full(20, np.nan), np.ones((12, 2)), []])
    def test_invalid_coefficients_raise_error(self, values):
        with pytest.raises(InputError, match=r"^coefficients"):
            PeriodicSpline(values)

    def test_arguments_are_unchanged_and_shape_preserved(self, readonly):
        values = np.ones(12)
        spline = PeriodicSpline(values)
        values[:] = 7.0
        assert spline(readonly(GRID.reshape(7, 103)), 3).shape == (7, 103)
        assert spline.height == pytest.approx(1.0)


EVENTS = {
    "smooth": smooth_event(),
    "asymmetric with ramps": smooth_event(
        fall_law=LAWS["modified-sine"], ramp=Ramp(2e-4, 0.3), closing_ramp=Ramp(3e-4, 0.4)
    ),
    "parabolic": LiftEvent(LAWS["parabolic"], 0.008, 1.1, 1.3, dwell=0.2, phase=0.5),
    "single dwell": LiftEvent(LAWS["quinquinomial-3"], 0.008, 1.2, 1.2, phase=6.0, single_dwell="low"),
}


@pytest.mark.parametrize("name", EVENTS)
def test_harmonics_of_lift_match_fft(name):
    """65536 samples: aliasing of a lift whose acceleration is bounded is below C/N^2 = 1e-10 of the lift."""
    event, n = EVENTS[name], 65536
    samples = np.fft.rfft(event(np.arange(n) * (TURN / n)))[:41] * (2.0 / n)
    samples[0] *= 0.5
    np.testing.assert_allclose(harmonics(event, 40), samples, rtol=0, atol=1e-9 * event.height)


@pytest.mark.parametrize("name", EVENTS)
def test_parseval(name):
    """The mean square is |c_0|^2 plus half the other squares; the neglected ones fall as n^-6 or faster."""
    event = EVENTS[name]
    grid = np.linspace(0.0, TURN, 100_001)[:-1]
    c = harmonics(event, 300)
    assert abs(c[0]) ** 2 + 0.5 * np.sum(np.abs(c[1:]) ** 2) == pytest.approx(np.mean(event(grid) ** 2), rel=1e-9)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("name", EVENTS)
def test_harmonics_of_derivative_are_lift_harmonics_times_i_n(name, order):
    """Integration by parts: lift and velocity are continuous. The quadrature is exact to rounding between joints."""
    event, n = EVENTS[name], np.arange(31)
    derived = harmonics(event, 30, order)
    np.testing.assert_allclose(
        derived, (1j * n) ** order * harmonics(event, 30), rtol=0, atol=1e-12 * np.abs(derived).max()
    )


@settings(max_examples=20, deadline=None)
@given(AMPLITUDES)
def test_harmonics_of_harmonic_lift_round_trip(amplitudes):
    a, b = (tuple(pair[k] for pair in amplitudes) for k in (0, 1))
    found = harmonics(HarmonicLift(0.2, a, b), len(amplitudes) + 2)
    expected = np.array([0.2, *(x - 1j * y for x, y in amplitudes), 0.0, 0.0])
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13)


def test_simple_harmonic_event_has_one_harmonic():
    found = harmonics(LiftEvent(LAWS["shm"], 0.006, math.pi, math.pi), 6)
    np.testing.assert_allclose(found, [0.003, -0.003, 0, 0, 0, 0, 0], rtol=0, atol=1e-16)


def test_closed_form_of_parabolic_motion():
    """The acceleration is -a within a quarter turn of the nose and a elsewhere, a = 4 lift/pi^2.

    Its c_n are -(4 a/(pi n)) (-1)^n sin(n pi/2); those of the lift are these over -n^2.
    """
    lift = 0.006
    found = harmonics(LiftEvent(LAWS["parabolic"], lift, math.pi, math.pi), 9)
    n = np.arange(1, 10)
    expected = 4 * (4 * lift / math.pi**2) / (math.pi * n**3) * (-1.0) ** n * np.sin(n * math.pi / 2)
    np.testing.assert_allclose(found[1:], expected, rtol=0, atol=1e-15)
    assert found[0].real == pytest.approx(lift / 2, rel=1e-12)


def test_high_harmonics_are_exact():
    """The number of panels follows the count: c_401 of a parabolic lift, 1e-8 of the lift, is as accurate as c_9."""
    n = 401
    found = harmonics(LiftEvent(LAWS["parabolic"], 1.0, math.pi, math.pi), n)
    expected = -16 / math.pi**3 / n**3 * math.sin(n * math.pi / 2)
    assert found[n].real == pytest.approx(expected, abs=1e-14)
    assert abs(found[400]) < 1e-14  # eight points per half wave
