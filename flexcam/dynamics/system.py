"""Equations of motion of a mechanism: matrices, loads, local forces, probes and channels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np

from flexcam.core import FloatArray, IntArray, Triplets
from flexcam.core.errors import refuse
from flexcam.dynamics.cam_motion import AngleFunction, AngleVector, CamFunctionCache, CamMotion
from flexcam.dynamics.force_laws import CUSTOM, LAWS, LawKind
from flexcam.dynamics.law_data import ForceLaw


@dataclass(frozen=True, eq=False)
class Reaction:
    """Forces of local laws and their derivatives."""

    force: FloatArray  #: N, shape (c,)
    by_penetration: FloatArray  #: derivatives by the sensed scalars, shape (c, c)
    by_rate: FloatArray  #: derivatives by their rates, shape (c, c)
    state_rate: FloatArray = field(default_factory=lambda: np.zeros(0))  #: rates of the internal states, shape (s,)


class CustomLaw(Protocol):
    """A force law as an object in Python, without internal state; only the direct engine evaluates it."""

    def respond(self, penetration: FloatArray, rate: FloatArray, angle: float) -> Reaction:
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
        Force from the sensed scalars; a law of fewer scalars than c applies to each group of them.
    offset
        g(theta), one function per sensed scalar.
    restitution
        Coefficient of restitution (Newton's law of impact) when a switching scalar becomes positive; None without
        impact.
    """

    name: str
    sense: tuple[AngleVector, ...]
    act: tuple[AngleVector, ...]
    law: ForceLaw | CustomLaw
    offset: tuple[AngleFunction, ...]
    restitution: float | None = None

    def __post_init__(self) -> None:
        if isinstance(self.law, ForceLaw) and len(self.sense) % self.law.scalars:
            given, allowed = f"{len(self.sense)} sensed scalars", f"multiples of {self.law.scalars}"
            raise refuse(self.name, given, allowed, "its law needs them", "give a vector for each")

    @property
    def kind(self) -> LawKind:
        """Traits of its law."""
        return LAWS[self.law.kind if isinstance(self.law, ForceLaw) else CUSTOM]

    @property
    def groups(self) -> range:
        """First scalar of each group to which its law applies."""
        return range(0, len(self.sense), self.law.scalars if isinstance(self.law, ForceLaw) else len(self.sense) or 1)

    @property
    def switching(self) -> range:
        """Sensed scalars whose passing zero is located, since the law begins to act there."""
        return self.groups if self.kind.touching else range(0)

    @property
    def states(self) -> int:
        """Number of internal states."""
        return self.kind.states * len(self.groups)

    def idle_scalars(self) -> list[tuple[int, ...]]:
        """Return sets of scalars that, while zero, neither carry nor cause a force."""
        idle = self.law.idle_scalars() if isinstance(self.law, ForceLaw) else ()
        return [tuple(first + i for i in scalars) for first in self.groups for scalars in idle]

    @property
    def conservative(self) -> bool:
        """True if the force acts exactly against its sensed motion, A = -G, with a law that stores energy."""
        return isinstance(self.law, ForceLaw) and all(
            sense.functions == act.functions and np.array_equal(sense.vectors, -act.vectors)
            for sense, act in zip(self.sense, self.act, strict=True)
        )


class MotionView(Protocol):
    """Motion of unknowns at given instants."""

    def whole(self, order: int) -> FloatArray:
        """Return displacement (order 0), velocity (1) or acceleration (2) of all unknowns, shape (m, n)."""
        ...

    def extract(self, rows: FloatArray, order: int = 0) -> FloatArray:
        """Return rows times the motion, shape (k, n) to (m, k); results are cached by the array of rows."""
        ...


@dataclass(frozen=True, eq=False)
class Observation:
    """Observed quantities at m instants, from which channels are computed."""

    motion: CamMotion
    cam: CamFunctionCache  #: functions of the cam angle at these instants
    moved: MotionView  #: motion of all unknowns
    histories: FloatArray  #: scalar histories of the loads, shape (m, loads)
    forces: FloatArray  #: local forces, shape (m, c)
    penetrations: FloatArray  #: their sensed scalars, shape (m, c)
    rates: FloatArray  #: rates of these, shape (m, c)
    states: FloatArray  #: internal states of the local laws, shape (m, s)

    @property
    def displacement(self) -> FloatArray:
        """Of all unknowns, shape (m, n)."""
        return self.moved.whole(0)

    def part(self, loads: slice, scalars: slice, states: slice) -> Observation:
        """Return the observation of selected loads, sensed scalars and internal states."""
        return Observation(
            self.motion, self.cam, self.moved, self.histories[:, loads], self.forces[:, scalars],
            self.penetrations[:, scalars], self.rates[:, scalars], self.states[:, states],
        )  # fmt: skip


Observable = Callable[[Observation], FloatArray]
"""Function of an observation that returns a scalar history, shape (m,)."""


@dataclass(frozen=True, eq=False)
class Channel:
    """A named scalar history.

    Parameters
    ----------
    name
        Such as ``"contacts.intake.force"``.
    unit
        SI unit.
    value
        Observable; indices refer to the observation passed to the channel (a system, or one coupling of it).
    """

    name: str
    unit: str
    value: Observable


def load_sum(*loads: int, factor: AngleFunction | None = None) -> Observable:
    """Return the sum of some load histories, times a function of the cam angle."""
    return lambda observation: _sum(observation, observation.histories, loads, factor)


def force_sum(*scalars: int, factor: AngleFunction | None = None) -> Observable:
    """Return the sum of some local forces, times a function of the cam angle."""
    return lambda observation: _sum(observation, observation.forces, scalars, factor)


def observable_sum(*parts: Observable) -> Observable:
    """Return the sum of observables."""
    return lambda observation: np.sum([part(observation) for part in parts], axis=0)


def row_of(row: FloatArray) -> Observable:
    """Return the observable of a row: its displacement."""
    rows = row[None]
    return lambda observation: observation.moved.extract(rows)[:, 0]


def _sum(
    observation: Observation, values: FloatArray, columns: tuple[int, ...], factor: AngleFunction | None
) -> FloatArray:  # fmt: skip
    total = values[:, columns[0]] if len(columns) == 1 else values[:, list(columns)].sum(axis=1)
    return total if factor is None else total * observation.cam(factor, 0)


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
        Whether it acts before the cam turns (a preload): the initial state at rest is its equilibrium.
    steady
        Whether its history is constant: in equilibrium it causes no motion.
    """

    name: str
    vector: FloatArray
    history: Callable[[CamMotion], FloatArray]
    installed: bool = False
    steady: bool = False


@dataclass(frozen=True, eq=False)
class Probe:
    """Output scalars ``rows u + offset(theta)`` with their velocities and accelerations.

    Parameters
    ----------
    name
        As in the case file, such as ``"valve"``.
    components
        A name per scalar, such as ``("ux", "uy")``.
    rows
        Shape (k, n).
    offset
        Prescribed part by component; None for zero.
    """

    name: str
    components: tuple[str, ...]
    rows: FloatArray
    offset: tuple[AngleFunction | None, ...]


VirtualWork = Callable[[int, IntArray, FloatArray], FloatArray]
"""Function of a scalar, some unknowns and k motions of them, shape (k, unknowns): the virtual work of the scalar's
force in these motions, per unit of force, at m instants, shape (m, k)."""


class PrescribedMotion(Protocol):
    """Motion of all unknowns that the cam prescribes, with the forces of the constraints that enforce it."""

    @property
    def constraints(self) -> IntArray:
        """Scalars of the local forces whose laws are replaced by constraint forces."""
        ...

    def at(self, motion: CamMotion) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return displacement, velocity and acceleration at some instants, shape (m, n) each."""
        ...

    def along(self, rows: FloatArray, motion: CamMotion) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the same along some rows of the unknowns, shape (k, n): three arrays of the shape (m, k)."""
        ...

    def complete_forces(
        self, motion: CamMotion, residual: FloatArray, work: VirtualWork, rate: FloatArray,
        local: FloatArray,
    ) -> FloatArray:  # fmt: skip
        """Return the local forces with those of the constraints, N, shape (m, c).

        The constraints balance the `residual`: inertia, damping and elastic forces minus all other forces, shape
        (m, n). `work` is that of the forces, see `VirtualWork`. Rates of the sensed scalars and the other `local`
        forces, zero for the constraints, have the shape (m, c).
        """
        ...


@dataclass(frozen=True, eq=False)
class System:
    """Equations of motion of a mechanism.

    Parameters
    ----------
    mass, damping, stiffness
        n x n, SI.
    names
        A name per unknown, such as ``"cam.uy"``.
    loads, local_forces, probes, channels
        As their classes say.
    free
        Motions without stiffness, shape (n, k), if known; None to compute them numerically.
    prescribed_motion
        Motion of all unknowns if it is prescribed; None if it follows from the equations.
    stored
        Strain energy of inactive parts that are not among the unknowns, J.

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
    prescribed_motion: PrescribedMotion | None = None
    stored: float = 0.0

    def __post_init__(self) -> None:
        lengths = [("names", len(self.names)), ("damping", self.damping.size), ("stiffness", self.stiffness.size)]
        lengths += [(f"load {load.name}", len(load.vector)) for load in self.loads]
        for what, length in lengths:
            if length != self.size:
                raise refuse(what, f"size {length}", f"the size of the mass matrix, {self.size}")

    def __repr__(self) -> str:
        """Return size and parts, not the values."""
        return f"<System of {self.size} unknowns, {len(self.loads)} loads, {len(self.local_forces)} local forces>"

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.mass.size

    @property
    def is_kinematic(self) -> bool:
        """True if there is nothing to integrate: the motion is prescribed, or there are no unknowns."""
        return self.prescribed_motion is not None or not self.size

    def load_histories(self, motion: CamMotion) -> FloatArray:
        """Return the scalar histories of all loads.

        Parameters
        ----------
        motion
            Of the cam, at some instants.

        Returns
        -------
        ndarray
            Shape (times, loads); with `load_vectors` the loads in the unknowns.
        """
        if not self.loads:
            return np.zeros((*motion.angle.shape, 0))
        return np.stack([np.broadcast_to(load.history(motion), motion.angle.shape) for load in self.loads], axis=-1)

    def load_vector(self, motion: CamMotion) -> FloatArray:
        """Return the loads in the unknowns at some instants.

        Parameters
        ----------
        motion
            Of the cam, at those instants.

        Returns
        -------
        ndarray
            N or N m, shape (times, n).
        """
        return self.load_histories(motion) @ self._load_vectors

    def load_vectors(self) -> FloatArray:
        """Return the spatial vectors of all loads, shape (loads, n)."""
        return self._load_vectors.copy()

    @cached_property
    def _load_vectors(self) -> FloatArray:
        return np.array([load.vector for load in self.loads]).reshape(len(self.loads), self.size)
