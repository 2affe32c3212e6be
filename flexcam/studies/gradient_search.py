"""Search for the best variant of a case along exact gradients.

Maxima and minima over a revolution have kinks where another instant becomes the extreme one. A step therefore takes all
planes that are known near the best variant, tangents of the goal and of the constraints: a linear program within a box
about it, which moves with the best variant and shrinks when no better one is found. This is the cutting-plane method
with a trust region: J. E. Kelley, J. SIAM 8 (1960) 703; K. Madsen, J. Inst. Maths Applics 16 (1975) 321.
"""

# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flexcam.core import FloatArray
from flexcam.core.errors import refuse
from flexcam.dynamics import RunFailedError
from flexcam.studies.gradients import Gradient
from flexcam.studies.optimization import ROUNDING, Evaluations, OptimizationProblem, ProblemEvaluator
from flexcam.studies.plan import check_seed

_BOX, _SMALLEST_BOX = 0.1, 1e-3
"""First and smallest half width of the box, relative to the intervals."""
_SHRINK, _GROW = 0.6, 1.5
"""Factors of the box after a step without and with success at its border."""
_CORRECTIONS = 1
"""Steps without success before the box shrinks."""
_NEAR, _PLANES = 3.0, 16
"""Distance of the planes that count, in half widths of the box, and their number."""
_PENALTY = 100.0
"""Weight of the largest relative violation of a constraint, relative to that of the goal."""
_INSIDE = 1e-6
"""Distance from a bound, relative to it, that a step keeps, so that its result satisfies the bound."""


@dataclass(frozen=True, eq=False)
class Plane:
    """Tangents at a point, by fractions of the intervals."""

    at: FloatArray  #: shape (k,)
    cost: float  #: quantity to be minimized
    cost_slope: FloatArray  #: shape (k,)
    violations: FloatArray  #: relative violations of the constraints, shape (b,)
    violation_slopes: FloatArray  #: shape (b, k)

    @property
    def merit(self) -> tuple[float, float]:
        """Violation of the constraints, then the cost: the smaller pair is the better variant."""
        passed = float(np.maximum(self.violations, 0.0).sum())
        return (passed if passed > ROUNDING else 0.0, self.cost)


def optimize_by_gradient(
    design: OptimizationProblem, derive: Callable[[FloatArray], Gradient], *, evaluations: int = 200, starts: int = 1,
    seed: int = 0,
) -> Evaluations:  # fmt: skip
    """Search for the best variant with exact gradients, from the case and further random points.

    Parameters
    ----------
    design
        One goal, and constraints with derivatives.
    derive
        Function from a point in the units of the variables, shape (k,), to the gradient of all quantities.
    evaluations
        Maximum number of variants, each with its gradient.
    starts
        Number of points from which the search starts: that of the case, or the centre of the intervals, then random
        ones.
    seed
        Of the random points.

    Returns
    -------
    Evaluations
        All variants of the search in their order.
    """
    if len(design.goals) != 1:
        raise refuse("goals", len(design.goals), "one", "a gradient search has one goal")
    if starts < 1:
        raise refuse("--starts", starts, "1 or more")
    check_seed(seed)
    judge, count = ProblemEvaluator(design), len(design.points.variables)
    first = np.full(count, 0.5) if design.start is None else design.start
    begins = [first, *np.random.default_rng(seed).random((starts - 1, count))]
    tangents = _Tangents(design, judge, derive)

    def search() -> None:
        for i, begin in enumerate(begins):
            _descend(tangents, judge, begin, judge.count + (evaluations - judge.count) // (starts - i))

    found = judge.run_search(search)
    if tangents.warning and judge.count == starts:
        why, remedy = tangents.warning, "use --method evolution"
        raise refuse("--method gradient", "a start without derivatives", "a run with derivatives", why, remedy)
    return found


class _Tangents:
    """Evaluates points with their planes."""

    def __init__(
        self, design: OptimizationProblem, judge: ProblemEvaluator, derive: Callable[[FloatArray], Gradient]
    ) -> None:
        self._design, self._judge, self._derive, self._spans = design, judge, derive, design.spans
        self.warning = ""  #: why the last variant without derivatives has none

    def plane(self, x: FloatArray) -> Plane | None:
        """Return the tangents at a point; None if its run fails or has no derivative."""
        costs, violations = self._judge.evaluate(x[None])
        if not math.isfinite(costs[0, 0]):
            return None
        try:
            found = self._derive(self._design.points_at(x))
        except RunFailedError:
            return None
        if found.warning:
            self.warning = found.warning
            return None
        goal, bounds, variables = self._design.goals[0], self._design.bounds, self._design.points.variables

        def slope(name: str) -> FloatArray:
            return self._spans * np.array([found.derivatives[name, one.key] for one in variables])

        rows = [
            slope(one.name) * (1.0 if one.relation == "<=" else -1.0) / (abs(one.bound(found.units[one.name])) or 1.0)
            for one in bounds
        ]
        cost_slope = (-1.0 if goal.most else 1.0) * slope(goal.name)
        slopes = np.array(rows).reshape(len(bounds), len(variables))
        if not (np.isfinite(cost_slope).all() and np.isfinite(slopes).all()):
            return None
        return Plane(x, float(costs[0, 0]), cost_slope, violations[0, :-1], slopes)


def _descend(tangents: _Tangents, judge: ProblemEvaluator, start: FloatArray, end: int) -> None:
    """Search from a point until the box is small or a number of variants is reached."""
    best = tangents.plane(start)
    if best is None:
        return
    planes, radius, failed = [best], _BOX, 0
    while radius > _SMALLEST_BOX and judge.count < end:
        near = [one for one in planes if np.abs(one.at - best.at).max() <= _NEAR * radius][-_PLANES:]
        x = _lowest(near if best in near else [best, *near], best, radius)
        new = tangents.plane(x) if np.abs(x - best.at).max() > 0.01 * _SMALLEST_BOX else None
        if new is not None:
            planes.append(new)
        if new is None or new.merit >= best.merit:
            failed += 1  # the planes of a point that is no better correct the next step in the same box
            radius *= _SHRINK if new is None or failed > _CORRECTIONS else 1.0
            continue
        failed = 0
        if np.abs(new.at - best.at).max() > 0.8 * radius:
            radius = min(_GROW * radius, 0.5)
        best = new


def _lowest(planes: list[Plane], best: Plane, radius: float) -> FloatArray:
    """Return the lowest point of all planes in the box about the best variant, shape (k,)."""
    from scipy.optimize import linprog

    size, rows, limits = abs(best.cost) or 1.0, list[list[float]](), list[float]()

    def add(value: float, known: float, slope: FloatArray, at: FloatArray, by_cost: float, by_violation: float) -> None:
        here = min(value + float(slope @ (best.at - at)), known)  # a plane that is too high there is lowered
        rows.append([*slope.tolist(), by_cost, by_violation])
        limits.append(float(slope @ best.at) - here)

    for one in planes:
        add(one.cost / size, best.cost / size, one.cost_slope / size, one.at, -1.0, 0.0)
        for i, slope in enumerate(one.violation_slopes):
            known = float(best.violations[i]) + _INSIDE
            add(float(one.violations[i]) + _INSIDE, known, slope, one.at, 0.0, -1.0)
    box = [(max(one - radius, 0.0), min(one + radius, 1.0)) for one in best.at.tolist()]
    found = linprog(
        [*(0.0 * best.at), 1.0, _PENALTY],
        A_ub=rows,
        b_ub=limits,
        bounds=[*box, (None, None), (0.0, None)],
        method="highs",
    )
    return best.at if found.x is None else np.clip(np.asarray(found.x[:-2], dtype=float), 0.0, 1.0)
