"""The law of a family whose largest velocity, acceleration or jerk is least: a linear program, with its proof.

Between the places where the program looks, a curve may rise above its bound; such places are added until none is left
(exchange, as E. Y. Remez's algorithm does). The dual solution of the last program bounds every law of the family from
below, so the gap between both says how far from the optimum the law can be.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from flexcam.cams.law_criteria import Criteria, criteria, stationary_points
from flexcam.cams.linear_program import ALMOST, CRITERIA, ORDERS, Condition, Cut, Program
from flexcam.cams.motion_law import Law
from flexcam.cams.synthesis_family import Family, bound_over_all
from flexcam.core import FloatArray
from flexcam.core.errors import InputError, refuse

_START = np.linspace(0.0, 1.0, 161)
_ROUNDS = 200
_GAP = 1e-8
"""Part of the objective by which a law may miss the bound before places are added."""

_CLOSED = 1e-6
"""Part of the objective beyond which the law is not called the best: a hundred times what the search asks for."""


@dataclass(frozen=True, eq=False)
class Synthesized:
    """A law found, and how good it is.

    Parameters
    ----------
    law
        The law.
    objective
        Weighted sum of its criteria.
    bound
        No law of the family under the same conditions has less; None where the problem is not convex.
    bound_all
        No law at all has less, as far as that is known; None where it is not.
    criteria
        Of the law.
    family
        In words.
    open
        What keeps the law from being the one sought, in words: a bound it misses, a gap that the search did not close.
        Empty if it converged.
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
        """Whether the law meets its bounds and, where there is a proof, is proved to be the best."""
        return not self.open

    @property
    def gap(self) -> float | None:
        """Duality gap: objective less the family's bound."""
        return None if self.bound is None else self.objective - self.bound


def minimax(
    family: Family, minimize: Mapping[str, float], *, bounds: Mapping[str, float] | None = None,
    conditions: Sequence[Condition] = (), monotone: bool = True,
) -> Synthesized:  # fmt: skip
    """Return the law of a family with the least weighted sum of criteria.

    ``Cv``, ``Ca``, ``Cj`` are linear; the root mean square ``rms`` of the acceleration is convex: alone it is a problem
    of least squares, beside others it is met by its tangent planes, and the bound holds either way. The operating
    moment ``Cm`` is neither: the law is then the best nearby, found by linear programs within a changing trust region
    from the laws of least acceleration and of least rms, and has no bound.
    """
    weights, limits = _checked("minimize", minimize, CRITERIA), _checked("bounds", bounds or {}, ORDERS)
    if not weights:
        raise refuse("minimize", "nothing", f"one or more of {', '.join(CRITERIA)}")
    program = Program(family, weights, limits, _positions(conditions), monotone)
    x, bound = (_nearby(program), None) if "Cm" in weights else _exchanged(program)
    law = family.law(x)
    found = criteria(law)
    least = bound_over_all(weights, limits, free_ends=max(abs(end[2]) for end in found.ends) > 1e-9)
    objective = _objective(found, weights)
    return Synthesized(law, objective, bound, least, found, family.name, _open(program, law, objective, bound))


def _open(program: Program, law: Law, objective: float, bound: float | None) -> tuple[str, ...]:
    """Return what a law misses of its bounds, its conditions and its proof, in words."""
    said = list(program.missed(law, ALMOST))
    if bound is not None and abs(objective - bound) > _CLOSED * max(1.0, abs(bound)):
        side = "above" if objective > bound else "below"
        said.append(f"the objective lies {abs(objective - bound):.2g} {side} the bound that is to prove it")
    return tuple(said)


def _exchanged(program: Program) -> tuple[FloatArray, float]:
    """Return the coefficients of the best law and the bound that proves it."""
    places: dict[int, FloatArray] = dict.fromkeys((1, 2, 3), _START)
    cuts = list[Cut]()
    alone = set(program.weights) == {"rms"}
    x, bound = program.least_rms(places) if alone else program.solve(places, cuts)
    for _ in range(_ROUNDS):
        law = program.family.law(x)
        if program.met(law, 0.0) and program.objective(law) - bound <= _GAP * abs(bound):
            break
        places = {order: _with(places[order], stationary_points(law, order)) for order in places}
        cuts += [program.tangent(x)] if "rms" in program.weights else []
        x, bound = program.least_rms(places) if alone else program.solve(places, cuts)
    return x, bound


_FIRST, _SMALLEST, _LARGEST = 0.1, 1e-8, 0.2
"""Distances of coefficients within which the moment is taken as linear."""

_PATIENCE = 8
"""Times that a step is tried again with more places before it is shortened."""


def _nearby(program: Program) -> FloatArray:
    """Return the better of the laws that no small step improves, from that of least acceleration and of least rms."""
    starts = [_exchanged(replace(program, weights={name: 1.0}))[0] for name in ("Ca", "rms")]
    return min((_descended(program, start) for start in starts), key=lambda x: program.objective(program.family.law(x)))


def _descended(program: Program, x: FloatArray) -> FloatArray:
    """Return the coefficients of a law that no small step improves."""
    law, radius, stubborn = program.family.law(x), _FIRST, 0
    best = program.objective(law)
    places: dict[int, FloatArray] = dict.fromkeys((1, 2, 3), np.linspace(0.0, 1.0, 401))
    for _ in range(_ROUNDS):
        places = {order: _with(places[order], stationary_points(law, order)) for order in places}
        cuts = [program.tangent(x)] if "rms" in program.weights else []
        try:
            step, _ = program.solve(places, cuts, around=(x, radius))
        except InputError:  # a place just added is not met here, and the step is too short to mend it
            radius *= 2.0
            if radius > _LARGEST:
                break
            continue
        tried = program.family.law(step)
        places = {order: _with(places[order], stationary_points(tried, order)) for order in places}
        if not program.met(tried, 0.5 * ALMOST) and stubborn < _PATIENCE:
            stubborn += 1  # the places just added may see to it
            continue
        stubborn, value = 0, program.objective(tried)
        if value < best * (1.0 - 1e-9) and program.met(tried, 0.5 * ALMOST):
            x, law, best, radius = step, tried, value, min(2.0 * radius, _LARGEST)
        else:
            radius *= 0.5
        if radius < _SMALLEST:
            break
    return x


def pareto(
    family: Family, first: str, second: str, *, count: int = 9, conditions: Sequence[Condition] = (),
    monotone: bool = True,
) -> list[Synthesized]:  # fmt: skip
    """Return laws of which none is better in both of two criteria than another: a front, from end to end."""
    if first == second or count < 3:
        raise refuse("pareto", f"{first}, {second}, {count} laws", "two different criteria and three laws or more")

    def solve(minimize: Mapping[str, float], bounds: Mapping[str, float]) -> Synthesized:
        return minimax(family, minimize, bounds=bounds, conditions=conditions, monotone=monotone)

    least = solve({second: 1.0}, {})
    best = solve({first: 1.0}, {})
    # The best in one criterion alone leaves the other one open: it is made best among its equals.
    low = _value(least.criteria, second) * (1.0 + 1e-6)
    high = _value(solve({second: 1.0}, {first: best.objective * (1.0 + 1e-6)}).criteria, second) * (1.0 + 1e-6)
    return [solve({first: 1.0}, {second: float(limit)}) for limit in np.geomspace(low, max(low, high), count)]


def _checked(where: str, given: Mapping[str, float], known: Iterable[str]) -> dict[str, float]:
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
