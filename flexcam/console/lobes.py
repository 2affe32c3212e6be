"""Lobes that cannot be made as the case gives them, and bodies on their shaft that its equations hold still."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from flexcam.cam import Follower, profile_at, undercut
from flexcam.checks import InputError
from flexcam.linalg import FloatArray
from flexcam.train import Cam, CamContact, Model, PublishedLoad, member_masses

_ANGLES = np.linspace(0.0, 2.0 * math.pi, 720, endpoint=False)
"""Cam angles at which a profile is looked at."""

_BESIDE = 1.0
"""Angle between two lifts, deg, up to which one lobe may be meant for both."""

_THICKER = 1.0 + 1e-9
"""Shaft by base circle from which the shaft is the thicker one; where both are equal the follower rests on either."""


def lobe_doubts(model: Model) -> list[str]:
    """Return which lobes cannot be made, and which bodies turn although they are taken as still, in words."""
    known = [(name, cam, cam.follower) for name, cam in model.cams.items() if cam.follower is not None]
    lobes = [one for name, cam, follower in known for one in _told(model, name, cam, follower)]
    return [*lobes, *_shared(model), *dict.fromkeys(_uneven_bodies(model))]


_FELT = 0.01
"""Share of the energy of a shaft's bending from which the swing of a body's inertia is told: flexcam's choice."""


def _uneven_bodies(model: Model) -> Iterator[str]:
    """Yield the bodies that turn with a shaft and have another inertia about each axis across it.

    In a half wave of bending over a shaft of length L and mass m, the difference of both has ``2 (pi/L)^2 dJ/m`` of the
    kinetic energy: slopes are pi/L times the deflection, and the mean of the squared half wave is 1/2.
    """
    own = member_masses(model)
    for contact in model.driven.values():
        nodes = model.mesh.connected(model.mesh.node(model.cams[contact.cam].at))
        length = float(np.ptp(model.mesh.nodes[nodes] @ contact.shaft_axis))
        mass = sum(own[name] for name, line in model.mesh.lines.items() if np.isin(line, nodes).any())
        for name, part in model.masses.items():
            at = model.mesh.points.get(part.at, np.empty(0, dtype=int))
            apart = _across(part.body.matrix()[3:, 3:], contact.shaft_axis) if np.isin(at, nodes).any() else 0.0
            if 2.0 * math.pi**2 * apart > _FELT * mass * length**2:
                given = f"its inertias across the shaft are {apart:.3g} kg m^2 apart and turn with it"
                yield f"Warning: masses.{name}: {given}; they are taken as still: give the mean of both"


def _across(inertia: FloatArray, axis: FloatArray) -> float:
    """Return the difference of the largest and the least moment of inertia about the axes square to one."""
    square = np.eye(3) - np.outer(axis, axis)
    values = np.linalg.eigvalsh(square @ inertia @ square + 2.0 * np.trace(inertia) * np.outer(axis, axis))
    return float(values[1] - values[0])


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
