"""Initial acceleration at the start and at restarts, and impacts by Newton's law of restitution.

Impacts of several bodies at once are a linear complementarity problem. With the rate of approach u of every closed
contact and its impulse p, the rate after the impact is ``u - W p``, where W = G M^-1 G^T is the Delassus matrix.
Newton's law requires ``0 <= p``, ``W p >= (1 + e) u``, and no impulse if a contact separates faster. B. Brogliato,
Nonsmooth Mechanics, 3rd ed. (2016), ch. 5; V. Acary and B. Brogliato, Numerical Methods for Nonsmooth Dynamical Systems
(2008), ch. 3 and 12; O. Bruels, V. Acary, A. Cardona, Comput. Methods Appl. Mech. Eng. 281 (2014). The kinetic energy
changes by ``sum p (e - 1) u/2``: it never grows for e up to 1.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from flexcam.core import Factor, FloatArray, IntArray
from flexcam.core.errors import Fault, InputError, refuse
from flexcam.dynamics.local_forces import LocalForces
from flexcam.dynamics.massless import FORCE_TOLERANCE, MasslessMotions
from flexcam.dynamics.problem import State
from flexcam.dynamics.step_state import StepInputs, StepState
from flexcam.dynamics.system import System

_ROUNDING = 1e-12
"""Relative size below which an impulse is zero."""


@dataclass(frozen=True, eq=False)
class Impact:
    """Closed contacts at an instant, k of them."""

    sense: FloatArray  #: G, shape (k, n)
    turning: FloatArray  #: time derivative of G, shape (k, n)
    gained: FloatArray  #: velocity per unit of each impulse, -M^-1 G^T, shape (n, k)
    restitution: FloatArray  #: e, shape (k,)

    @cached_property
    def delassus(self) -> FloatArray:
        """Delassus matrix W, shape (k, k)."""
        return -self.sense @ self.gained

    def reversal(self, rate: FloatArray) -> FloatArray:
        """Return the minimum factor of the rate that an impulse removes, shape (k,).

        A contact that separates slowly, by oscillation on its stiffness, may return with the same velocity; stopping it
        would add energy.
        """
        return np.where(rate >= 0.0, 1.0 + self.restitution, 2.0)

    def impulse(self, rate: FloatArray) -> FloatArray:
        """Return the impulses, shape (k,); zeros if no impulse can separate the bodies, as between closing walls."""
        return solve_complementarity(self.delassus, self.reversal(rate) * rate)

    def velocity_change(self, rate: FloatArray, factor: FloatArray) -> FloatArray:
        """Return the velocity change, shape (n, ...), that removes a factor of the rates, shape (k, ...)."""
        removed = (factor * rate.T).T
        return np.asarray(self.gained @ np.linalg.lstsq(self.delassus, removed, rcond=_ROUNDING)[0], dtype=float)


def solve_complementarity(W: FloatArray, asked: FloatArray) -> FloatArray:
    """Return p >= 0 with W p >= b and p (W p - b) = 0 for a symmetric W without negative eigenvalues.

    The solution is the smallest change of velocity in the mass norm: least-distance programming by non-negative least
    squares, C. L. Lawson and R. J. Hanson, Solving Least Squares Problems (1974), ch. 23. All solutions give the same
    velocities; zeros where there is none.
    """
    zeros = np.zeros(len(asked))
    if len(asked) == 1:
        return np.maximum(asked / W[0], 0.0)
    scale = 1.0 / np.sqrt(np.diag(W))
    scaled, target = scale[:, None] * W * scale, scale * asked
    if not (size := float(target.max())) > 0.0:
        return zeros
    impulses = _solve_active_set(scaled, target / size)
    if impulses is None:
        return zeros
    active = np.flatnonzero(impulses > _ROUNDING * impulses.max())
    solution = zeros.copy()
    solution[active] = np.linalg.lstsq(scaled[np.ix_(active, active)], target[active], rcond=_ROUNDING)[0]
    return scale * np.maximum(solution, 0.0)


def _solve_active_set(W: FloatArray, target: FloatArray) -> FloatArray | None:
    """Return the solution to some digits, which identifies the active contacts; None without a solution."""
    from scipy.optimize import nnls

    values, vectors = np.linalg.eigh(W)
    root = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
    matrix, right = np.vstack([root, target]), np.append(np.zeros(len(target)), 1.0)
    try:
        solution = np.asarray(nnls(matrix, right)[0], dtype=float)
    except RuntimeError:  # iteration limit of the active set
        return None
    remainder = 1.0 - float(target @ solution)
    return solution / remainder if remainder > _ROUNDING else None


class InitialAcceleration:
    """Solver for the acceleration of an instant: ``M a = f - C v - K d``."""

    def __init__(self, system: System, forces: LocalForces) -> None:
        self._system, self._forces = system, forces
        self._massless = MasslessMotions(system)
        self._factor: Factor | None = None
        if refusal := massless_impact_error(forces, self._massless):
            raise refusal

    def first(self, start: State, to: StepInputs) -> StepState:
        """Return the first instant.

        Massless unknowns have no initial acceleration: their displacement is set to the equilibrium of stiffness and
        loads, with the local forces at the given displacement.
        """
        d, v = start.displacement, start.velocity
        inner = self._forces.start_state if start.inner is None else start.inner
        if start.acceleration is not None:
            return replace(self.update_forces(d, v, inner, to), a=start.acceleration)
        if self._massless.any:
            d = self._massless.place(d, self.update_forces(d, v, inner, to).applied)
        return self.restart(self.update_forces(d, v, inner, to))

    def restart(self, moment: StepState) -> StepState:
        """Return an instant with the acceleration in equilibrium."""
        system = self._system
        right = moment.applied - system.damping.times(moment.v) - system.stiffness.times(moment.d)
        return replace(moment, a=self.accelerations(right[:, None])[:, 0])

    def impact(self, moment: StepState, to: StepInputs, closed: IntArray) -> StepState:
        """Return the instant after an impact at all closed switching scalars."""
        scalars = self._forces.switching[closed]
        data, impulse = self.impact_data(to, closed), np.zeros(self._forces.count)
        impulse[scalars] = data.impulse(moment.rate[scalars])
        after = self.update_forces(moment.d, moment.v + data.gained @ impulse[scalars], moment.inner, to)
        return replace(self.restart(after), impulse=impulse)

    def impact_data(self, to: StepInputs, closed: IntArray) -> Impact:
        """Return the data of an impact at switching scalars."""
        forces, inputs, i = self._forces, to.inputs, to.row
        index = forces.switching[closed]
        sense, turning = (
            rows[index] @ forces.sense.vectors for rows in (inputs.sensing_matrix(i), inputs.sensing_rate_matrix(i))
        )
        act = inputs.acting_matrix(i)[index] @ forces.act.vectors
        return Impact(sense, turning, self.accelerations(act.T), forces.restitution[closed])

    def update_forces(self, d: FloatArray, v: FloatArray, inner: FloatArray, to: StepInputs) -> StepState:
        """Return an instant with the forces of its motion, without acceleration."""
        forces = self._forces
        penetration, rate, _ = (rows[0] for rows in forces.sense_motion(d[None], v[None], to.inputs.row(to.row)))
        reaction = forces.respond(penetration, rate, inner, to.inputs, to.row)
        applied = to.load + (reaction.force @ to.inputs.acting_matrix(to.row)) @ forces.act.vectors
        return StepState(to.time, d, v, np.zeros(len(d)), applied, reaction.force, penetration, rate, inner)

    def accelerations(self, right: FloatArray) -> FloatArray:
        """Return ``M^-1 f`` for columns f, shape (n, k); massless motions have no acceleration."""
        if self._factor is None:
            self._factor = self._massless.inverse(self._system.mass)
        return self._factor.solve(right)


def massless_impact_error(forces: LocalForces, light: MasslessMotions) -> InputError | None:
    """Return the error for impacts on massless unknowns, with all names; None without such impacts."""
    bouncing: list[int] = forces.switching[~np.isnan(forces.restitution)].tolist()
    faulty = [
        scalar
        for scalar in bouncing
        if (light.force_on_massless(forces.act.vectors[forces.act.owner[scalar] > 0.0]) > FORCE_TOLERANCE).any()
    ]
    given, allowed = "a restitution where a body has no mass", "a mass on both sides, or ground"
    why, remedy = "an impact changes the velocity of a mass", "add a mass there, or use dissipation"
    return InputError(Fault(forces.names[scalar], given, allowed, why, remedy) for scalar in faulty) if faulty else None


def massless_contact_error(system: System, method: str) -> InputError | None:
    """Return the error for contacts and dampers on massless motions, with names; None without such."""
    light = MasslessMotions(system)
    if not light.any:
        return None
    why, remedy = "only springs determine the position of a point without mass", "give it a mass, or use newmark"
    forces = LocalForces(system)
    affected = np.zeros(forces.count, dtype=bool)
    for stack in (forces.sense, forces.act):
        affected |= (stack.owner[:, light.force_on_massless(stack.vectors) > FORCE_TOLERANCE] > 0.0).any(axis=1)
    names = list(dict.fromkeys(forces.names[i] for i in np.flatnonzero(affected).tolist()))
    if names:
        return refuse("run.integrator", method, f"a method that allows {', '.join(names)} without mass", why, remedy)
    damping = np.abs(system.damping.multiply(light.motions))
    damped = np.flatnonzero(damping.max(axis=0) > FORCE_TOLERANCE * np.abs(system.damping.values).max(initial=0.0))
    if not len(damped):
        return None
    rows: list[int] = np.abs(light.motions[:, damped]).argmax(axis=0).tolist()
    names = list(dict.fromkeys(system.names[i] for i in rows))[:6]
    given = f"a method that allows dampers on {', '.join(names)} without mass"
    return refuse("run.integrator", method, given, why, f"{remedy}, or mass-proportional damping")
