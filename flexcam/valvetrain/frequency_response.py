"""Frequency response of the linear train to the cam lift."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexcam.core import ComplexArray, FloatArray
from flexcam.core.errors import refuse
from flexcam.dynamics import static_displacement
from flexcam.fem.rigid_bodies import scalar_matrix
from flexcam.valvetrain.contacts import lash_row
from flexcam.valvetrain.model import Model
from flexcam.valvetrain.parts import Adjuster, Lash, PublishedLoad
from flexcam.valvetrain.published_load import series_stiffness
from flexcam.valvetrain.structure import build_structure, find_node
from flexcam.valvetrain.system_builder import build_system

_MOST = 3000
"""Number of unknowns up to which a dense solution per harmonic is reasonable."""


def lift_transfer(model: Model, contact: str, probe: str, speed: float) -> Callable[[FloatArray], ComplexArray]:
    """Return the motion of a point per lift of a cam, as a function of the circular frequency."""
    system = build_system(model, speed)
    if contact not in model.cam_contacts:
        raise refuse("contact", repr(contact), f"one of {', '.join(model.cam_contacts)}")
    if system.size > _MOST:
        raise refuse("model", f"{system.size} unknowns", f"up to {_MOST} for a polydyne cam", "", "fewer elements")
    structure, part = build_structure(model), model.cam_contacts[contact]
    where = f"contacts.{contact}.follower"
    lift = part.direction
    push = structure.row(part.follower, lift) - structure.row(model.cams[part.cam].at, lift)
    stiffness, free = system.stiffness, system.free
    if isinstance(part, PublishedLoad):
        force = series_stiffness(structure, part, where) * push
    else:
        if part.stiffness is None:
            raise refuse(f"contacts.{contact}.stiffness", "hertz", "a number", "the answer to a lift must be linear")
        force = part.stiffness * push
        stiffness, free = stiffness + scalar_matrix(push, part.stiffness), None
    for name, play in model.contacts.items():  # lash is closed while the train is under compression
        if isinstance(play, Lash | Adjuster):
            closed = scalar_matrix(lash_row(structure, play, f"contacts.{name}"), play.stiffness)
            stiffness, free = stiffness + closed, None
    row = structure.row(probe, np.zeros(6) if model.rocker_at(probe) else lift, "probe")
    M, C, K = (np.asarray(matrix.dense()) for matrix in (system.mass, system.damping, stiffness))
    still = float(row @ static_displacement(stiffness, force, system.names, free))

    def answer(omega: FloatArray) -> ComplexArray:
        found: ComplexArray = np.full(omega.shape, still, dtype=np.complex128)
        for i in np.flatnonzero(omega > 0.0).tolist():
            w = float(omega[i])
            found[i] = row @ np.linalg.solve(K + 1j * w * C - w**2 * M, force)
        return found

    return answer


def valve_ratio(model: Model, cam: str) -> float:
    """Return the valve motion per cam lift, from the rocker of the follower's train."""
    for contact in model.cam_contacts.values():
        if contact.cam == cam:
            finger = model.rocker_at(contact.follower)
            if finger is not None:
                return finger.ratio
            train = model.connected_nodes(find_node(model, contact.follower, "follower"))
            ratios = [r.ratio for r in model.rockers.values() if not r.finger and model.mesh.node(r.start) in train]
            return ratios[0] if ratios else 1.0
    return 1.0
