"""Contacts of a train as local forces: cam and follower, seat, play, coils.

Every contact here is conservative but for its dissipation: it acts along the vector it senses, A = -(d gamma/du)^T, so
that what the cam's torque puts in is what kinetic, strain and contact energy take up.
"""

from __future__ import annotations

import numpy as np

from flexcam.cam import profile_at, undercut
from flexcam.checks import refuse
from flexcam.linalg import FloatArray
from flexcam.system import AngleFunction, AngleVector, Channel, LocalForce, LocalLaw, constant
from flexcam.train.coupling import Coupling
from flexcam.train.model import Cam, CamContact, Lash, Seat
from flexcam.train.penalty import Bilateral, HertzLine, HuntCrossley, Stop
from flexcam.train.structure import Structure, find_node, spring_parts

_one, _zero = constant(1.0), constant(0.0)


def conservative(name: str, sense: AngleVector, law: LocalLaw, offset: AngleFunction = _zero) -> LocalForce:
    """Return a local force of one scalar that acts against the motion that presses its bodies together.

    Parameters
    ----------
    name
        For messages and results.
    sense
        Derivative of the depth by the unknowns.
    law
        Force from the depth.
    offset
        Prescribed part of the depth.

    Returns
    -------
    LocalForce
        With A = -G.
    """
    return LocalForce(name, (sense,), (AngleVector(-sense.vectors, sense.functions),), law, (offset,))


def couple_cam(structure: Structure, name: str, contact: CamContact) -> Coupling:
    """Return the contact of a cam and its follower.

    The depth is the lift plus what the cam's node moves towards the follower less what the follower moves away, counted
    along the lift. It acts at the true point of contact, s' beside the axis of a flat follower: there the cam's twist
    lifts the follower (and the force twists the cam, T = F s'), and the follower's tilt lets it sink.

    Parameters
    ----------
    structure
        The structure.
    name
        Of the contact.
    contact
        The contact.

    Returns
    -------
    Coupling
        A local force with the channels force, torque and depth.
    """
    cam, where = structure.model.cams[contact.cam], f"contacts.{name}"
    lift, axis = contact.direction, np.concatenate([np.zeros(3), contact.shaft_axis])
    follower = structure.row(contact.follower, lift, f"{where}.follower")
    if not follower.any():
        given, why = f"{contact.follower!r}, held along the lift", "a follower that cannot move feels no cam"
        raise refuse(f"{where}.follower", given, "a point that is free along the lift", why, "free it in [supports]")
    rows = np.array([
        structure.row(cam.at, lift) - follower,
        structure.row(cam.at, axis) - structure.row(contact.follower, axis),
    ])  # fmt: skip
    arm = _slope(cam)
    force = conservative(where, AngleVector(rows, (_one, arm)), _cam_law(structure, name, contact, cam), cam.event)
    return Coupling((), (force,), (
        Channel(f"{where}.force", "N", (), ((0, 0),)),
        Channel(f"{where}.torque", "N m", (), ((0, 0),), arm),
    ))  # fmt: skip


def _slope(cam: Cam) -> AngleFunction:
    return lambda angle, order: cam.event(angle, order + 1)


def _cam_law(structure: Structure, name: str, contact: CamContact, cam: Cam) -> LocalLaw:
    if contact.stiffness is None:
        return hertz_line(structure, name, contact, cam)
    if not contact.unilateral:
        return Bilateral(contact.stiffness)
    return HuntCrossley(contact.stiffness, contact.dissipation)


def hertz_line(structure: Structure, name: str, contact: CamContact, cam: Cam) -> HertzLine:
    """Return the line contact of a cam with its follower.

    Parameters
    ----------
    structure
        The structure: the member at the cam says the material.
    name
        Of the contact.
    contact
        The contact.
    cam
        Its cam, with follower, base circle and width.

    Returns
    -------
    HertzLine
        The law.

    Raises
    ------
    InputError
        If follower or width are not given, or the profile is hollow under a flat face.
    """
    where = f"contacts.{name}.stiffness"
    if cam.follower is None or cam.width is None:
        remedy = "give base_radius, follower and width of the cam, or a stiffness"
        raise refuse(where, "hertz", "a cam with a profile and a width", "the radius of curvature decides", remedy)
    model = structure.model
    node = find_node(model, cam.at, where)
    material = next(m.material for n, m in model.members.items() if node in model.mesh.lines[n])
    follower, roller = cam.follower, cam.follower.roller_radius

    own = profile_at(cam.event, follower, _ANGLES, cam.turn).radius
    curvature = 1.0 / own + 1.0 / roller
    radii = 1.0 / np.maximum(curvature, _STRAIGHT)

    def relative(angle: FloatArray, order: int) -> FloatArray:
        del order  # the law asks for the radius alone
        return np.interp(np.mod(angle, 2.0 * np.pi), _ANGLES, radii)

    if (undercut(own, follower) | (curvature < 0.0)).any():
        given = "a profile that is undercut or hollow under its follower"
        raise refuse(where, given, "one that touches along a line", "see flexcam cam", "a larger base circle")
    depth = roller if np.isfinite(roller) else cam.follower.base_radius
    return HertzLine(cam.width, material.E, material.nu, relative, depth, contact.dissipation)


_ANGLES = np.linspace(0.0, 2.0 * np.pi, 7201)
"""Where the curvature is taken; between these it is interpolated, as it is asked for at every iteration."""

_STRAIGHT = 1e-2
"""Least relative curvature, 1/m: a flank with a radius above 100 m is as good as straight."""


def couple_seat(structure: Structure, name: str, seat: Seat) -> Coupling:
    """Return a stop.

    Parameters
    ----------
    structure
        The structure.
    name
        Of the contact.
    seat
        The seat.

    Returns
    -------
    Coupling
        A local force with its channel.
    """
    row = structure.row(seat.at, seat.direction, f"contacts.{name}.at")
    force = conservative(f"contacts.{name}", AngleVector.constant(-row), Stop(seat.stiffness, seat.damping))
    return Coupling((), (force,), (Channel(f"contacts.{name}.force", "N", (), ((0, 0),)),))


def couple_lash(structure: Structure, name: str, lash: Lash) -> Coupling:
    """Return the play between a rocker and its point.

    Parameters
    ----------
    structure
        The structure.
    name
        Of the contact.
    lash
        The play.

    Returns
    -------
    Coupling
        A local force with its channel.
    """
    rocker = structure.model.rockers[lash.rocker]
    row = structure.reach(rocker) - structure.dofs.unit(rocker.point)
    gap = constant(-lash.gap)
    force = conservative(f"contacts.{name}", AngleVector.constant(row), Stop(lash.stiffness, lash.damping), gap)
    return Coupling((), (force,), (Channel(f"contacts.{name}.force", "N", (), ((0, 0),)),))


def clashes(structure: Structure) -> Coupling:
    """Return the contacts between neighbouring parts of every spring that can close its coils.

    Parameters
    ----------
    structure
        The structure.

    Returns
    -------
    Coupling
        A local force per spring with a clash travel, a scalar per part, and a channel of their sum.
    """
    forces: list[LocalForce] = []
    channels: list[Channel] = []
    for name, spring in structure.model.springs.items():
        if spring.clash_travel is None:
            continue
        parts = spring_parts(structure, name, spring)
        sense = tuple(AngleVector.constant(high - low) for low, high in parts)
        act = tuple(AngleVector.constant(low - high) for low, high in parts)
        room = constant(-spring.clash_travel / spring.elements)
        law = Stop(spring.clash_stiffness)
        places = tuple((len(forces), i) for i in range(len(parts)))
        forces.append(LocalForce(f"springs.{name}.clash", sense, act, law, (room,) * len(parts)))
        channels.append(Channel(f"springs.{name}.clash", "N", (), places))
    return Coupling((), tuple(forces), tuple(channels))
