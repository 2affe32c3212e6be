"""The modes of a train whose contacts hold, and how far the contact of a cam reaches each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexcam.integrate import Tangents, equilibrium
from flexcam.linalg import FloatArray, Triplets
from flexcam.motion import event_extremes
from flexcam.system import CamMotion, ConstantSpeed, System
from flexcam.train.assembled import build_structure
from flexcam.train.build import build_system
from flexcam.train.model import Model
from flexcam.train.modes import ModelModes, model_modes
from flexcam.train.structure import Structure

_FELT = 1e-4
"""Share of the contact's static yield from which on a mode is felt at the contact."""

_MOST = 3000
"""Unknowns up to which the matrices of contacts are reasonable."""


@dataclass(frozen=True, eq=False)
class ReachedModes:
    """Modes on the lift of a cam.

    Parameters
    ----------
    found
        The modes; contacts that are closed at full lift hold with their stiffness.
    push
        Size of the modal force by the contact's force, shape (k,), 1/sqrt(kg).
    """

    found: ModelModes
    push: FloatArray

    @property
    def felt(self) -> list[int]:
        """Positions of the modes that take part in what the contact yields under a constant force, no free motions.

        Low modes count more by this than by the modal force, so that the surge of a spring is not missed beside the
        stiff modes of the contact itself.
        """
        rigid, omegas = self.found.modes.rigid, self.found.modes.omegas
        shares = (self.push[rigid:] / omegas[rigid:]) ** 2
        return (np.flatnonzero(shares > _FELT * shares.sum()) + rigid).tolist()


def contact_modes(structure: Structure, contact: str, held: Sequence[tuple[str, Triplets]]) -> ReachedModes:
    """Return the modes of a train, and how far a contact reaches each."""
    part = structure.model.driven[contact]
    found = model_modes(structure, held=held)
    push = structure.row(part.follower, part.direction) - structure.row(
        structure.model.cams[part.cam].at, part.direction
    )
    return ReachedModes(found, np.abs(push @ found.modes.shapes))


def holding(
    system: System, motion: CamMotion, displacement: FloatArray, velocity: FloatArray, inner: FloatArray | None = None
) -> list[tuple[str, Triplets]]:
    """Return the stiffness with which each local force holds at an instant."""
    tangents = Tangents(system, motion, displacement, velocity, inner)
    return [(name, Triplets.from_dense(0.5 * (part + part.T))) for name, part in tangents.parts(0)]


def modes_on_the_lift(model: Model, contact: str, speed: float) -> ReachedModes:
    """Return the modes of a train at rest on the full lift of a cam, contacts closed as they are in balance there."""
    structure, system = build_structure(model), build_system(model, speed)
    if not system.local_forces or system.size > _MOST:
        return contact_modes(structure, contact, ())
    highest = event_extremes(model.cams[model.driven[contact].cam].event)[1]
    drive = ConstantSpeed(speed, start=highest.at)
    state = equilibrium(system, drive)
    inner = None if state.inner is None else state.inner[None]
    still = np.zeros((1, system.size))
    return contact_modes(
        structure, contact, holding(system, drive.at(np.zeros(1)), state.displacement[None], still, inner)
    )
