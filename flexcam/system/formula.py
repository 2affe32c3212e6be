"""Local laws as data: a kind, constants and functions of the cam angle, from which a compiled step computes them."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol, runtime_checkable

from flexcam.system.local import AngleFunction, Constant


class Kind(IntEnum):
    """Laws that a compiled step knows, with their constants and functions."""

    BILATERAL = 0
    """k, c: k gamma + c gamma'."""
    STOP = 1
    """k, c, hold: `pointwise.stop`."""
    HUNT_CROSSLEY = 2
    """k, chi: `pointwise.hunt_crossley`."""
    LINE = 3
    """width, give, rest, depth, chi, and most per radius; relative radius and cosine: `pointwise.line_contact`."""
    OIL = 4
    """k, c, c0, plunger force; one state: `pointwise.oil`."""
    PULSATING = 5
    """k; its swing: k gamma times the swing."""
    LEVER = 6
    """k, c, arm, driven arm, angle: a lever's end beyond its linear spring, of path and motion."""
    ARCH = 7
    """EA/L, g by rows, y0, g y0: a shallow arch beyond its bar, of its stretch and three scalars per plane."""


_DISSIPATION = {Kind.BILATERAL: 1, Kind.STOP: 1, Kind.HUNT_CROSSLEY: 1, Kind.LINE: 4, Kind.LEVER: 1}
"""Which of the constants dissipates."""


@dataclass(frozen=True, eq=False)
class Formula:
    """A law of one or a few scalars.

    Parameters
    ----------
    kind
        Which.
    constants
        As `Kind` says.
    functions
        Of the cam angle, as `Kind` says.
    scalars
        How many it senses.
    friction
        mu and v0 of Coulomb's friction on a further scalar behind its own; None without.
    """

    kind: Kind
    constants: tuple[float, ...]
    functions: tuple[AngleFunction, ...] = ()
    scalars: int = 1
    friction: tuple[float, float] | None = None

    @property
    def lossless(self) -> bool:
        """Whether it gives back all that it takes: no dissipation, friction or leak."""
        where = _DISSIPATION.get(self.kind)
        return self.friction is None and self.kind is not Kind.OIL and (where is None or self.constants[where] == 0.0)


@runtime_checkable
class Formulated(Protocol):
    """A local law that can be written as formulas."""

    def formulas(self, count: int) -> tuple[Formula, ...] | None:
        """Return the formulas of its sensed scalars, so many, in order; None where it has none after all."""
        ...


ONE = Constant(1.0)
"""The cosine of a contact that is not inclined."""
