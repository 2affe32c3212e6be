"""Local forces of a system, stacked in arrays, and their stored energy."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flexcam.core import FloatArray, IntArray
from flexcam.dynamics.cam_motion import (
    ONE,
    AngleFunction,
    AngleVector,
    CamFunctionCache,
    CamMotion,
    Constant,
    PrescribedInputs,
    cam_angle,
)
from flexcam.dynamics.force_laws import (
    ANSWER,
    ARCH,
    BEGIN,
    CUSTOM,
    ENERGY_BY_STATE,
    FIRST,
    FUNCTIONS,
    FUNCTIONS_OF_LAWS,
    KIND,
    LAW_STATE,
    LAWS,
    LIFT,
    LOCAL_ROWS,
    OWN,
    PENETRATION,
    RATE,
    SCALARS,
    SPAN,
    STATE,
    STATE_RATE,
    STATE_ROWS,
)
from flexcam.dynamics.jit import Functions, bind
from flexcam.dynamics.law_data import CamLift, ForceLaw
from flexcam.dynamics.local_newton import FUNCTIONS_OF_NEWTON, NUMPY
from flexcam.dynamics.system import CustomLaw, LocalForce, Reaction, System, VirtualWork


class StoredEnergy:
    """Energy of some conservative local forces at m instants: of sensed scalars of complete laws, or all.

    `lossy` lists the positions, among these scalars, of those whose laws may dissipate energy.
    """

    def __init__(self, forces: LocalForces, scalars: IntArray | None = None) -> None:
        self._forces = forces
        self._scalars = np.arange(forces.count) if scalars is None else scalars
        table = forces.table.laws
        stores = np.isin(table[:, FIRST], self._scalars) & (forces.storing[table[:, FIRST]] > 0.0)
        self._laws = table[stores & (table[:, KIND] != CUSTOM)]
        varies = [bool(LAWS[kind].functions) for kind in self._laws[:, KIND].tolist()]
        self._varying = self._laws[varies]
        lossy = forces.mask(lambda force: isinstance(force.law, ForceLaw) and not force.law.is_conservative)
        self.lossy: IntArray = np.flatnonzero((lossy & (forces.storing > 0.0))[self._scalars])

    def at(
        self, penetration: FloatArray, state: FloatArray, cam: CamFunctionCache
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the energy, J, (m,), its derivatives by the scalars, (m, r), and by all internal states, (m, s)."""
        functions = self._forces.function_values(cam)
        energy, force, by_state = self._forces.evaluate(self._expand(penetration), state, functions, self._laws)
        return energy.sum(axis=1), force[:, self._scalars], by_state

    def varying(self, penetration: FloatArray, state: FloatArray, cam: CamFunctionCache) -> FloatArray:
        """Return the energy of the laws that depend on the cam angle, J, shape (m,)."""
        if not len(self._varying):
            return np.zeros(len(penetration))
        functions = self._forces.function_values(cam)
        return self._forces.evaluate(self._expand(penetration), state, functions, self._varying)[0].sum(axis=1)

    def _expand(self, penetration: FloatArray) -> FloatArray:
        """Return the scalars among all of the system, zero for the others."""
        if len(self._scalars) == self._forces.count:
            return penetration
        scalars = np.zeros((len(penetration), self._forces.count))
        scalars[:, self._scalars] = penetration
        return scalars


@dataclass(frozen=True, eq=False)
class VectorStack:
    """All sensing or all acting vectors, stacked."""

    vectors: FloatArray  #: shape (k, n)
    owner: FloatArray  #: 1 where a vector belongs to a scalar, shape (c, k)
    fixed: FloatArray  #: weights that are constant, zero for the others, shape (k,)
    varying: tuple[tuple[int, AngleFunction], ...]  #: index and weight function of the others
    rows: FloatArray  #: constant part of every scalar, then vectors of varying weights, shape (c + varying, n)

    @classmethod
    def of(cls, terms: Sequence[AngleVector], size: int) -> VectorStack:
        """Return the stack of angle-dependent vectors without zero vectors."""
        vectors = np.concatenate([np.zeros((0, size)), *(term.vectors for term in terms)])
        owner = np.repeat(np.eye(len(terms)), [len(term.vectors) for term in terms], axis=1)
        functions = [function for term in terms for function in term.functions or (ONE,) * len(term.vectors)]
        nonzero = np.flatnonzero(vectors.any(axis=1))
        vectors, owner = vectors[nonzero], owner[:, nonzero]
        fixed, varying = _separate([functions[i] for i in nonzero.tolist()])
        rows = np.concatenate([(owner * fixed) @ vectors, vectors[[i for i, _ in varying]]])
        return cls(vectors, owner, fixed, varying, rows)

    @property
    def places(self) -> IntArray:
        """Index of the first vector of each scalar, shape (c + 1,)."""
        return np.concatenate([[0], np.cumsum(self.owner.sum(axis=1))]).astype(np.intp)

    @cached_property
    def scalars(self) -> IntArray:
        """Scalar of every vector, shape (k,)."""
        return self.owner.argmax(axis=0) if len(self.owner) else np.zeros(0, dtype=np.intp)

    @cached_property
    def varying_vectors(self) -> list[tuple[int, int, FloatArray]]:
        """Index, scalar and vector of every vector whose weight varies."""
        places = [place for place, _ in self.varying]
        return list(zip(places, self.varying_scalars, self.vectors[places], strict=True))

    @property
    def varying_scalars(self) -> list[int]:
        """Scalar of every vector whose weight varies."""
        return [int(self.scalars[i]) for i, _ in self.varying]


def _separate(functions: Sequence[AngleFunction]) -> tuple[FloatArray, tuple[tuple[int, AngleFunction], ...]]:
    """Return the values of constant functions, zero for others, and the others with their indices."""
    fixed = np.array([function.value if isinstance(function, Constant) else 0.0 for function in functions], dtype=float)
    return fixed, tuple((i, function) for i, function in enumerate(functions) if not isinstance(function, Constant))


@dataclass(frozen=True, eq=False)
class LawTable:
    """The laws of all local forces as arrays, see `flexcam.dynamics.force_laws`."""

    laws: IntArray  #: shape (l, 8)
    constants: FloatArray  #: of all laws, one after the other
    functions: tuple[AngleFunction, ...]  #: of the cam angle, of all laws
    owners: IntArray  #: first scalar of the law of every internal state, shape (s,)
    custom: dict[int, CustomLaw]  #: laws as Python objects by row of the table

    @classmethod
    def of(cls, forces: Sequence[LocalForce], moved: Callable[[int], bool]) -> LawTable:
        """Return the table of some local forces; `moved` states whether a scalar of an arch can differ from zero."""
        rows: list[tuple[int, ...]] = []
        constants: list[float] = []
        functions: list[AngleFunction] = []
        owners: list[int] = []
        custom: dict[int, CustomLaw] = {}
        first = 0
        for force in forces:
            law, count = force.law, len(force.sense)
            if not isinstance(law, ForceLaw):
                custom[len(rows)] = law
                rows.append((CUSTOM, first, count, 0, len(functions), -1, 0, -1))
                functions.append(cam_angle)
                first += count
                continue
            for _ in force.groups:
                friction = len(constants) + len(law.constants)
                scalars = _count_arch_scalars(first, moved) if law.kind == ARCH else law.scalars
                state = len(owners) if law.states else -1
                lift = -1 if law.lift is None else friction + len(law.friction or ())
                rows.append((law.kind, first, scalars, len(constants), len(functions), state, friction, lift))
                constants += [*law.constants, *(law.friction or ())]
                constants += [] if law.lift is None else [len(law.lift.pieces), *law.lift.pieces.ravel().tolist()]
                functions += law.functions
                owners += [first] * law.states
                first += law.scalars
        table = np.array(rows, dtype=np.intp).reshape(-1, 8)
        return cls(table, np.array(constants), tuple(functions), np.array(owners, dtype=np.intp), custom)

    def repeat(self, times: int, count: int) -> LawTable:
        """Return the table of several instants in a row, each with its own scalars, functions and internal states."""
        shift = np.zeros(self.laws.shape[1], dtype=np.intp)
        shift[[FIRST, FUNCTIONS]] = count, len(self.functions)
        rows = [self.laws + i * shift for i in range(times)]
        for i, laws in enumerate(rows):
            laws[laws[:, LAW_STATE] >= 0, LAW_STATE] += i * len(self.owners)
        owners = np.concatenate([self.owners + i * count for i in range(times)])
        return replace(self, laws=np.concatenate(rows), functions=self.functions * times, owners=owners)


def _count_arch_scalars(first: int, moved: Callable[[int], bool]) -> int:
    """Return the number of active scalars of an arch: planes without motion are omitted."""
    planes = [plane for plane in (1, 2) if any(moved(first + 3 * plane - 2 + i) for i in range(3))]
    return 1 + 3 * max(planes, default=0)


class CamLifts(tuple[tuple[int, int, CamLift], ...]):
    """First scalar, last scalar and lift of the laws that follow the angle of a cam, see `ForceLaw.lift`."""

    __slots__ = ()

    def depth(self, scalars: FloatArray) -> FloatArray:
        """Return sensed scalars, shape (..., c), with the lifts in the penetrations of the laws."""
        depth = scalars.copy() if self else scalars
        for first, last, lift in self:
            depth[..., first] += lift(scalars[..., last], 0)
        return depth

    def depth_rate(self, scalars: FloatArray, rates: FloatArray) -> FloatArray:
        """Return the rates of `depth`."""
        result = rates.copy() if self else rates
        for first, last, lift in self:
            result[..., first] += lift(scalars[..., last], 1) * rates[..., last]
        return result

    def gradient(self, scalar: int, scalars: FloatArray) -> FloatArray:
        """Return the derivatives of one of `depth` by all sensed scalars, shape (c,)."""
        gradient = np.zeros(len(scalars))
        gradient[scalar] = 1.0
        for first, last, lift in self:
            gradient[last] += float(lift(scalars[last], 1)) * (first == scalar)
        return gradient


class Workspace:
    """Work arrays of `flexcam.dynamics.local_newton` for some local forces."""

    def __init__(self, table: LawTable, count: int) -> None:
        width = int(table.laws[:, SCALARS].max(initial=1))
        self.local = np.zeros((LOCAL_ROWS, count))
        self.local[OWN] = -1.0
        self.tangent = np.zeros((2, count, width))
        self.states = np.zeros((STATE_ROWS, len(table.owners)))
        self.active = np.zeros((2, count), dtype=np.intp)
        self.compliance = np.zeros((2, count, count))
        self.matrix = np.zeros((count, count + 1))


class LocalForces:
    """The local forces of a system, stacked; evaluated in Python without compiled functions.

    With `impacts_only` steps end only at impacts with restitution, and not wherever a contact opens or closes.
    """

    def __init__(self, system: System, compiled: Functions | None = None, *, impacts_only: bool = False) -> None:
        forces = system.local_forces
        self.names = [force.name for force in forces for _ in force.sense]
        self.sense = VectorStack.of([term for force in forces for term in force.sense], system.size)
        self.act = VectorStack.of([term for force in forces for term in force.act], system.size)
        self._offsets = _separate([offset for force in forces for offset in force.offset])
        self.count = len(self._offsets[0])
        self.places = np.vstack([self.sense.places, self.act.places, *[np.arange(self.count + 1)] * 2])
        self.no_reach = np.zeros(self.count + 1, dtype=np.intp)  #: empty runs: the compliance in Python is complete
        can_move = (np.diff(self.places[:2]) > 0).any(axis=0) | (self._offsets[0] != 0.0)
        self.table = LawTable.of(forces, lambda i: bool(can_move[i]))
        scalars, states = _slices([len(force.sense) for force in forces]), _slices([force.states for force in forces])
        self.parts = list(zip(forces, scalars, states, strict=True))
        switches = [(part.start + i, force.restitution) for force, part, _ in self.parts for i in force.switching]
        #: Scalars of contacts, whose passing zero opens or closes them.
        self.touching: IntArray = np.array([i for i, _ in switches], dtype=np.intp)
        switches = [switch for switch in switches if switch[1] is not None or not impacts_only]
        self.lifts = CamLifts(
            (part.start + i, part.start + i + force.law.scalars - 1, force.law.lift)
            for force, part, _ in self.parts if isinstance(force.law, ForceLaw) and force.law.lift
            for i in force.groups
        )  # fmt: skip
        self.switching: IntArray = np.array([i for i, _ in switches], dtype=np.intp)
        self.restitution: FloatArray = np.array([np.nan if e is None else e for _, e in switches], dtype=float)
        ramps = {
            part.start + i: force.law.ramp for force, part, _ in self.parts if isinstance(force.law, ForceLaw)
            for i in force.switching
        }  # fmt: skip
        #: Penetrations of the switching scalars over which their damping grows, m.
        self.ramps: FloatArray = np.array([ramps[i] for i, _ in switches], dtype=float)
        self.functions = bind((*FUNCTIONS_OF_LAWS, *FUNCTIONS_OF_NEWTON), self._overrides())
        self.compiled = compiled  #: functions of the kernel; None in Python
        self._evaluate, self._evaluate_rows = (
            (compiled or self.functions)[name] for name in ("evaluate_laws", "evaluate_rows")
        )
        self.workspace = Workspace(self.table, self.count)

    def _overrides(self) -> Functions:
        custom, laws = self.table.custom, self.table.laws

        def evaluate(law: int, angle: float, local: FloatArray, tangent: FloatArray) -> None:
            first, size = int(laws[law, FIRST]), int(laws[law, SCALARS])
            part = slice(first, first + size)
            reaction = custom[law].respond(local[PENETRATION, part], local[RATE, part], float(angle))
            local[ANSWER, part] = reaction.force
            tangent[0, part, :size], tangent[1, part, :size] = reaction.by_penetration, reaction.by_rate

        return {**NUMPY, "custom": evaluate} if custom else dict(NUMPY)

    @cached_property
    def storing(self) -> FloatArray:
        """One for the scalars of conservative forces, zero for others, shape (c,)."""
        return self.mask(lambda force: force.conservative).astype(float)

    @cached_property
    def opposed(self) -> NDArray[np.bool_]:
        """Mask of the forces that act exactly against their sensed motion at all cam angles, shape (c,)."""
        mask = self.storing > 0.0
        mask[[*self.sense.varying_scalars, *self.act.varying_scalars, *(i for i, _ in self._offsets[1])]] = False
        return mask

    @property
    def start_state(self) -> FloatArray:
        """Internal states at rest, shape (s,)."""
        return np.zeros(len(self.table.owners))

    @property
    def varying(self) -> IntArray:
        """Scalars whose sensing or acting vectors change with the cam angle, shape (v,)."""
        return np.unique(np.array([*self.sense.varying_scalars, *self.act.varying_scalars], dtype=np.intp))

    def mask(self, trait: Callable[[LocalForce], bool]) -> NDArray[np.bool_]:
        """Return the mask of the scalars of the forces with a trait, shape (c,)."""
        return np.array([trait(force) for force, _, _ in self.parts for _ in force.sense], dtype=bool)

    @property
    def polynomial(self) -> NDArray[np.bool_]:
        """Mask of scalars of opposed laws whose force is a polynomial of at most third degree, shape (c,)."""
        return self.mask(lambda force: force.kind.polynomial) & self.opposed

    @property
    def circulatory(self) -> NDArray[np.bool_]:
        """Mask of the scalars of circulatory laws, shape (c,)."""
        return self.mask(lambda force: force.kind.circulatory)

    @cached_property
    def prescribed_cuts(self) -> IntArray:
        """Columns at which the parts of the prescribed inputs begin, and their number, shape (7,)."""
        senses, acts, c = len(self.sense.vectors), len(self.act.vectors), self.count
        return np.cumsum([0, senses, senses, acts, c, c, len(self.table.functions)])

    def prescribed_inputs(self, motion: CamMotion) -> PrescribedInputs:
        """Return the prescribed inputs for the cam motion at some instants."""
        cam, speed, cuts = motion.cam, motion.speed[:, None], self.prescribed_cuts
        rows = np.empty((len(motion.angle), int(cuts[-1])))
        sensed, sensed_rates, acted, offset, offset_rate, functions = (rows[:, a:b] for a, b in pairwise(cuts.tolist()))
        _write_functions(sensed, self.sense.fixed, self.sense.varying, cam, 0)
        _write_functions(sensed_rates, 0.0 * self.sense.fixed, self.sense.varying, cam, 1, speed)
        _write_functions(acted, self.act.fixed, self.act.varying, cam, 0)
        _write_functions(offset, *self._offsets, cam, 0)
        _write_functions(offset_rate, 0.0 * self._offsets[0], self._offsets[1], cam, 1, speed)
        functions[:] = self.function_values(cam)
        return PrescribedInputs(motion.angle, rows, self.sense.owner, self.act.owner, cam)

    def function_values(self, cam: CamFunctionCache) -> FloatArray:
        """Return the functions of the laws at the m cam angles of a cache, shape (m, f)."""
        values = np.empty((len(cam.angle), len(self.table.functions)))
        for i, function in enumerate(self.table.functions):
            values[:, i] = cam(function, 0)
        return values

    def sense_motion(
        self, d: FloatArray, v: FloatArray, inputs: PrescribedInputs
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the sensed scalars, their rates, and the prescribed part of the rates, shape (m, c) each.

        Displacements and velocities are those at the m instants of the inputs, shape (m, n).
        """
        rows, c = self.sense.rows, self.count
        on_d, on_v = (rows @ d.T).T, (rows @ v.T).T  # contiguous histories per scalar
        penetration, rate, prescribed_rates = on_d[:, :c], on_v[:, :c], np.zeros((len(d), c), order="F")
        penetration += inputs.offset
        prescribed_rates += inputs.offset_rate
        for j, ((place, _), scalar) in enumerate(zip(self.sense.varying, self.sense.varying_scalars, strict=True)):
            penetration[:, scalar] += inputs.sensing_weights[:, place] * on_d[:, c + j]
            prescribed_rates[:, scalar] += inputs.sensing_rates[:, place] * on_d[:, c + j]
            rate[:, scalar] += inputs.sensing_weights[:, place] * on_v[:, c + j]
        rate += prescribed_rates
        return penetration, rate, prescribed_rates

    def virtual_work(self, inputs: PrescribedInputs) -> VirtualWork:
        """Return the virtual work of the forces at m instants, see `flexcam.dynamics.system.VirtualWork`."""

        def work(scalar: int, dofs: IntArray, motions: FloatArray) -> FloatArray:
            indices = np.flatnonzero(inputs.acts[scalar])
            weights = inputs.acts[scalar, indices] * inputs.acting_weights[:, indices]
            return weights @ (self.act.vectors[np.ix_(indices, dofs)] @ motions.T)

        return work

    def respond(
        self, penetration: FloatArray, rate: FloatArray, state: FloatArray, inputs: PrescribedInputs, i: int = 0
    ) -> Reaction:
        """Return the forces for sensed scalars and rates, shape (c,), and states, (s,), at an instant of the inputs."""
        work, table = self.workspace, self.table
        local, tangent, states = work.local, work.tangent, work.states
        local[PENETRATION], local[RATE], local[ANSWER] = penetration, rate, 0.0
        tangent[:] = 0.0
        states[STATE], states[BEGIN], states[SPAN] = state, penetration[table.owners], 0.0
        column = int(self.prescribed_cuts[-2])
        self._evaluate(table.laws, table.constants, inputs.rows, i, column, local, tangent, states)
        by_penetration, by_rate = np.zeros((2, self.count, self.count))
        for first, size in table.laws[:, [FIRST, SCALARS]].tolist():
            part = slice(first, first + size)
            by_penetration[part, part], by_rate[part, part] = tangent[:, part, :size]
        return Reaction(local[ANSWER].copy(), by_penetration, by_rate, states[STATE_RATE].copy())

    def follow_states(
        self, steps: FloatArray, penetration: FloatArray, begin: FloatArray, state: FloatArray
    ) -> FloatArray:  # fmt: skip
        """Return the rows of the internal states, shape (m, 9, s), at the ends of steps, s, that may be zero.

        The sensed scalars at their ends and at their beginnings have the shape (m, c), the states at their beginnings
        (m, s). With e, scalar minus internal state, ``e1 = BY_TRAVEL (x1 - x0) + BY_BEGIN e0``.
        """
        rows = self.table.laws[self.table.laws[:, LAW_STATE] >= 0]
        begin, no_functions = begin[:, self.table.owners], np.zeros((0, len(self.table.functions)))
        return self._evaluate_all(penetration, state, no_functions, rows, step=(steps, begin))[2]

    def acting_laws(self, penetration: FloatArray) -> IntArray:
        """Return the rows of the laws without those of contacts that stay open at all m instants, shape (m, c)."""
        table = self.table.laws
        contacts = np.array([kind != CUSTOM and LAWS[kind].touching for kind in table[:, KIND].tolist()], dtype=bool)
        still_open = (penetration[:, table[:, FIRST]] <= 0.0).all(axis=0)
        return table[~(contacts & still_open & (table[:, LAW_STATE] < 0) & (table[:, LIFT] < 0))]

    def contact_sides(self, penetration: FloatArray) -> NDArray[np.bool_]:
        """Return the sides of the switching scalars."""
        return self.lifts.depth(penetration)[..., self.switching] > 0.0

    def evaluate(
        self, penetration: FloatArray, state: FloatArray, functions: FloatArray, laws: IntArray | None = None,
        rate: FloatArray | None = None,
    ) -> tuple[FloatArray, FloatArray, FloatArray]:  # fmt: skip
        """Return stored energies, J, elastic forces, N, and derivatives of the energy by the states at m instants.

        Sensed scalars have the shape (m, c), internal states (m, s), functions of the laws (m, f); `laws` are rows of
        the table, None for all. With rates of the scalars, (m, c), the forces are those of the motion. The results have
        the shapes (m, c), (m, c) and (m, s).
        """
        energy, force, state_rows, _ = self._evaluate_all(penetration, state, functions, laws, rate)
        return energy, force, state_rows[:, ENERGY_BY_STATE]

    def tangents(
        self, penetration: FloatArray, rate: FloatArray, state: FloatArray, functions: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the forces at m instants (m, c), the rows of the internal states (m, 9, s), and derivatives.

        The derivatives of the forces, shape (m, 2, c, width), are those by the scalars of the law of a force, and by
        their rates. The arguments are those of `evaluate`.
        """
        return self._evaluate_all(penetration, state, functions, None, rate, tangents=True)[1:]

    @cached_property
    def coupled_scalars(self) -> IntArray:
        """Scalar of a force, and place and scalar of a derivative of it, of all derivatives, shape (3, d)."""
        triples = [
            (i, j, first + j)
            for first, size in self.table.laws[:, [FIRST, SCALARS]].tolist()
            for i in range(first, first + size)
            for j in range(size)
        ]
        return np.array(triples, dtype=np.intp).reshape(-1, 3).T

    def _evaluate_all(
        self, penetration: FloatArray, state: FloatArray, functions: FloatArray, laws: IntArray | None = None,
        rate: FloatArray | None = None, step: tuple[FloatArray, FloatArray] | None = None, *, tangents: bool = False,
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:  # fmt: skip
        """Return energies, forces, rows of the internal states, and the tangents of every law if requested.

        `step` are the lengths of the steps that end at the instants, and the scalars of the states before them.
        """
        work, table, m = Workspace(self.table, self.count), self.table, len(penetration)
        force, energy = np.zeros_like(penetration, order="C"), np.zeros_like(penetration, order="C")
        state_rows, rows = np.zeros((m, *work.states.shape)), table.laws if laws is None else laws
        rates = np.zeros(penetration.shape) if rate is None else np.ascontiguousarray(rate)
        narrow = np.zeros((m if tangents else 0, *work.tangent.shape))
        span, begin = step or (np.zeros(m), penetration[:, table.owners])
        if not len(rows):
            return energy, force, state_rows, narrow
        self._evaluate_rows(
            rows, table.constants, np.ascontiguousarray(functions), 0, np.ascontiguousarray(penetration), rates,
            np.ascontiguousarray(state), np.ascontiguousarray(begin), span, work.local, work.tangent, work.states,
            force, energy, state_rows, narrow,
        )  # fmt: skip
        return energy, force, state_rows, narrow


def _write_functions(
    columns: FloatArray, fixed: FloatArray, varying: tuple[tuple[int, AngleFunction], ...], cam: CamFunctionCache,
    order: int, speed: FloatArray | None = None,
) -> None:  # fmt: skip
    """Write functions of the cam angle as columns, or their derivatives by the angle times a speed."""
    columns[:] = fixed
    for i, function in varying:
        columns[:, i] = cam(function, order) if speed is None else cam(function, order) * speed[:, 0]


def _slices(sizes: Sequence[int]) -> list[slice]:
    return [slice(a, b) for a, b in pairwise(np.cumsum([0, *sizes]).tolist())]
