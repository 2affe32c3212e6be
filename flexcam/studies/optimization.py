"""Optimization of a case: goals, constraints, and searches without derivatives (by gradients: `gradients`)."""

# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from flexcam.core import FloatArray
from flexcam.core.errors import InputError, parse_all, refuse, require_packages
from flexcam.core.units import DIMENSIONS, NUMBER, RPM, conversion_factor, input_unit, unit_of
from flexcam.studies.plan import Row, check_seed
from flexcam.studies.variables import PointEvaluator

_CONSTRAINT = re.compile(r"\s*([^<>=]+?)\s*(<=|>=)\s*([^<>=]+?)\s*$")
_FAILED_VIOLATION = 1e6  # violation of every constraint if a variant has no value: larger than any regular one

ROUNDING = 1e-9  # tolerance of a bound for rounding, relative to the bound
_ACTIVE_TOLERANCE = 0.01  # distance from a bound, relative to the bound, within which a constraint is active


@dataclass(frozen=True)
class Goal:
    """Quantity to be minimized or maximized."""

    name: str  #: name of the quantity (`flexcam.studies.quantities`), or a key of the case
    most: bool = False  #: whether to maximize it

    @property
    def words(self) -> str:
        """Description, such as ``min springs.valve.force.largest``."""
        return f"{'max' if self.most else 'min'} {self.name}"


@dataclass(frozen=True)
class Constraint:
    """Bound of a quantity."""

    name: str  #: name of the quantity
    relation: Literal["<=", ">="]  #: whether the bound is an upper or a lower limit
    text: str  #: bound as given; with a unit if the quantity has one that a case may contain

    @property
    def words(self) -> str:
        """Text of the constraint as given."""
        return f"{self.name} {self.relation} {self.text}"

    def bound(self, unit: str) -> float:
        """Return the bound in the unit of its quantity."""
        number, text_unit = _split_bound(self.text)
        base_unit = "rad/s" if unit.endswith("rpm") else unit
        if text_unit:
            try:
                factor = conversion_factor(text_unit, base_unit, "--subject")
            except InputError:
                allowed = f"a bound with {unit_of(base_unit)}"
                raise refuse("--subject", self.words, allowed, "units differ") from None
            return number * factor / (RPM if unit.endswith("rpm") else 1.0)
        if number and unit and unit in {kind.si for kind in DIMENSIONS.values()}:
            remedy = f"add the unit, such as {input_unit(unit)[1]}"
            raise refuse("--subject", self.words, "a bound with its unit", "", remedy)
        return number

    def violation(self, value: float, unit: str) -> float:
        """Return the violation of the bound by a value, relative to the bound; negative if it is satisfied."""
        bound = self.bound(unit)
        size = abs(bound) or 1.0
        return (value - bound if self.relation == "<=" else bound - value) / size


def parse_constraint(text: str) -> Constraint:
    """Parse a constraint."""
    match = _CONSTRAINT.match(text)
    if match is None:
        allowed, remedy = "NAME <= VALUE or NAME >= VALUE, in quotes", "use <= or >=, as in 'frequency.1 >= 900 Hz'"
        raise refuse("--subject", repr(text), allowed, "", remedy)
    _split_bound(match[3])
    return Constraint(match[1], "<=" if match[2] == "<=" else ">=", match[3])


def parse_constraints(texts: Sequence[str]) -> tuple[Constraint, ...]:
    """Parse several constraints."""
    return tuple(parse_all(parse_constraint, texts))


def _split_bound(text: str) -> tuple[float, str]:
    """Return the number and the unit of a bound, which may be empty."""
    match = NUMBER.match(text)
    if match is None:
        raise refuse("--subject", repr(text), "a number with a unit after <= or >=", "it does not begin with a number")
    conversion_factor(match[2], match[2], "--subject")  # the unit is known
    return float(match[1]), match[2]


def row_value(row: Row, name: str) -> float:
    """Return a quantity of a row; infinite for a limit that is not met, otherwise NaN if missing."""
    missing = math.inf if name.startswith("limits.") and row.status.ok else math.nan
    return row.scalars.get(name, missing)


def is_feasible(violations: FloatArray) -> NDArray[np.bool_]:
    """Return which variants satisfy all constraints."""
    return np.asarray((violations <= ROUNDING).all(axis=1))


def is_active(violation: float) -> bool:
    """Return whether a constraint is active: the value is within a hundredth of the bound."""
    return violation >= -_ACTIVE_TOLERANCE


_POINTS_PER_VARIABLE, _MIN_POINTS, _MAX_POINTS = 6, 12, 64  # points of a generation; twice as many for two goals
_GLOBAL_FRACTION = 0.7  # fraction of the evaluations for the global search; the others refine the best variant
_TRUST_RADIUS = 0.05  # initial radius of the trust region relative to the intervals
_LARGE_COST = 1e30
_MAX_VIOLATION = 10.0  # maximum violation passed to the models of the constraints


@dataclass(frozen=True, eq=False)
class OptimizationProblem:
    """Optimization problem."""

    points: PointEvaluator  #: evaluated points; variables stay within their intervals
    goals: tuple[Goal, ...]  #: one goal, or two for a Pareto front
    bounds: tuple[Constraint, ...] = ()  #: constraints

    @property
    def start(self) -> FloatArray | None:
        """Point of the case as fractions of the intervals, shape (k,); None if it is outside of an interval."""
        parts = [variable.start for variable in self.points.variables]
        known = [part for part in parts if part is not None and 0.0 <= part <= 1.0]
        return np.array(known) if len(known) == len(parts) else None

    def unit(self, name: str, rows: Sequence[Row]) -> str:
        """Return the unit of a quantity; empty for a dimensionless one."""
        unit = next((row.units[name] for row in rows if name in row.units), "")
        return "" if unit == "1" else unit


@dataclass(frozen=True, eq=False)
class Evaluations:
    """All evaluations of a search in their order."""

    points: FloatArray  #: points in the units of the variables, shape (m, k)
    parts: FloatArray  #: the same points as fractions of the intervals
    rows: tuple[Row, ...]  #: one row per point
    costs: FloatArray  #: quantities to be minimized, shape (m, goals)
    violations: FloatArray  #: violations of the constraints, shape (m, bounds + 1)
    stopped: bool = False  #: whether Ctrl-C ended the search early
    is_flat: bool = False  #: whether the goal of a gradient search has no slope at its first start

    @property
    def best(self) -> int | None:
        """Index of the best variant that satisfies all constraints; None if there is none."""
        feasible = np.flatnonzero(is_feasible(self.violations))
        return int(feasible[np.argmin(self.costs[feasible, 0])]) if len(feasible) else None

    @property
    def nearest(self) -> int:
        """Index of the variant with the smallest violation."""
        excess = np.maximum(self.violations, 0.0).sum(axis=1)
        return int(np.argmin(excess))

    def distance_to_violation(self, at: int, bound: int) -> float:
        """Return the maximum distance, in fractions of an interval, to the nearest variant that violates a constraint.

        Discontinuous quantities, such as lost contact, have no slack: this distance shows whether they are active.
        Infinite if no variant violates the constraint; zero if the variant itself does.
        """
        violating = (self.violations[:, bound] > 0.0) & np.array([row.status.ok for row in self.rows])
        steps = np.abs(self.parts - self.parts[at]).max(axis=1)
        return float(steps[violating].min(initial=np.inf))


class ProblemEvaluator:
    """Evaluates points of an optimization problem and keeps their rows in order."""

    def __init__(self, design: OptimizationProblem) -> None:
        self.design = design
        self._rows: dict[tuple[float, ...], Row] = {}

    @property
    def count(self) -> int:
        """Number of points evaluated so far."""
        return len(self._rows)

    def evaluate(self, parts: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return costs, (m, goals), and violations, (m, bounds + 1), at fractions of the intervals, shape (m, k)."""
        return self.judge(self.rows(parts))

    def rows(self, parts: FloatArray) -> list[Row]:
        """Return the rows at fractions of the intervals, shape (m, k)."""
        points = [tuple(point) for point in self.design.points.at(np.clip(parts, 0.0, 1.0)).tolist()]
        new = [point for point in dict.fromkeys(points) if point not in self._rows]
        if new:
            for point, row in zip(new, self.design.points.rows(np.array(new)), strict=True):
                self._rows[point] = row
        return [self._rows[point] for point in points]

    def judge(self, rows: Sequence[Row]) -> tuple[FloatArray, FloatArray]:
        """Return the costs of rows, and the relative violations of the constraints with a zero for a complete run."""
        goals, bounds = self.design.goals, self.design.bounds
        values = np.array([[row_value(row, goal.name) for goal in goals] for row in rows], dtype=float)
        signed = values.reshape(len(rows), len(goals)) * np.array([-1.0 if goal.most else 1.0 for goal in goals])
        violations = np.full((len(rows), len(bounds) + 1), _FAILED_VIOLATION)
        for i, row in enumerate(rows):
            results = [(bound, row_value(row, bound.name), row.units.get(bound.name, "rpm")) for bound in bounds]
            if row.status.ok and not np.isnan([*values[i], *(value for _, value, _ in results)]).any():
                violations[i] = [*(min(b.violation(x, unit), _FAILED_VIOLATION) for b, x, unit in results), 0.0]
        return np.where(np.isnan(signed), math.inf, signed), np.maximum(violations, -_FAILED_VIOLATION)

    def evaluations(self) -> Evaluations:
        """Return all evaluations so far."""
        points, rows, (low, high) = np.array(list(self._rows)), tuple(self._rows.values()), self.design.points.ends
        return Evaluations(points, (points - low) / (high - low), rows, *self.judge(rows))

    def run_search(self, search: Callable[[], None]) -> Evaluations:
        """Run a search and return all evaluations, even after Ctrl-C."""
        try:
            search()
        except KeyboardInterrupt:
            if not self.count:
                raise
            return replace(self.evaluations(), stopped=True)
        return self.evaluations()


def optimize(design: OptimizationProblem, *, evaluations: int = 200, seed: int = 0) -> Evaluations:
    """Search for the best variant that satisfies all constraints, or for the Pareto front of two goals.

    Differential evolution (R. Storn and K. Price, J. Global Optim. 11 (1997) 341) evaluates whole generations, with
    constraints before the goal: J. Lampinen, Proc. CEC (2002) 1468. Then COBYQA, a trust region of quadratic models
    without derivatives (T. M. Ragonneau and Z. Zhang, 2024), refines the best variant.
    Two goals need NSGA-II: K. Deb et al., IEEE Trans. Evol. Comput. 6 (2002) 182, as implemented in pymoo.
    """
    generation = generation_size(len(design.goals), len(design.points.variables), evaluations, seed)
    judge = ProblemEvaluator(design)

    def search() -> None:
        if len(design.goals) == 2:
            _run_nsga2(judge, generation, evaluations // generation, seed)
            return
        _differential_evolution(judge, generation, int(_GLOBAL_FRACTION * evaluations), seed)
        if (remaining := evaluations - judge.count) > 0:
            _refine(judge, remaining)

    return judge.run_search(search)


def generation_size(goals: int, variables: int, evaluations: int, seed: int) -> int:
    """Return the number of variants in a generation; raise an error, before any run, if the search is impossible."""
    if goals > 2:
        raise refuse("goals", goals, "one or two", "")
    if goals == 2:
        require_packages("optimize", "two goals", "design", "pymoo")
    generation = goals * min(max(_POINTS_PER_VARIABLE * variables, _MIN_POINTS), _MAX_POINTS)
    if evaluations < 2 * generation:
        raise refuse("--evaluations", evaluations, f"{2 * generation} or more", "the search needs two generations")
    check_seed(seed)
    return generation


def _differential_evolution(judge: ProblemEvaluator, generation: int, evaluations: int, seed: int) -> None:
    from scipy.optimize import Bounds, NonlinearConstraint, differential_evolution
    from scipy.stats import qmc

    design, rng = judge.design, np.random.default_rng(seed)
    variables = len(design.points.variables)
    start = qmc.LatinHypercube(variables, seed=rng).random(generation)
    if design.start is not None:
        start[0] = design.start  # the result is not worse than the given case

    def cost(x: FloatArray) -> FloatArray:
        return np.minimum(judge.evaluate(x.T)[0][:, 0], _LARGE_COST)

    def violations(x: FloatArray) -> FloatArray:
        return judge.evaluate(np.atleast_2d(x.T))[1].T

    cube, constraint = Bounds(np.zeros(variables), np.ones(variables)), NonlinearConstraint(violations, -np.inf, 0.0)
    differential_evolution(
        cost,  # pyright: ignore[reportArgumentType] - vectorized
        cube, constraints=constraint, init=start, maxiter=max(evaluations // generation - 1, 1), polish=False,
        updating="deferred", vectorized=True, rng=rng, tol=1e-6,
    )  # fmt: skip


def _refine(judge: ProblemEvaluator, evaluations: int) -> None:
    from scipy.optimize import Bounds, NonlinearConstraint, minimize

    known = judge.evaluations()
    start = known.parts[known.nearest if known.best is None else known.best]
    finite = known.costs[np.isfinite(known.costs)]
    size = float(np.ptp(finite)) if len(finite) > 1 else 1.0
    worst = float(finite.max()) if len(finite) else 0.0

    def cost(x: FloatArray) -> float:
        value = float(judge.evaluate(x[None, :])[0][0, 0])
        return min(value, worst + size) / (size or 1.0)

    def violations(x: FloatArray) -> FloatArray:
        return np.minimum(judge.evaluate(x[None, :])[1][0, :-1], _MAX_VIOLATION)

    count = len(start)
    minimize(
        cost, start, method="COBYQA", bounds=Bounds(np.zeros(count), np.ones(count)),
        constraints=NonlinearConstraint(violations, -np.inf, 0.0) if judge.design.bounds else (),
        options={"maxfev": evaluations, "initial_tr_radius": _TRUST_RADIUS, "final_tr_radius": 1e-5},
    )  # fmt: skip


def _run_nsga2(judge: ProblemEvaluator, size: int, generations: int, seed: int) -> None:
    from pymoo.algorithms.moo.nsga2 import NSGA2
    from pymoo.core.evaluator import Evaluator
    from pymoo.core.problem import Problem
    from pymoo.problems.static import StaticProblem

    design = judge.design
    if design.start is not None:
        judge.evaluate(design.start[None])  # the front is not worse than the given case
    variables, bounds = len(design.points.variables), len(design.bounds) + 1
    problem = Problem(n_var=variables, n_obj=2, n_ieq_constr=bounds, xl=0.0, xu=1.0)
    algorithm = NSGA2(pop_size=size)
    algorithm.setup(problem, termination=("n_gen", generations), seed=seed, verbose=False)
    while algorithm.has_next():
        population: Any = algorithm.ask()
        cost, violations = judge.evaluate(np.asarray(population.get("X"), dtype=float))
        Evaluator().eval(StaticProblem(problem, F=np.minimum(cost, _LARGE_COST), G=violations), population)
        algorithm.tell(infills=population)


def pareto_indices(found: Evaluations) -> list[int]:
    """Return the indices of the Pareto-optimal variants that satisfy all constraints."""
    feasible = np.flatnonzero(is_feasible(found.violations) & np.isfinite(found.costs).all(axis=1)).tolist()
    costs, first = found.costs[feasible], dict[tuple[float, ...], int]()
    for i, cost in zip(feasible, costs, strict=True):
        if not ((costs <= cost).all(axis=1) & (costs < cost).any(axis=1)).any():
            first.setdefault(tuple(cost.tolist()), i)
    return sorted(first.values(), key=lambda i: float(found.costs[i, 0]))
