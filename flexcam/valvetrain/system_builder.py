"""Equations of motion of the flexible model (`rigid_model` builds those of the rigid one)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from flexcam import dynamics
from flexcam.core import DENSE_LIMIT, IntArray, Triplets
from flexcam.core.errors import parse_all, refuse
from flexcam.dynamics import Channel, DofSubset, Observable, Observation, Probe, System
from flexcam.fem.assembly import modal_damping, rayleigh_damping
from flexcam.valvetrain.cam_contact import couple_cam
from flexcam.valvetrain.camshaft import shaft_channels
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
from flexcam.valvetrain.structure import Structure, build_structure, coupled_groups, probe_of
from flexcam.valvetrain.support_reactions import support_channels

_MODAL_LIMIT = 2 * DENSE_LIMIT  # maximum number of unknowns for which all modes are computed


def build_system(model: Model, speed: float) -> System:
    """Return the system of the flexible mechanism."""
    structure = build_structure(model)
    contacts = couple_contacts(structure, lambda name: couple_contact(structure, name, model.contacts[name], speed))
    couplings = [*contacts, *_joints_and_loads(structure), couple_films(structure, speed)]
    terms = list(zip(couplings, split_observation(couplings), strict=True))
    reactions = support_channels(structure, terms, lambda released: _reaction_couplings(released, speed))
    return assemble_system(structure, _damping(structure), couplings, reactions)


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
def _joints_and_loads(structure: Structure) -> tuple[Coupling, ...]:
    """Return the couplings other than contacts and films, in the order of the system."""
    parts = lever_joints, couple_springs, couple_friction, geometric_stiffness_forces, shaft_channels
    return (*(couple(structure) for couple in parts), Coupling(given_loads(structure), (), ()))


def _reaction_couplings(structure: Structure, speed: float) -> list[Coupling]:
    """Return the couplings of a structure with released supports in the order of the system.

    Published loads are left out: their stiffness is that of the supported structure.
    """
    contacts = [
        Coupling((), (), ()) if isinstance(contact, PublishedLoad) else couple_contact(structure, name, contact, speed)
        for name, contact in structure.model.contacts.items()
    ]
    return [*contacts, *_joints_and_loads(structure), couple_films(structure, speed)]


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


@lru_cache(maxsize=4)
def _damping(structure: Structure) -> Triplets:
    terms = structure.model.damping
    matrix = structure.dampers + rayleigh_damping(structure.mass, structure.stiffness, terms.alpha, terms.beta)
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
