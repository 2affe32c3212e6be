"""Contributions of contacts and joints to the equations of motion.

They are seats, lash, adjusters, lever ends, friction and the oil films of journal bearings.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from flexcam.core import FloatArray
from flexcam.core.errors import refuse
from flexcam.dynamics import (
    AngleVector,
    Channel,
    ForceLaw,
    LocalForce,
    Observable,
    Observation,
    constant,
    elastic_stop,
    force_sum,
    oil_column_law,
)
from flexcam.dynamics.force_laws import LEVER, SLIDING_FRICTION
from flexcam.valvetrain.coupling import Coupling, conservative_force, opposed_force
from flexcam.valvetrain.parts import Adjuster, Friction, Lash, Lever, Seat
from flexcam.valvetrain.rigid_kinematics import follower_train
from flexcam.valvetrain.structure import Structure, lever_ends, nest_rows, stop_row


def couple_seat(structure: Structure, name: str, seat: Seat) -> Coupling:
    """Return the coupling of a stop."""
    row = stop_row(structure, name, seat)
    if not row.any():
        if not seat.direction.any():
            why = "flexcam finds the direction only at the point of a rocker"
            remedy = 'add the direction away from the seat, such as direction = "uy"'
            raise refuse(f"contacts.{name}.direction", "nothing", "a direction", why, remedy)
        given = f"a seat at {seat.at!r} along {seat.direction.tolist()}"
        why = "a point that cannot move needs no seat"
        raise refuse(f"contacts.{name}", given, "a point that is free along the seat's direction", why)
    law = elastic_stop(seat.stiffness, seat.damping, seat.damping_depth)
    force = conservative_force(f"contacts.{name}", AngleVector.constant(row), law, restitution=seat.restitution)
    return Coupling((), (force,), (
        Channel(f"contacts.{name}.force", "N", force_sum(0)),
        Channel(f"contacts.{name}.gap", "m", lambda obs: -obs.penetrations[:, 0]),
        Channel(f"contacts.{name}.velocity", "m/s", lambda obs: -obs.rates[:, 0]),
    ))  # fmt: skip


def couple_lash(structure: Structure, name: str, lash: Lash) -> Coupling:
    """Return the coupling of the lash between a rocker and its point, or between two nodes."""
    where = f"contacts.{name}"
    row, gap = stop_row(structure, name, lash), constant(-lash.gap)
    if not row.any():
        allowed, why = "a point that is free along the direction, or about it", "it would never close"
        raise refuse(where, "a lash between fixed points", allowed, why)
    law = elastic_stop(lash.stiffness, lash.damping, lash.damping_depth)
    force = conservative_force(where, AngleVector.constant(row), law, gap)
    force_unit, gap_unit = ("N m", "rad") if lash.turns else ("N", "m")
    return Coupling((), (force,), (
        Channel(f"{where}.force", force_unit, force_sum(0)),
        Channel(f"{where}.gap", gap_unit, lambda obs: -obs.penetrations[:, 0]),
    ))  # fmt: skip


def couple_adjuster(structure: Structure, name: str, part: Adjuster) -> Coupling:
    """Return the coupling of a hydraulic lash adjuster."""
    where, chamber, travel = f"contacts.{name}", part.chamber, part.travel
    size = part.leak, part.refill, part.plunger_force
    law = oil_column_law(part.stiffness, *size) if chamber is None else chamber.law(*size)
    row = AngleVector.constant(stop_row(structure, name, part))
    forces = [conservative_force(where, row, law)]
    channels = [
        Channel(f"{where}.force", "N", force_sum(0)),
        Channel(f"{where}.leak_down", "m", lambda obs: obs.states[:, 0]),
    ]
    if chamber is not None:
        area, preload = chamber.area, part.plunger_force
        channels.append(Channel(f"{where}.pressure", "Pa", lambda obs: (obs.forces[:, 0] - preload) / area))
    if travel is not None:
        stop, outward = elastic_stop(travel.stiffness, travel.damping), AngleVector(-row.vectors, row.functions)
        forces += [
            conservative_force(f"{where}.bottom", row, stop, constant(-travel.compression)),
            conservative_force(f"{where}.ring", outward, stop, constant(-travel.extension)),
        ]
        channels.append(Channel(f"{where}.stop_force", "N", lambda obs: obs.forces[:, 1] - obs.forces[:, 2]))
    return Coupling((), tuple(forces), tuple(channels))


def couple_friction(structure: Structure) -> Coupling:
    """Return the friction of guides, seals, pivots and nested springs, with its power as a channel."""
    forces: list[LocalForce] = []
    channels: list[Channel] = []
    count = 0
    for name, part in structure.model.friction.items():
        where = f"friction.{name}"
        rows = _slide_row(structure, part, where)[None] if part.springs is None else nest_rows(structure, part.springs)
        force, breakaway, damping = (value / len(rows) for value in (part.force, part.breakaway_force, part.damping))
        law = ForceLaw(SLIDING_FRICTION, (force, breakaway, part.stribeck_speed, damping, part.friction_speed))
        forces.append(opposed_force(where, rows, law))
        scalars = list(range(count, count + len(rows)))
        count += len(rows)
        unit = "N" if part.direction[:3].any() else "N m"
        channels.append(Channel(f"{where}.force", unit, force_sum(*scalars)))
        channels.append(Channel(f"{where}.power", "W", _power(scalars)))
    return Coupling((), tuple(forces), tuple(channels))


def couple_films(structure: Structure, speed: float) -> Coupling:
    """Return the oil films of journal bearings at a speed of the shaft, rad/s."""
    forces: list[LocalForce] = []
    channels: list[Channel] = []
    for i, (name, part) in enumerate(structure.model.bearings.items()):
        where = f"bearings.{name}"
        rows = np.array([structure.row(part.at, direction, f"{where}.at") for direction in part.directions])
        if not rows.any(axis=1).all():
            given, why = f"a film at {part.at!r}, which is held across the shaft", "the journal must move in its film"
            raise refuse(where, given, "a journal that is free across the shaft", why)
        forces.append(opposed_force(where, rows, part.law(speed)))
        channels += _film_channels(where, part.radial_clearance, slice(2 * i, 2 * i + 2))
    return Coupling((), tuple(forces), tuple(channels))


def _film_channels(where: str, clearance: float, scalars: slice) -> Iterator[Channel]:
    """Yield the channels of a film by the indices of its forces."""

    def eccentricity(obs: Observation) -> FloatArray:
        return np.hypot(*obs.penetrations[:, scalars].T) / clearance

    yield Channel(f"{where}.force", "N", lambda obs: np.hypot(*obs.forces[:, scalars].T))
    yield Channel(f"{where}.eccentricity", "1", eccentricity)
    yield Channel(f"{where}.angle", "rad", lambda obs: np.arctan2(*obs.penetrations[:, scalars].T[::-1]))
    yield Channel(f"{where}.film_thickness", "m", lambda obs: clearance * (1.0 - eccentricity(obs)))


def _power(scalars: list[int]) -> Observable:
    """Return the sum of some local forces times their rates."""
    return lambda obs: (obs.forces[:, scalars] * obs.rates[:, scalars]).sum(axis=1)


def _slide_row(structure: Structure, part: Friction, where: str) -> FloatArray:
    row = structure.row(part.at, part.direction, f"{where}.at")
    if part.to is not None:
        row = row - structure.row(part.to, part.direction, f"{where}.to")
    if not row.any():
        given, why = f"a slide at {part.at!r} along {part.direction.tolist()}", "it cannot move that way"
        raise refuse(where, given, "a point that is free along the direction", why)
    return row


def lever_end(lever: Lever, end: int) -> ForceLaw:
    """Return the law of an elastic lever end beyond its linear spring; it senses the path p and the motion x."""
    return ForceLaw(
        LEVER, (lever.stiffness[end], lever.damping[end], lever.arms[end], lever.arms[0], lever.angles[end])
    )


def lever_joints(structure: Structure) -> Coupling:
    """Return the nonlinear forces of all levers, beyond the linear springs of the structure.

    The force of the exact penetration ``y(p) - x`` minus that of the linear one acts on the lever with ``y'(p)``.
    """
    check_lever_rotation(structure)
    forces: list[LocalForce] = []
    for name, lever in structure.model.levers.items():
        for end, rows in lever_ends(structure, lever).items():
            where = f"rockers.{name}.{('from', 'to')[end]}"
            forces.append(opposed_force(where, np.array(rows), lever_end(lever, end)))
    return Coupling((), tuple(forces), ())


def check_lever_rotation(structure: Structure) -> None:
    """Refuse a lift that rotates a lever until its arm is parallel to the motion."""
    model = structure.model
    for name, contact in model.cam_contacts.items() if model.levers else ():
        train = follower_train(structure, contact, f"contacts.{name}.follower")
        event = model.cams[contact.cam].event
        for rocker, lever in model.levers.items():
            ratio = float(structure.row(lever.start, lever.direction) @ train.motion)
            lever.path_at(np.array([ratio * event.height]), f"rockers.{rocker}.arms")
