"""What a contact adds to the equations."""

from __future__ import annotations

from dataclasses import dataclass

from flexcam.system import Channel, Load, LocalForce


@dataclass(frozen=True, eq=False)
class Coupling:
    """Loads, local forces and channels of one contact; positions count within these tuples."""

    loads: tuple[Load, ...]
    forces: tuple[LocalForce, ...]
    channels: tuple[Channel, ...]
