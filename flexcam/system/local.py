"""Local forces: what senses a few scalars of the motion and acts with as many forces."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np

from flexcam.linalg import FloatArray, IntArray

AngleFunction = Callable[[FloatArray, int], FloatArray]
"""A scalar function of the cam angle (rad) and of the order of its derivative."""


@dataclass(frozen=True)
class Constant:
    """A function of the cam angle that is `value` everywhere, and can be told from others."""

    value: float

    def __call__(self, angle: FloatArray, order: int) -> FloatArray:
        """Return the value at every angle; derivatives are zero."""
        return np.full_like(angle, self.value if order == 0 else 0.0)


@dataclass(frozen=True)
class Derivative:
    """The derivative of a function of the cam angle."""

    function: AngleFunction

    def __call__(self, angle: FloatArray, order: int) -> FloatArray:
        """Return it, or a derivative of it."""
        return self.function(angle, order + 1)


@dataclass(frozen=True, eq=False)
class AngleVector:
    """A vector that depends on the cam angle: a few constant vectors times scalar functions.

    Parameters
    ----------
    vectors
        Shape (k, n).
    functions
        One function of the angle per vector; none for a single vector that does not depend on it.
    """

    vectors: FloatArray
    functions: tuple[AngleFunction, ...]

    @classmethod
    def constant(cls, vector: FloatArray) -> AngleVector:
        """Return a vector that does not depend on the angle, shape (n,)."""
        return cls(vector[None, :], ())

    def weights(self, angle: FloatArray, order: int = 0) -> FloatArray:
        """Return the weights of the vectors, shape (len(angle), k), or their derivatives by the angle."""
        if not self.functions:
            return np.full((*angle.shape, 1), 0.0 if order else 1.0)
        return np.stack([function(angle, order) for function in self.functions], axis=-1)


_NO_STATE = np.zeros(0)
_NONE = np.zeros((0, 0))


@dataclass(frozen=True, eq=False)
class Reaction:
    """Answer of a local law and its derivatives.

    Parameters
    ----------
    force
        Shape (c,).
    by_gap, by_rate
        Derivatives of the force by gamma and gamma', shape (c, c).
    state_rate
        z', shape (s,); empty for most laws.
    by_state
        Derivative of the force by z, shape (c, s).
    state_rate_by_gap, state_rate_by_rate
        Derivatives of z' by gamma and gamma', shape (s, c).
    state_rate_by_state
        Derivative of z' by z, shape (s, s).
    """

    force: FloatArray
    by_gap: FloatArray
    by_rate: FloatArray
    state_rate: FloatArray = field(default_factory=lambda: _NO_STATE)
    by_state: FloatArray = field(default_factory=lambda: _NONE)
    state_rate_by_gap: FloatArray = field(default_factory=lambda: _NONE)
    state_rate_by_rate: FloatArray = field(default_factory=lambda: _NONE)
    state_rate_by_state: FloatArray = field(default_factory=lambda: _NONE)


class LocalLaw(Protocol):
    """Force of a contact, a joint or a published load from what it senses."""

    @property
    def start_state(self) -> FloatArray:
        """Internal state at rest, shape (s,); empty for most laws."""
        ...

    def respond(self, gap: FloatArray, rate: FloatArray, state: FloatArray, angle: float) -> Reaction:
        """Return the reaction to gamma and gamma', each shape (c,), an internal state (s,) and the cam angle."""
        ...


@dataclass(frozen=True, eq=False)
class Stored:
    """Energy of a local law at m instants, and its derivatives.

    Parameters
    ----------
    energy
        J, shape (m,).
    by_gap
        Derivative by what is sensed: the force at rest, shape (m, c).
    by_state
        Derivative by the internal state, shape (m, s).
    """

    energy: FloatArray
    by_gap: FloatArray
    by_state: FloatArray


@runtime_checkable
class Storing(Protocol):
    """A local law that stores energy: it acts along what it senses, A = -G."""

    def stored(self, gap: FloatArray, state: FloatArray, angle: FloatArray) -> Stored:
        """Return the energy at gamma, shape (m, c), internal states, shape (m, s), and cam angles, shape (m,)."""
        ...


@runtime_checkable
class Smooth(Protocol):
    """A storing law that loses nothing, whatever the cam angle, and whose force is a polynomial of what it senses.

    Of the third degree at most, so that Simpson's rule is exact: what it takes between two instants is the difference
    of its energies.
    """

    def energy(self, gap: FloatArray) -> FloatArray:
        """Return the energy at gamma, J, shape (m, c) to (m,)."""
        ...


@runtime_checkable
class Changing(Protocol):
    """A storing law of which only a part changes with the cam angle."""

    def changing(self, gap: FloatArray, state: FloatArray, angle: FloatArray) -> FloatArray:
        """Return the energy without what every cam angle has alike, J, shape (m,), as `Storing.stored` is asked."""
        ...


@runtime_checkable
class Idle(Protocol):
    """A local law with scalars that nothing drives: while they are zero, no force is on them, and they cause none."""

    def idle(self) -> tuple[IntArray, ...]:
        """Return sets of such scalars: each is idle as long as all of its own are zero, whatever the others do."""
        ...


@runtime_checkable
class Resting(Protocol):
    """A local law whose internal state follows from where it comes to rest."""

    def rest_state(self, gap: FloatArray) -> FloatArray:
        """Return the internal state, shape (s,), at rest at gamma, shape (c,)."""
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
        Force from what is sensed.
    offset
        g(theta), one function per sensed scalar.
    switching
        Sensed scalars whose passing zero changes the law, such as the depth of a contact: a step ends there.
    restitution
        Rate of parting per rate of approach at the moment a switching scalar becomes positive (Newton's law of
        impact); None where bodies meet without an impact.
    """

    name: str
    sense: tuple[AngleVector, ...]
    act: tuple[AngleVector, ...]
    law: LocalLaw
    offset: tuple[AngleFunction, ...]
    switching: tuple[int, ...] = ()
    restitution: float | None = None


def constant(value: float) -> AngleFunction:
    """Return the function of the cam angle that is `value` everywhere."""
    return Constant(value)


def derivative(function: AngleFunction) -> AngleFunction:
    """Return the derivative of a function of the cam angle."""
    return Derivative(function)
