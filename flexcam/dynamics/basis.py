"""Bases of the equations of motion, u = T q + u0: a subset of the unknowns, or modes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from flexcam.core import FloatArray, IntArray, Triplets
from flexcam.dynamics.cam_motion import AngleFunction, Constant
from flexcam.dynamics.system import Channel, LocalForce, MotionView, Observation, Probe, System


@dataclass(frozen=True, eq=False)
class DofSubset:
    """Subset of m of n unknowns; the others are constant."""

    kept: IntArray  #: indices of the unknowns, shape (m,)
    offset: FloatArray  #: u0, displacement of the others, shape (n,); zero for unknowns kept

    @property
    def size(self) -> int:
        """Number of unknowns kept."""
        return len(self.kept)

    def coordinate_names(self, names: Sequence[str]) -> tuple[str, ...]:
        """Return the names of those kept."""
        kept: list[int] = self.kept.tolist()
        return tuple(names[i] for i in kept)

    def matrix(self, full: Triplets) -> Triplets:
        """Return the kept part of a matrix, ``T' A T``."""
        return full.part(self.kept)

    def rows(self, full: FloatArray) -> FloatArray:
        """Return the kept columns of rows or one row, ``A T``, shape (..., n) to (..., m)."""
        return full[..., self.kept]

    def expand(self, motion: FloatArray) -> FloatArray:
        """Return motions expanded to all unknowns, ``T q``, zero for the others, shape (..., m) to (..., n)."""
        full = np.zeros((*motion.shape[:-1], len(self.offset)))
        full[..., self.kept] = motion
        return full

    def project(self, motion: FloatArray, weight: Triplets) -> FloatArray:
        """Return the motion of the unknowns kept."""
        return motion[self.kept]

    def free(self, motions: FloatArray | None) -> FloatArray | None:
        """Return an orthonormal basis of the kept part of the free motions.

        Valid if the kept unknowns are uncoupled from the others, so that each part of a free motion is free.
        """
        if motions is None or not motions.shape[1]:
            return None if motions is None else np.zeros((len(self.kept), 0))
        basis, sizes, _ = np.linalg.svd(motions[self.kept], full_matrices=False)
        norm = float(np.linalg.norm(motions, 2))
        return basis[:, sizes > _ROUNDING * norm]


@dataclass(frozen=True, eq=False)
class ModeBasis:
    """Coordinates of given shape vectors."""

    vectors: FloatArray  #: independent shapes as columns, shape (n, m)
    names: tuple[str, ...] = ()  #: a name per coordinate; ``shape 1`` and so on by default
    #: Displacement at zero coordinates, shape (n,), uncoupled from the shapes; None for zero.
    shift: FloatArray | None = None

    @property
    def offset(self) -> FloatArray:
        """Displacement at zero coordinates."""
        return np.zeros(len(self.vectors)) if self.shift is None else self.shift

    @property
    def size(self) -> int:
        """Number of shapes."""
        return self.vectors.shape[1]

    def coordinate_names(self, names: Sequence[str]) -> tuple[str, ...]:
        """Return the names of the coordinates."""
        return self.names or tuple(f"shape {i}" for i in range(1, self.vectors.shape[1] + 1))

    def matrix(self, full: Triplets) -> Triplets:
        """Return ``T' A T`` with rounding removed: massless shapes then have zero mass."""
        projected = self.vectors.T @ full.multiply(self.vectors)
        sizes = replace(full, values=np.abs(full.values)).multiply(np.abs(self.vectors))
        rounding = np.finfo(float).eps * np.sqrt(full.size) * (np.abs(self.vectors).T @ sizes)
        projected[np.abs(projected) <= rounding] = 0.0
        symmetric = np.abs(projected - projected.T) <= 2.0 * rounding
        return Triplets.from_dense(np.where(symmetric, 0.5 * (projected + projected.T), projected))

    def rows(self, full: FloatArray) -> FloatArray:
        """Return the rows times the shapes."""
        return full @ self.vectors

    def expand(self, motion: FloatArray) -> FloatArray:
        """Return the sum of the shapes times the coordinates."""
        return motion @ self.vectors.T

    def project(self, motion: FloatArray, weight: Triplets) -> FloatArray:
        """Return the coordinates of the nearest motion, in the norm of a weight such as the mass."""
        heavy = weight.multiply(self.vectors)
        return np.asarray(np.linalg.lstsq(self.vectors.T @ heavy, heavy.T @ motion)[0], dtype=float)

    def free(self, motions: FloatArray | None) -> FloatArray | None:
        """Return None: the free motions are recomputed, at low cost."""
        return None


Basis = DofSubset | ModeBasis
"""Transformation of n unknowns to m generalized coordinates; its offset must not couple with them."""

_ROUNDING = 1e-9
"""Relative size below which an entry is rounding."""


def project_system(system: System, basis: Basis) -> System:
    """Return the equations of a system in the coordinates of a basis."""
    expansion = _Expansion(basis)
    return System(
        mass=basis.matrix(system.mass),
        damping=basis.matrix(system.damping),
        stiffness=basis.matrix(system.stiffness),
        names=basis.coordinate_names(system.names),
        loads=tuple(replace(load, vector=basis.rows(load.vector)) for load in system.loads),
        local_forces=tuple(_local(force, basis) for force in system.local_forces),
        probes=tuple(_probe(probe, basis) for probe in system.probes),
        channels=tuple(_channel(channel, expansion) for channel in system.channels),
        free=basis.free(system.free),
        stored=system.stored + 0.5 * float(basis.offset @ system.stiffness.times(basis.offset)),
    )


def _local(force: LocalForce, basis: Basis) -> LocalForce:
    pairs = zip(force.offset, force.sense, strict=True)
    offset = tuple(_offset_function(function, term.vectors @ basis.offset, term.functions) for function, term in pairs)
    sense, act = (
        tuple(replace(term, vectors=basis.rows(term.vectors)) for term in side) for side in (force.sense, force.act)
    )
    return replace(force, sense=sense, act=act, offset=offset)


def _probe(probe: Probe, basis: Basis) -> Probe:
    offset = tuple(
        _offset_function(function, np.array([displacement])) if displacement != 0.0 else function
        for function, displacement in zip(probe.offset, (probe.rows @ basis.offset).tolist(), strict=True)
    )
    return replace(probe, rows=basis.rows(probe.rows), offset=offset)


def _offset_function(
    function: AngleFunction | None, amounts: FloatArray, functions: tuple[AngleFunction, ...] = ()
) -> AngleFunction:
    """Return a function of the cam angle plus multiples of others; a single constant stays a constant."""
    begin = function or Constant(0.0)
    if not amounts.any():
        return begin
    terms = functions or (Constant(1.0),)
    if isinstance(begin, Constant) and not functions:
        return Constant(begin.value + float(amounts[0]))

    def both(angle: FloatArray, order: int) -> FloatArray:
        addition = sum(amount * term(angle, order) for amount, term in zip(amounts.tolist(), terms, strict=True))
        return begin(angle, order) + addition

    return both


def _channel(channel: Channel, expansion: _Expansion) -> Channel:
    def value(observation: Observation) -> FloatArray:
        return channel.value(expansion(observation))

    return replace(channel, value=value)


class _Expansion:
    """Observations expanded to all unknowns; rows over all unknowns are projected to the basis once."""

    def __init__(self, basis: Basis) -> None:
        self.basis, self.offset = basis, basis.offset
        self._last: tuple[Observation, Observation] | None = None  # all channels have the same observation
        self._projected: dict[int, tuple[FloatArray, FloatArray, FloatArray]] = {}  # keeps the ids valid

    def __call__(self, observation: Observation) -> Observation:
        if self._last is None or self._last[0] is not observation:
            self._last = observation, replace(observation, moved=_ExpandedMotion(observation.moved, self))
        return self._last[1]

    def project(self, rows: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the projected rows and their products with the offset."""
        if id(rows) not in self._projected:
            self._projected[id(rows)] = rows, self.basis.rows(rows), rows @ self.offset
        return self._projected[id(rows)][1:]


class _ExpandedMotion:
    """Motion of all unknowns from that of the coordinates, computed on demand."""

    def __init__(self, inside: MotionView, expansion: _Expansion) -> None:
        self._inside, self._expansion = inside, expansion
        self._extracted: dict[tuple[int, int], FloatArray] = {}
        self._whole: dict[int, FloatArray] = {}

    def whole(self, order: int) -> FloatArray:
        """Return the motion of all unknowns, see `MotionView`."""
        if order not in self._whole:
            motion = self._expansion.basis.expand(self._inside.whole(order))
            self._whole[order] = motion + self._expansion.offset if order == 0 else motion
        return self._whole[order]

    def extract(self, rows: FloatArray, order: int = 0) -> FloatArray:
        """Return scalars of the motion, see `MotionView`."""
        key = id(rows), order
        if key not in self._extracted:
            projected, offset = self._expansion.project(rows)
            values = self._inside.extract(projected, order)
            self._extracted[key] = values + offset if order == 0 else values
        return self._extracted[key]
