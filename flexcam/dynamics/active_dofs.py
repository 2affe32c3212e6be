"""Active degrees of freedom: unknowns that can move. The others are excluded from the integration.

M, C, K and the local forces couple unknowns. A group of coupled unknowns moves if a time-dependent load or a local
force that depends on the cam angle acts on it, if it has an initial velocity, or if it is initially not in equilibrium.
Every other group stays at its initial displacement, also under its weight. Idle scalars of a local force, such as the
bending of a straight strut, couple nothing unless another force moves them.

An entry couples unless it is exactly zero, even if it is of the size of rounding: a soft spring between stiff parts has
entries as small. Too many active unknowns cost only time, not accuracy.

The reduced problem is integrated in the active unknowns or in a basis, and its results are expanded.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexcam.core import FloatArray, IntArray, Triplets, component_members, connected_components, diagonal_scale
from flexcam.core.errors import InputError
from flexcam.dynamics.basis import Basis, DofSubset, project_system
from flexcam.dynamics.blocks import Block, Series
from flexcam.dynamics.cam_motion import CamMotion, Constant
from flexcam.dynamics.initial_acceleration import massless_impact_error
from flexcam.dynamics.integrator import Method
from flexcam.dynamics.law_data import ForceLaw
from flexcam.dynamics.local_forces import LocalForces
from flexcam.dynamics.massless import MasslessMotions
from flexcam.dynamics.problem import Problem
from flexcam.dynamics.system import LocalForce, System

_MOTION_TOLERANCE = 1e-13
"""Fraction of the largest initial displacement or velocity, as square roots of energies, below which it is rounding."""

_RESIDUAL_TOLERANCE = 1e-12
"""Fraction of the forces on a group below which its residual is rounding of the equilibrium."""

_FORCE_TOLERANCE = 1e-15
"""Fraction of the forces on all groups below which a force is rounding."""

_FREE_TOLERANCE = 1e-6
"""Fraction of the largest displacement of a motion without stiffness below which a displacement is rounding."""


@dataclass(frozen=True, eq=False)
class InactiveGroup:
    """A group of coupled unknowns that never moves."""

    unknowns: IntArray  #: indices of the unknowns, shape (k,)
    loaded: bool  #: whether constant loads or forces act on it, in equilibrium
    free: bool  #: whether the group has a motion without stiffness


@dataclass(frozen=True, eq=False)
class ActiveDofs:
    """Active unknowns of a system for an initial state."""

    moving: NDArray[np.bool_]  #: mask of the active unknowns, shape (n,)
    inactive: tuple[InactiveGroup, ...]  #: the inactive groups
    offset: FloatArray  #: constant displacements of the inactive unknowns, shape (n,); zero for active ones


def find_active_dofs(
    system: System, displacement: FloatArray | None = None, velocity: FloatArray | None = None,
    inner: FloatArray | None = None,
) -> ActiveDofs:  # fmt: skip
    """Return the active unknowns of a system for an initial state."""
    n = system.size
    d = np.zeros(n) if displacement is None else displacement
    v = np.zeros(n) if velocity is None else velocity
    vectors = [load.vector for load in system.loads if not load.steady]
    loaded = (np.array(vectors).reshape(len(vectors), n) != 0.0).any(axis=0)
    idle, excited = _find_idle_scalars(system, d), loaded | _find_motion(v, system.mass.diagonal())
    while True:
        labels = _coupling_groups(system, idle)
        steady, moving = _constant_forces(system, d, inner, _spread_to_groups(excited, labels), labels)
        moving |= _spread_to_groups(_find_unbalanced_dofs(system, d, steady, labels), labels)
        unmoved = [entry for entry in idle if not moving[entry.unknowns].any()]
        if len(unmoved) == len(idle):
            break
        idle = unmoved
    loads = np.abs(system.load_vectors()).sum(axis=0) + np.abs(steady).sum(axis=0)
    sizes = np.zeros((n, 0)) if system.free is None else np.abs(system.free)
    free = (sizes > _FREE_TOLERANCE * sizes.max(axis=0, initial=0.0)).any(axis=1)
    inactive = tuple(
        InactiveGroup(group, bool(loads[group].any()), bool(free[group].any()))
        for group in component_members(labels)
        if not moving[group[0]]
    )
    return ActiveDofs(moving, inactive, np.where(moving, 0.0, d))


@dataclass(frozen=True, eq=False)
class _IdleScalars:
    """Idle scalars of a local force, and the unknowns that they sense or act on."""

    force: LocalForce
    scalars: frozenset[int]
    unknowns: NDArray[np.bool_]


def _find_idle_scalars(system: System, d: FloatArray) -> list[_IdleScalars]:
    """Return the sets of idle scalars that are zero within rounding in the initial state."""
    idle: list[_IdleScalars] = []
    d = np.where(_find_motion(d, system.stiffness.diagonal()), d, 0.0)
    for force in system.local_forces:
        for scalars in force.idle_scalars():
            if not any((force.sense[i].vectors @ d).any() or force.offset[i] != Constant(0.0) for i in scalars):
                vectors = [vector.vectors for i in scalars for vector in (force.sense[i], force.act[i])]
                idle.append(_IdleScalars(force, frozenset(scalars), (np.concatenate(vectors) != 0.0).any(axis=0)))
    return idle


def _coupling_groups(system: System, idle: list[_IdleScalars]) -> IntArray:
    """Return the group label of every unknown: its lowest member."""
    pairs = [
        (m.rows[m.values != 0.0], m.cols[m.values != 0.0]) for m in (system.mass, system.damping, system.stiffness)
    ]
    for force in system.local_forces:
        skipped = frozenset[int]().union(*(entry.scalars for entry in idle if entry.force is force))
        unknowns = np.flatnonzero(_force_unknowns(force, system.size, skipped))
        pairs.append((np.repeat(unknowns[:1], len(unknowns)), unknowns))
    rows, cols = (np.concatenate(indices) for indices in zip(*pairs, strict=True))
    return connected_components(system.size, rows, cols)


def _force_unknowns(force: LocalForce, size: int, idle: frozenset[int] = frozenset()) -> NDArray[np.bool_]:
    """Return the unknowns that a local force senses or acts on, except through idle scalars."""
    pairs = [pair for i, pair in enumerate(zip(force.sense, force.act, strict=True)) if i not in idle]
    vectors = [np.zeros((1, size)), *(vector.vectors for pair in pairs for vector in pair)]
    return (np.concatenate(vectors) != 0.0).any(axis=0)


def _constant_forces(
    system: System, d: FloatArray, inner: FloatArray | None, moving: NDArray[np.bool_], labels: IntArray
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Return the constant forces on inactive unknowns, shape (k, n), and the active unknowns, local forces included."""
    zero, moving = np.zeros(1), moving.copy()
    rest = CamMotion(zero, zero, zero, zero)
    steady = [load.vector * load.history(rest)[0] for load in system.loads if load.steady]
    forces = LocalForces(system)
    inputs = forces.prescribed_inputs(rest)
    penetration = forces.sense_motion(d[None], np.zeros((1, system.size)), inputs)[0][0]
    state = forces.start_state if inner is None else inner
    reaction = forces.respond(penetration, np.zeros(forces.count), state, inputs)
    for force, part, states in forces.parts:
        unknowns = _force_unknowns(force, system.size)
        if moving[unknowns].any():
            continue
        if _depends_on_angle(force, penetration[part]) or reaction.state_rate[states].any():
            moving |= _spread_to_groups(unknowns, labels)
        else:
            pairs = zip(reaction.force[part].tolist(), force.act, strict=True)
            steady += [value * act.vectors[0] for value, act in pairs]
    return np.array(steady).reshape(len(steady), system.size), moving


def _depends_on_angle(force: LocalForce, penetration: FloatArray) -> bool:
    """Return whether a force at rest depends on the cam angle through its vectors, offsets or law."""
    if any(vector.functions for vector in (*force.sense, *force.act)):
        return True
    if not all(isinstance(offset, Constant) for offset in force.offset):
        return True
    return bool((not isinstance(force.law, ForceLaw) or force.law.functions) and penetration.any())


def _find_unbalanced_dofs(system: System, d: FloatArray, steady: FloatArray, labels: IntArray) -> NDArray[np.bool_]:
    """Return the unknowns on which constant forces and stiffness are not in equilibrium within rounding."""
    K, scale = system.stiffness, diagonal_scale(system.stiffness)
    strained = np.bincount(K.rows, weights=np.abs(K.values * d[K.cols]), minlength=system.size)
    residual = np.abs(steady.sum(axis=0) - K.times(d)) * scale
    size = np.zeros(system.size)
    np.maximum.at(size, labels, (np.abs(steady).sum(axis=0) + strained) * scale)
    return residual > np.maximum(_RESIDUAL_TOLERANCE * size[labels], _FORCE_TOLERANCE * size.max(initial=0.0))


def _find_motion(motion: FloatArray, weights: FloatArray) -> NDArray[np.bool_]:
    """Return the unknowns with a displacement (weights: stiffness) or velocity (mass); without weight any counts."""
    sizes = np.abs(motion) * np.sqrt(np.maximum(weights, 0.0))
    return (sizes > _MOTION_TOLERANCE * sizes.max(initial=0.0)) | ((motion != 0.0) & (weights <= 0.0))


def _spread_to_groups(marked: NDArray[np.bool_], labels: IntArray) -> NDArray[np.bool_]:
    groups = np.zeros(len(labels), dtype=bool)
    groups[labels[marked]] = True
    return groups[labels]


def active_dofs_of(problem: Problem) -> ActiveDofs:
    """Return the active unknowns of a problem."""
    start = problem.initial_state
    return find_active_dofs(problem.system, start.displacement, start.velocity, start.inner)


def basis_of(problem: Problem) -> Basis | None:
    """Return the basis of the integration; None for the system's unknowns."""
    if problem.basis is not None or not problem.prune:
        return problem.basis
    dofs = active_dofs_of(problem)
    return None if dofs.moving.all() else DofSubset(np.flatnonzero(dofs.moving), dofs.offset)


def reduce_problem(problem: Problem, basis: Basis) -> Problem:
    """Return a problem in the coordinates of a basis."""
    system, start = problem.system, problem.initial_state
    weight = _weight(system)
    d, v = (basis.project(motion, weight) for motion in (start.displacement - basis.offset, start.velocity))
    a = None if start.acceleration is None else basis.project(start.acceleration, weight)
    reduced = replace(start, displacement=d, velocity=v, acceleration=a)
    return replace(problem, system=project_system(system, basis), start=reduced, basis=None, prune=False)


def integrated_size(problem: Problem) -> int:
    """Return the number of integrated unknowns of a problem."""
    if problem.system.is_kinematic:
        return 0
    basis = basis_of(problem)
    return problem.system.size if basis is None else basis.size


def method_refusal(problem: Problem, method: Method) -> InputError | None:
    """Return why a method cannot integrate the reduced problem; None if it can."""
    if problem.system.is_kinematic:
        return None
    impacts = any(force.restitution is not None for force in problem.system.local_forces)
    if type(method).refusal is Method.refusal and not impacts:
        return None  # it integrates any system in any unknowns
    basis = basis_of(problem)
    system = problem.system if basis is None else project_system(problem.system, basis)
    error = massless_impact_error(LocalForces(system), MasslessMotions(system)) if impacts else None
    return error or method.refusal(system, problem.step)


def _weight(system: System) -> Triplets:
    """Return the mass plus a small part of the stiffness that determines massless unknowns."""
    mass, stiff = system.mass.diagonal(), system.stiffness.diagonal()
    heavy = mass > 0.0
    highest = float((stiff[heavy] / mass[heavy]).max(initial=0.0))
    return system.mass + system.stiffness.scale(1.0 / highest if highest > 0.0 else 1.0)


def expand_block(block: Block, basis: Basis) -> Block:
    """Return a block with fields expanded to all unknowns."""
    d, v, a = map(basis.expand, block.fields)
    return replace(block, fields=Series(d + basis.offset if basis.offset.any() else d, v, a))
