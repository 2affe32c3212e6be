"""Motions without mass: no acceleration of their own, they follow the springs they touch."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from flexcam.checks import InputError, refuse
from flexcam.integrate.local import LocalForces
from flexcam.linalg import (
    DENSE_LIMIT,
    Factor,
    FloatArray,
    IntArray,
    Triplets,
    by_group,
    factorize,
    null_space,
    operator,
    pins,
)
from flexcam.system import System

TOUCHED = 1e-9
"""Share of a push (of size 1) along a motion without mass that is rounding."""


class Massless:
    """The motions without mass of a system.

    Parameters
    ----------
    system
        The system.

    Attributes
    ----------
    motions
        As columns, shape (n, k).
    kept
        Unknowns that place all others: those with mass of their own.
    """

    def __init__(self, system: System) -> None:
        self._system, self._K = system, operator(system.stiffness)
        self.motions = massless(system)
        self.kept: IntArray = np.setdiff1d(np.arange(system.size), pins(self.motions) if self.any else [])

    @property
    def any(self) -> bool:
        """Whether there are some."""
        return self.motions.shape[1] > 0

    def place(self, motion: FloatArray, push: FloatArray) -> FloatArray:
        """Return a motion, its massless part moved to where the springs balance a push, shape (n,) or (n, k) each."""
        if not self.any:
            return motion
        missing = self.motions.T @ (push - self._K @ motion)
        return motion + self.motions @ self._factor.solve(missing)

    def spread(self, kept: FloatArray) -> FloatArray:
        """Return the motion of all unknowns, shape (n, ...), that no push disturbs, from that of the kept ones."""
        motion = np.zeros((self._system.size, *kept.shape[1:]))
        motion[self.kept] = kept
        return self.place(motion, np.zeros(motion.shape))

    def passed_on(self, push: FloatArray) -> FloatArray:
        """Return a push, shape (n, ...), with what the massless motions pass on by their springs, and none on them."""
        return push - self._K @ self.place(np.zeros(push.shape), push)

    def inverse(self, matrix: Triplets) -> Factor:
        """Return what solves with a matrix that leaves the massless motions alone.

        They follow their springs in the answer, and what pushes on them pushes by the same springs on the others: the
        answer does not depend on which unknowns are kept.
        """
        return _Following(factorize(matrix.part(self.kept)), self) if self.any else factorize(matrix)

    def touched(self, vectors: FloatArray) -> FloatArray:
        """Return by how much a unit of each vector, shape (m, n), pushes on them, shape (m,)."""
        if not self.any or not len(vectors):
            return np.zeros(len(vectors))
        size = np.abs(vectors).max(axis=1)
        return np.abs(vectors @ self.motions).max(axis=1) / np.where(size > 0.0, size, 1.0)

    def pushed(self, method: str) -> InputError | None:
        """Return the refusal of contacts and dampers on motions without mass, by name; None where there are none."""
        if not self.any:
            return None
        why, remedy = "what has no mass is placed by springs alone", "give it a mass, or use newmark"
        forces = LocalForces(self._system)
        on = np.zeros(forces.count, dtype=bool)
        for stack in (forces.sense, forces.act):
            on |= (stack.owner[:, self.touched(stack.vectors) > TOUCHED] > 0.0).any(axis=1)
        names = list(dict.fromkeys(forces.names[i] for i in np.flatnonzero(on).tolist()))
        if names:
            return refuse("run.integrator", method, f"a method that takes {', '.join(names)} without mass", why, remedy)
        slowed = np.abs(self._system.damping.times_all(self.motions))
        damped = np.flatnonzero(slowed.max(axis=0) > TOUCHED * np.abs(self._system.damping.values).max(initial=0.0))
        if not len(damped):
            return None
        rows: list[int] = np.abs(self.motions[:, damped]).argmax(axis=0).tolist()
        names = list(dict.fromkeys(self._system.names[i] for i in rows))[:6]
        given = f"a method that takes dampers on {', '.join(names)} without mass"
        return refuse("run.integrator", method, given, why, f"{remedy}, or mass-proportional damping")

    @cached_property
    def _factor(self) -> Factor:
        return factorize(Triplets.from_dense(self.motions.T @ (self._K @ self.motions)))


@dataclass(frozen=True, eq=False)
class _Following:
    """Solves with the kept part of a matrix; the massless motions follow."""

    factor: Factor
    light: Massless

    def solve(self, right: FloatArray) -> FloatArray:
        return self.light.spread(self.factor.solve(self.light.passed_on(right)[self.light.kept]))


def massless(system: System) -> FloatArray:
    """Return the motions without mass as columns.

    Above the dense limit they are sought within the unknowns that mass couples: a massive member is one such group,
    and regular; a body on an arm at a node is a small one.
    """
    if system.size <= 2 * DENSE_LIMIT:
        return null_space(system.mass)
    from scipy.sparse.csgraph import connected_components

    light = [_unit(system.size, np.flatnonzero(system.mass.diagonal() <= 0.0))]
    labels = connected_components(system.mass.csr(), directed=False)[1].astype(np.intp)
    for group in by_group(labels):
        if 1 < len(group) <= DENSE_LIMIT:
            within = null_space(system.mass.part(group))
            spread = np.zeros((system.size, within.shape[1]))
            spread[group] = within
            light.append(spread)
    return np.hstack(light)


def _unit(size: int, places: IntArray) -> FloatArray:
    """Return the columns of the identity at some places, shape (size, k)."""
    columns = np.zeros((size, len(places)))
    columns[places, np.arange(len(places))] = 1.0
    return columns
