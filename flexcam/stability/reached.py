"""The modes of a train on the lift of a cam, and how far the cam's contact reaches each."""

from __future__ import annotations

import numpy as np

from flexcam.linalg import FloatArray, Triplets
from flexcam.motion import Event
from flexcam.orders import highest_order, latest_orders
from flexcam.response import Response
from flexcam.runner import Prepared
from flexcam.stability.discrete import MOST
from flexcam.train import ReachedModes, Structure, contact_modes, holding


def reached_modes(ready: Prepared, response: Response, contact: str, structure: Structure) -> ReachedModes:
    """Return the modes of a train on the lift of a cam."""
    cam = ready.model.cams[ready.model.driven[contact].cam]
    return contact_modes(structure, contact, _held(ready, response, cam.event))


def _held(ready: Prepared, response: Response, event: Event) -> list[tuple[str, Triplets]]:
    """Return the stiffness of each local force at the saved instant of the largest lift."""
    system = ready.problem.system
    late = response.field_time > response.field_time[-1:] - ready.revolution
    if not late.any() or not system.local_forces or system.size > MOST:
        return []
    at = np.flatnonzero(late)[[int(np.argmax(event(response.field_angle[late], 0)))]]
    motion = ready.problem.drive.at(response.field_time[at])
    return holding(system, motion, response.fields.displacement[at], response.fields.velocity[at])


def force_harmonics(response: Response, contact: str, count: int) -> FloatArray:
    """Return the amplitudes of the harmonics of a contact's force in the last revolution of a run."""
    force, told = response.channels.get(f"contacts.{contact}.force"), min(count, highest_order(response))
    if force is None or not told:
        return np.full(count, np.nan)
    return np.append(latest_orders(response, force, told).amplitudes[1:], np.full(count - told, np.nan))
