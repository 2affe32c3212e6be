"""What a contact adds to the equations."""

from __future__ import annotations

from dataclasses import dataclass

from flexcam.linalg import FloatArray
from flexcam.system import AngleFunction, AngleVector, Channel, ForceLaw, Load, LocalForce, constant


@dataclass(frozen=True, eq=False)
class Coupling:
    """Loads, local forces and channels of one contact; positions count within these tuples."""

    loads: tuple[Load, ...]
    forces: tuple[LocalForce, ...]
    channels: tuple[Channel, ...]


_zero = constant(0.0)


def opposed(
    name: str, rows: FloatArray, law: ForceLaw, offset: AngleFunction = _zero, switching: tuple[int, ...] = ()
) -> LocalForce:
    """Return a local force that acts against the rows it senses, A = -G, none of which changes with the cam angle."""
    sense = tuple(AngleVector.constant(row) for row in rows)
    act = tuple(AngleVector.constant(-row) for row in rows)
    return LocalForce(name, sense, act, law, (offset,) * len(rows), switching)
