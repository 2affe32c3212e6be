"""Nonlinear static equilibrium of a system with local forces, such as a train supported by its cam and seat.

The equilibrium is the minimum of the potential energy: strain energy and contact energy minus the work of the loads.
With unilateral contacts it is convex, so that Newton's method with a line search converges from any start, whichever
contacts open and close. Circulatory forces, such as those of an oil film, have no potential: the line search then
reduces the residual.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from flexcam.core import (
    DENSE_LIMIT,
    ROUNDING_LIMIT,
    Factor,
    FloatArray,
    SingularMatrixError,
    Triplets,
    diagonal_scale,
    energy_rounding,
    factorize,
    factorize_with_update,
    null_space,
    rounding_fraction,
    select_constraints,
)
from flexcam.dynamics.cam_motion import CamMotion, Drive, PrescribedInputs
from flexcam.dynamics.local_forces import LocalForces, StoredEnergy
from flexcam.dynamics.problem import State
from flexcam.dynamics.status import ROUNDING_STATUS, Cause, RunFailedError, Status, instability_status
from flexcam.dynamics.system import Reaction, System

_MAX_ITERATIONS = 300
_TOLERANCE = 1e-9
"""Relative residual, to the largest force."""

_AT_REST = 1e-6
"""Relative change of a displacement that counts as none."""

_TIGHT_TOLERANCE = 1e-12
"""Relative residual of an equilibrium that is compared with a nearby one."""

_SUMS = 4.0
"""Rounding of a sum of a dozen terms, a few of which are large."""

_NEGATIVE = 1e-9
"""Eigenvalue of the scaled stiffness, of size 1, that is negative beyond rounding."""

_DECREASE, _HALVINGS = 1e-4, 40
_FALL = 0.01
"""Largest displacement, m, of an unsupported part in one iteration."""
_STIFFEST = 1e9
"""Limit of the spring on free motions, N/m."""
_SOFTENING = 20
"""Iterations after which the spring on free motions, first 1 N/m, becomes half as stiff."""


def solve_equilibrium(
    system: System, forces: LocalForces, load: FloatArray, motion: CamMotion, near: FloatArray | None = None
) -> FloatArray:
    """Return the static equilibrium displacement of loads, stiffness and local forces."""
    free = null_space(system.stiffness) if system.free is None else system.free
    free = np.linalg.qr(free)[0] if free.shape[1] else free
    potential = _Potential(system, forces, forces.prescribed_inputs(motion), load)
    u = np.zeros(system.size) if near is None else near
    minimum = float(np.abs(free.T @ load).max(initial=0.0)) / _FALL
    previous, energy, tips, change = np.inf, None, bool(forces.lifts), np.inf
    for count in range(_MAX_ITERATIONS):
        residual, size, tangent = potential.at(u)
        largest = float(np.abs(residual).max(initial=0.0))
        stalled, close = 0.5 * previous <= largest, largest <= _TOLERANCE * size
        done = close and (near is None or stalled or largest <= _TIGHT_TOLERANCE * size)
        if done or (stalled and largest <= potential.rounding(u)):  # no further improvement
            # Without forces the residual is rounding alone, but the displacement is accurate if it no longer changes.
            moves = change > _AT_REST * float(np.abs(u).max(initial=0.0))
            if not close and moves and rounding_fraction(system.stiffness, u) > ROUNDING_LIMIT:
                raise RunFailedError(ROUNDING_STATUS)
            _refuse_unstable(potential, u, tangent)
            return u
        # A soft spring on the free motions limits a step along them and vanishes with the step. It becomes softer where
        # a small force of a contact, such as the torque of a cam that begins to lift, moves a part through its lash.
        spring = max(minimum, 0.5 ** (count // _SOFTENING))
        step = _solve(partial(factorize_with_update, tangent, free, spring), residual)
        while tips and residual @ step < 0.0:  # a shaft tips over the nose of its cam
            spring *= 4.0
            step = _solve(partial(factorize_with_update, tangent, free, spring), residual)
            tips = spring < _STIFFEST or residual @ step >= 0.0  # otherwise another motion is unstable
        fraction, energy = potential.line_search(u, step, residual, energy, diagonal_scale(tangent))
        u, previous, change = u + fraction * step, largest, float(np.abs(step).max(initial=0.0))
    residual, _, tangent = potential.at(u)
    _refuse_unstable(potential, u, tangent)
    raise _no_equilibrium_status(system, residual, free)


def _refuse_unstable(potential: _Potential, u: FloatArray, tangent: Triplets) -> None:
    """Refuse an unstable equilibrium, which is not a minimum of the energy."""
    system = potential.system
    if system.size > 2 * DENSE_LIMIT or not system.local_forces:
        return
    scale = diagonal_scale(tangent)
    scaled = scale[:, None] * tangent.dense() * scale
    symmetric = 0.5 * (scaled + scaled.T)
    try:
        np.linalg.cholesky(symmetric + _NEGATIVE * np.eye(len(symmetric)))
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(symmetric)
        if values[0] < -_NEGATIVE:
            status = instability_status(system.names, scale * vectors[:, 0], potential.parts(u))
            raise RunFailedError(status) from None


class _Potential:
    """Potential energy of a system at rest at a cam angle under a load, with its negative gradient and its tangent."""

    def __init__(self, system: System, forces: LocalForces, inputs: PrescribedInputs, load: FloatArray) -> None:
        self.system, self._forces, self._inputs, self._load = system, forces, inputs, load
        self._stored = StoredEnergy(forces)
        self._act = act = inputs.acting_matrix(0) @ forces.act.vectors
        self._sense = sense = inputs.sensing_matrix(0) @ forces.sense.vectors
        self._unknowns = [
            np.flatnonzero((act[part] != 0.0).any(axis=0) | (sense[part] != 0.0).any(axis=0))
            for _, part, _ in forces.parts
        ]

    def at(self, u: FloatArray) -> tuple[FloatArray, float, Triplets]:
        """Return the residual forces (n,), the magnitude of the forces, and the tangent."""
        reaction, stiffness = self._reaction(u), self.system.stiffness
        strain, acting = stiffness.times(u), reaction.force @ self._act
        local = [matrix for _, matrix in self._tangents(reaction)]
        size = max(float(np.abs(part).max(initial=0.0)) for part in (self._load, strain, acting))
        residual = self._load + acting - strain
        return residual, max(size, np.finfo(float).tiny), Triplets.sum([stiffness, *local])

    def parts(self, u: FloatArray) -> list[tuple[str, Triplets]]:
        """Return name and stiffness of each local force."""
        return self._tangents(self._reaction(u))

    def _tangents(self, reaction: Reaction) -> list[tuple[str, Triplets]]:
        result: list[tuple[str, Triplets]] = []
        for (force, part, _), unknowns in zip(self._forces.parts, self._unknowns, strict=True):
            act, sense = self._act[part, unknowns], self._sense[part, unknowns]
            local = Triplets.from_dense(-act.T @ reaction.by_penetration[part, part] @ sense)
            rows, cols = unknowns[local.rows], unknowns[local.cols]
            result.append((force.name, Triplets(self.system.size, rows, cols, local.values)))
        return result

    def _reaction(self, u: FloatArray) -> Reaction:
        forces, penetration = self._forces, self._penetration(u)
        owners, inner = forces.table.owners, _full_chambers(forces, penetration)
        reaction = forces.respond(penetration, np.zeros(forces.count), inner, self._inputs)
        extended = owners[penetration[owners] < 0.0]  # their oil follows, so that it has no stiffness
        reaction.by_penetration[extended, extended] = 0.0
        return reaction

    def _penetration(self, u: FloatArray) -> FloatArray:
        return self._sense @ u + self._inputs.offset[0]

    def rounding(self, u: FloatArray) -> float:
        """Return the rounding of the residual, as strain forces are sums of large terms."""
        K = self.system.stiffness
        parts = Triplets(K.size, K.rows, K.cols, np.abs(K.values)).times(np.abs(u))
        return _SUMS * float(np.finfo(float).eps) * float(parts.max(initial=0.0))

    def energy(self, u: FloatArray) -> float:
        """Return the potential energy; laws without energy do not contribute."""
        penetration = self._penetration(u)
        inner = _full_chambers(self._forces, penetration)
        stored = float(self._stored.at(penetration[None], inner[None], self._inputs.cam)[0][0])
        return 0.5 * float(u @ self.system.stiffness.times(u)) - float(self._load @ u) + stored

    def line_search(
        self, u: FloatArray, step: FloatArray, residual: FloatArray, known: float | None, scale: FloatArray
    ) -> tuple[float, float | None]:
        """Return the fraction of a step that reduces the energy enough, and the energy there, from the known one.

        Without a potential it is half the square of the residual, in which `scale` makes forces and torques comparable.
        """
        if not self._forces.storing.all():
            return 1.0, None  # a linear coupling: the full step is exact
        circulatory = bool(self._forces.circulatory.any())

        def merit(u: FloatArray) -> float:
            return 0.5 * float(np.square(scale * self.at(u)[0]).sum()) if circulatory else self.energy(u)

        before, fraction = merit(u) if known is None else known, 1.0
        slope = 2.0 * before if circulatory else float(residual @ step)
        noise = 1e-12 * abs(before) + (0.0 if circulatory else self.rounding(u) * float(np.abs(u).max(initial=0.0)))
        for _ in range(_HALVINGS):
            after = merit(u + fraction * step)
            if after <= before - _DECREASE * fraction * slope + noise:
                return fraction, None if circulatory else after
            fraction *= 0.5
        return fraction, None


def _no_equilibrium_status(system: System, residual: FloatArray, free: FloatArray) -> RunFailedError:
    push = np.abs(free @ (free.T @ residual)) if free.shape[1] else np.zeros(1)
    if float(push.max()) > 1e-6 * float(np.abs(residual).max(initial=0.0)):
        order: list[int] = np.argsort(-push)[:4].tolist()
        names = ", ".join(system.names[i] for i in order)
        text = f"no support, spring or contact holds the mechanism against its loads: {names} can move freely"
        return RunFailedError(Status(Cause.SINGULAR, text, "add a support, or springs whose force closes the contacts"))
    text = "the contacts have no static equilibrium"
    return RunFailedError(Status(Cause.NO_CONVERGENCE, text, "raise the installed forces, or soften a contact"))


_UNLOADED = 1e-9
"""Fraction of the load along a free motion that counts as zero: loads are sums of numbers with 15 digits."""


def static_displacement(
    stiffness: Triplets, load: FloatArray, names: Sequence[str], free: FloatArray | None = None
) -> FloatArray:
    """Return the displacement under a static load.

    A singular stiffness is allowed if the load does no work on its rigid-body motions or mechanisms (the axial motion
    of a shaft between radial bearings): the solution then has no part along them. No spring is added.
    """
    free = null_space(stiffness) if free is None else free
    if not free.shape[1]:
        return _check_rounding(stiffness, load, _solve(partial(factorize, stiffness), load))
    # Weighting by the diagonal of the stiffness makes translations and rotations comparable.
    scale = diagonal_scale(stiffness)
    motions = np.linalg.qr(free / scale[:, None])[0]
    _refuse_mechanism(motions, scale * load, names)
    # As the load does no work on the free motions, fixing one unknown of each changes only their part.
    active = np.setdiff1d(np.arange(stiffness.size), select_constraints(motions))
    x = np.zeros(stiffness.size)
    x[active] = _solve(partial(factorize, stiffness.part(active)), load[active])
    # Unweighted least squares of the components is independent of the axes.
    drift = np.linalg.qr(free)[0]
    return _check_rounding(stiffness, load, x) - drift @ (drift.T @ x)


def _solve(factorization: Callable[[], Factor], right: FloatArray) -> FloatArray:
    """Return the displacement of a structure without free motions; a singular matrix is then due to rounding."""
    try:
        return factorization().solve(right)
    except SingularMatrixError:
        raise RunFailedError(ROUNDING_STATUS) from None


def _check_rounding(stiffness: Triplets, load: FloatArray, x: FloatArray) -> FloatArray:
    """Return the solution unless rounding of the stiffness dominates it."""
    error = float(energy_rounding(stiffness, x[:, None])[0])
    if error > ROUNDING_LIMIT * abs(float(x @ load)):
        raise RunFailedError(ROUNDING_STATUS)
    return x


def _refuse_mechanism(motions: FloatArray, load: FloatArray, names: Sequence[str]) -> None:
    push = motions.T @ load
    if np.abs(push).max() <= _UNLOADED * np.linalg.norm(load):
        return
    motion = np.abs(motions @ push)
    order: list[int] = np.argsort(-motion).tolist()
    moving = [names[i] for i in order if motion[i] > 0.1 * motion.max()]
    listed = ", ".join(moving[:8]) + (f" and {len(moving) - 8} more" if len(moving) > 8 else "")
    text = f"the load drives a motion that nothing resists: {listed}"
    raise RunFailedError(Status(Cause.SINGULAR, text, "support one of these components or attach a spring to it"))


def installed_state(system: System, drive: Drive, time: float = 0.0, near: FloatArray | None = None) -> State:
    """Return the initial state as installed: equilibrium of preloads at rest, found from a nearby displacement."""
    return _solve_from(LocalForces(system), system, drive, time, near, installed=True)


def equilibrium(system: System, drive: Drive, time: float = 0.0, load: FloatArray | None = None) -> State:
    """Return the static equilibrium under all loads, a further one, and local forces at the cam angle of an instant."""
    return _solve_from(LocalForces(system), system, drive, time, further=load)


def moving_equilibrium(system: System, drive: Drive, time: float = 0.0, near: FloatArray | None = None) -> State:
    """Return the static equilibrium of an instant with its quasi-static velocity, found from a nearby displacement.

    A train at rest would be hit by a cam that lifts at the start. The velocities are ``omega du/dtheta``, by a central
    difference over a thousandth of a radian. A motion that only contacts stop crosses its lash at once where the load
    on it reverses; such a jump J, which adds J/(2h) to a difference over the step h, is no velocity.
    """
    forces = LocalForces(system)
    rest = _solve_from(forces, system, drive, time, near)
    step = _ANGLE_STEP / float(drive.at(np.array([time])).speed[0])

    def difference(h: float) -> FloatArray:
        displacement = rest.displacement
        before, after = (_solve_from(forces, system, drive, time + side, displacement).displacement for side in (-h, h))
        return (after - before) / (2.0 * h)

    velocity = difference(step)
    if system.free is not None and system.free.size:
        half = difference(0.5 * step)
        jump = 2.0 * step * np.linalg.norm(half - velocity)
        if jump > _MIN_JUMP and np.linalg.norm(half) > 1.5 * np.linalg.norm(velocity):
            velocity = 2.0 * velocity - half
        if forces.lifts:  # a shaft within its lash turns with its drive
            rows = forces.prescribed_inputs(drive.at(np.array([time]))).sensing_matrix(0) @ forces.sense.vectors
            rows = rows[[angle for _, angle, _ in forces.lifts]]
            rotations = rows @ system.free
            rotations[np.abs(rotations) <= _ROUNDING * np.abs(system.free).max()] = 0.0
            velocity = velocity - system.free @ np.linalg.pinv(rotations) @ (rows @ velocity)
    return replace(rest, velocity=velocity)


_ANGLE_STEP = 1e-3
"""Angle step of the difference, rad."""

_ROUNDING = 1e-9
"""Relative rotation of a shaft by a free motion that is rounding."""

_MIN_JUMP = 1e-9
"""Jump, m or rad, above the rounding of a motion without stiffness."""


def _solve_from(
    forces: LocalForces, system: System, drive: Drive, time: float, near: FloatArray | None = None, *,
    installed: bool = False, further: FloatArray | None = None,
) -> State:  # fmt: skip
    """Return the equilibrium at an instant under all or the installed loads, starting from a nearby displacement."""
    motion = drive.at(np.array([time]))
    factors = np.array([load.installed or not installed for load in system.loads], dtype=float)
    load = (factors * system.load_histories(motion)[0]) @ system.load_vectors()
    load = load if further is None else load + further
    if not forces.count:
        d = static_displacement(system.stiffness, load, system.names, system.free)
    else:
        d = solve_equilibrium(system, forces, load, motion, near)
    inner = None
    if len(forces.start_state):
        penetration = forces.sense_motion(d[None], np.zeros((1, len(d))), forces.prescribed_inputs(motion))[0][0]
        inner = _full_chambers(forces, penetration)
    return State(d, np.zeros(system.size), time, inner)


def _full_chambers(forces: LocalForces, penetration: FloatArray) -> FloatArray:
    """Return the internal states at rest: the oil of an adjuster has not leaked, and fills its chamber."""
    return np.minimum(penetration[forces.table.owners], 0.0)
