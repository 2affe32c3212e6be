"""Followers on their cams: a flat face or a roller, and its connection to the moving node."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexcam.plotting.scene.solids import Solid, cylinder, revolve

if TYPE_CHECKING:
    from flexcam.plotting.scene.instant import SceneState
    from flexcam.plotting.scene.layout import CamPlacement


def follower(place: CamPlacement, instant: SceneState) -> list[Solid]:
    """Return the solids of a follower."""
    moved = instant.at(place.contact.follower, place.lift)
    if np.isinf(place.frame.follower.roller_radius):
        return _face(place, moved)
    return _roller(place, moved, instant)


def _face(place: CamPlacement, moved: np.ndarray) -> list[Solid]:
    """Return a disc with its face on the cam, and the neck to the node if that is farther away."""
    base, radius = place.frame.follower.base_radius, place.face
    face = place.frame.centre + base * place.lift + moved
    thick = 0.3 * radius
    profile = [(0.0, 0.96 * radius), (0.04 * radius, radius), (thick, radius)]
    parts = [revolve("follower", face, place.lift, profile)]
    if place.ahead - base > thick:
        parts.append(
            cylinder("follower", face + thick * place.lift, face + (place.ahead - base) * place.lift, 0.3 * radius)
        )
    return parts


def _roller(place: CamPlacement, moved: np.ndarray, instant: SceneState) -> list[Solid]:
    frame = place.frame
    along = float(moved @ place.lift)
    finger = not instant.structure.is_node(place.contact.follower)
    swings = finger or frame.side != 1
    centre = frame.contact_end(along if swings else 0.0)
    middle = frame.centre + np.array([centre.real, centre.imag]) @ frame.plane + (0.0 if swings else 1.0) * moved
    half, radius = 0.55 * frame.width * frame.axis, frame.follower.roller_radius
    parts = [cylinder("roller", middle - half, middle + half, radius)]
    node = place.ahead - centre.imag
    if not finger and node > 1.2 * radius:
        parts.append(cylinder("follower", middle, middle + node * place.lift, 0.4 * radius))
    return parts
