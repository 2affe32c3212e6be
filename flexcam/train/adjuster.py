"""Hydraulic lash adjusters: a plunger on oil that leaks, with a check valve and a spring.

While the oil column is pressed by e = gamma - z it carries k e and leaks, z' = k e/c. When it would be pulled the check
valve opens: oil flows in, z' = k e/c0 with a c0 much smaller than c, and only the plunger's spring pushes. The internal
state z is the leak-down since installation. At rest the plunger's spring has taken up all
play.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexcam.linalg import FloatArray
from flexcam.system import AngleVector, Channel, Formula, Kind, Reaction, Stored, force_sum
from flexcam.train.contacts import conservative, play_row
from flexcam.train.coupling import Coupling
from flexcam.train.model import Adjuster
from flexcam.train.structure import Structure


@dataclass(frozen=True)
class OilColumn:
    """Local law of an adjuster: its depth is how far both sides have come together.

    Parameters
    ----------
    stiffness
        k of the oil, N/m.
    leak, refill
        c and c0, N s/m.
    plunger_force
        N.

    Examples
    --------
    >>> OilColumn(2.0, 4.0, 0.1, 1.0).respond(np.array([3.0]), np.zeros(1), np.array([1.0]), 0.0).force
    array([5.])
    """

    stiffness: float
    leak: float
    refill: float
    plunger_force: float

    @property
    def start_state(self) -> FloatArray:
        """No leak-down."""
        return np.zeros(1)

    def rest_state(self, gap: FloatArray) -> FloatArray:
        """Return the leak-down at which no oil is missing: what carries at rest has not leaked yet."""
        return np.minimum(gap, 0.0)

    def respond(self, gap: FloatArray, rate: FloatArray, state: FloatArray, angle: float) -> Reaction:
        """Return force, velocity of leak-down and tangent."""
        pressed = float(gap[0] - state[0])
        carried = self.stiffness if pressed > 0.0 else 0.0
        flow = self.stiffness / (self.leak if pressed > 0.0 else self.refill)
        one = np.ones((1, 1))
        return Reaction(
            np.array([self.plunger_force + carried * pressed]), carried * one, 0.0 * one, np.array([flow * pressed]),
            -carried * one, flow * one, 0.0 * one, -flow * one,
        )  # fmt: skip

    def formulas(self, count: int) -> tuple[Formula, ...]:
        """Return the law as data."""
        return (Formula(Kind.OIL, (self.stiffness, self.leak, self.refill, self.plunger_force)),) * count

    def stored(self, gap: FloatArray, state: FloatArray, angle: FloatArray) -> Stored:
        """Return the energy in oil and plunger spring and its derivatives, per instant."""
        pressed = np.maximum(gap - state, 0.0)
        force = self.stiffness * pressed
        energy = self.plunger_force * gap[..., 0] + 0.5 * (force * pressed)[..., 0]
        return Stored(energy, self.plunger_force + force, -force)


def couple_adjuster(structure: Structure, name: str, part: Adjuster) -> Coupling:
    """Return a hydraulic lash adjuster.

    Parameters
    ----------
    structure
        The structure.
    name
        Of the contact.
    part
        The adjuster.

    Returns
    -------
    Coupling
        A local force with the channels force and leak-down.
    """
    where = f"contacts.{name}"
    law = OilColumn(part.stiffness, part.leak, part.refill, part.plunger_force)
    force = conservative(where, AngleVector.constant(play_row(structure, part, where)), law)
    return Coupling((), (force,), (
        Channel(f"{where}.force", "N", force_sum(0)),
        Channel(f"{where}.leak_down", "m", lambda seen: seen.states[:, 0]),
    ))  # fmt: skip
