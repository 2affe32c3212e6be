"""The seam between the physics and everything that works on it.

A `System` is what a mechanism is, mathematically, with theta(t) the given cam angle::

    M u'' + C u' + K u = sum_k p_k phi_k(theta, omega, omega') + sum_i A_i(theta) f_i(gamma_i, gamma_i', z_i, theta)
    gamma_i = G_i(theta) u + g_i(theta)

Loads are a few vectors times scalar histories, evaluated for all steps at once. Everything nonlinear is local: a
`LocalForce` senses a few scalars gamma and acts with as many forces, so its tangent is a low-rank update. A rigid or
lumped model is the same `System` with fewer unknowns, or none: then only `Probe.offset` moves.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from flexcam.checks import positive
from flexcam.linalg import FloatArray, Triplets

AngleFunction = Callable[[FloatArray, int], FloatArray]
"""A scalar function of the cam angle (rad) and of the order of its derivative."""


@dataclass(frozen=True, eq=False)
class CamMotion:
    """Cam angle and its rates at some instants, all of one shape.

    Parameters
    ----------
    angle, speed, rate
        rad, rad/s, rad/s^2.
    """

    angle: FloatArray
    speed: FloatArray
    rate: FloatArray


class Drive(Protocol):
    """How the camshaft turns."""

    def at(self, time: FloatArray) -> CamMotion:
        """Return the motion at the given times, s."""
        ...


@dataclass(frozen=True)
class ConstantSpeed:
    """Camshaft at constant speed.

    Parameters
    ----------
    speed
        rad/s, above zero.
    start
        Cam angle at time zero, rad.

    Examples
    --------
    >>> ConstantSpeed(2.0).at(np.array([0.5])).angle
    array([1.])
    """

    speed: float
    start: float = 0.0

    def __post_init__(self) -> None:
        positive("speed", self.speed, "rad/s")

    def at(self, time: FloatArray) -> CamMotion:
        """Return angle, speed and a zero rate at the given times, s."""
        time = np.asarray(time, dtype=float)
        return CamMotion(self.start + self.speed * time, np.full_like(time, self.speed), np.zeros_like(time))


@dataclass(frozen=True, eq=False)
class Load:
    """A spatial vector times a scalar history.

    Parameters
    ----------
    name
        For messages and results.
    vector
        Shape (n,), N or N m per unit of the history.
    history
        Scalar of the cam motion, vectorized.
    installed
        Whether it is there before the cam turns (a preload): a start from rest is its equilibrium.
    """

    name: str
    vector: FloatArray
    history: Callable[[CamMotion], FloatArray]
    installed: bool = False


@dataclass(frozen=True, eq=False)
class AngleVector:
    """A vector that depends on the cam angle: a few constant vectors times scalar functions.

    Parameters
    ----------
    vectors
        Shape (k, n).
    functions
        One function of the angle per vector.
    """

    vectors: FloatArray
    functions: tuple[AngleFunction, ...]

    @classmethod
    def constant(cls, vector: FloatArray) -> AngleVector:
        """Return a vector that does not depend on the angle, shape (n,)."""
        return cls(vector[None, :], (constant(1.0),))

    def weights(self, angle: FloatArray, order: int = 0) -> FloatArray:
        """Return the weights of the vectors, shape (len(angle), k), or their derivatives by the angle."""
        return np.stack([function(angle, order) for function in self.functions], axis=-1)


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
        z', shape (s,).
    """

    force: FloatArray
    by_gap: FloatArray
    by_rate: FloatArray
    state_rate: FloatArray


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
    """

    name: str
    sense: tuple[AngleVector, ...]
    act: tuple[AngleVector, ...]
    law: LocalLaw
    offset: tuple[AngleFunction, ...]


@dataclass(frozen=True, eq=False)
class Probe:
    """What a user watches: scalars ``rows u + offset(theta)`` with their velocities and accelerations.

    Parameters
    ----------
    name
        As in the case file, such as ``"valve"``.
    components
        A name per scalar, such as ``("ux", "uy")``.
    rows
        Shape (k, n).
    offset
        Prescribed part by component; None where there is none.
    """

    name: str
    components: tuple[str, ...]
    rows: FloatArray
    offset: tuple[AngleFunction | None, ...]


@dataclass(frozen=True, eq=False)
class Channel:
    """A named scalar history made of load histories and local forces, times a function of the cam angle.

    Parameters
    ----------
    name
        Such as ``"contacts.intake.force"``.
    unit
        SI unit.
    loads
        Positions of the loads whose histories add up.
    forces
        Pairs (local force, which of its scalars) that add up.
    factor
        Function of the angle that multiplies the sum.
    """

    name: str
    unit: str
    loads: tuple[int, ...] = ()
    forces: tuple[tuple[int, int], ...] = ()
    factor: AngleFunction | None = None


@dataclass(frozen=True, eq=False)
class System:
    """A mechanism as equations, see the module's head.

    Parameters
    ----------
    mass, damping, stiffness
        n x n, SI.
    names
        A name per unknown, such as ``"cam.uy"``.
    loads, local_forces, probes, channels
        As their classes say.
    free
        Motions that the stiffness leaves free, shape (n, k), where they are known; None to find them numerically.

    Examples
    --------
    >>> one = Triplets.from_dense([[1.0]])
    >>> System(mass=one, damping=Triplets.zeros(1), stiffness=one, names=("x",)).size
    1
    """

    mass: Triplets
    damping: Triplets
    stiffness: Triplets
    names: tuple[str, ...]
    loads: tuple[Load, ...] = ()
    local_forces: tuple[LocalForce, ...] = ()
    probes: tuple[Probe, ...] = ()
    channels: tuple[Channel, ...] = ()
    free: FloatArray | None = None

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.mass.size

    def load_histories(self, motion: CamMotion) -> FloatArray:
        """Return the scalar histories of all loads, shape (times, loads)."""
        if not self.loads:
            return np.zeros((*motion.angle.shape, 0))
        return np.stack([load.history(motion) for load in self.loads], axis=-1)

    def load_vectors(self) -> FloatArray:
        """Return the spatial vectors of all loads, shape (loads, n)."""
        return np.array([load.vector for load in self.loads]).reshape(len(self.loads), self.size)


def constant(value: float) -> AngleFunction:
    """Return the function of the cam angle that is `value` everywhere.

    Parameters
    ----------
    value
        The constant.

    Returns
    -------
    AngleFunction
        Its derivatives are zero.

    Examples
    --------
    >>> constant(2.0)(np.zeros(2), 1)
    array([0., 0.])
    """
    return lambda angle, order: np.full_like(angle, value if order == 0 else 0.0)
