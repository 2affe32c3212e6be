"""Fits of closed-form curves without a case: failed trials, one-sided derivatives, missing values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from flexcam import InputError
from flexcam.dynamics import Cause, RunFailedError, Status
from flexcam.studies.fitting import Curve, Measurement, fit_curves
from flexcam.studies.plan import Row
from flexcam.studies.variables import PointEvaluator, Variable

INSTANTS = np.linspace(0.0, 1.0, 21)


@dataclass
class KnownCurve:
    """Evaluator of a closed-form curve, whose runs fail where `fails` returns True."""

    variables: tuple
    curve: object
    fails: object = staticmethod(lambda *_: False)
    at, ends = PointEvaluator.at, PointEvaluator.ends

    def rows(self, points):
        failed = Row(Status(Cause.NO_CONVERGENCE, "it broke"))
        return [failed if self.fails(*one) else Row(Status(), history=("curves", self.curve(*one).tobytes()))
                for one in points.tolist()]  # fmt: skip


def measurement(values):
    return Measurement("time", INSTANTS, (Curve("y", "y", "N", values),))


def growth(x):
    return np.exp(6.0 * x * INSTANTS)


def test_failed_trials_shorten_step():
    """A step overshoots into the range of failing runs; the solution is below it."""
    variables, tried = (Variable("x", 0.0, 1.0, start=0.05),), []
    found = fit_curves(KnownCurve(variables, growth, lambda x: tried.append(x) or x > 0.605), measurement(growth(0.6)))
    assert found.converged
    assert max(tried) > 0.605
    assert found.values == pytest.approx([0.6], rel=1e-6)
    with pytest.raises(RunFailedError, match="it broke"):
        fit_curves(KnownCurve(variables, growth, lambda _: True), measurement(growth(0.6)))


def test_one_sided_derivative_next_to_failing_runs():
    """The derivative is then a one-sided difference; if both sides fail, the fit ends."""
    variables = (Variable("offset", -5.0, 5.0, start=0.7), Variable("rate", 0.0, 1.0, start=0.3))
    known = measurement(1.0 + growth(0.6) + 1e-3 * np.random.default_rng(0).standard_normal(len(INSTANTS)))
    exact = fit_curves(KnownCurve(variables, lambda a, x: a + growth(x)), known)
    for fails in (lambda _, x: x > 0.6003, lambda a, _: a < 0.999, lambda a, x: x > 0.6003 or a < 0.999):
        found = fit_curves(KnownCurve(variables, lambda a, x: a + growth(x), fails), known)
        assert found.converged
        assert found.values == pytest.approx(exact.values, rel=1e-5)
        assert found.intervals == pytest.approx(exact.intervals, rel=0.02)
    with pytest.raises(RunFailedError, match="it broke"):
        fit_curves(KnownCurve(variables, lambda a, x: a + growth(x), lambda _, x: abs(x - 0.3) > 1e-6), known)


def test_solution_at_end_of_interval():
    """Differences stay within the interval, outside of which the model may not be defined."""
    seen = []

    def line(x):
        seen.append(x)
        return x * INSTANTS

    found = fit_curves(KnownCurve((Variable("x", 2.0, 3.0, start=0.5),), line), measurement(3.2 * INSTANTS))
    assert found.values == pytest.approx([3.0], abs=1e-3)
    assert 2.0 <= min(seen) <= max(seen) <= 3.0


def test_missing_and_correlated_values():
    """Offset and slope of a line are correlated if only its far end is observed, and less so for the complete line."""
    variables = (Variable("offset", -5.0, 5.0, start=0.5), Variable("slope", -5.0, 5.0, start=0.5))
    noise = 0.01 * np.random.default_rng(0).standard_normal(len(INSTANTS))
    values = 1.0 + 2.0 * INSTANTS + noise
    seen = KnownCurve(variables, lambda a, b: a + b * INSTANTS)
    whole, end = (
        fit_curves(seen, measurement(values)),
        fit_curves(seen, measurement(np.where(INSTANTS < 0.7, np.nan, values))),
    )
    assert whole.correlated_pairs() == []
    assert end.correlated_pairs() == [(0, 1)]
    exact = np.polyfit(INSTANTS[INSTANTS >= 0.7], values[INSTANTS >= 0.7], 1)[::-1]
    assert end.values == pytest.approx(exact, rel=1e-6)


@pytest.mark.parametrize("count", [1, 2])
def test_variables_without_effect_are_undetermined(count):
    """Variables without effect are listed as undetermined; there is no division by their zero derivative."""
    variables = tuple(Variable(f"x{i}", 0.0, 1.0, start=0.5) for i in range(count))
    found = fit_curves(KnownCurve(variables, lambda *_: 2.0 * INSTANTS), measurement(INSTANTS))
    assert sorted(i for group in found.undetermined for i in group) == list(range(count))
    assert np.isinf(found.intervals).all()
    assert found.correlated_pairs() == []


def test_start_outside_interval_raises_error():
    with pytest.raises(InputError, match=r"^--vary.*contains the value of the case"):
        fit_curves(KnownCurve((Variable("x", 0.0, 1.0, start=1.5),), growth), measurement(INSTANTS))
