"""Equations of motion of the flexible model (`rigid_model` builds those of the rigid one)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cache, lru_cache, partial
from itertools import product

import numpy as np

from flexcam import dynamics
from flexcam.core import DENSE_LIMIT, FloatArray, IntArray, Triplets
from flexcam.core.errors import parse_all, refuse
from flexcam.dynamics import Channel, DofSubset, Observable, Observation, Probe, System
from flexcam.fem.assembly import modal_damping, rayleigh_damping
from flexcam.fem.dofs import COMPONENTS
from flexcam.valvetrain.cam_contact import couple_cam
from flexcam.valvetrain.camshaft import rotation_supports, shaft_channels
from flexcam.valvetrain.contacts import (
    couple_adjuster,
    couple_films,
    couple_friction,
    couple_lash,
    couple_seat,
    lever_joints,
)
from flexcam.valvetrain.coupling import Coupling, shift_coupling
from flexcam.valvetrain.loads import couple_published_load, given_loads
from flexcam.valvetrain.model import Model
from flexcam.valvetrain.parts import Adjuster, CamContact, Contact, Lash, PublishedLoad, Seat
from flexcam.valvetrain.springs import couple_springs
from flexcam.valvetrain.strength import geometric_stiffness_forces
from flexcam.valvetrain.structure import Structure, build_structure, build_structure_in, coupled_groups, probe_of

_MODAL_LIMIT = 2 * DENSE_LIMIT  # maximum number of unknowns for which all modes are computed


def build_system(model: Model, speed: float) -> System:
    """Return the system of the flexible mechanism."""
    structure = build_structure(model)
    contacts = couple_contacts(structure, lambda name: couple_contact(structure, name, model.contacts[name], speed))
    damping, joints = _at_any_speed(structure)
    couplings = [*contacts, *joints, Coupling(given_loads(structure), (), ()), couple_films(structure, speed)]
    parts = split_observation(couplings)
    reactions = partial(_reaction, structure, contacts, parts, speed)
    return assemble_system(structure, damping, couplings, _support_channels(model, reactions))


def couple_contacts(structure: Structure, couple: Callable[[str], Coupling]) -> list[Coupling]:
    """Return the couplings of all contacts; the faults of all of them are in one error."""
    return parse_all(couple, structure.model.contacts)


def assemble_system(
    structure: Structure, damping: Triplets, couplings: Sequence[Coupling], further: Iterable[Channel] = ()
) -> System:
    """Return the system of a structure with some couplings; the further channels observe the whole system."""
    pairs = zip(couplings, split_observation(couplings), strict=True)
    channels = [
        replace(channel, value=_offset_positions(channel.value, part)) for c, part in pairs for channel in c.channels
    ]
    return System(
        mass=structure.mass, damping=damping, stiffness=structure.stiffness, names=structure.dofs.names,
        loads=tuple(load for c in couplings for load in c.loads),
        local_forces=tuple(force for c in couplings for force in c.forces),
        probes=_probes(structure), channels=(*channels, *further), free=structure.free,
    )  # fmt: skip


@lru_cache(maxsize=4)
def _probes(structure: Structure) -> tuple[Probe, ...]:
    return (*(probe_of(structure, point) for point in structure.model.probes), *_inner_probes(structure))


@lru_cache(maxsize=4)
def _at_any_speed(structure: Structure) -> tuple[Triplets, tuple[Coupling, ...]]:
    return structure.dampers + _damping(structure), _joints(structure)


def _joints(structure: Structure) -> tuple[Coupling, ...]:
    """Return the couplings other than contacts and loads."""
    parts = lever_joints, couple_springs, couple_friction, geometric_stiffness_forces, shaft_channels
    return tuple(couple(structure) for couple in parts)


_REACTIONS = ("force", "N"), ("moment", "N m")


def _support_channels(model: Model, reaction: Callable[[int, FloatArray], Observable]) -> Iterator[Channel]:
    """Yield the torques of supports that hold the rotation of a shaft, and the reactions of the requested supports.

    `reaction` returns the force of the support of a node on the mechanism along some motions of the node, shape (k, 6).
    """

    def channel(name: str, unit: str, node: int, motions: FloatArray) -> Channel:
        along = cache(partial(reaction, node, motions))  # built at its first use: it takes a second structure
        return Channel(f"supports.{name}", unit, lambda obs: along()(obs))

    for name, node, axis in rotation_supports(model):
        yield channel(f"{name}.torque", "N m", node, np.append(np.zeros(3), axis)[None])
    for point in model.reactions:
        nodes = model.mesh.select(point).tolist()
        held = [COMPONENTS.index(component) for component in model.supports[point]]
        for node, motions in product(nodes, [np.eye(6)[held]]):
            name = point if len(nodes) == 1 else model.mesh.node_name(node)
            if len(forces := motions[motions[:, :3].any(axis=1)]):
                yield channel(f"{name}.force", "N", node, forces)
            for component, motion in zip(held, motions, strict=True):
                kind, unit = _REACTIONS[component // 3]
                yield channel(f"{name}.{kind}_{'xyz'[component % 3]}", unit, node, motion[None])


@lru_cache(maxsize=16)
def _release_support(structure: Structure, node: int) -> tuple[Structure, IntArray]:
    """Return the structure with the held components of a node released, and the indices of the others in it."""
    held = np.flatnonzero(~structure.dofs.moving[node])
    dofs = structure.dofs.release(node, held, structure.model.mesh.node_name(node))
    return build_structure_in(structure.model, dofs), np.delete(np.arange(dofs.size), dofs.numbers[node, held])


@lru_cache(maxsize=16)
def _joints_and_loads(structure: Structure) -> tuple[Coupling, ...]:
    """Return the couplings other than contacts, in the order of the system."""
    return (*_joints(structure), Coupling(given_loads(structure), (), ()))


def _reaction(
    structure: Structure, contacts: Sequence[Coupling], parts: Sequence[_Part], speed: float, node: int,
    motions: FloatArray,
) -> Observable:  # fmt: skip
    """Return the force of a support on the mechanism along a motion of its node, or the magnitude along several.

    It balances inertia, damping without modal damping, stiffness, loads and local forces of the released structure.
    """
    released, kept = _release_support(structure, node)
    rows = np.array([released.dofs.vector(node, motion) for motion in motions])
    damping = released.model.damping
    damped = released.dampers + rayleigh_damping(released.mass, released.stiffness, damping.alpha, damping.beta)
    matrices = released.stiffness, damped, released.mass
    passive = [np.array([matrix.times(row)[kept] for row in rows]) for matrix in matrices]
    applied = [
        (part, partial(_applied_force, coupling, rows))
        for part, coupling in zip(parts[len(contacts) :], _joints_and_loads(released), strict=False)
    ]
    for part, (name, contact), coupling in zip(parts, structure.model.contacts.items(), contacts, strict=False):
        if isinstance(contact, PublishedLoad):  # its stiffness is that of the supported structure
            twist = released.row(released.model.cams[contact.cam].at, contact.rotation)
            arms = rows @ np.array([released.push(name), -contact.cam_torque * twist]).T
            applied.append((part, partial(_published_force, coupling, arms)))
        else:
            applied.append((part, partial(_applied_force, couple_contact(released, name, contact, speed), rows)))

    def force(obs: Observation) -> FloatArray:
        total: FloatArray = np.sum([obs.moved.extract(row, order) for order, row in enumerate(passive)], axis=0)
        total -= np.sum([along(part(obs)) for part, along in applied], axis=0)
        return total[:, 0] if len(rows) == 1 else np.linalg.norm(total, axis=1)

    return force


def _applied_force(coupling: Coupling, rows: FloatArray, obs: Observation) -> FloatArray:
    """Return the force of loads and local forces of a coupling along some motions, shape (m, k)."""
    vectors = np.array([load.vector for load in coupling.loads]).reshape(-1, rows.shape[1])
    total = obs.histories @ (vectors @ rows.T)
    for i, act in enumerate(act for force in coupling.forces for act in force.act):
        if (arms := act.vectors @ rows.T).any():
            weights = [obs.cam(function, 0) for function in act.functions] or [np.ones(len(total))]
            total += obs.forces[:, i, None] * (np.array(weights).T @ arms)
    return total


def _published_force(coupling: Coupling, arms: FloatArray, obs: Observation) -> FloatArray:
    """Return the force of a published load along some motions, from the arms of its force and its torque, (k, 2)."""
    return np.column_stack([channel.value(obs) for channel in coupling.channels]) @ arms.T


def couple_contact(structure: Structure, name: str, contact: Contact, speed: float) -> Coupling:
    """Return the coupling of a contact."""
    match contact:
        case PublishedLoad():
            coupling = couple_published_load(structure, name, contact, speed)
            return shift_coupling(coupling, structure.model.cams[contact.cam].phaser)
        case CamContact():
            return shift_coupling(couple_cam(structure, name, contact), structure.model.cams[contact.cam].phaser)
        case Seat():
            return couple_seat(structure, name, contact)
        case Lash():
            return couple_lash(structure, name, contact)
        case Adjuster():
            return couple_adjuster(structure, name, contact)


def _damping(structure: Structure) -> Triplets:
    terms = structure.model.damping
    matrix = rayleigh_damping(structure.mass, structure.stiffness, terms.alpha, terms.beta)
    if terms.modal == 0.0:
        return matrix
    if structure.dofs.size > _MODAL_LIMIT:
        why = "every mode of the model takes part, and the matrix is full"
        given, remedy = f"modal damping of {structure.dofs.size} unknowns", "use damping = { alpha = ..., beta = ... }"
        raise refuse("run.damping.modal", given, f"up to {_MODAL_LIMIT} unknowns", why, remedy)
    return Triplets.sum([matrix, *(_modal_damping(structure, dofs, terms.modal) for dofs in coupled_groups(structure))])


def _modal_damping(structure: Structure, dofs: IntArray, ratio: float) -> Triplets:
    """Return the modal damping of one uncoupled part, so that rounding does not couple parts."""
    size, subset = structure.dofs.size, DofSubset(dofs, np.zeros(structure.dofs.size))
    mass = structure.mass.part(dofs)
    if not mass.values.any():
        return Triplets.zeros(size)
    modes = dynamics.modes(mass, structure.stiffness.part(dofs), free=subset.free(structure.free))
    matrix = modal_damping(mass, modes.shapes, modes.omegas, ratio)
    return Triplets(size, dofs[matrix.rows], dofs[matrix.cols], matrix.values)


def split_observation(couplings: Iterable[Coupling]) -> list[_Part]:
    """Return views of the observation for each coupling."""
    views: list[_Part] = []
    loads = scalars = states = 0
    for coupling in couplings:
        sizes = [(len(f.sense), f.states) for f in coupling.forces]
        ends = loads + len(coupling.loads), scalars + sum(c for c, _ in sizes), states + sum(s for _, s in sizes)
        views.append(_Part(slice(loads, ends[0]), slice(scalars, ends[1]), slice(states, ends[2])))
        loads, scalars, states = ends
    return views


class _Part:
    """View of the observation for one coupling, cached for its channels."""

    def __init__(self, loads: slice, scalars: slice, states: slice) -> None:
        self._slices = loads, scalars, states
        self._last: tuple[Observation, Observation] | None = None

    def __call__(self, obs: Observation) -> Observation:
        if self._last is None or self._last[0] is not obs:
            self._last = obs, obs.part(*self._slices)
        return self._last[1]


def _offset_positions(value: Observable, part: _Part) -> Observable:
    return lambda obs: value(part(obs))


def _inner_probes(structure: Structure) -> list[Probe]:
    """Return probes of the unknowns not at nodes: loose points, inner parts of springs, modes of superelements.

    Results then contain every unknown, so that a run can be resumed from them.
    """
    model = structure.model
    groups = {name: [name] for name in model.further_unknowns if name not in model.loose_points} | model.inner_unknowns
    probes = [probe_of(structure, point) for point in model.loose_points if point not in model.probes]
    return probes + [
        Probe(part, tuple(name.removeprefix(f"{part}.") for name in names),
              np.array([structure.dofs.unit(name) for name in names]), (None,) * len(names))
        for part, names in groups.items() if names
    ]  # fmt: skip
