"""Minimax synthesis: the law of a family with the smallest peak of velocity, acceleration or jerk.

Linear programs bound the curves at sampled positions. Between them a curve may exceed its bound; such positions are
added until none is left (the exchange of E. Y. Remez's algorithm). The dual solution of the last linear program is a
lower bound for the family, and the duality gap bounds the distance from the optimum.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from flexcam.cams.harmonic_lift import PRECISE, constrained_least_squares
from flexcam.cams.law_criteria import Criteria, criteria, root_mean_square, stationary_points
from flexcam.cams.motion_law import Law, quadrature
from flexcam.cams.synthesis_family import Family, SplineFamily, universal_bound
from flexcam.core import FloatArray
from flexcam.core.errors import InputError, refuse

ORDERS = {"Cv": 1, "Ca": 2, "Cj": 3}
"""Linear criteria and the order of the derivative whose largest absolute value each measures."""

FEASIBILITY_TOLERANCE = 1e-7
"""Relative violation of a bound allowed for an intermediate law."""

CRITERIA = (*ORDERS, "rms", "Cm")

_MAX_ORDER = 4
_LIMIT_MARGIN = 1e-8  # relative margin to a limit, so that rounding does not violate it
_INFEASIBLE = 2  # status of `scipy.optimize.linprog`

Condition = tuple[float, int, float]
"""Position, order of derivative, and prescribed value."""

TangentPlane = tuple[FloatArray, float]
"""Tangent plane of the rms: gradient, and value at zero."""


@dataclass(frozen=True, eq=False)
class Program:
    """Minimization of weighted criteria over a family of laws.

    Linear criteria may have limits, the law prescribed values, and the velocity must not be negative if monotone.
    """

    family: Family
    weights: Mapping[str, float]
    limits: Mapping[str, float]
    conditions: tuple[Condition, ...]
    monotone: bool

    def objective(self, law: Law) -> float:
        """Return the weighted sum of a law's criteria."""
        return sum(weight * _criterion(law, name) for name, weight in self.weights.items())

    def is_feasible(self, law: Law, slack: float) -> bool:
        """Return whether a law satisfies the bounds and does not reverse, within a slack."""
        bounded = all(_criterion(law, name) <= limit * (1.0 + slack) for name, limit in self.limits.items())
        return bounded and (not self.monotone or _slowest(law) >= -slack - _LIMIT_MARGIN)

    def violations(self, law: Law, slack: float) -> list[str]:
        """Describe the violated bounds and conditions of a law, within a slack."""
        values = {name: _criterion(law, name) for name in self.limits}
        texts = [f"{name} is {values[name]:.9g}, its bound {limit:.9g}"
                 for name, limit in self.limits.items() if values[name] > limit * (1.0 + slack)]  # fmt: skip
        if self.monotone and (slowest := _slowest(law)) < -slack - _LIMIT_MARGIN:
            texts.append(f"the velocity falls to {slowest:.3g}, and must not be negative")
        for z, order, value in self.conditions:
            error = abs(float(law(np.array([z]), order)[0]) - value)
            if error > slack * max(1.0, abs(value)):
                texts.append(f"the condition {z:g},{order},{value:g} is missed by {error:.3g}")
        return texts

    def tangent(self, x: FloatArray) -> TangentPlane:
        """Return the tangent plane of the rms at given coefficients."""
        rows, offset = self._weighted_acceleration()
        acceleration = rows @ x + offset
        rms = float(np.linalg.norm(acceleration))
        slope = rows.T @ acceleration / rms
        return slope, rms - float(slope @ x)

    def _weighted_acceleration(self) -> tuple[FloatArray, FloatArray]:
        """Return rows and offset of the acceleration, whose square sum is the square of its rms."""
        z, weight = (np.concatenate(parts) for parts in zip(*quadrature(()), strict=True))
        rows, offset = self.family.rows(z, 2)
        return np.sqrt(weight)[:, None] * rows, np.sqrt(weight) * offset

    def solve(
        self, places: Mapping[int, FloatArray], cuts: Sequence[TangentPlane] = (),
        around: tuple[FloatArray, float] | None = None,
    ) -> tuple[FloatArray, float]:  # fmt: skip
        """Return the coefficients and the dual objective, a lower bound for the family."""
        from scipy.optimize import linprog

        A, b = self._inequalities(places, cuts, around)
        E, e = self._equalities()
        cost = np.concatenate([np.zeros(self.family.size), list(self.weights.values())])
        # A bound of zero does not contribute to the dual objective.
        box: list[tuple[float | None, float | None]] = [(None, None)] * self.family.size
        if around is not None:
            box = [(v - around[1], v + around[1]) for v in around[0].tolist()]
        box += [(0.0, None)] * len(self.weights)

        def run(*, presolve: bool) -> Any:  # noqa: ANN401 - scipy's result
            return linprog(cost, A, b, E, e, bounds=box, method="highs", options={
                "primal_feasibility_tolerance": PRECISE, "dual_feasibility_tolerance": PRECISE, "presolve": presolve,
            })  # fmt: skip

        result = run(presolve=True)
        if result.x is None and result.status != _INFEASIBLE:  # the solver occasionally fails after its presolve
            result = run(presolve=False)
        if result.status == _INFEASIBLE:
            raise self._impossible()
        if result.x is None:
            why, remedy = "its linear program did not converge", "use wider bounds, a lower degree or fewer pieces"
            raise refuse("family", self.family.name, "a family that converges", why, remedy)
        dual = float(b @ result.ineqlin.marginals + e @ result.eqlin.marginals)
        return np.asarray(result.x[: self.family.size], dtype=float), dual

    def minimum_rms(self, places: Mapping[int, FloatArray]) -> tuple[FloatArray, float]:
        """Return the coefficients of minimum rms, by constrained least squares, and that rms."""
        rows, offset = self._weighted_acceleration()
        A, b = self._inequalities(places, (), None)
        E, e = self._equalities()
        free = slice(0, self.family.size)
        # x = base + N y satisfies the equalities for every y.
        base, N = np.zeros(self.family.size), np.eye(self.family.size)
        if len(E):
            from scipy.linalg import null_space

            base = np.asarray(np.linalg.lstsq(E[:, free], e, rcond=None)[0], dtype=float)
            if not np.allclose(E[:, free] @ base, e, rtol=0.0, atol=FEASIBILITY_TOLERANCE):
                raise self._impossible()
            N = np.asarray(null_space(E[:, free], rcond=1e-12), dtype=float)
        f = -(rows @ base + offset)
        y = constrained_least_squares(rows @ N, f, -A[:, free] @ N, A[:, free] @ base - b)
        if y is None:
            raise self._impossible()
        x = base + N @ y
        return x, float(np.linalg.norm(rows @ x + offset))

    def _impossible(self) -> InputError:
        bounds = ", ".join([f"{name} up to {limit:g}" for name, limit in self.limits.items()])
        conditions = " and ".join(f"{z:g},{order},{value:g}" for z, order, value in self.conditions)
        given = " with ".join(filter(None, (bounds, conditions)))
        what = " and ".join(["bounds"] * bool(bounds) + ["conditions"] * bool(conditions))
        remedy = " or ".join(["a wider bound"] * bool(bounds) + ["other conditions"] * bool(conditions))
        why, rest = "", self.family.rest if isinstance(self.family, SplineFamily) else 1
        if fixed := [order for z, order, value in self.conditions
                     if z in (0.0, 1.0) and order <= rest and value != (0.0 if order else z)]:  # fmt: skip
            higher = f"--rest is {rest}, so the first {rest} derivatives are zero at both ends"
            why = ("the law rises from 0 to 1", "the velocity is zero at both ends", higher)[min(fixed[0], 2)]
            remedy += f", or --rest {fixed[0] - 1}" if fixed[0] > 1 else ""
        elif self.monotone and any(map(_turns_back, self.conditions)):
            remedy += ", or allow laws that turn back (--turning-back)"
        elif isinstance(self.family, SplineFamily) and self.family.symmetric and self.conditions:
            remedy += ", or allow asymmetric laws (--asymmetric), which may meet these"
        return refuse(what, given, f"{what} that {self.family.name} can meet", why, f"use {remedy}")

    def _inequalities(
        self, places: Mapping[int, FloatArray], cuts: Sequence[TangentPlane], around: tuple[FloatArray, float] | None
    ) -> tuple[FloatArray, FloatArray]:
        blocks = [self._constraints(n, *self.family.rows(places[k], k)) for n, k in ORDERS.items() if n in self.weights]
        for name, limit in self.limits.items():
            rows, offset = self.family.rows(places[ORDERS[name]], ORDERS[name])
            blocks.append(self._constraints(name, rows, offset, limit * (1.0 - _LIMIT_MARGIN)))
        if self.monotone:
            rows, offset = self.family.rows(places[1], 1)
            # If a law reverses by rounding, a short step could only correct that.
            blocks.append((self._dense_rows(-rows), offset + (0.0 if around is None else FEASIBILITY_TOLERANCE)))
        if cuts:
            slopes = np.array([slope for slope, _ in cuts])
            blocks.append((np.hstack([slopes, -self._pick("rms", len(cuts))]), -np.array([value for _, value in cuts])))
        if around is not None and "Cm" in self.weights:
            (V, v), (A, a), x = self.family.rows(places[2], 1), self.family.rows(places[2], 2), around[0]
            velocity, acceleration = V @ x + v, A @ x + a
            rows = acceleration[:, None] * V + velocity[:, None] * A  # s' s'' linearized about x
            blocks.append(self._constraints("Cm", rows, velocity * acceleration - rows @ x))
        blocks.append((np.zeros((0, self.family.size + len(self.weights))), np.zeros(0)))
        return np.vstack([A for A, _ in blocks]), np.concatenate([b for _, b in blocks])

    def _constraints(
        self, name: str, rows: FloatArray, offset: FloatArray, limit: float | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Return the inequalities abs(rows x + offset) <= a limit, or <= the largest value of a criterion."""
        if limit is None:
            right, columns = 0.0, self._pick(name, len(rows))
        else:
            rows, offset, right, columns = rows / limit, offset / limit, 1.0, np.zeros((len(rows), len(self.weights)))
        matrix = np.vstack([np.hstack([rows, -columns]), np.hstack([-rows, -columns])])
        return matrix, np.concatenate([right - offset, right + offset])

    def _dense_rows(self, rows: FloatArray) -> FloatArray:
        return np.hstack([rows, np.zeros((len(rows), len(self.weights)))])

    def _pick(self, name: str, count: int) -> FloatArray:
        columns = np.zeros((count, len(self.weights)))
        columns[:, list(self.weights).index(name)] = 1.0
        return columns

    def _equalities(self) -> tuple[FloatArray, FloatArray]:
        matrix, right = self.family.equalities()
        rows = [self.family.rows(np.array([z]), order) for z, order, _ in self.conditions]
        values = [value - offset[0] for (_, offset), (*_, value) in zip(rows, self.conditions, strict=True)]
        return self._dense_rows(np.vstack([matrix, *(row for row, _ in rows)])), np.concatenate([right, values])


def _turns_back(condition: Condition) -> bool:
    """Return whether a law that meets a condition has a negative velocity."""
    z, order, value = condition
    return (order == 1 and value < 0.0) or (order == 2 and ((z == 0.0 and value < 0.0) or (z == 1.0 and value > 0.0)))


def _slowest(law: Law) -> float:
    return float(law(stationary_points(law, 1), 1).min())


def _criterion(law: Law, name: str) -> float:
    """Return a single criterion: all of them at once would cost more than the program."""
    if name == "rms":
        return root_mean_square(law, 2)
    if name == "Cm":
        z = np.union1d(stationary_points(law, 1), np.linspace(0.0, 1.0, 4001))
        return float(np.abs(law(z, 1) * law(z, 2)).max())
    z = stationary_points(law, ORDERS[name])
    return float(np.abs(law(z, ORDERS[name])).max())


_START = np.linspace(0.0, 1.0, 161)
_ROUNDS = 200
_GAP = 1e-8  # relative violation of the bound allowed before positions are added
_OPTIMALITY_TOLERANCE = 100.0 * _GAP  # relative duality gap above which the law is not reported as optimal


@dataclass(frozen=True, eq=False)
class Synthesis:
    """Result of a synthesis."""

    law: Law
    objective: float  #: weighted sum of its criteria
    bound: float | None  #: lower bound for the family under the same conditions; None if the problem is not convex
    bound_all: float | None  #: lower bound for all laws; None if unknown
    criteria: Criteria
    family: str  #: name of the family
    #: reasons for non-convergence, in words: a violated bound, or a remaining gap. Empty if converged
    open: tuple[str, ...] = ()

    @property
    def converged(self) -> bool:
        """True if the law meets its bounds and, if a bound is known, is proved optimal."""
        return not self.open

    @property
    def gap(self) -> float | None:
        """Duality gap: objective minus the family's bound."""
        return None if self.bound is None else self.objective - self.bound


def minimax(
    family: Family, minimize: Mapping[str, float], *, bounds: Mapping[str, float] | None = None,
    conditions: Sequence[Condition] = (), monotone: bool = True,
) -> Synthesis:  # fmt: skip
    """Return the law of a family with the minimum weighted sum of criteria.

    ``Cv``, ``Ca``, ``Cj`` are linear; the root mean square ``rms`` of the acceleration is convex: alone it is a
    least-squares problem, with others it is approximated by tangent planes, and the bound holds in both cases. The
    operating moment ``Cm`` is neither: the law is then a local optimum, found by linear programs in a trust region
    starting from the laws of minimum acceleration and of minimum rms, and has no bound.
    """
    weights, limits = _check_weights("minimize", minimize, CRITERIA), _check_weights("bounds", bounds or {}, ORDERS)
    if not weights:
        raise refuse("minimize", "nothing", f"one or more of {', '.join(CRITERIA)}")
    for z, order, value in conditions:
        if not (0.0 <= z <= 1.0 and 0 <= order <= _MAX_ORDER and math.isfinite(value)):
            allowed = f"[z from 0 to 1, order of the derivative from 0 to {_MAX_ORDER}, finite value]"
            raise refuse("conditions", [z, order, value], allowed)
    program = Program(family, weights, limits, tuple(conditions), monotone)
    if "Cm" in weights:
        starts = [_exchange(replace(program, weights={name: 1.0}))[0] for name in ("Ca", "rms")]
        optima = (_trust_region_descent(program, start) for start in starts)
        x, bound = min(optima, key=lambda x: program.objective(family.law(x))), None
    else:
        x, bound = _exchange(program)
    law = family.law(x)
    values = criteria(law)
    bound_all = universal_bound(weights, limits, free_ends=max(abs(end[2]) for end in values.ends) > 1e-9)
    objective = sum(weight * _value(values, name) for name, weight in weights.items())
    violations = program.violations(law, FEASIBILITY_TOLERANCE)
    if bound is not None and abs(objective - bound) > _OPTIMALITY_TOLERANCE * max(1.0, abs(bound)):
        side = "above" if objective > bound else "below"
        violations.append(f"the objective lies {abs(objective - bound):.2g} {side} the bound that is to prove it")
    return Synthesis(law, objective, bound, bound_all, values, family.name, tuple(violations))


def _exchange(program: Program) -> tuple[FloatArray, float]:
    """Return the coefficients of the optimal law and the lower bound."""
    places: dict[int, FloatArray] = dict.fromkeys((1, 2, 3), _START)
    cuts = list[TangentPlane]()
    alone = set(program.weights) == {"rms"}
    x, bound = program.minimum_rms(places) if alone else program.solve(places, cuts)
    for _ in range(_ROUNDS):
        law = program.family.law(x)
        if program.is_feasible(law, 0.0) and program.objective(law) - bound <= _GAP * abs(bound):
            break
        places = {order: _merge(places[order], stationary_points(law, order)) for order in places}
        cuts += [program.tangent(x)] if "rms" in program.weights else []
        x, bound = program.minimum_rms(places) if alone else program.solve(places, cuts)
    return x, bound


_FIRST, _SMALLEST, _LARGEST = 0.1, 1e-8, 0.2  # trust region radii for the linearized moment
_MAX_REPEATS = 8  # number of repetitions of a step with more positions before it is shortened


def _trust_region_descent(program: Program, x: FloatArray) -> FloatArray:
    """Return the coefficients of a local optimum."""
    law, radius, repeats = program.family.law(x), _FIRST, 0
    lowest = program.objective(law)
    places: dict[int, FloatArray] = dict.fromkeys((1, 2, 3), np.linspace(0.0, 1.0, 401))
    for _ in range(_ROUNDS):
        places = {order: _merge(places[order], stationary_points(law, order)) for order in places}
        cuts = [program.tangent(x)] if "rms" in program.weights else []
        try:
            step, _ = program.solve(places, cuts, around=(x, radius))
        except InputError:  # a position just added is violated, and the step is too short to correct it
            radius *= 2.0
            if radius > _LARGEST:
                break
            continue
        trial = program.family.law(step)
        places = {order: _merge(places[order], stationary_points(trial, order)) for order in places}
        if not program.is_feasible(trial, 0.5 * FEASIBILITY_TOLERANCE) and repeats < _MAX_REPEATS:
            repeats += 1  # the positions just added may correct it
            continue
        repeats, value = 0, program.objective(trial)
        if value < lowest * (1.0 - 1e-9) and program.is_feasible(trial, 0.5 * FEASIBILITY_TOLERANCE):
            x, law, lowest, radius = step, trial, value, min(2.0 * radius, _LARGEST)
        else:
            radius *= 0.5
        if radius < _SMALLEST:
            break
    return x


def pareto(
    family: Family, first: str, second: str, *, count: int = 9, conditions: Sequence[Condition] = (),
    monotone: bool = True,
) -> list[Synthesis]:  # fmt: skip
    """Return a Pareto front of two criteria, from end to end."""
    if first == second or count < 3:
        raise refuse("pareto", f"{first}, {second}, {count} laws", "two different criteria and three laws or more")

    def solve(minimize: Mapping[str, float], bounds: Mapping[str, float]) -> Synthesis:
        return minimax(family, minimize, bounds=bounds, conditions=conditions, monotone=monotone)

    best_second = solve({second: 1.0}, {})
    best_first = solve({first: 1.0}, {})
    # The optimum of one criterion alone is not unique: choose the one with the best other criterion.
    low = _value(best_second.criteria, second) * (1.0 + 1e-6)
    high = _value(solve({second: 1.0}, {first: best_first.objective * (1.0 + 1e-6)}).criteria, second) * (1.0 + 1e-6)
    return [solve({first: 1.0}, {second: float(limit)}) for limit in np.geomspace(low, max(low, high), count)]


def _check_weights(where: str, weights: Mapping[str, float], allowed: Iterable[str]) -> dict[str, float]:
    for name, value in weights.items():
        if name not in allowed:
            raise refuse(where, repr(name), ", ".join(allowed))
        if not (math.isfinite(value) and value > 0.0):
            raise refuse(f"{where}.{name}", value, "a finite number above zero")
    return dict(weights)


def _value(values: Criteria, name: str) -> float:
    if name == "rms":
        return values.rms[1]
    value: float | None = getattr(values, name)
    return math.inf if value is None else value


def _merge(places: FloatArray, added: FloatArray) -> FloatArray:
    return np.unique(np.concatenate([places, added]).round(13))
