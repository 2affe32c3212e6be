"""One time step on a `System`: implicit stages with the new acceleration as the unknown.

One operator ``S = wm M + wf (c_v C + c_d K)`` per stage is factorized once for the whole run, because neither the step
nor the tangent outside the local forces changes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from flexcam.integrate.local import LocalForces, Schedule
from flexcam.integrate.scheme import Bathe, Method, Scheme
from flexcam.integrate.settle import Compliance, Inner, settle
from flexcam.linalg import FloatArray, factorize, operator
from flexcam.system import System


@dataclass(frozen=True, eq=False)
class Moment:
    """Everything the next step needs to know of an instant.

    Parameters
    ----------
    time
        s.
    d, v, a
        Displacement, velocity, acceleration, shape (n,).
    applied
        Loads and local forces in the unknowns, shape (n,).
    local, gap
        Local forces and what they sense, shape (c,).
    inner
        Internal states of the local laws.
    pressed
        On which side of zero the switching scalars are counted; None for that of the gap.
    impulse
        Of impacts at this instant, N s, shape (c,); None without.
    iterations
        Newton iterations that led here.
    """

    time: float
    d: FloatArray
    v: FloatArray
    a: FloatArray
    applied: FloatArray
    local: FloatArray
    gap: FloatArray
    inner: Inner
    pressed: NDArray[np.bool_] | None = None
    impulse: FloatArray | None = None
    iterations: int = 0


@dataclass(frozen=True, eq=False)
class Instant:
    """What is prescribed at an instant.

    Parameters
    ----------
    time
        s.
    load
        Loads in the unknowns, shape (n,).
    schedule
        What follows from the cam motion for the local forces.
    row
        Which row of the schedule is meant.
    """

    time: float
    load: FloatArray
    schedule: Schedule
    row: int = 0

    @property
    def angle(self) -> float:
        """Cam angle, rad."""
        return float(self.schedule.angle[self.row])


@dataclass(frozen=True, eq=False)
class _Predicted:
    """What is known before the new acceleration: displacement, velocity, and the forces of the old instant."""

    d: FloatArray
    v: FloatArray
    old: FloatArray | None = None


class _Stage:
    """An implicit stage: ``d = d^ + c_d a``, ``v = v^ + c_v a``, and the balance of a weighted instant for a.

    Parameters
    ----------
    system, forces
        The system and its local forces, stacked.
    to_d, to_v
        c_d, s^2, and c_v, s.
    step
        Over which internal states advance, s.
    weight_m, weight_f
        Of the new instant in the inertia and in the other forces.

    Raises
    ------
    SingularMatrixError
        If some motion has neither mass, damping nor stiffness.
    """

    def __init__(
        self, system: System, forces: LocalForces, to_d: float, to_v: float, step: float,
        weight_m: float = 1.0, weight_f: float = 1.0,
    ) -> None:  # fmt: skip
        self._forces, self._to_d, self._to_v, self._step, self._new = forces, to_d, to_v, step, weight_f
        self._C, self._K = operator(system.damping), operator(system.stiffness)
        self._damped = bool(system.damping.values.any())
        S = system.mass.scaled(weight_m) + system.damping.scaled(weight_f * to_v)
        self._S = factorize(S + system.stiffness.scaled(weight_f * to_d))
        # Response of all unknowns to each acting vector, and of each sensing vector to it: the low-rank update.
        self._by_act = self._S.solve(forces.act.vectors.T) * weight_f
        self._sensed = forces.sense.vectors @ self._by_act

    def solve(self, predicted: _Predicted, now: Moment, to: Instant) -> Moment:
        """Return the new instant."""
        right = self._new * (to.load - self._K @ predicted.d)
        if self._damped:
            right = right - self._new * (self._C @ predicted.v)
        if predicted.old is not None:
            right = right + predicted.old
        a = self._S.solve(right)
        d, v = predicted.d + self._to_d * a, predicted.v + self._to_v * a
        if self._forces.count == 0:
            return Moment(to.time, d, v, a, to.load, now.local, now.gap, now.inner)
        found = settle(self._forces, self._within(d, v, to), now.local, now.inner, self._step, to.angle)
        weights = found.force @ to.schedule.act[to.row]
        more = self._by_act @ weights
        applied = to.load + weights @ self._forces.act.vectors
        return Moment(
            to.time, d + self._to_d * more, v + self._to_v * more, a + more, applied, found.force, found.gap,
            found.inner, iterations=found.iterations,
        )  # fmt: skip

    def _within(self, d: FloatArray, v: FloatArray, to: Instant) -> Compliance:
        schedule, i = to.schedule, to.row
        sense, sense_rate = schedule.sense[i], schedule.sense_rate[i]
        vectors = self._forces.sense.vectors
        on_d, on_v = vectors @ d, vectors @ v
        per_force = self._sensed @ schedule.act[i].T
        return Compliance(
            gap=sense @ on_d + schedule.offset[i],
            rate=sense @ on_v + sense_rate @ on_d + schedule.offset_rate[i],
            gap_by_force=self._to_d * (sense @ per_force),
            rate_by_force=self._to_v * (sense @ per_force) + self._to_d * (sense_rate @ per_force),
        )


class Stepper(Protocol):
    """Advances a system by one step."""

    def advance(self, now: Moment, to: Instant) -> Moment:
        """Return the next instant.

        Parameters
        ----------
        now
            The instant before.
        to
            What is prescribed at the new one, a step later.

        Returns
        -------
        Moment
            The new instant.

        Raises
        ------
        NoConvergenceError
            If the local forces do not settle.
        """
        ...


class AlphaStepper:
    """A step of the generalized-alpha family.

    Parameters
    ----------
    system, forces
        The system and its local forces, stacked.
    scheme
        The scheme.
    step
        s.
    """

    def __init__(self, system: System, forces: LocalForces, scheme: Scheme, step: float) -> None:
        self._scheme, self._dt = scheme, step
        self._M, self._C, self._K = operator(system.mass), operator(system.damping), operator(system.stiffness)
        new_m, new_f = 1.0 - scheme.alpha_m, 1.0 - scheme.alpha_f
        self._stage = _Stage(system, forces, scheme.beta * step**2, scheme.gamma * step, step, new_m, new_f)

    def advance(self, now: Moment, to: Instant) -> Moment:
        """Return the next instant, as `Stepper` says."""
        s, dt = self._scheme, self._dt
        d = now.d + dt * now.v + (0.5 - s.beta) * dt**2 * now.a
        v = now.v + (1.0 - s.gamma) * dt * now.a
        return self._stage.solve(_Predicted(d, v, self._old(now)), now, to)

    def _old(self, now: Moment) -> FloatArray | None:
        """Return what the scheme weighs of the old instant."""
        s = self._scheme
        if not s.alpha_f and not s.alpha_m:
            return None
        forces = now.applied - self._K @ now.d - self._C @ now.v
        return s.alpha_f * forces - s.alpha_m * (self._M @ now.a)


class CompositeStepper:
    """Bathe's composite step: half of it by the trapezoidal rule, then three-point backward Euler over the whole.

    Parameters
    ----------
    system, forces
        The system and its local forces, stacked.
    step
        s.
    at
        What is prescribed at a time: the half step needs it.
    """

    def __init__(self, system: System, forces: LocalForces, step: float, at: Callable[[float], Instant]) -> None:
        self._dt, self._at = step, at
        self._half = AlphaStepper(system, forces, Scheme(0.25, 0.5), 0.5 * step)
        self._whole = _Stage(system, forces, (step / 3.0) ** 2, step / 3.0, 0.5 * step)

    def advance(self, now: Moment, to: Instant) -> Moment:
        """Return the next instant, as `Stepper` says."""
        half = self._half.advance(now, self._at(to.time - 0.5 * self._dt))
        # a = (v0 - 4 vh + 3 v)/dt and v = (d0 - 4 dh + 3 d)/dt, solved for v and d.
        v = (4.0 * half.v - now.v) / 3.0
        d = (4.0 * half.d - now.d + self._dt * v) / 3.0
        whole = self._whole.solve(_Predicted(d, v), half, to)
        return replace(whole, iterations=half.iterations + whole.iterations)


def stepper(
    system: System, forces: LocalForces, method: Method, step: float, at: Callable[[float], Instant]
) -> Stepper:
    """Return what advances a system by a method.

    Parameters
    ----------
    system, forces
        The system and its local forces, stacked.
    method
        A `Scheme` or `Bathe`.
    step
        s.
    at
        What is prescribed at a time, s.

    Returns
    -------
    Stepper
        For steps of this length.

    Raises
    ------
    SingularMatrixError
        If some motion has neither mass, damping nor stiffness.
    """
    if isinstance(method, Bathe):
        return CompositeStepper(system, forces, step, at)
    return AlphaStepper(system, forces, method, step)
