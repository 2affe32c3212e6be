"""Linear program of the minimax synthesis: coefficients of a family and a bound per criterion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from flexcam.cams.harmonic_fit import constrained_least_squares
from flexcam.cams.law_criteria import stationary_points
from flexcam.cams.motion_law import Law, quadrature
from flexcam.cams.synthesis_family import Family, SplineFamily
from flexcam.core import FloatArray
from flexcam.core.errors import InputError, refuse

ORDERS = {"Cv": 1, "Ca": 2, "Cj": 3}
"""Linear criteria and the order of the derivative whose largest absolute value each measures."""

FEASIBILITY_TOLERANCE = 1e-7
"""Relative violation of a bound allowed for an intermediate law."""

CRITERIA = (*ORDERS, "rms", "Cm")

_LIMIT_MARGIN = 1e-8
"""Relative margin to a limit, so that rounding does not violate it."""

_PRECISE = 1e-10
_INFEASIBLE = 2
"""Status of `scipy.optimize.linprog`."""

Condition = tuple[float, int, float]
"""Position, order of derivative, and prescribed value."""

TangentPlane = tuple[FloatArray, float]
"""Tangent plane of the rms: gradient, and value at zero."""


@dataclass(frozen=True, eq=False)
class Program:
    """Minimization problem over a family of laws.

    Parameters
    ----------
    family
        Family of laws.
    weights
        Weights of the criteria in the objective.
    limits
        Bounds on linear criteria.
    conditions
        Prescribed values of the law.
    monotone
        Whether the velocity must not be negative.
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
        within = all(_criterion(law, name) <= limit * (1.0 + slack) for name, limit in self.limits.items())
        return within and (not self.monotone or _min_velocity(law) >= -slack - _LIMIT_MARGIN)

    def violations(self, law: Law, slack: float) -> list[str]:
        """Return the violated bounds and conditions of a law, within a slack, in words."""
        values = {name: _criterion(law, name) for name in self.limits}
        said = [f"{name} is {values[name]:.9g}, its bound {limit:.9g}"
                for name, limit in self.limits.items() if values[name] > limit * (1.0 + slack)]  # fmt: skip
        if self.monotone and (slowest := _min_velocity(law)) < -slack - _LIMIT_MARGIN:
            said.append(f"the velocity falls to {slowest:.3g}, and must not be negative")
        for z, order, value in self.conditions:
            off = abs(float(law(np.array([z]), order)[0]) - value)
            if off > slack * max(1.0, abs(value)):
                said.append(f"the condition {z:g},{order},{value:g} is missed by {off:.3g}")
        return said

    def tangent(self, x: FloatArray) -> TangentPlane:
        """Return the tangent plane of the rms at given coefficients."""
        z, weight = (np.concatenate(parts) for parts in zip(*quadrature(()), strict=True))
        rows, offset = self.family.rows(z, 2)
        bent = rows @ x + offset
        rms = float(np.sqrt(weight @ bent**2))
        slope = rows.T @ (weight * bent) / rms
        return slope, rms - float(slope @ x)

    def solve(
        self, places: Mapping[int, FloatArray], cuts: Sequence[TangentPlane] = (),
        around: tuple[FloatArray, float] | None = None,
    ) -> tuple[FloatArray, float]:  # fmt: skip
        """Return the coefficients and the dual objective, a lower bound for the family."""
        from scipy.optimize import linprog

        A, b = self._inequalities(places, cuts, around)
        E, e = self._equalities()
        cost = np.concatenate([np.zeros(self.family.size), list(self.weights.values())])
        box = self._box(around)
        found = linprog(cost, A, b, E, e, bounds=box, method="highs", options={
            "primal_feasibility_tolerance": _PRECISE, "dual_feasibility_tolerance": _PRECISE,
        })  # fmt: skip
        if found.x is None and found.status != _INFEASIBLE:  # the solver occasionally fails after its presolve
            found = linprog(cost, A, b, E, e, bounds=box, method="highs", options={
                "primal_feasibility_tolerance": _PRECISE, "dual_feasibility_tolerance": _PRECISE, "presolve": False,
            })  # fmt: skip
        if found.status == _INFEASIBLE:
            raise self._impossible()
        if found.x is None:
            raise refuse("family", self.family.name, "a program that can be solved", str(found.message), "fewer terms")
        dual = float(b @ found.ineqlin.marginals + e @ found.eqlin.marginals)
        return np.asarray(found.x[: self.family.size], dtype=float), dual

    def least_rms(self, places: Mapping[int, FloatArray]) -> tuple[FloatArray, float]:
        """Return the coefficients of minimum rms, by constrained least squares, and that rms."""
        z, weight = (np.concatenate(parts) for parts in zip(*quadrature(()), strict=True))
        rows, offset = self.family.rows(z, 2)
        root = np.sqrt(weight)
        A, b = self._inequalities(places, (), None)
        E, e = self._equalities()
        free = slice(0, self.family.size)
        base, ways = _solutions(E[:, free], e, self.family.size)
        f = -root * (rows @ base + offset)
        y = constrained_least_squares(root[:, None] * (rows @ ways), f, -A[:, free] @ ways, A[:, free] @ base - b)
        if y is None:
            raise self._impossible()
        x = base + ways @ y
        return x, float(np.linalg.norm(root * (rows @ x + offset)))

    def _impossible(self) -> InputError:
        given = ", ".join([f"{name} up to {limit:g}" for name, limit in self.limits.items()]) or "the conditions"
        remedy = "a wider bound, a higher degree or more pieces"
        if self.conditions and isinstance(self.family, SplineFamily) and self.family.symmetric:
            remedy += ", or laws without symmetry (--asymmetric)"
        return refuse("bounds", given, f"what {self.family.name} can meet", "there is no such law", remedy)

    def _box(self, around: tuple[FloatArray, float] | None) -> list[tuple[float | None, float | None]]:
        """Return the bounds of the unknowns; a bound of zero does not contribute to the dual objective."""
        near: list[tuple[float | None, float | None]] = [(None, None)] * self.family.size
        if around is not None:
            near = [(v - around[1], v + around[1]) for v in around[0].tolist()]
        return near + [(0.0, None)] * len(self.weights)

    def _inequalities(
        self, places: Mapping[int, FloatArray], cuts: Sequence[TangentPlane], around: tuple[FloatArray, float] | None
    ) -> tuple[FloatArray, FloatArray]:
        blocks = [
            self._objective_constraints(name, *self.family.rows(places[k], k))
            for name, k in ORDERS.items()
            if name in self.weights
        ]
        blocks += [
            self._limit_constraints(name, *self.family.rows(places[ORDERS[name]], ORDERS[name])) for name in self.limits
        ]
        if self.monotone:
            rows, offset = self.family.rows(places[1], 1)
            # If a law reverses by rounding, a short step could only correct that.
            blocks.append((self._dense_rows(-rows), offset + (0.0 if around is None else FEASIBILITY_TOLERANCE)))
        if cuts:
            slopes = np.array([slope for slope, _ in cuts])
            blocks.append((np.hstack([slopes, -self._pick("rms", len(cuts))]), -np.array([value for _, value in cuts])))
        if around is not None and "Cm" in self.weights:
            blocks.append(self._objective_constraints("Cm", *self._moment(places[2], around[0])))
        nothing = np.zeros((0, self.family.size + len(self.weights))), np.zeros(0)
        blocks.append(nothing)
        return np.vstack([A for A, _ in blocks]), np.concatenate([b for _, b in blocks])

    def _moment(self, z: FloatArray, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return rows and offset of s' s'' linearized about given coefficients."""
        (V, v), (A, a) = self.family.rows(z, 1), self.family.rows(z, 2)
        first, second = V @ x + v, A @ x + a
        rows = second[:, None] * V + first[:, None] * A
        return rows, first * second - rows @ x

    def _objective_constraints(self, name: str, rows: FloatArray, offset: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the inequalities abs(rows x + offset) <= the largest value of a criterion."""
        pick = self._pick(name, len(rows))
        return np.vstack([np.hstack([rows, -pick]), np.hstack([-rows, -pick])]), np.concatenate([-offset, offset])

    def _limit_constraints(self, name: str, rows: FloatArray, offset: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the inequalities abs(rows x + offset) <= the limit."""
        limit = self.limits[name] * (1.0 - _LIMIT_MARGIN)
        rows, offset = self._dense_rows(rows) / limit, offset / limit
        return np.vstack([rows, -rows]), np.concatenate([1.0 - offset, 1.0 + offset])

    def _dense_rows(self, rows: FloatArray) -> FloatArray:
        return np.hstack([rows, np.zeros((len(rows), len(self.weights)))])

    def _pick(self, name: str, count: int) -> FloatArray:
        picked = np.zeros((count, len(self.weights)))
        picked[:, list(self.weights).index(name)] = 1.0
        return picked

    def _equalities(self) -> tuple[FloatArray, FloatArray]:
        matrix, right = self.family.equalities()
        rows = [self.family.rows(np.array([z]), order) for z, order, _ in self.conditions]
        values = [value - offset[0] for (_, offset), (*_, value) in zip(rows, self.conditions, strict=True)]
        return self._dense_rows(np.vstack([matrix, *(row for row, _ in rows)])), np.concatenate([right, values])


def _solutions(E: FloatArray, e: FloatArray, size: int) -> tuple[FloatArray, FloatArray]:
    """Return a particular solution of E x = e and a basis of the null space, shape (size, k)."""
    if not len(E):
        return np.zeros(size), np.eye(size)
    base = np.asarray(np.linalg.lstsq(E, e, rcond=None)[0], dtype=float)
    _, values, vectors = np.linalg.svd(E)
    rank = int(np.count_nonzero(values > 1e-12 * values.max(initial=0.0)))
    return base, np.asarray(vectors[rank:].T, dtype=float)


def _min_velocity(law: Law) -> float:
    """Return the minimum velocity of a law."""
    return float(law(stationary_points(law, 1), 1).min())


def _criterion(law: Law, name: str) -> float:
    """Return a single criterion: all of them at once would cost more than the program."""
    if name == "rms":
        return float(np.sqrt(sum(float(weight @ law(z, 2) ** 2) for z, weight in quadrature(law.breaks))))
    if name == "Cm":
        z = np.union1d(stationary_points(law, 1), np.linspace(0.0, 1.0, 4001))
        return float(np.abs(law(z, 1) * law(z, 2)).max())
    z = stationary_points(law, ORDERS[name])
    return float(np.abs(law(z, ORDERS[name])).max())
