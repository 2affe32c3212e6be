"""Modes of a model with what moves in them, in words: member by member and mass by mass."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from flexcam import fem, modal
from flexcam.fem import COMPONENTS, beam
from flexcam.fem.recovery import section_forces
from flexcam.linalg import FloatArray, Triplets
from flexcam.modal import Modes
from flexcam.response import NotPositiveError, RunFailedError, gives_way
from flexcam.train.springs import spring_parts
from flexcam.train.structure import Structure

_KINDS = {"axial": beam.AXIAL, "torsion": beam.TORSION, "bending x-y": beam.PLANE_XY, "bending x-z": beam.PLANE_XZ}
_NAMED = 0.05
"""Share of a mode's kinetic energy from which a part is named."""


@dataclass(frozen=True, eq=False)
class ModelModes:
    """Modes of a model.

    Parameters
    ----------
    modes
        Frequencies and shapes.
    effective
        Effective masses along ux uy uz and about rx ry rz through the origin, shape (k, 6), kg and kg m^2.
    shares
        Kinetic energy by part, one dict per mode: ``"camshaft torsion"`` or ``"mass valve"`` to its share.
    """

    modes: Modes
    effective: FloatArray
    shares: tuple[dict[str, float], ...]

    def words(self, mode: int) -> str:
        """Return what moves in a mode, such as ``mass valve 60 %, pushrod axial 30 %``."""
        shares = sorted(self.shares[mode].items(), key=lambda item: -item[1])
        named = [f"{part} {100.0 * share:.0f} %" for part, share in shares if share >= _NAMED]
        free = "free motion: " if mode < self.modes.rigid else ""
        return free + ", ".join(named)


def model_modes(
    structure: Structure, count: int | None = None, *, loaded: FloatArray | None = None,
    held: Sequence[tuple[str, Triplets]] = (),
) -> ModelModes:  # fmt: skip
    """Return the lowest modes of a model."""
    stiffness, free = structure.stiffness, structure.free
    force = None if loaded is None else section_forces(structure.beams, structure.dofs.nodal(loaded))[:, 0, 0]
    if held:
        closed = Triplets.joined([part for _, part in held])
        stiffness, free = stiffness + closed, _unstressed(free, closed, stiffness)
    if force is not None:
        geometric = fem.geometric(structure.beams, force, structure.dofs)
        stiffness, free = stiffness + geometric, _unstressed(free, geometric, stiffness)
    try:
        found = modal.modes(structure.mass, stiffness, count, free=free)
    except NotPositiveError as failure:
        if failure.motion is None:
            raise
        parts = [*held, *(() if force is None else _pressed(structure, force))]
        raise RunFailedError(gives_way(structure.dofs.names, failure.motion, parts)) from None
    motions = np.array([structure.dofs.rigid_motion(structure.model.mesh, unit) for unit in np.eye(6)])
    effective = modal.effective_masses(found, structure.mass, motions)
    return ModelModes(found, effective, _shares(structure, found.shapes.T))


def _pressed(structure: Structure, force: FloatArray) -> Iterator[tuple[str, Triplets]]:
    """Yield the name of each member and the stiffness by its axial forces, N, tension positive, shape (e,)."""
    for name, its in structure.model.mesh.element_ranges().items():
        elements = np.arange(len(structure.beams))[its]
        yield f"members.{name}", fem.geometric(structure.beams.part(elements), force[elements], structure.dofs)


def _unstressed(free: FloatArray, geometric: Triplets, stiffness: Triplets) -> FloatArray:
    """Return the free motions that an axial force does not resist either: it resists what turns its member."""
    if not free.shape[1]:
        return free
    values, vectors = np.linalg.eigh(free.T @ geometric.times_all(free))
    size = float((free**2 * stiffness.diagonal()[:, None]).sum(axis=0).max())
    return free @ vectors[:, np.abs(values) <= 1e-12 * size]


def _shares(structure: Structure, shapes: FloatArray) -> tuple[dict[str, float], ...]:
    mass = beam.mass(structure.beams)
    return tuple(_shares_of(structure, shape, mass) for shape in shapes)


def _shares_of(structure: Structure, shape: FloatArray, mass: FloatArray) -> dict[str, float]:
    """Return the kinetic energy of every part, as shares of the whole (mass-orthonormal shapes have 1/2)."""
    nodal = structure.dofs.nodal(shape)
    shares = _member_shares(structure, nodal, mass)
    for name, part in structure.model.masses.items():
        rocker = structure.model.rocker_at(part.at)
        if rocker is not None:
            shares[f"mass {name}"] = part.body.mass * float(structure.row(part.at, np.zeros(6)) @ shape) ** 2
        else:
            motion = nodal[structure.model.mesh.node(part.at)]
            shares[f"mass {name}"] = float(motion @ part.body.matrix() @ motion)
    for name, rocker in structure.model.rockers.items():
        turn = float(structure.path(rocker) @ shape) / rocker.arms[0]
        shares[f"rocker {name}"] = rocker.inertia * turn**2
    for name, spring in structure.model.springs.items():
        if spring.mass > 0.0:
            parts = [(float(a @ shape), float(b @ shape)) for a, b in spring_parts(structure, name, spring)]
            shares[f"spring {name}"] = (
                spring.mass / spring.elements * sum(a * a + a * b + b * b for a, b in parts) / 3.0
            )
    return shares


def _member_shares(structure: Structure, nodal: FloatArray, mass: FloatArray) -> dict[str, float]:
    beams = structure.beams
    ends = nodal[beams.nodes].reshape(-1, 4, 3)
    local = np.einsum("eij,ekj->eki", beams.triads, ends).reshape(-1, 2 * len(COMPONENTS))
    shares: dict[str, float] = {}
    for kind, places in _KINDS.items():
        part = local[:, places]
        energy = np.einsum("ei,eij,ej->e", part, mass[:, places[:, None], places], part)
        for member, elements in structure.model.mesh.element_ranges().items():
            shares[f"{member} {kind}"] = float(energy[elements].sum())
    return shares
