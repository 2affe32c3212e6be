"""Local forces: each senses a few scalars of the motion and acts with as many forces."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from flexcam.linalg import FloatArray
from flexcam.system.angle_functions import AngleFunction, AngleVector
from flexcam.system.force_laws import ForceLaw

_NO_STATE = np.zeros(0)
_NONE = np.zeros((0, 0))


@dataclass(frozen=True, eq=False)
class Reaction:
    """Forces of local laws and their derivatives.

    Parameters
    ----------
    force
        N, shape (c,).
    by_gap, by_rate
        Derivatives of the forces by the sensed scalars and their rates, shape (c, c).
    state_rate
        Rates of the internal states, shape (s,).
    by_state
        Derivatives of the forces by the states, shape (c, s).
    state_rate_by_gap, state_rate_by_rate
        Derivatives of the rates by the sensed scalars and their rates, shape (s, c).
    state_rate_by_state
        Derivatives of the rates by the states, shape (s, s).
    """

    force: FloatArray
    by_gap: FloatArray
    by_rate: FloatArray
    state_rate: FloatArray = field(default_factory=lambda: _NO_STATE)
    by_state: FloatArray = field(default_factory=lambda: _NONE)
    state_rate_by_gap: FloatArray = field(default_factory=lambda: _NONE)
    state_rate_by_rate: FloatArray = field(default_factory=lambda: _NONE)
    state_rate_by_state: FloatArray = field(default_factory=lambda: _NONE)


class CustomLaw(Protocol):
    """A force law as an object in Python, without internal state; only the direct engine evaluates it."""

    def respond(self, gap: FloatArray, rate: FloatArray, angle: float) -> Reaction:
        """Return the forces for sensed scalars and rates, shape (c,) each, at a cam angle (rad)."""
        ...


@dataclass(frozen=True, eq=False)
class LocalForce:
    """A force that senses c scalars of the motion and acts with c forces.

    Parameters
    ----------
    name
        For messages and results.
    sense
        G: one vector per sensed scalar.
    act
        A: one vector per force. A conservative contact has A = -(d gamma/du)^T.
    law
        Force from the sensed scalars; a law of fewer scalars than c holds for each group of them.
    offset
        g(theta), one function per sensed scalar.
    switching
        Sensed scalars whose passing zero must be located: a step ends there, and an impact may follow.
    restitution
        Rate of separation per rate of approach at the moment a switching scalar becomes positive (Newton's law of
        impact); None where bodies meet without an impact.
    """

    name: str
    sense: tuple[AngleVector, ...]
    act: tuple[AngleVector, ...]
    law: ForceLaw | CustomLaw
    offset: tuple[AngleFunction, ...]
    switching: tuple[int, ...] = ()
    restitution: float | None = None

    @property
    def states(self) -> int:
        """Number of internal states."""
        return self.law.states * (len(self.sense) // self.law.scalars) if isinstance(self.law, ForceLaw) else 0

    def idle_scalars(self) -> list[tuple[int, ...]]:
        """Return sets of scalars on which no force acts, and which cause none, while they are zero."""
        if not isinstance(self.law, ForceLaw):
            return []
        groups = range(0, len(self.sense), self.law.scalars)
        return [tuple(first + i for i in scalars) for first in groups for scalars in self.law.idle_scalars()]

    @property
    def conservative(self) -> bool:
        """Whether it acts against exactly what it senses, A = -G, by a law that stores energy."""
        return isinstance(self.law, ForceLaw) and all(
            sense.functions == act.functions and np.array_equal(sense.vectors, -act.vectors)
            for sense, act in zip(self.sense, self.act, strict=True)
        )
