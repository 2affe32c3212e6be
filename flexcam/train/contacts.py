"""Contacts of a train as local forces: seat and play (cam and follower stand in `cam_contact`, coils in `coils`).

Every contact here is conservative but for its dissipation: it acts along the vector it senses, A = -(d gamma/du)^T, so
that what the cam's torque puts in is what kinetic, strain and contact energy take up.
"""

from __future__ import annotations

from flexcam.checks import refuse
from flexcam.linalg import FloatArray
from flexcam.system import AngleFunction, AngleVector, Channel, ForceLaw, LocalForce, constant, elastic_stop, force_sum
from flexcam.train.coupling import Coupling
from flexcam.train.model import Adjuster, Lash, Seat
from flexcam.train.structure import Structure

_zero = constant(0.0)


def conservative(
    name: str,
    sense: AngleVector,
    law: ForceLaw,
    offset: AngleFunction = _zero,
    restitution: float | None = None,
) -> LocalForce:
    """Return a local force of one scalar that acts against the motion that presses its bodies together."""
    switching = () if restitution is None else (0,)  # an impact happens at the moment of touchdown
    act = AngleVector(-sense.vectors, sense.functions)
    return LocalForce(name, (sense,), (act,), law, (offset,), switching, restitution)


def couple_seat(structure: Structure, name: str, seat: Seat) -> Coupling:
    """Return a stop."""
    row = structure.row(seat.at, seat.direction, f"contacts.{name}.at")
    if not row.any():
        given = f"a seat at {seat.at!r} along {seat.direction.tolist()}"
        why = "what cannot move that way needs no seat"
        raise refuse(
            f"contacts.{name}", given, "a point that is free along the seat's direction", why, 'add direction = "uy"'
        )
    law = elastic_stop(seat.stiffness, seat.damping, seat.damping_depth)
    force = conservative(f"contacts.{name}", AngleVector.constant(-row), law, restitution=seat.restitution)
    return Coupling((), (force,), (
        Channel(f"contacts.{name}.force", "N", force_sum(0)),
        Channel(f"contacts.{name}.gap", "m", lambda seen: -seen.gaps[:, 0]),
        Channel(f"contacts.{name}.velocity", "m/s", lambda seen: -seen.rates[:, 0]),
    ))  # fmt: skip


def couple_lash(structure: Structure, name: str, lash: Lash) -> Coupling:
    """Return the play between a rocker and its point."""
    where = f"contacts.{name}"
    row, gap = play_row(structure, lash, where), constant(-lash.gap)
    law = elastic_stop(lash.stiffness, lash.damping, lash.damping_depth)
    force = conservative(where, AngleVector.constant(row), law, gap)
    return Coupling((), (force,), (
        Channel(f"{where}.force", "N", force_sum(0)),
        Channel(f"{where}.gap", "m", lambda seen: -seen.gaps[:, 0]),
    ))  # fmt: skip


def play_row(structure: Structure, part: Lash | Adjuster, where: str) -> FloatArray:
    """Return the row of how far the two sides of a play have come together, shape (n,)."""
    if part.ends is not None and part.direction is not None:
        first, second = (structure.row(end, part.direction, where) for end in part.ends)
        return first - second
    rocker = structure.model.rockers[str(part.rocker)]
    return structure.reach(rocker) - structure.dofs.unit(rocker.point)
