"""Massless motions, which follow the static equilibrium of their springs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import TypeVar

import numpy as np

from flexcam.core import (
    DENSE_LIMIT,
    Factor,
    FloatArray,
    IntArray,
    SingularMatrixError,
    Triplets,
    component_members,
    factorize,
    null_space,
    select_constraints,
    select_storage,
)
from flexcam.dynamics.step_state import StepState
from flexcam.dynamics.system import System

FORCE_TOLERANCE = 1e-9
"""Fraction of a unit force along a massless motion that is rounding."""


class MasslessMotions:
    """Massless motions of a system; `kept` are the unknowns with mass, which determine all others."""

    def __init__(self, system: System) -> None:
        self._system, self._K = system, select_storage(system.stiffness)
        self.motions = find_massless_motions(system)  #: as columns, shape (n, k)
        self.kept: IntArray = np.setdiff1d(np.arange(system.size), select_constraints(self.motions) if self.any else [])

    @property
    def any(self) -> bool:
        """True if the system has massless motions."""
        return self.motions.shape[1] > 0

    def place(self, motion: FloatArray, push: FloatArray) -> FloatArray:
        """Return a motion with its massless part in static equilibrium with a force, shape (n,) or (n, k) each."""
        if not self.any:
            return motion
        residual = self.motions.T @ (push - self._K @ motion)
        return motion + self.motions @ self._factor.solve(residual)

    def expand(self, kept: FloatArray) -> FloatArray:
        """Return the motion of all unknowns, shape (n, ...), from the kept ones, without massless forces."""
        motion = np.zeros((self._system.size, *kept.shape[1:]))
        motion[self.kept] = kept
        return self.place(motion, np.zeros(motion.shape))

    def condense_force(self, push: FloatArray) -> FloatArray:
        """Return a force, shape (n, ...), condensed to the unknowns with mass."""
        return push - self._K @ self.place(np.zeros(push.shape), push)

    def inverse(self, matrix: Triplets) -> Factor:
        """Return a solver for a matrix with massless motions condensed statically.

        Massless motions follow their springs in the solution, and forces on them act through the same springs on the
        others. The solution does not depend on the choice of kept unknowns.
        """
        return _CondensedSolver(factorize(matrix.part(self.kept)), self) if self.any else factorize(matrix)

    def force_on_massless(self, vectors: FloatArray) -> FloatArray:
        """Return the force of each unit vector, shape (m, n), on the massless motions, shape (m,)."""
        if not self.any or not len(vectors):
            return np.zeros(len(vectors))
        size = np.abs(vectors).max(axis=1)
        return np.abs(vectors @ self.motions).max(axis=1) / np.where(size > 0.0, size, 1.0)

    @cached_property
    def _factor(self) -> Factor:
        try:
            return factorize(Triplets.from_dense(self.motions.T @ (self._K @ self.motions)))
        except SingularMatrixError as fault:
            leading = np.abs(self.motions[:, list(fault.unknowns)]).argmax(axis=0)
            raise SingularMatrixError(tuple(leading.tolist())) from None


@dataclass(frozen=True, eq=False)
class _CondensedSolver:
    """Solver for the kept part of a matrix; the massless motions follow."""

    factor: Factor
    light: MasslessMotions

    def solve(self, right: FloatArray) -> FloatArray:
        """Solve, see `Factor`."""
        return self.light.expand(self.factor.solve(self.light.condense_force(right)[self.light.kept]))


def find_massless_motions(system: System) -> FloatArray:
    """Return the massless motions as columns.

    Above the dense limit they are computed within groups of unknowns coupled by mass: a massive member is one such
    group, and regular; a body with an offset at a node is a small one.
    """
    if system.size <= 2 * DENSE_LIMIT:
        return null_space(system.mass)
    from scipy.sparse.csgraph import connected_components

    light = [_unit(system.size, np.flatnonzero(system.mass.diagonal() <= 0.0))]
    labels = connected_components(system.mass.csr(), directed=False)[1].astype(np.intp)
    for group in component_members(labels):
        if 1 < len(group) <= DENSE_LIMIT:
            motions = null_space(system.mass.part(group))
            expanded = np.zeros((system.size, motions.shape[1]))
            expanded[group] = motions
            light.append(expanded)
    return np.hstack(light)


def _unit(size: int, places: IntArray) -> FloatArray:
    columns = np.zeros((size, len(places)))
    columns[places, np.arange(len(places))] = 1.0
    return columns


BETA, GAMMA = 1.0, 1.5
"""Newmark's parameters of these motions: the velocity is that of the parabola through the last three instants, the
acceleration their second difference, so that a start or a kink has no effect after two steps.
"""

Number = TypeVar("Number", float, FloatArray)
"""A number or one per motion."""


def massless_rates(change: Number, v: Number, a: Number, h: float) -> tuple[Number, Number]:
    """Return velocity and acceleration of a massless motion from its change of displacement over a step."""
    new = (change / h - v - (0.5 - BETA) * h * a) / (BETA * h)
    return v + h * ((1.0 - GAMMA) * a + GAMMA * new), new


@dataclass(frozen=True, eq=False)
class MasslessRates:
    """Massless motions of unit stiffness."""

    free: FloatArray  #: undamped ones, as columns, shape (n, k)
    slow: FloatArray  #: damped ones whose acceleration has no effect, shape (n, l)
    amounts: FloatArray  #: rows that extract their coordinates from a displacement, shape (k + l, n)

    def update_rates(self, now: StepState, new: StepState, step: float) -> StepState:
        """Return an instant with the massless rates from displacements, velocities and the previous instant."""
        k = self.free.shape[1]
        change, v, a, v1, a1 = (self.amounts @ np.column_stack([new.d - now.d, now.v, now.a, new.v, new.a])).T
        a_new = (v1 - v) / step
        v_new, a_new[:k] = massless_rates(change[:k], v[:k], a[:k], step)
        correction = self.free @ (a_new - a1)[:k] + self.slow @ (a_new - a1)[k:]
        return replace(new, v=new.v + self.free @ (v_new - v1[:k]), a=new.a + correction)


@lru_cache(maxsize=1)
def find_massless_rates(system: System, *, average: bool) -> MasslessRates | None:
    """Return the motions of a system with derived rates; None without such."""
    motions = find_massless_motions(system)
    if not motions.shape[1]:
        return None
    unit = normalize_stiffness(motions, system.stiffness)
    times, rotation = relaxation_times(unit, system.damping)
    free, slow = unit @ rotation[:, times == 0.0], unit @ rotation[:, (times != 0.0) & average]
    derived = np.hstack([free, slow])
    return MasslessRates(free, slow, system.stiffness.multiply(derived).T) if derived.shape[1] else None


def normalize_stiffness(motions: FloatArray, stiffness: Triplets) -> FloatArray:
    """Return motions combined such that the stiffness matrix is the identity."""
    try:
        L = np.linalg.cholesky(motions.T @ stiffness.multiply(motions))
    except np.linalg.LinAlgError:
        raise SingularMatrixError(tuple(np.abs(motions).argmax(axis=0).tolist())) from None
    return np.asarray(np.linalg.solve(L, motions.T).T, dtype=float)


def relaxation_times(unit: FloatArray, damping: Triplets) -> tuple[FloatArray, FloatArray]:
    """Return the relaxation times of motions of unit stiffness by dampers."""
    reduced = unit.T @ damping.multiply(unit)
    size = np.abs(unit).T @ replace(damping, values=np.abs(damping.values)).multiply(np.abs(unit))
    if not (reduced - np.diag(np.diag(reduced))).any():
        times, vectors = np.diag(reduced), np.eye(len(reduced))
    else:
        times, vectors = np.linalg.eigh(0.5 * (reduced + reduced.T))
    rounding = 64.0 * np.finfo(float).eps * np.abs(size).max(initial=0.0)
    return np.where(np.abs(times) <= rounding, 0.0, times), vectors
