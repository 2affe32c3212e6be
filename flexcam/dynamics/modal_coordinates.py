"""Modal coordinates, in which mass and stiffness are diagonal and a step costs a few operations per mode.

Massless motions follow their springs: they are modes of zero mass.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from flexcam.core import FloatArray, SingularMatrixError, Triplets, connected_components, solve_eigenproblem
from flexcam.dynamics.active_dofs import reduce_problem
from flexcam.dynamics.basis import ModeBasis
from flexcam.dynamics.massless import MasslessMotions, normalize_stiffness, relaxation_times
from flexcam.dynamics.problem import Problem
from flexcam.dynamics.system import System

_COUPLED = 1e-9
"""Modal damping coupling, relative to the diagonal, that counts as zero."""

_SYMMETRIC = 1e-12
"""Relative asymmetry that is rounding of sums."""

_ROUNDING = 64.0 * np.finfo(float).eps
"""Rounding of a stiffness and its sums: energies above minus this value are not negative."""

_CLEAN = 1e-9
"""Orthogonality tolerance of two modes."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ModalCoordinates(ModeBasis):
    """Modal coordinates of a system: a complete basis of modes."""

    back: FloatArray  #: inverse: modal coordinates per unit of each unknown, shape (n, n)
    mass: FloatArray  #: modal, shape (n,): 1, or 0 of massless motions
    stiffness: FloatArray  #: modal, shape (n,): angular frequency squared, or 1 of massless motions

    def coordinate_names(self, names: Sequence[str]) -> tuple[str, ...]:
        """Return the unknown that moves most, per mode."""
        leading: list[int] = np.abs(self.vectors).argmax(axis=0).tolist() if self.size else []
        return tuple(names[i] for i in leading)

    def project(self, motion: FloatArray, weight: Triplets) -> FloatArray:
        """Return the modal coordinates of a motion."""
        return self.back @ motion

    def free(self, motions: FloatArray | None) -> FloatArray | None:
        """Return the free motions in modal coordinates."""
        return None if motions is None else self.back @ motions


def find_modal_coordinates(system: System) -> ModalCoordinates | None:
    """Return the modal coordinates of a system."""
    coordinates = _motions(_MatrixPair(system.mass, system.stiffness))
    return None if coordinates is None else _sort_by_part(_decouple_massless(coordinates, system.damping), system)


@dataclass(frozen=True, eq=False)
class _MatrixPair:
    """Mass and stiffness as a cache key, equal if all entries are, so that runs of one mechanism share the modes."""

    mass: Triplets
    stiffness: Triplets

    @cached_property
    def _content(self) -> tuple[bytes, ...]:
        entries = [(matrix.rows, matrix.cols, matrix.values) for matrix in (self.mass, self.stiffness)]
        return tuple(array.tobytes() for arrays in entries for array in arrays)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _MatrixPair) and self.mass.size == other.mass.size and self._content == other._content

    def __hash__(self) -> int:
        return hash(self._content)


@lru_cache(maxsize=8)
def _motions(pair: _MatrixPair) -> ModalCoordinates | None:
    n = pair.mass.size
    system = System(pair.mass, Triplets.zeros(n), pair.stiffness, ("",) * n)
    if not (_symmetric(system.mass) and _symmetric(system.stiffness)):
        return None
    light = MasslessMotions(system)
    try:
        massive = light.expand(np.eye(system.size)[:, light.kept][light.kept])
        M, K = (massive.T @ matrix.multiply(massive) for matrix in (system.mass, system.stiffness))
        values, shapes = solve_eigenproblem(0.5 * (M + M.T), 0.5 * (K + K.T))
        soft = normalize_stiffness(light.motions, system.stiffness)
    except (np.linalg.LinAlgError, SingularMatrixError):  # a mass or a stiffness that is not positive
        return None
    moving = massive @ shapes
    if _is_indefinite(moving, system.stiffness):
        return None
    back = np.vstack([system.mass.multiply(moving).T, system.stiffness.multiply(soft).T])
    count, vectors = soft.shape[1], np.hstack([moving, soft])
    if not np.abs(back @ vectors - np.eye(len(vectors))).max(initial=0.0) <= _CLEAN:
        return None
    heavy = np.concatenate([np.ones(len(values)), np.zeros(count)])
    stiff = np.concatenate([values, np.ones(count)])
    return ModalCoordinates(vectors, back=back, mass=heavy, stiffness=stiff)


def _symmetric(matrix: Triplets) -> bool:
    full = matrix.dense()
    size = np.sqrt(np.abs(np.diag(full)))
    return bool((np.abs(full - full.T) <= _SYMMETRIC * np.outer(size, size)).all())


def _is_indefinite(motions: FloatArray, stiffness: Triplets) -> bool:
    """Return whether a stiffness is indefinite, as beyond buckling."""
    energy = np.sum(motions * stiffness.multiply(motions), axis=0)
    absolute = replace(stiffness, values=np.abs(stiffness.values))
    sizes = np.sum(np.abs(motions) * absolute.multiply(np.abs(motions)), axis=0)
    return bool((energy < -_ROUNDING * sizes).any())


def _decouple_massless(coordinates: ModalCoordinates, damping: Triplets) -> ModalCoordinates:
    """Return modes in which dampers do not couple two massless ones."""
    light = coordinates.mass == 0.0
    if not light.any() or not damping.values.any():
        return coordinates
    rotation = relaxation_times(coordinates.vectors[:, light], damping)[1]
    vectors, back = coordinates.vectors.copy(), coordinates.back.copy()
    vectors[:, light], back[light] = vectors[:, light] @ rotation, rotation.T @ back[light]
    return replace(coordinates, vectors=vectors, back=back)


def _sort_by_part(coordinates: ModalCoordinates, system: System) -> ModalCoordinates:
    """Return the modes in the order of the parts that the matrices connect.

    A vector in modal coordinates then differs from zero in few runs of entries.
    """
    matrices = (system.mass, system.damping, system.stiffness)
    rows, columns = (np.concatenate([getattr(matrix, name) for matrix in matrices]) for name in ("rows", "cols"))
    parts = connected_components(system.size, rows, columns)
    order = np.argsort(parts[np.abs(coordinates.vectors).argmax(axis=0)], kind="stable")
    return replace(
        coordinates, vectors=coordinates.vectors[:, order], back=coordinates.back[order], mass=coordinates.mass[order],
        stiffness=coordinates.stiffness[order],
    )  # fmt: skip


def modal_problem(problem: Problem, motions: ModalCoordinates) -> Problem:
    """Return a problem in modal coordinates."""
    zeros = Triplets.zeros(problem.system.size)  # mass and stiffness are known already
    reduced = reduce_problem(replace(problem, system=replace(problem.system, mass=zeros, stiffness=zeros)), motions)
    mass, stiffness = (Triplets.from_dense(np.diag(values)) for values in (motions.mass, motions.stiffness))
    damping = _drop_coupling(_clear_rounding(reduced.system.damping, problem.system.damping, motions))
    return replace(reduced, system=replace(reduced.system, mass=mass, stiffness=stiffness, damping=damping))


def _clear_rounding(modal: Triplets, damping: Triplets, motions: ModalCoordinates) -> Triplets:
    """Return a modal damping with exact zeros for undamped massless motions."""
    light = np.flatnonzero(motions.mass == 0.0)
    free = light[relaxation_times(motions.vectors[:, light], damping)[0] == 0.0]
    cleared = np.isin(modal.rows, free) | np.isin(modal.cols, free)
    return replace(modal, values=np.where(cleared, 0.0, modal.values))


def _drop_coupling(damping: Triplets) -> Triplets:
    full = damping.dense()
    size = np.sqrt(np.abs(np.diag(full)))
    coupled = np.abs(full) > _COUPLED * np.outer(size, size)
    np.fill_diagonal(coupled, True)
    return damping if (coupled & ~np.eye(len(full), dtype=bool)).any() else Triplets.from_dense(np.diag(np.diag(full)))


def diagonal(matrix: Triplets) -> FloatArray | None:
    """Return the diagonal of a diagonal matrix, shape (n,); None if it is not diagonal."""
    return matrix.diagonal() if (matrix.rows == matrix.cols).all() else None
