"""Lobes that cannot be made as the case gives them: crossing themselves, thinner than their shaft, at two places."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from flexcam.cam import Follower, profile_at, undercut
from flexcam.checks import InputError
from flexcam.train import Cam, CamContact, Model, PublishedLoad

_ANGLES = np.linspace(0.0, 2.0 * math.pi, 720, endpoint=False)
"""Cam angles at which a profile is looked at."""

_BESIDE = 1.0
"""Angle between two lifts, deg, up to which one lobe may be meant for both."""

_THICKER = 1.0 + 1e-9
"""Shaft by base circle from which the shaft is the thicker one; where both are equal the follower rests on either."""


def lobe_doubts(model: Model) -> list[str]:
    """Return which lobes cannot be made, in words."""
    known = [(name, cam, cam.follower) for name, cam in model.cams.items() if cam.follower is not None]
    return [*(one for name, cam, follower in known for one in _told(model, name, cam, follower)), *_shared(model)]


def _shared(model: Model) -> Iterator[str]:
    """Yield the cams that lift followers on different sides of the shaft at the same cam angle."""
    first: dict[str, PublishedLoad | CamContact] = {}
    for one in model.driven.values():
        other = first.setdefault(one.cam, one)
        later = _turn(other, one)
        if min(later, 360.0 - later) > _BESIDE:
            why = f"it lifts {other.follower} and {one.follower} at one cam angle, and a lobe reaches the second"
            remedy = f"give {one.follower} a cam of its own with a phase greater by that"
            yield f"Warning: cams.{one.cam}: {why} {later:.4g} deg later; {remedy}"


def _turn(one: PublishedLoad | CamContact, other: PublishedLoad | CamContact) -> float:
    """Return the angle from one lift to another in the cam's sense of rotation, deg, from 0 to 360."""
    a, b = one.direction[:3], other.direction[:3]
    return math.degrees(math.atan2(float(np.cross(a, b) @ one.shaft_axis), float(a @ b))) % 360.0


def _told(model: Model, name: str, cam: Cam, follower: Follower) -> Iterator[str]:
    if _undercut(cam, follower):
        why = "its profile would cross itself (undercut), so that no cam makes the lift of this run"
        yield f"Warning: cams.{name}: {why}; flexcam cam says which base circle is enough"
    shaft = _shaft_radius(model, cam)
    if shaft > _THICKER * follower.base_radius:
        sizes = f"its base circle has a radius of {1e3 * follower.base_radius:.4g} mm, its shaft one of"
        yield f"Warning: cams.{name}: {sizes} {1e3 * shaft:.4g} mm: the follower would run on the shaft"


def _undercut(cam: Cam, follower: Follower) -> bool:
    try:
        radius = profile_at(cam.event, follower, _ANGLES, cam.turn).radius
    except InputError:  # the follower cannot stand on it: what needs the profile refuses it
        return False
    return bool(undercut(radius, follower).any())


def _shaft_radius(model: Model, cam: Cam) -> float:
    """Return the radius of the round shaft a cam sits on, m; zero where there is none."""
    node = model.mesh.points.get(cam.at, np.empty(0, dtype=int))
    lines, members = model.mesh.lines, model.members
    sections = [one.section for name, one in members.items() if np.isin(node, lines[name]).any()]
    return max((one.radius for one in sections if one.round), default=0.0)
