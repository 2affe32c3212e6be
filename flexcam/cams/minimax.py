"""Minimax synthesis: the law of a family with the smallest peak of velocity, acceleration or jerk.

Between the sampled positions a curve may exceed its bound; such positions are added until none is left (the exchange of
E. Y. Remez's algorithm). The dual solution of the last linear program is a lower bound for the family, and the duality
gap bounds the distance from the optimum.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from flexcam.cams.law_criteria import Criteria, criteria, stationary_points
from flexcam.cams.linear_program import CRITERIA, FEASIBILITY_TOLERANCE, ORDERS, Condition, Program, TangentPlane
from flexcam.cams.motion_law import Law
from flexcam.cams.synthesis_family import Family, universal_bound
from flexcam.core import FloatArray
from flexcam.core.errors import InputError, refuse

_START = np.linspace(0.0, 1.0, 161)
_ROUNDS = 200
_GAP = 1e-8
"""Relative violation of the bound allowed before positions are added."""

_OPTIMALITY_TOLERANCE = 1e-6
"""Relative duality gap above which the law is not reported as optimal: a hundred times the target of the search."""


@dataclass(frozen=True, eq=False)
class Synthesis:
    """Result of a synthesis.

    Parameters
    ----------
    law
        The law.
    objective
        Weighted sum of its criteria.
    bound
        Lower bound for the family under the same conditions; None if the problem is not convex.
    bound_all
        Lower bound for all laws; None if unknown.
    criteria
        Criteria of the law.
    family
        Name of the family.
    open
        Reasons for non-convergence, in words: a violated bound, or a remaining gap. Empty if converged.
    """

    law: Law
    objective: float
    bound: float | None
    bound_all: float | None
    criteria: Criteria
    family: str
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
    weights, limits = _validate("minimize", minimize, CRITERIA), _validate("bounds", bounds or {}, ORDERS)
    if not weights:
        raise refuse("minimize", "nothing", f"one or more of {', '.join(CRITERIA)}")
    program = Program(family, weights, limits, _positions(conditions), monotone)
    x, bound = (_local_optimum(program), None) if "Cm" in weights else _exchange(program)
    law = family.law(x)
    found = criteria(law)
    least = universal_bound(weights, limits, free_ends=max(abs(end[2]) for end in found.ends) > 1e-9)
    objective = _objective(found, weights)
    return Synthesis(law, objective, bound, least, found, family.name, _violations(program, law, objective, bound))


def _violations(program: Program, law: Law, objective: float, bound: float | None) -> tuple[str, ...]:
    """Return the violated bounds and conditions and the remaining gap of a law, in words."""
    said = list(program.violations(law, FEASIBILITY_TOLERANCE))
    if bound is not None and abs(objective - bound) > _OPTIMALITY_TOLERANCE * max(1.0, abs(bound)):
        side = "above" if objective > bound else "below"
        said.append(f"the objective lies {abs(objective - bound):.2g} {side} the bound that is to prove it")
    return tuple(said)


def _exchange(program: Program) -> tuple[FloatArray, float]:
    """Return the coefficients of the optimal law and the lower bound."""
    places: dict[int, FloatArray] = dict.fromkeys((1, 2, 3), _START)
    cuts = list[TangentPlane]()
    alone = set(program.weights) == {"rms"}
    x, bound = program.least_rms(places) if alone else program.solve(places, cuts)
    for _ in range(_ROUNDS):
        law = program.family.law(x)
        if program.is_feasible(law, 0.0) and program.objective(law) - bound <= _GAP * abs(bound):
            break
        places = {order: _with(places[order], stationary_points(law, order)) for order in places}
        cuts += [program.tangent(x)] if "rms" in program.weights else []
        x, bound = program.least_rms(places) if alone else program.solve(places, cuts)
    return x, bound


_FIRST, _SMALLEST, _LARGEST = 0.1, 1e-8, 0.2
"""Trust region radii for the linearized moment."""

_MAX_REPEATS = 8
"""Number of repetitions of a step with more positions before it is shortened."""


def _local_optimum(program: Program) -> FloatArray:
    """Return the better of the local optima from the laws of minimum acceleration and of minimum rms."""
    starts = [_exchange(replace(program, weights={name: 1.0}))[0] for name in ("Ca", "rms")]
    return min(
        (_trust_region_descent(program, start) for start in starts),
        key=lambda x: program.objective(program.family.law(x)),
    )


def _trust_region_descent(program: Program, x: FloatArray) -> FloatArray:
    """Return the coefficients of a local optimum."""
    law, radius, stubborn = program.family.law(x), _FIRST, 0
    best = program.objective(law)
    places: dict[int, FloatArray] = dict.fromkeys((1, 2, 3), np.linspace(0.0, 1.0, 401))
    for _ in range(_ROUNDS):
        places = {order: _with(places[order], stationary_points(law, order)) for order in places}
        cuts = [program.tangent(x)] if "rms" in program.weights else []
        try:
            step, _ = program.solve(places, cuts, around=(x, radius))
        except InputError:  # a position just added is violated, and the step is too short to correct it
            radius *= 2.0
            if radius > _LARGEST:
                break
            continue
        tried = program.family.law(step)
        places = {order: _with(places[order], stationary_points(tried, order)) for order in places}
        if not program.is_feasible(tried, 0.5 * FEASIBILITY_TOLERANCE) and stubborn < _MAX_REPEATS:
            stubborn += 1  # the positions just added may correct it
            continue
        stubborn, value = 0, program.objective(tried)
        if value < best * (1.0 - 1e-9) and program.is_feasible(tried, 0.5 * FEASIBILITY_TOLERANCE):
            x, law, best, radius = step, tried, value, min(2.0 * radius, _LARGEST)
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

    least = solve({second: 1.0}, {})
    best = solve({first: 1.0}, {})
    # The optimum of one criterion alone is not unique: choose the one with the best other criterion.
    low = _value(least.criteria, second) * (1.0 + 1e-6)
    high = _value(solve({second: 1.0}, {first: best.objective * (1.0 + 1e-6)}).criteria, second) * (1.0 + 1e-6)
    return [solve({first: 1.0}, {second: float(limit)}) for limit in np.geomspace(low, max(low, high), count)]


def _validate(where: str, given: Mapping[str, float], known: Iterable[str]) -> dict[str, float]:
    for name, value in given.items():
        if name not in known:
            raise refuse(where, repr(name), ", ".join(known))
        if not (math.isfinite(value) and value > 0.0):
            raise refuse(f"{where}.{name}", value, "a finite number above zero")
    return dict(given)


def _positions(conditions: Sequence[Condition]) -> tuple[Condition, ...]:
    for z, order, value in conditions:
        if not (0.0 <= z <= 1.0 and 0 <= order <= _MOST_ORDER and math.isfinite(value)):
            allowed = f"[z from 0 to 1, order of the derivative from 0 to {_MOST_ORDER}, finite value]"
            raise refuse("conditions", [z, order, value], allowed)
    return tuple(conditions)


_MOST_ORDER = 4


def _objective(found: Criteria, weights: Mapping[str, float]) -> float:
    return sum(weight * _value(found, name) for name, weight in weights.items())


def _value(found: Criteria, name: str) -> float:
    if name == "rms":
        return found.rms[1]
    value: float | None = getattr(found, name)
    return math.inf if value is None else value


def _with(places: FloatArray, more: FloatArray) -> FloatArray:
    return np.unique(np.concatenate([places, more]).round(13))
