"""Contributions of contacts to the equations of motion: seats, lash and lash adjusters."""

from __future__ import annotations

from dataclasses import dataclass

from flexcam.core import FloatArray
from flexcam.core.errors import refuse
from flexcam.dynamics import (
    AngleFunction,
    AngleVector,
    Channel,
    ForceLaw,
    Load,
    LocalForce,
    constant,
    elastic_stop,
    force_sum,
    oil_column_law,
)
from flexcam.valvetrain.parts import Adjuster, Lash, Seat
from flexcam.valvetrain.structure import Structure


@dataclass(frozen=True, eq=False)
class Coupling:
    """Loads, local forces and channels of one contact; indices refer to these tuples."""

    loads: tuple[Load, ...]
    forces: tuple[LocalForce, ...]
    channels: tuple[Channel, ...]


_zero = constant(0.0)


def opposed_force(name: str, rows: FloatArray, law: ForceLaw, offset: AngleFunction = _zero) -> LocalForce:
    """Return a local force that acts against the rows it senses, A = -G, none of which changes with the cam angle."""
    sense = tuple(AngleVector.constant(row) for row in rows)
    act = tuple(AngleVector.constant(-row) for row in rows)
    return LocalForce(name, sense, act, law, (offset,) * len(rows))


def conservative_force(
    name: str,
    sense: AngleVector,
    law: ForceLaw,
    offset: AngleFunction = _zero,
    restitution: float | None = None,
) -> LocalForce:
    """Return a local force of one scalar that acts against the motion that presses its bodies together."""
    act = AngleVector(-sense.vectors, sense.functions)
    return LocalForce(name, (sense,), (act,), law, (offset,), restitution)


def couple_seat(structure: Structure, name: str, seat: Seat) -> Coupling:
    """Return the coupling of a stop."""
    row = structure.row(seat.at, seat.direction, f"contacts.{name}.at")
    if not row.any():
        given = f"a seat at {seat.at!r} along {seat.direction.tolist()}"
        why = "what cannot move that way needs no seat"
        raise refuse(
            f"contacts.{name}", given, "a point that is free along the seat's direction", why, 'add direction = "uy"'
        )
    law = elastic_stop(seat.stiffness, seat.damping, seat.damping_depth)
    force = conservative_force(f"contacts.{name}", AngleVector.constant(-row), law, restitution=seat.restitution)
    return Coupling((), (force,), (
        Channel(f"contacts.{name}.force", "N", force_sum(0)),
        Channel(f"contacts.{name}.gap", "m", lambda seen: -seen.penetrations[:, 0]),
        Channel(f"contacts.{name}.velocity", "m/s", lambda seen: -seen.rates[:, 0]),
    ))  # fmt: skip


def couple_lash(structure: Structure, name: str, lash: Lash) -> Coupling:
    """Return the coupling of the lash between a rocker and its point."""
    where = f"contacts.{name}"
    row, gap = lash_row(structure, lash, where), constant(-lash.gap)
    law = elastic_stop(lash.stiffness, lash.damping, lash.damping_depth)
    force = conservative_force(where, AngleVector.constant(row), law, gap)
    return Coupling((), (force,), (
        Channel(f"{where}.force", "N", force_sum(0)),
        Channel(f"{where}.gap", "m", lambda seen: -seen.penetrations[:, 0]),
    ))  # fmt: skip


def lash_row(structure: Structure, part: Lash | Adjuster, where: str) -> FloatArray:
    """Return the row of the approach of both sides of a lash, shape (n,)."""
    if part.ends is not None and part.direction is not None:
        first, second = (structure.row(end, part.direction, where) for end in part.ends)
        return first - second
    rocker = structure.model.rockers[str(part.rocker)]
    return structure.reach(rocker) - structure.dofs.unit(rocker.point)


def couple_adjuster(structure: Structure, name: str, part: Adjuster) -> Coupling:
    """Return the coupling of a hydraulic lash adjuster."""
    where = f"contacts.{name}"
    law = oil_column_law(part.stiffness, part.leak, part.refill, part.plunger_force)
    force = conservative_force(where, AngleVector.constant(lash_row(structure, part, where)), law)
    return Coupling((), (force,), (
        Channel(f"{where}.force", "N", force_sum(0)),
        Channel(f"{where}.leak_down", "m", lambda seen: seen.states[:, 0]),
    ))  # fmt: skip
