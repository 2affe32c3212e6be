"""Linearization of a system about a motion, instant by instant."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, fields

import numpy as np

from flexcam.core import FloatArray, IntArray
from flexcam.dynamics.cam_motion import CamMotion, PrescribedInputs
from flexcam.dynamics.jit import Functions, bind
from flexcam.dynamics.law_data import ForceLaw
from flexcam.dynamics.local_forces import LocalForces, VectorStack
from flexcam.dynamics.massless import MasslessMotions, find_massless_rates
from flexcam.dynamics.system import System
from flexcam.dynamics.tangent_kernel import FUNCTIONS_OF_TANGENTS, NUMPY

_SAME_LENGTH = 1e-9
"""Relative difference of two step lengths that is rounding."""


@dataclass(frozen=True, eq=False)
class Linear:
    """Linearized local forces at m instants: the forces ``by_d d + by_v v + by_state z`` act along the rows `act`."""

    act: FloatArray  #: shape (m, c, n)
    by_d: FloatArray  #: derivatives of the forces by displacement, shape (m, c, n)
    by_v: FloatArray  #: by velocity, shape (m, c, n)
    by_state: FloatArray  #: by the internal states z, shape (m, c, s); every state follows one sensed scalar G d
    followed: FloatArray  #: G, shape (m, s, n)
    by_penetration: FloatArray  #: derivatives by the sensed scalars, shape (m, c, c)
    by_rate: FloatArray  #: by their rates, shape (m, c, c)
    #: The c forces among all of the system.
    kept: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.intp))


def linearize(
    forces: LocalForces, inputs: PrescribedInputs, narrow: FloatArray, answer: FloatArray | None = None
) -> Linear:
    """Return the linear forces at all m rows of the prescribed inputs from the derivatives of `LocalForces.tangents`.

    Forces of laws that have none, such as those of open contacts, are left out, unless parameters change them: the
    derivatives `answer` have the shape (m, c, p).
    """
    (rows, places, columns), changes = forces.coupled_scalars, np.asarray(narrow.any(axis=(0, 1)))
    used = np.zeros(forces.count, dtype=bool)
    used[rows[changes[rows, places]]] = used[columns[changes[rows, places]]] = True
    if answer is not None:
        used |= answer.any(axis=(0, 2))
    kept, m = np.flatnonzero(used), len(narrow)
    at, owners = np.cumsum(used) - 1, forces.table.owners
    inside = used[rows] & used[columns]
    by_x, by_rate = np.zeros((2, m, len(kept), len(kept)))
    target, source = at[rows[inside]] * len(kept) + at[columns[inside]], rows[inside] * narrow.shape[3] + places[inside]
    for i, tangent in enumerate((by_x, by_rate)):
        tangent.reshape(m, len(kept) ** 2)[:, target] = narrow[:, i].reshape(m, -1)[:, source]
    weights, rates = inputs.sensing_weights, inputs.sensing_rates
    by_d, by_v = (_by_unknowns(tangent, forces.sense, weights, kept) for tangent in (by_x, by_rate))
    by_d += _by_unknowns(by_rate, forces.sense, rates, kept, constant=False)
    by_state = np.where(used[owners], -by_x[:, :, at[owners]], 0.0)
    act = _rows(forces.act, inputs.acting_weights, kept)
    followed = _rows(forces.sense, inputs.sensing_weights, owners)
    return Linear(act, by_d, by_v, by_state, followed, by_x, by_rate, kept)


def _rows(stack: VectorStack, weights: FloatArray, scalars: IntArray) -> FloatArray:
    vectors = np.tile(stack.rows[scalars], (len(weights), 1, 1))
    for place, scalar, vector in stack.varying_vectors:
        vectors[:, scalars == scalar] += (weights[:, place, None] * vector)[:, None]
    return vectors


def _by_unknowns(
    tangent: FloatArray, stack: VectorStack, weights: FloatArray, kept: IntArray, *, constant: bool = True
) -> FloatArray:
    """Return derivatives by some sensed scalars, shape (m, c, c), as those by the unknowns, shape (m, c, n).

    Without `constant` the constant part of the sensing vectors, which has no rate, is left out.
    """
    m, c, _ = tangent.shape
    result = np.zeros((m, c, stack.vectors.shape[1]))
    changed = np.flatnonzero(tangent.any(axis=(0, 2))) if constant else kept[:0]
    if len(changed) == c:
        result = (tangent.reshape(m * c, c) @ stack.rows[kept]).reshape(result.shape)
    elif len(changed):
        result[:, changed] = tangent[:, changed] @ stack.rows[kept]
    for place, scalar, vector in stack.varying_vectors:
        for j in np.flatnonzero(kept == scalar).tolist():
            changed = np.flatnonzero(tangent[:, :, j].any(axis=0))
            result[:, changed] += (tangent[:, changed, j] * weights[:, place, None])[:, :, None] * vector
    return result


def directions(forces: LocalForces, inputs: PrescribedInputs, i: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the acting and sensing rows of the forces, and the rates of the latter, shape (c, n) each."""
    act, sense, turning = inputs.acting_matrix(i), inputs.sensing_matrix(i), inputs.sensing_rate_matrix(i)
    return act @ forces.act.vectors, sense @ forces.sense.vectors, turning @ forces.sense.vectors


class Tangents:
    """Tangent damping and stiffness about a motion at m instants of the cam; the `mass` (n, n) is constant.

    The derivatives of the local forces depend on the cam angle, on the contact state and on the axial force of a
    pushrod. Displacements and velocities have the shape (m, n); the internal states `inner`, (m, s), are constant, None
    for those at rest.
    """

    def __init__(
        self, system: System, motion: CamMotion, displacement: FloatArray, velocity: FloatArray,
        inner: FloatArray | None = None,
    ) -> None:  # fmt: skip
        self._forces = LocalForces(system)
        self.mass, self._C, self._K = (matrix.dense() for matrix in (system.mass, system.damping, system.stiffness))
        self._schedule = self._forces.prescribed_inputs(motion)
        self._penetration, self._rate, _ = self._forces.sense_motion(displacement, velocity, self._schedule)
        self._inner = inner

    def at(self, i: int) -> tuple[FloatArray, FloatArray]:
        """Return damping and stiffness at an instant, shape (n, n) each."""
        row, state, forces = slice(i, i + 1), self._state(i)[None], self._forces
        inputs = self._schedule.at(row)
        narrow = forces.tangents(self._penetration[row], self._rate[row], state, inputs.functions)[2]
        linear = linearize(forces, inputs, narrow)
        (act,) = linear.act
        return self._C - act.T @ linear.by_v[0], self._K - act.T @ linear.by_d[0]

    def parts(self, i: int) -> Iterator[tuple[str, FloatArray]]:
        """Yield the name of each local force and the stiffness that it adds at an instant, without friction, (n, n).

        Friction depends on the penetration, but the force of the penetration does not depend on the sliding: this
        coupling has no potential, and half of it in a symmetric matrix would be a negative stiffness.
        """
        if not self._forces.count:
            return
        reaction = self._forces.respond(self._penetration[i], self._rate[i], self._state(i), self._schedule, i)
        act, sense, turning = directions(self._forces, self._schedule, i)
        for force, at, _ in self._forces.parts:
            by_penetration = reaction.by_penetration[at, at] @ sense[at] + reaction.by_rate[at, at] @ turning[at]
            if isinstance(force.law, ForceLaw) and force.law.friction:
                by_penetration[force.kind.scalars :: force.law.scalars] = 0.0
            yield self._forces.names[at.start], -act[at].T @ by_penetration

    def _state(self, i: int) -> FloatArray:
        return self._forces.start_state if self._inner is None else self._inner[i]


class LinearStep:
    """A step of the average acceleration, linearized: accelerations balance the forces at both of its ends.

    Massless motions are in equilibrium at the new end; residual forces of the old end are transferred by their springs,
    and undamped ones have the mean velocity of the step.
    """

    def __init__(self, system: System) -> None:
        self.mass, self._damping, self._stiffness = (
            matrix.dense() for matrix in (system.mass, system.damping, system.stiffness)
        )
        self._massless, self._size = MasslessMotions(system), system.size
        rates = find_massless_rates(system, average=True) if self._massless.any else None
        unit = np.eye(self._size)
        travel = unit if rates is None else unit + rates.free @ rates.amounts[: rates.free.shape[1]]
        #: Displacement per new velocity and half a step; that of the old velocity makes the sum 2.
        self.travel = _compact(travel)
        self._transfer = _compact(self._massless.condense_force(unit) if self._massless.any else unit)
        #: Mass, damping, stiffness, displacement per new and old velocity, transfer of forces from the old end.
        self.operators = (
            *(_compact(matrix) for matrix in (self.mass, self._damping, self._stiffness)),
            self.travel, _compact(2.0 * unit - travel), self._transfer,
        )  # fmt: skip
        self._length, self._inverse = 0.0, self.travel

    def equilibrate(self, forces: FloatArray) -> FloatArray:
        """Return forces of the old end, shape (n, k), without their part on massless motions."""
        return _multiply(self._transfer, forces)

    def initial_disturbances(self, at: Linear, given: FloatArray, source: FloatArray) -> FloatArray:
        """Return disturbances of an initial state with massless motions in equilibrium with a source of force."""
        if not self._massless.any:
            return given
        d, v, z = split_state(given, self._size)
        push = source + at.act[0].T @ (at.by_state[0] @ z + at.by_v[0] @ v + at.by_d[0] @ d)
        return np.vstack([self._massless.place(d, push), v, z])

    def inverse(self, length: float) -> FloatArray:
        """Return the new velocities without local forces by the impulse, for a length of the step in s."""
        if abs(length - self._length) > _SAME_LENGTH * length:
            half = 0.5 * length
            mass, damping, stiffness = self.operators[:3]
            if len(damping) == len(stiffness) == len(mass) == len(self.travel) == 1:
                self._inverse = 1.0 / (mass + half * (damping + half * stiffness * self.travel))
            else:
                product = self._stiffness @ _dense(self.travel)
                matrix = self.mass + half * (self._damping + half * product)
                self._inverse = np.linalg.inv(matrix).astype(np.float64)
            self._length = length
        return self._inverse

    def by_length(self, old: FloatArray, new: FloatArray) -> FloatArray:
        """Return the derivatives of d, momentum and z by the step length from the flows at both ends, (..., 2n + s)."""
        n, mean = self._size, 0.5 * (old + new)
        return np.concatenate([mean[..., :n], mean[..., n : 2 * n] @ self.mass.T, mean[..., 2 * n :]], axis=-1)

    def old_terms(self, more: FloatArray) -> FloatArray:
        """Return the contribution of the old end, without its residual on massless motions."""
        n = self._size
        return np.concatenate([more[:n], self.equilibrate(more[n : 2 * n, None])[:, 0], more[2 * n :]])


class StepSequence:
    """Equal steps of small disturbances between m successive instants, which share their preparation.

    With ``d = d_free + A v``, ``z = z_free + F d`` and ``M v + h/2 (C v + K d - f) = p`` at the new end, v is the only
    unknown of a step; the local forces f are a correction of low rank (Sherman, Morrison and Woodbury). Internal states
    follow the rule of `flexcam.dynamics.oil_laws.oil_column`: what a state z leaves of its scalar x, ``e = x - z``,
    follows ``e1 = T (x1 - x0) + B e0``, so that ``z1 = (1 - T) x1 + (T - B) x0 + B z0``; T and B have the shape (m - 1,
    s). The steps are those of `propagate_disturbances`, of the compiled functions if they are given.
    """

    def __init__(
        self, stepper: LinearStep, length: float, linear: Linear, T: FloatArray, B: FloatArray,
        compiled: Functions | None = None,
    ) -> None:  # fmt: skip
        _, c, n = linear.act.shape
        self._half, self._shape, self._linear, self._rules = 0.5 * length, (c, n), linear, (T, B)
        self._propagate, self._compiled = (compiled or _PYTHON)["propagate_disturbances"], compiled is not None
        inverse, by_new, by_v = stepper.inverse(length), linear.by_d[1:], linear.by_v[1:]
        rest = (1.0 - T)[:, :, None] * linear.followed[1:]
        difference = (T - B)[:, :, None] * linear.followed[:-1]
        by_new = by_new + linear.by_state[1:] @ rest if T.shape[1] else by_new
        sense = by_new * stepper.travel if len(stepper.travel) < n else by_new @ stepper.travel
        sense *= self._half
        sense += by_v
        sense *= self._half
        answers = linear.act[1:] * inverse if len(inverse) < n else linear.act[1:] @ inverse.T
        self._operators = (*stepper.operators, inverse, np.ones((1, n)))
        self._forces = tuple(
            np.ascontiguousarray(array) for array in (
                linear.act, linear.by_d, linear.by_v, linear.by_state, by_new,
                sense, answers, rest, difference, B,
            )
        )  # fmt: skip

    @property
    def constant(self) -> bool:
        """True if all steps are the same."""
        parts = (*(getattr(self._linear, item.name) for item in fields(Linear) if item.name != "kept"), *self._rules)
        return all((part[1:] == part[:1]).all() for part in parts)

    def propagate(self, i: int, before: FloatArray, more: FloatArray) -> FloatArray:
        """Return disturbances, shape (2n + s, k), after the step that follows instant i.

        `more` is what comes to d_free, p and z_free from elsewhere, of the same shape.
        """
        return self.propagate_all(before, more[None], i)[1]

    def propagate_all(self, before: FloatArray, more: FloatArray, first: int = 0, *, last: bool = False) -> FloatArray:
        """Return disturbances before and after successive steps, or before or after the `last` one alone, at its index.

        `more` is that of `propagate`, shape (steps, 2n + s, k); the result has a row more, or two rows.
        """
        (c, n), (size, k), steps = self._shape, before.shape, len(more)
        states = np.empty((2 if last else steps + 1, k, size))
        states[0] = before.T
        part, ends = slice(first, first + steps), slice(first, first + steps + 1)
        forces = [array[ends] for array in self._forces[:4]] + [array[part] for array in self._forces[4:]]
        more = np.ascontiguousarray(more.swapaxes(1, 2)) if self._compiled else more.swapaxes(1, 2)
        work = [np.empty((k, width)) for width in (n, n, size - 2 * n, n, size - 2 * n, n, n, c)]
        if not self._propagate(self._half, *self._operators, *forces, more, states, *work, np.empty((c, c + k))):
            raise np.linalg.LinAlgError
        return states.swapaxes(1, 2)


_PYTHON = bind(FUNCTIONS_OF_TANGENTS, NUMPY)


def _compact(matrix: FloatArray) -> FloatArray:
    """Return a matrix, or the diagonal of a diagonal one as a row, whose product takes one operation per entry."""
    diagonal = np.diag(matrix)[None].copy()
    is_diagonal = np.count_nonzero(matrix) <= len(matrix) and not (matrix - np.diagflat(diagonal)).any()
    return diagonal if is_diagonal else np.ascontiguousarray(matrix)


def _dense(matrix: FloatArray) -> FloatArray:
    return np.diagflat(matrix) if len(matrix) == 1 else matrix


def _multiply(matrix: FloatArray, columns: FloatArray) -> FloatArray:
    return matrix.T * columns if len(matrix) < len(columns) else matrix @ columns


def split_state(state: FloatArray, n: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return displacements, velocities and internal states of n unknowns."""
    return state[:n], state[n : 2 * n], state[2 * n :]
