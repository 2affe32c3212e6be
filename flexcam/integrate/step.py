"""One time step of the generalized-alpha family on a `System`.

The unknown is the new acceleration. One operator ``S = (1-am) M + (1-af) (gamma dt C + beta dt^2 K)`` is factorized
once for the whole run, because neither the step nor the tangent outside the local forces changes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexcam.integrate.local import LocalForces, Schedule
from flexcam.integrate.scheme import Scheme
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


class Stepper:
    """The step operator of a system, a scheme and a step size.

    Parameters
    ----------
    system
        The system.
    scheme
        The scheme.
    step
        s.
    forces
        The system's local forces, stacked.

    Raises
    ------
    SingularMatrixError
        If some motion has neither mass, damping nor stiffness.
    """

    def __init__(self, system: System, scheme: Scheme, step: float, forces: LocalForces) -> None:
        self._scheme, self._dt, self._forces = scheme, step, forces
        self._M, self._C, self._K = operator(system.mass), operator(system.damping), operator(system.stiffness)
        self._damped = bool(system.damping.values.any())
        self._to_v, self._to_d = scheme.gamma * step, scheme.beta * step**2
        new = 1.0 - scheme.alpha_f
        S = system.mass.scaled(1.0 - scheme.alpha_m) + system.damping.scaled(new * self._to_v)
        self._S = factorize(S + system.stiffness.scaled(new * self._to_d))
        # Response of all unknowns to each acting vector, and of each sensing vector to it: the low-rank update.
        self._by_act = self._S.solve(forces.act.vectors.T) * new
        self._sensed = forces.sense.vectors @ self._by_act

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
        s, dt = self._scheme, self._dt
        d = now.d + dt * now.v + (0.5 - s.beta) * dt**2 * now.a
        v = now.v + (1.0 - s.gamma) * dt * now.a
        a = self._S.solve(self._right_side(now, d, v, to.load))
        if self._forces.count == 0:
            d, v = d + self._to_d * a, v + self._to_v * a
            return Moment(to.time, d, v, a, to.load, now.local, now.gap, now.inner)
        within = self._within(d + self._to_d * a, v + self._to_v * a, to)
        found = settle(self._forces, within, now.local, now.inner, dt, to.angle)
        weights = found.force @ to.schedule.act[to.row]
        a = a + self._by_act @ weights
        applied = to.load + weights @ self._forces.act.vectors
        d, v = d + self._to_d * a, v + self._to_v * a
        return Moment(
            to.time, d, v, a, applied, found.force, found.gap, found.inner, iterations=found.iterations
        )  # fmt: skip

    def _right_side(self, now: Moment, d: FloatArray, v: FloatArray, load: FloatArray) -> FloatArray:
        s = self._scheme
        new, old = 1.0 - s.alpha_f, s.alpha_f
        # The predictor's forces and, where the scheme weighs the old instant, those of the old one.
        at_d = new * d + old * now.d if old else d
        right = new * load - self._K @ at_d + (old * now.applied if old else 0.0)
        if self._damped:
            right = right - self._C @ (new * v + old * now.v)
        if s.alpha_m:
            right = right - s.alpha_m * (self._M @ now.a)
        return right

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
