"""An implicit stage, of which every step of the family consists: the new acceleration is the unknown.

One operator ``S = wm M + wf (c_v C + c_d K)`` per stage is factorized once for the whole run, because neither the step
nor the tangent outside the local forces changes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from flexcam.integrate.local import LocalForces
from flexcam.integrate.moment import Instant, Moment
from flexcam.integrate.settle import Compliance, settle
from flexcam.linalg import Factor, FloatArray, Triplets, factorize, operator
from flexcam.system import System


@dataclass(frozen=True, eq=False)
class Predicted:
    """What is known before the new acceleration: displacement, velocity, and the forces of the old instant."""

    d: FloatArray
    v: FloatArray
    old: FloatArray | None = None


class Stage:
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
    inverse
        Makes S's factorization; the matrix is regular by default.
    """

    def __init__(
        self, system: System, forces: LocalForces, to_d: float, to_v: float, step: float,
        weight_m: float = 1.0, weight_f: float = 1.0, inverse: Callable[[Triplets], Factor] = factorize,
    ) -> None:  # fmt: skip
        self._forces, self._to_d, self._to_v, self._step, self._new = forces, to_d, to_v, step, weight_f
        self._C, self._K = operator(system.damping), operator(system.stiffness)
        self._damped = bool(system.damping.values.any())
        S = system.mass.scaled(weight_m) + system.damping.scaled(weight_f * to_v)
        self._S = inverse(S + system.stiffness.scaled(weight_f * to_d) if to_d else S)
        # Response of all unknowns to each acting vector, and of each sensing vector to it: the low-rank update.
        self._by_act = self._S.solve(forces.act.vectors.T) * weight_f
        self._sensed = forces.sense.vectors @ self._by_act

    def solve(self, predicted: Predicted, now: Moment, to: Instant) -> Moment:
        """Return the new instant."""
        right = self._new * (to.load - self._K @ predicted.d)
        if self._damped:
            right = right - self._new * (self._C @ predicted.v)
        if predicted.old is not None:
            right = right + predicted.old
        a = self._S.solve(right)
        d, v = predicted.d + self._to_d * a, predicted.v + self._to_v * a
        if self._forces.count == 0:
            return Moment(to.time, d, v, a, to.load, now.local, now.gap, now.rate, now.inner)
        found = settle(self._forces, self._within(d, v, to), now.local, now.inner, self._step, to.angle)
        weights = found.force @ to.schedule.acting(to.row)
        more = self._by_act @ weights
        applied = to.load + weights @ self._forces.act.vectors
        return Moment(
            to.time, d + self._to_d * more, v + self._to_v * more, a + more, applied, found.force, found.gap,
            found.rate, found.inner, iterations=found.iterations,
        )  # fmt: skip

    def _within(self, d: FloatArray, v: FloatArray, to: Instant) -> Compliance:
        schedule, i = to.schedule, to.row
        sense, sense_rate = schedule.sensing(i), schedule.turning(i)
        vectors = self._forces.sense.vectors
        on_d, on_v = vectors @ d, vectors @ v
        per_force = self._sensed @ schedule.acting(i).T
        return Compliance(
            gap=sense @ on_d + schedule.offset[i],
            rate=sense @ on_v + sense_rate @ on_d + schedule.offset_rate[i],
            gap_by_force=self._to_d * (sense @ per_force),
            rate_by_force=self._to_v * (sense @ per_force) + self._to_d * (sense_rate @ per_force),
        )
