"""Optimization of problems with known solution, without a case: evolution, trust region, gradient and front."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import pytest

from flexcam.core.errors import InputError
from flexcam.dynamics import Cause, Status
from flexcam.studies import gradients
from flexcam.studies.optimization import (
    Goal,
    OptimizationProblem,
    is_active,
    optimize,
    pareto_indices,
    parse_constraint,
    parse_constraints,
)
from flexcam.studies.plan import Row
from flexcam.studies.variables import PointEvaluator, Variable, WorstCase


@dataclass
class KnownFunctions:
    """Evaluator of closed-form functions in place of the runs of a case."""

    functions: dict
    variables: tuple = (Variable("x", 0.0, 4.0), Variable("y", 0.0, 4.0))
    calls: list = field(default_factory=list)
    case = None
    at, ends = PointEvaluator.at, PointEvaluator.ends

    def rows(self, points):
        self.calls.append(len(points))
        return [self._row(point) for point in points]

    def _row(self, point):
        if "fails" in self.functions and self.functions["fails"](*point):
            return Row(Status(Cause.NO_CONVERGENCE, "it broke"))
        found = {name: float(f(*point)) for name, f in self.functions.items() if name != "fails"}
        return Row(Status(), found, dict.fromkeys(found, "N"))


CORNER = {"sum": lambda x, y: x + 2.0 * y, "product": lambda x, y: x * y}
"""Minimum of x + 2 y with x y >= 2: x = 2, y = 1, value 4 (Lagrange)."""


def test_optimum_at_bound():
    known = KnownFunctions(CORNER)
    design = OptimizationProblem(known, (Goal("sum"),), parse_constraints(["product >= 2 N"]))
    found = optimize(design, evaluations=200)
    best = found.best
    assert best is not None
    np.testing.assert_allclose(found.points[best], [2.0, 1.0], atol=0.02)
    assert found.costs[best, 0] == pytest.approx(4.0, abs=2e-3)
    assert found.rows[best].scalars["product"] >= 2.0 * (1.0 - 1e-9)
    assert is_active(found.violations[best, 0])
    assert len(found.points) <= 230


def test_maximum_with_failing_variants():
    """Maximum of a hill whose top fails: the optimum is at the border of the failing range."""
    known = KnownFunctions({"hill": lambda x, y: -((x - 3.0) ** 2) - (y - 1.0) ** 2, "fails": lambda x, y: x > 2.5})
    found = optimize(OptimizationProblem(known, (Goal("hill", most=True),)), evaluations=250)
    assert found.best is not None
    np.testing.assert_allclose(found.points[found.best], [2.5, 1.0], atol=0.03)
    assert any(not row.status.ok for row in found.rows)


def test_infeasible_constraints_have_no_best_variant():
    found = optimize(
        OptimizationProblem(KnownFunctions(CORNER), (Goal("sum"),), parse_constraints(["product >= 20 N"])),
        evaluations=60,
    )
    assert found.best is None
    np.testing.assert_allclose(found.points[found.nearest], [4.0, 4.0], atol=0.1)


@pytest.fixture
def fractions(monkeypatch):
    """Return a function that creates variables from 0 to 1 with given starts."""
    monkeypatch.setattr(gradients, "interval_widths", lambda _case, variables: np.ones(len(variables)))
    return lambda **starts: tuple(Variable(name, 0.0, 1.0, "", start) for name, start in starts.items())


class Polygon(KnownFunctions):
    """The sum x + 0.7 y within a polygon of 24 sides, whose maximum excess is one of 24 extremes."""

    normals = np.stack([np.cos(np.pi * np.arange(24) / 12.0), np.sin(np.pi * np.arange(24) / 12.0)], axis=1)

    def _row(self, point):
        excess = self.normals @ (np.array(point) - 2.0) - 1.5
        worst = int(excess.argmax())
        others = [(excess[i] - excess[worst], *self.normals[i]) for i in range(24) if i != worst]
        scalars, units = {"sum": point[0] + 0.7 * point[1], "excess": 1.0 + excess[worst]}, {"sum": "1", "excess": "1"}
        slopes = {"sum": (1.0, 0.7), "excess": tuple(self.normals[worst])}
        return Row(Status(), scalars, units, derivatives=slopes, extremes={"excess": tuple(others)})


def test_gradient_search_uses_all_extremes(monkeypatch):
    """The search finds the corner at 37.5 deg in four variants; with the maximum only, the error is then 9e-5.

    A step keeps 1e-6 of a bound: tolerance 1e-5.
    """
    monkeypatch.setattr(gradients, "interval_widths", lambda _case, _variables: np.array([4.0, 4.0]))
    design = OptimizationProblem(Polygon({}), (Goal("sum", most=True),), parse_constraints(["excess <= 1"]))
    found, corner = gradients.optimize_by_gradient(design, evaluations=4), math.radians(37.5)
    best = 3.4 + 1.5 * (math.cos(corner) + 0.7 * math.sin(corner)) / math.cos(math.pi / 24.0)
    assert -found.costs[found.best, 0] == pytest.approx(best, abs=1e-5)


def test_gradient_search_ends_at_zero_goal(fractions):
    """A goal of zero with zero slope, such as the force of an open contact."""

    class ZeroForce(KnownFunctions):
        def _row(self, _point):
            return Row(Status(), {"force": 0.0}, {"force": "N"}, derivatives={"force": (0.0,)})

    points = ZeroForce({}, fractions(x=0.5))
    design = OptimizationProblem(points, (Goal("force", most=True),), parse_constraints(["force >= 1 N"]))
    found = gradients.optimize_by_gradient(design, evaluations=5)
    assert found.costs[found.nearest, 0] == 0.0
    assert found.is_flat


def test_gradient_search_with_curved_constraint(fractions):
    """Minimum of 1 + x + y within an ellipse about (0.5, 0.5), with a half axis of 0.1 or less.

    The search ends with a box of a thousandth of the intervals: tolerance 1e-3.
    """
    H = np.array([[1.0 + 16.0 * 0.3**2, -16.0 * 0.3], [-16.0 * 0.3, 16.0]]) / 0.1**2

    class Ellipse(KnownFunctions):
        def _row(self, point):
            d = np.array(point) - 0.5
            slopes = {"sum": (1.0, 1.0), "square": tuple(2.0 * H @ d)}
            values = {"sum": 1.0 + sum(point), "square": d @ H @ d}
            return Row(Status(), values, dict.fromkeys(slopes, "1"), derivatives=slopes)

    points = Ellipse({}, fractions(x=0.55, y=0.5))
    design = OptimizationProblem(points, (Goal("sum"),), parse_constraints(["square <= 1"]))
    found = gradients.optimize_by_gradient(design, evaluations=80)
    least = 2.0 - np.sqrt(np.ones(2) @ np.linalg.solve(H, np.ones(2)))
    assert found.costs[found.best, 0] == pytest.approx(least, abs=1e-3)


def test_gradient_search_ends_with_wrong_slope(fractions, monkeypatch):
    """Two points whose order depends on the penalty of a violation do not alternate endlessly."""
    lowest, steps = gradients._lowest, list[object]()

    def count_steps(*given):
        steps.append(None)
        assert len(steps) < 200
        return lowest(*given)

    class WrongSlope(KnownFunctions):
        def _row(self, point):
            slopes = {"cost": (1.0,), "lift": (0.1,)}
            return Row(Status(), dict.fromkeys(slopes, point[0]), dict.fromkeys(slopes, "1"), derivatives=slopes)

    monkeypatch.setattr(gradients, "_lowest", count_steps)
    points = WrongSlope({}, fractions(x=0.2))
    design = OptimizationProblem(points, (Goal("cost"),), parse_constraints(["lift >= 0.6"]))
    assert gradients.optimize_by_gradient(design, evaluations=80).best is not None


def test_front_of_two_parabolas():
    """(x - 1)^2 + y^2 against (x - 3)^2 + y^2: the front is y = 0, 1 <= x <= 3, with sqrt f1 + sqrt f2 = 2."""
    pytest.importorskip("pymoo")
    known = KnownFunctions({"left": lambda x, y: (x - 1.0) ** 2 + y**2, "right": lambda x, y: (x - 3.0) ** 2 + y**2})
    found = optimize(OptimizationProblem(known, (Goal("left"), Goal("right"))), evaluations=960)
    best = pareto_indices(found)
    assert len(best) > 20
    roots = np.sqrt(found.costs[best]).sum(axis=1)
    assert np.median(roots) < 2.05
    assert found.costs[best][0, 0] < 0.05
    assert found.costs[best][-1, 1] < 0.05
    assert (np.diff(found.costs[best][:, 1]) < 0.0).all()


def test_constraints_with_units():
    one = parse_constraint("contacts.intake.force.largest <= 2 kN")
    assert one.bound("N") == 2000.0
    assert one.violation(2200.0, "N") == pytest.approx(0.1)
    assert parse_constraint("limits.loss_of_contact >= 7000 rpm").bound("rpm") == pytest.approx(7000.0)
    assert parse_constraint("limits.loss_of_contact >= 7000 rpm").bound("crank rpm") == pytest.approx(7000.0)
    assert parse_constraint("frequency.1 >= 0.9 kHz").bound("Hz") == pytest.approx(900.0)
    assert parse_constraint("deviation.peak <= 0.05").bound("1") == 0.05
    assert parse_constraint("contacts.intake.force.least >= 0").bound("N") == 0.0
    with pytest.raises(InputError, match="Add the unit, such as MPa"):
        parse_constraint("springs.valve.stress.largest <= 800").bound("Pa")
    assert parse_constraint("deviation.peak <= 5 %").bound("1") == pytest.approx(0.05)
    assert parse_constraint("limits.loss_of_contact >= 7000").bound("crank rpm") == 7000.0
    assert parse_constraint("cams.intake.deceleration <= 25 mm/rad^2").bound("m/rad^2") == pytest.approx(0.025)
    with pytest.raises(InputError):
        one.bound("m")


@pytest.mark.parametrize("text", ["", "x", "x < 3", "x <= ", "<= 3", "x <= many", "x == 3", "x <= 3 parsec"])
def test_invalid_constraints_raise_error(text):
    with pytest.raises(InputError):
        parse_constraint(text)


def test_only_worst_conditions_are_differentiated():
    """The maximum force is at the second of three conditions, the minimum gap at the third; the cost is constant."""
    names, values = ("force", "gap", "cost"), {"1": (5.0, 3.0, 4.0), "2": (9.0, 2.0, 4.0), "3": (7.0, 1.0, 4.0)}
    more = {"2": {"gap": ((-1.0, 5.0),)}, "3": {"force": ((-0.5, 7.0),)}}  # a smaller gap would be the minimum
    derived = list[tuple[str, ...]]()

    def runs(variants):
        return (Row(Status(), dict(zip(names, values[at], strict=True))) for _, at in variants)

    def derive(variants):
        derived.extend(variants)
        slopes = ((at, dict.fromkeys(names, (float(at),))) for _, at in variants)
        return (Row(Status(), derivatives=found, extremes=more[at]) for at, found in slopes)

    worst = WorstCase((("1",), ("2",), ("3",)), {"force": True, "gap": False, "cost": True})
    (row,) = worst.over(runs, derive)([("x",)])
    assert row.scalars == {"force": 9.0, "gap": 1.0, "cost": 4.0}
    assert (row.derivatives["force"], row.derivatives["gap"]) == ((2.0,), (3.0,))
    assert derived == [("x", "2"), ("x", "3")]
    assert set(row.extremes["force"]) == {
        (-2.0, 3.0),
        (-2.5, 7.0),
    }  # value at the third condition and its local extreme
    assert set(row.extremes["gap"]) == {(1.0, 2.0)}
