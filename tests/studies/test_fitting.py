"""Fits of curves in closed form, without a case behind them: failed trials, derivatives to one side, missing values."""

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
class Known:
    """Points of one curve in closed form, whose runs fail where `fails` says so."""

    variables: tuple
    curve: object
    fails: object = staticmethod(lambda *_: False)
    at, ends = PointEvaluator.at, PointEvaluator.ends

    def rows(self, points):
        failed = Row(Status(Cause.NO_CONVERGENCE, "it broke"))
        return [failed if self.fails(*one) else Row(Status(), history=("curves", self.curve(*one).tobytes()))
                for one in points.tolist()]  # fmt: skip


def measured(values):
    return Measurement("time", INSTANTS, (Curve("y", "y", "N", values),))


def growth(x):
    return np.exp(6.0 * x * INSTANTS)


def test_trials_that_fail_shorten_the_step():
    """A step overshoots to where every run fails; the value lies before."""
    variables, tried = (Variable("x", 0.0, 1.0, start=0.05),), []
    found = fit_curves(Known(variables, growth, lambda x: tried.append(x) or x > 0.605), measured(growth(0.6)))
    assert found.converged
    assert max(tried) > 0.605
    assert found.values == pytest.approx([0.6], rel=1e-6)
    with pytest.raises(RunFailedError, match="it broke"):
        fit_curves(Known(variables, growth, lambda _: True), measured(growth(0.6)))


def test_runs_that_fail_on_one_side_of_a_value():
    """The derivative is then the difference to the other side; where both sides fail, the fit ends."""
    variables = (Variable("offset", -5.0, 5.0, start=0.7), Variable("rate", 0.0, 1.0, start=0.3))
    known = measured(1.0 + growth(0.6) + 1e-3 * np.random.default_rng(0).standard_normal(len(INSTANTS)))
    exact = fit_curves(Known(variables, lambda a, x: a + growth(x)), known)
    for fails in (lambda _, x: x > 0.6003, lambda a, _: a < 0.999, lambda a, x: x > 0.6003 or a < 0.999):
        found = fit_curves(Known(variables, lambda a, x: a + growth(x), fails), known)
        assert found.converged
        assert found.values == pytest.approx(exact.values, rel=1e-5)
        assert found.intervals == pytest.approx(exact.intervals, rel=0.02)
    with pytest.raises(RunFailedError, match="it broke"):
        fit_curves(Known(variables, lambda a, x: a + growth(x), lambda _, x: abs(x - 0.3) > 1e-6), known)


def test_a_value_at_an_end_of_its_interval():
    """Differences stay within the interval, where the model may not be defined beyond."""
    seen = []

    def line(x):
        seen.append(x)
        return x * INSTANTS

    found = fit_curves(Known((Variable("x", 2.0, 3.0, start=0.5),), line), measured(3.2 * INSTANTS))
    assert found.values == pytest.approx([3.0], abs=1e-3)
    assert 2.0 <= min(seen) <= max(seen) <= 3.0


def test_missing_values_and_correlated_ones():
    """Offset and slope of a line seen at its far end only are correlated, over all of it they are less so."""
    variables = (Variable("offset", -5.0, 5.0, start=0.5), Variable("slope", -5.0, 5.0, start=0.5))
    noise = 0.01 * np.random.default_rng(0).standard_normal(len(INSTANTS))
    values = 1.0 + 2.0 * INSTANTS + noise
    seen = Known(variables, lambda a, b: a + b * INSTANTS)
    whole, end = (
        fit_curves(seen, measured(values)),
        fit_curves(seen, measured(np.where(INSTANTS < 0.7, np.nan, values))),
    )
    assert whole.correlated_pairs() == []
    assert end.correlated_pairs() == [(0, 1)]
    exact = np.polyfit(INSTANTS[INSTANTS >= 0.7], values[INSTANTS >= 0.7], 1)[::-1]
    assert end.values == pytest.approx(exact, rel=1e-6)


@pytest.mark.parametrize("count", [1, 2])
def test_values_without_effect(count):
    """They are named as undetermined; no number divides by their zero derivative."""
    variables = tuple(Variable(f"x{i}", 0.0, 1.0, start=0.5) for i in range(count))
    found = fit_curves(Known(variables, lambda *_: 2.0 * INSTANTS), measured(INSTANTS))
    assert sorted(i for group in found.undetermined for i in group) == list(range(count))
    assert np.isinf(found.intervals).all()
    assert found.correlated_pairs() == []


def test_a_start_outside_its_interval_is_refused():
    with pytest.raises(InputError, match=r"^--vary.*contains the value of the case"):
        fit_curves(Known((Variable("x", 0.0, 1.0, start=1.5),), growth), measured(INSTANTS))
