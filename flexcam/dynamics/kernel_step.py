"""The compiled step of a system in modal coordinates: its operators, its laws as arrays, and calls of the kernel."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flexcam.core import FloatArray, IntArray, component_members, connected_components
from flexcam.dynamics.cam_motion import CamMotion, PrescribedInputs
from flexcam.dynamics.collocation import Collocation, stage_coefficients
from flexcam.dynamics.contact_events import MAX_HALVINGS
from flexcam.dynamics.force_laws import DEPTH, FIRST, OWN, SCALARS, STATE, STATE_ROWS
from flexcam.dynamics.generalized_alpha import Scheme
from flexcam.dynamics.integrator import unconverged_forces
from flexcam.dynamics.jit import Program
from flexcam.dynamics.kernel import (
    BEFORE,
    FORCE_SIZE,
    FUNCTIONS_OF_KERNEL,
    LAST_DEPTH,
    PART_ROWS,
    PARTS,
    STATE_SIZE,
)
from flexcam.dynamics.local_forces import LocalForces, Workspace
from flexcam.dynamics.problem import Problem
from flexcam.dynamics.step_state import StepState
from flexcam.dynamics.system import System
from flexcam.dynamics.tangent_kernel import FUNCTIONS_OF_TANGENTS

_NONE = np.zeros((0, 0))
_STRONG = 0.05
"""Motion of a scalar by the force of another law, relative to their own, above which both laws are in one block."""
_CLOSED = 1e-6
"""Penetration of a contact that has just closed, m or rad."""
_ANGLES = 73
"""Number of cam angles at which the weights of vectors are compared."""
Places = NDArray[np.uint32]
"""Lists of places in arrays, unsigned: see `flexcam.dynamics.kernel`."""
_NO_SIDES, _NO_SCALARS = np.zeros((2, 0), dtype=np.intp), np.zeros(0, dtype=np.intp)


PROGRAM = Program(
    (*FUNCTIONS_OF_KERNEL, *FUNCTIONS_OF_TANGENTS),
    (
        ("evaluate_laws", "i2 f1 f2 i i f2 f3 f2"),
        ("evaluate_rows", "i2 f1 f2 i f2 f2 f2 f2 f1 f2 f3 f2 f2 f2 f3 f4"),
        ("march", "i i i f1 f1 f1 f3 f4 u1 f4 f2 f5 f2 u1 f2 u1 f2 i1 f2 i2 i1 f1 u2 u1 i1 i1 i1" + 3 * " f2"
                  + " f3 f3 i2 f4 f2 i2 f1 f2 i1"),
        ("propagate_disturbances", "f" + 8 * " f2" + 9 * " f3" + " f2 f3 f3" + 9 * " f2"),
    ),
)  # fmt: skip
"""The compiled functions of the kernel."""


@dataclass(frozen=True, eq=False)
class StepOperator:
    """Steps of one or two lengths, as arrays of the kernel with an axis of the lengths in front."""

    lengths: FloatArray  #: of a stage, s, shape (lengths,)
    slopes: FloatArray  #: velocity per displacement by a force within the step, 1/s, shape (lengths,)
    scheme: FloatArray  #: parameters of the generalized-alpha family; without effect for the collocation
    operator: FloatArray  #: matrices of the modes and coefficients of the step
    answers: FloatArray  #: response of the modes to the acting vectors, shape (lengths, stages, acts, n)
    give: FloatArray  #: displacement and velocity along sensing vectors by acting ones, (lengths, 2, acts, senses)
    #: Square of the step times the acceleration along the sensing vectors by the acting ones, as far as modes with mass
    #: answer within the step, shape (acts, senses) of one stage; empty where it does not limit the step.
    hold: FloatArray
    #: Treatment of the damping that couples modes, shape (lengths, stages, stages, n, n); empty without it.
    inverse: FloatArray


@dataclass(frozen=True, eq=False)
class ModalSystem:
    """A system in modal coordinates as arrays of the kernel."""

    modes: FloatArray  #: mass, damping and stiffness, shape (3, n)
    coupled: FloatArray  #: damping off its diagonal, shape (n, n); empty where there is none
    sensing: FloatArray  #: sensing vectors of the local forces, shape (senses, n)
    acting: FloatArray  #: acting vectors, shape (acts, n)

    @classmethod
    def of(cls, system: System, forces: LocalForces) -> ModalSystem:
        """Return those of a system whose mass and stiffness are diagonal."""
        diagonal = system.damping.diagonal()
        coupled = system.damping.dense() - np.diag(diagonal)
        modes = np.array([system.mass.diagonal(), diagonal, system.stiffness.diagonal()])
        return cls(modes, coupled if coupled.any() else _NONE, forces.sense.vectors, forces.act.vectors)

    @cached_property
    def coupled_groups(self) -> IntArray:
        """Label of the group of modes that dampers couple, of each mode; empty without such dampers."""
        return connected_components(len(self.coupled), *np.nonzero(self.coupled))

    @cached_property
    def groups(self) -> list[tuple[IntArray, FloatArray]]:
        """Groups of modes that dampers couple, such as those of one valve train, by size.

        Arrays (groups, size), and their acting vectors, shape (groups, size, acts).
        """
        members = component_members(self.coupled_groups)
        sizes = sorted({len(group) for group in members})
        groups = [np.array([group for group in members if len(group) == size]) for size in sizes]
        return [(group, np.ascontiguousarray(self.acting.T[group])) for group in groups]

    def operator(self, scheme: Scheme | Collocation, *steps: float) -> StepOperator:
        """Return the step of a method, s; the collocation may have two lengths."""
        return self._one_stage(scheme, *steps) if isinstance(scheme, Scheme) else self._two_stages(np.array(steps))

    def _one_stage(self, scheme: Scheme, step: float) -> StepOperator:
        new = 1.0 - scheme.alpha_f
        mass, damping, stiffness = self.modes
        effective = scheme.effective_mass(mass, damping, stiffness, step)
        inverse_mass, inverse = np.zeros_like(effective), _NONE
        if len(self.coupled):
            inverse, answers = np.zeros_like(self.coupled), np.empty_like(self.acting)
            matrix = np.diag(effective) + new * scheme.gamma * step * self.coupled
            for group, acting in self.groups:
                rows, columns = group[:, :, None], group[:, None, :]
                blocks = np.linalg.inv(matrix[rows, columns])
                inverse[rows, columns] = blocks
                answers[:, group.ravel()] = new * (blocks @ acting).reshape(group.size, len(self.acting)).T
        else:
            inverse_mass = 1.0 / effective
            answers = new * self.acting * inverse_mass
        weights = np.array([step, scheme.beta, scheme.gamma, scheme.alpha_m, scheme.alpha_f])
        to_d, to_v = scheme.beta * step**2, scheme.gamma * step
        sensed = answers @ self.sensing.T
        operator, give = np.array([*self.modes, inverse_mass]), np.array([to_d * sensed, to_v * sensed])
        lengths, slopes = np.array([step]), np.array([to_v / to_d])
        arrays = operator[None], answers[None, None], give[None]
        return StepOperator(lengths, slopes, weights, *arrays, _NONE, inverse[None, None, None])

    def _two_stages(self, lengths: FloatArray) -> StepOperator:
        """Return the collocation over two stages of each of some lengths, s; a force acts on its stage alone."""
        (_, n), acts, count = self.modes.shape, len(self.acting), len(lengths)
        mass, damping, stiffness = np.tile(self.modes, count)
        rows = stage_coefficients(mass, damping, stiffness, np.repeat(2.0 * lengths, n))
        rows = np.ascontiguousarray(rows.reshape(2, 3, 5, count, n).transpose(3, 0, 1, 2, 4))
        by_force = rows[:, :, :2, 3:].swapaxes(1, 2)  # d and v by forces at middle and end, (lengths, 2, stages, 2, n)
        answers = np.zeros((count, 2, 2 * acts, n))  # by stage of the mode force; acting vectors of both stages
        answers[:, 0, :acts] = answers[:, 1, acts:] = self.acting
        inverse = np.zeros((count, 2, 2, 0, 0))
        if len(self.coupled):
            to_v: FloatArray = (by_force[:, 1, :, :, :, None] * np.eye(n)).swapaxes(2, 3).reshape(count, 2 * n, 2 * n)
            dampers = np.kron(np.eye(2), self.coupled)
            flat = np.asarray(dampers @ np.linalg.inv(np.eye(2 * n) + to_v @ dampers), dtype=float)
            pushes = answers.swapaxes(1, 2).reshape(count, 2 * acts, 2 * n)
            pushes = pushes - pushes @ (flat @ to_v).swapaxes(1, 2)
            answers = pushes.reshape(count, 2 * acts, 2, n).swapaxes(1, 2).copy()
            inverse = flat.reshape(count, 2, n, 2, n).swapaxes(2, 3).copy()
        motion = np.einsum("ltan,lqstn->lqasn", answers, by_force)
        give = (motion @ self.sensing.T).reshape(count, 2, 2 * acts, 2 * len(self.sensing))
        modes = np.broadcast_to(self.modes, (count, 3, n))
        operator = np.concatenate([modes, rows.reshape(count, -1, n)], axis=1)
        # A force at the middle alone moves a free mass by 4/3 h^2 of its acceleration until the end.
        heavy = np.where(mass[:n] > 0.0, 0.75 * by_force[0, 0, 1, 0], 0.0)
        hold = (self.acting * heavy) @ self.sensing.T
        return StepOperator(lengths, 1.0 / lengths, np.zeros(5), operator, answers, give, hold, inverse)


@dataclass(frozen=True, eq=False)
class KernelState:
    """An instant as arrays that the kernel advances: modes (12, n), local forces (6, c) and internal states (9, s)."""

    modes: FloatArray
    forces: FloatArray
    states: FloatArray


class Kernel:
    """The compiled step of one system, in modal coordinates and with all laws as data.

    The collocation takes a local force at each stage for a separate force.
    """

    def __init__(self, problem: Problem, scheme: Scheme | Collocation, forces: LocalForces) -> None:
        self._march, self._scheme, self.forces = PROGRAM.compile()["march"], scheme, forces
        self.stages = stages = 1 if isinstance(scheme, Scheme) else 2
        self._system = system = ModalSystem.of(problem.system, forces)
        self.columns = 3 * problem.system.size + forces.count + len(forces.start_state)
        self._vectors = np.concatenate([system.sensing] * stages + [system.acting] * stages)
        self._runs = list_runs(self._vectors)
        groups = system.coupled_groups
        self._mode_runs = list_runs((groups[:, None] == groups).astype(float))
        #: Scalars of contacts without impacts, whose opening and closing divides a step.
        self._touching = np.setdiff1d(forces.touching, forces.switching) if stages == 2 else _NO_SCALARS
        self._ramps = forces.ramps if stages == 1 else np.zeros(0)
        self.shorten(problem.step)
        self._answer_runs = list_runs(np.abs(self.whole.answers).sum(axis=(0, 1)))
        can_move, coupling = find_coupling(forces, self.whole)
        can_move = np.tile(can_move != 0.0, (stages, stages))
        columns = np.lexsort([np.arange(len(can_move)), *can_move])  # equal columns are neighbours
        self._reach, self._places = list_runs(can_move[:, columns]), _repeat_places(forces.places, stages, columns)
        order, blocks = divide_laws(forces.table.laws, coupling)
        table, count = forces.table.repeat(stages, forces.count), len(order)
        rows = (order[:, None] + count * np.arange(stages)).ravel()  # the stages of a law stand together
        self._table, self._blocks = replace(table, laws=table.laws[rows]), stages * blocks
        self._varying = np.concatenate([forces.varying + stage * forces.count for stage in range(stages)])
        self._work = work = Workspace(self._table, stages * forces.count)
        self._local, self._compliance = np.stack([work.local] * 2), np.stack([work.compliance] * 2)
        n, c = problem.system.size, forces.count
        sizes = [n, *np.diff(forces.prescribed_cuts).tolist()]
        self._cuts = np.cumsum([0, *(stages * size for size in sizes)])
        width = max(int(self._cuts[-1]), self.columns, n, stages * c)
        self._parts = np.zeros((PART_ROWS, width))
        self._length, self.shortest = 0.0, problem.step * 0.5**MAX_HALVINGS

    def operator(self, *steps: float) -> StepOperator:
        """Return steps whose stages have a length, s, or two."""
        return self._system.operator(self._scheme, *steps)

    def shorten(self, step: float) -> None:
        """Make a length, s, that of usual steps."""
        #: Steps of the usual length, and parts of them.
        self.whole = self.operator(step, step / PARTS) if len(self._touching) else self.operator(step)

    def given(self, loads: FloatArray, inputs: PrescribedInputs) -> FloatArray:
        """Return the prescribed inputs of steps side by side: loads and those of the local forces, by stage."""
        parts = [loads, *inputs.parts] if self.stages > 1 else [loads, inputs.rows]
        steps = len(loads) // self.stages
        return np.hstack([part[: steps * self.stages].reshape(steps, self.stages * part.shape[1]) for part in parts])

    def instant(self, loads: FloatArray, inputs: PrescribedInputs, i: int) -> FloatArray:
        """Return the prescribed inputs of an instant as a row, the same at every stage."""
        rows = [i] * self.stages
        return self.given(loads[rows], inputs.at(np.array(rows)))[0]

    def state(self, moment: StepState) -> KernelState:
        """Return a copy of an instant."""
        modes, stages = np.zeros((STATE_SIZE, len(moment.d))), self.stages
        modes[:4] = moment.d, moment.v, moment.a, moment.applied
        forces = np.zeros((FORCE_SIZE, stages * self.forces.count))
        forces[:3] = np.tile([moment.local, moment.penetration, moment.rate], stages)
        forces[LAST_DEPTH] = np.tile(self.forces.lifts.depth(moment.penetration), stages)
        states = np.zeros((STATE_ROWS, stages * len(moment.inner)))
        states[STATE] = np.tile(moment.inner, stages)
        return KernelState(modes, forces, states)

    def moment(self, state: KernelState, time: float, pressed: NDArray[np.bool_] | None = None) -> StepState:
        """Return an instant; its arrays are its own."""
        c, z = self.forces.count, len(self.forces.start_state)
        (d, v, a, applied), (local, penetration, rate) = state.modes[:4].copy(), state.forces[:3, -c or None :].copy()
        inner = state.states[STATE, -z or None :].copy()
        return StepState(time, d, v, a, applied, local, penetration, rate, inner, pressed)

    def advance(
        self, operator: StepOperator, state: KernelState, steps: tuple[int, int], given: FloatArray, found: FloatArray,
        sides: IntArray = _NO_SIDES, before: FloatArray | None = None,
    ) -> tuple[int, int, int]:  # fmt: skip
        """Step over some rows of given; return how it ended, the row reached and the iterations. The state advances.

        Steps are divided where contacts open and close if the inputs `before` the first row are given.
        """
        system, table, work, count = self._system, self._table, self._work, np.zeros(2, dtype=np.intp)
        if operator.lengths[0] != self._length:  # the compliance belongs to the length of a step
            self._compliance[..., :1], self._local[:, OWN], self._length = np.nan, -1.0, float(operator.lengths[0])
        if before is not None:
            self._parts[BEFORE, : len(before)] = before
        stage_sides = np.hstack([np.add(sides, [[stage * self.forces.count], [0]]) for stage in range(self.stages)])
        ending = self._march(
            *steps, self.stages, operator.lengths, operator.slopes, operator.scheme, operator.operator,
            operator.answers, self._answer_runs, operator.give, operator.hold, operator.inverse, system.coupled,
            self._mode_runs, self._vectors, self._runs, given, self._cuts, self._parts, table.laws, self._blocks,
            table.constants, self._places, self._reach, table.owners, self._varying,
            _NO_SCALARS if before is None else self._touching, state.modes, state.forces, state.states, self._local,
            work.tangent, work.active, self._compliance, work.matrix, stage_sides, self._ramps, found, count,
        )  # fmt: skip
        row, iterations = count.tolist()
        return int(ending), row, iterations

    def touches_between(self, now: StepState, new: StepState) -> bool:
        """Return whether in the last call a switching scalar had another side at the middle than at both ends."""
        before, after = now.sides(self.forces.contact_sides), self.forces.contact_sides(new.penetration)
        middle = self._local[0, DEPTH, self.forces.switching] > 0.0
        return bool(((middle != before) & (middle != after)).any())

    def unconverged_forces(self) -> list[str]:
        """Return the names of the forces that did not converge in the last call."""
        return unconverged_forces(self.forces.names * self.stages, self._local[0])


def list_runs(rows: FloatArray | NDArray[np.bool_]) -> Places:
    """Return the runs of nonzero entries of each row, as `flexcam.dynamics.kernel` reads them.

    Examples
    --------
    >>> list_runs(np.array([[1.0, 1.0, 0.0, 1.0], [0.0, 0.0, 0.0, 0.0]])).tolist()
    [3, 7, 7, 0, 2, 3, 4]
    """
    padded = np.zeros((len(rows), rows.shape[1] + 2), dtype=bool)
    padded[:, 1:-1] = rows != 0.0
    owner, border = np.nonzero(padded[:, 1:] != padded[:, :-1])  # begin and end in turn
    starts = len(rows) + 1 + np.searchsorted(owner, np.arange(len(rows) + 1))
    return np.concatenate([starts, border]).astype(np.uint32)


def find_coupling(forces: LocalForces, operator: StepOperator) -> tuple[FloatArray, FloatArray]:
    """Return which forces can move which scalars, and how much relative to their own, shape (c, c) each.

    The motion is the largest of the stages of a step, with the root mean squares of the weights over a revolution.
    """
    acts, senses = len(forces.act.vectors), len(forces.sense.vectors)
    if not (acts and senses):
        return np.zeros((forces.count, forces.count)), np.zeros((forces.count, forces.count))
    give = np.abs(operator.give[0])
    give = give.reshape(2, -1, acts, give.shape[2] // senses, senses).max(axis=(1, 3))
    coupled = forces.act.owner @ give.sum(axis=0) @ forces.sense.owner.T
    inputs = _revolution_inputs(forces)
    sensed, acted = (np.sqrt(np.mean(w**2, axis=0)) for w in (inputs.sensing_weights, inputs.acting_weights))
    motion = (forces.act.owner * acted) @ give[0] @ (forces.sense.owner * sensed).T
    root = np.sqrt(np.diag(motion))
    scale = np.outer(root, root)
    infinite = np.where(motion > 0.0, np.inf, 0.0)  # forces that move other scalars than their own
    relative = np.divide(motion, scale, out=infinite, where=scale > 0.0)
    return coupled + coupled.T, np.maximum(relative, relative.T)


def _revolution_inputs(forces: LocalForces) -> PrescribedInputs:
    angle = np.linspace(0.0, 2.0 * np.pi, _ANGLES)
    return forces.prescribed_inputs(CamMotion(angle, np.ones_like(angle), np.zeros_like(angle), angle))


def contact_stiffness_ratio(problem: Problem, step: float) -> float:
    """Return the largest (omega h)^2 of a contact that has just closed, for the collocation in modal coordinates.

    It is an estimate of `flexcam.dynamics.kernel.contact_ratio` before the run, with stages of length `step`, s: at
    rest, each contact by itself, with the functions of its law at angle zero.
    """
    forces = LocalForces(problem.system)
    hold = ModalSystem.of(problem.system, forces).operator(Collocation(), step).hold
    inputs = _revolution_inputs(forces)
    acted = forces.act.owner * inputs.acting_weights[:, None]  # shape (angles, c, acts)
    response = np.abs(np.sum(acted @ hold * (forces.sense.owner * inputs.sensing_weights[:, None]), axis=2)).max(axis=0)
    closed = np.full(forces.count, _CLOSED)
    closed -= forces.lifts.depth(closed) - closed
    stiffness = forces.respond(closed, np.zeros_like(closed), forces.start_state, inputs).by_penetration
    return float((np.abs(np.diag(stiffness)) * response).max(initial=0.0))


def divide_laws(laws: IntArray, coupling: FloatArray) -> tuple[IntArray, IntArray]:
    """Return the rows of the table of laws block by block, and where blocks begin and the last one ends.

    Laws that move each other's scalars more than a little form one block.
    """
    scalars = [slice(first, first + size) for first, size in laws[:, [FIRST, SCALARS]].tolist()]
    strong = [(i, j) for i, a in enumerate(scalars) for j, b in enumerate(scalars) if (coupling[a, b] > _STRONG).any()]
    rows, columns = np.array(strong, dtype=np.intp).reshape(-1, 2).T
    members = component_members(connected_components(len(laws), rows, columns))
    order = np.concatenate([np.zeros(0, dtype=np.intp), *members])
    return order, np.cumsum([0, *(len(block) for block in members)])


def _repeat_places(places: IntArray, stages: int, order: IntArray) -> Places:
    """Return the places of the scalars of all stages; `order` are the scalars of the columns of the compliance."""
    later = [places[:2, 1:] + stage * places[:2, -1:] for stage in range(stages)]
    columns = [np.append(row, len(order)) for row in (np.argsort(order), order)]
    return np.vstack([np.hstack([places[:2, :1], *later]), *columns]).astype(np.uint32)
