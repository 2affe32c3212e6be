"""A model's structure: matrices of beams, masses, springs and levers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache

import numpy as np

from flexcam import fem
from flexcam.checks import refuse
from flexcam.fem import along, mass_at
from flexcam.linalg import FloatArray, Triplets
from flexcam.train.model import MassAt, Model
from flexcam.train.springs import inner_name, spring_parts
from flexcam.train.structure import Structure, find_node, lever_ends


@lru_cache(maxsize=4)
def build_structure(model: Model) -> Structure:
    """Assemble the passive part of a model."""
    inner = [inner_name(name, i) for name, spring in model.springs.items() for i in range(1, spring.elements)]
    dofs = fem.dof_map(model.mesh, model.supports.items(), _single(model))
    bare = structure_in(model, dofs.extended([*model.further_unknowns, *inner]))
    stretches = (stretch for stretch, spring, _ in _stretches(bare) if spring > 0.0)
    return replace(bare, free=fem.free_motions(model.mesh, bare.dofs, stretches))


def structure_in(model: Model, dofs: fem.DofMap) -> Structure:
    """Assemble the passive part of a model in given unknowns."""
    beams, nothing = fem.beams(model.mesh, model.members), Triplets.zeros(dofs.size)
    bare = Structure(model, beams, dofs, nothing, nothing, nothing, np.zeros((dofs.size, 0)))
    mass, stiffness, dampers = [fem.mass(beams, dofs), *_masses(bare)], [fem.stiffness(beams, dofs)], [nothing]
    for stretch, spring, damper in _stretches(bare):
        stiffness.append(along(stretch, spring))
        dampers.append(along(stretch, damper))
    mass, stiffness, dampers = (Triplets.joined(parts) for parts in (mass, stiffness, dampers))
    return replace(bare, mass=mass, stiffness=stiffness, dampers=dampers)


def _masses(bare: Structure) -> Iterator[Triplets]:
    """Yield the masses of bodies, rockers and springs."""
    for name, part in bare.model.masses.items():
        yield _mass(bare, name, part)
    for rocker in bare.model.rockers.values():
        yield along(bare.path(rocker), rocker.inertia / rocker.arms[0] ** 2)
    for name, spring in bare.model.springs.items():
        if spring.mass > 0.0:
            for low, high in spring_parts(bare, name, spring):
                yield _bar_mass(low, high, spring.mass / spring.elements)


def _stretches(bare: Structure) -> Iterator[tuple[FloatArray, float, float]]:
    """Yield the row, the stiffness and the damping of everything that stretches: ends of levers, parts of springs."""
    for lever in bare.model.levers.values():
        for end, (path, moved) in lever_ends(bare, lever).items():
            bent = float(lever.reach(np.zeros(1), end)[1][0]) * path - moved
            yield bent, lever.stiffness[end], lever.damping[end]
    for name, spring in bare.model.springs.items():
        share = float(spring.elements)
        for low, high in spring_parts(bare, name, spring):
            yield high - low, share * spring.stiffness, share * spring.damping


def _single(model: Model) -> list[tuple[int, FloatArray]]:
    """Return what moves at nodes on no member: where a mass has inertia, and along springs."""
    known, used = model.mesh.points, model.mesh.on_members()
    moved = [(part.at, np.diag(part.body.matrix())) for part in model.masses.values()]
    for spring in model.springs.values():
        moved += [(end, spring.direction) for end in (spring.at, spring.to) if end is not None]
    nodes = [(int(node), size) for point, size in moved if point in known for node in known[point]]
    return [(node, size) for node, size in nodes if not used[node]]


def _bar_mass(low: FloatArray, high: FloatArray, mass: float) -> Triplets:
    """Return the consistent mass m/6 [2 1; 1 2] of a bar between two motions."""
    both, apart = low + high, high - low
    return along(both, 0.25 * mass) + along(apart, mass / 12.0)


def _mass(structure: Structure, name: str, part: MassAt) -> Triplets:
    if structure.model.rocker_at(part.at) is not None:
        if any(part.body.inertia) or any(part.body.offset):
            why = "a lumped rocker moves its point along one line"
            raise refuse(
                f"masses.{name}", "inertia or offset at a rocker's point", "a mass alone", why, "leave them out"
            )
        return along(structure.row(part.at, np.zeros(6)), part.body.mass)
    return mass_at(find_node(structure.model, part.at, f"masses.{name}.at"), part.body, structure.dofs)


def member_masses(model: Model) -> dict[str, float]:
    """Return the mass of every member."""
    beams = fem.beams(model.mesh, model.members)
    return {n: float((beams.rho_A * beams.length)[part].sum()) for n, part in model.mesh.element_ranges().items()}
