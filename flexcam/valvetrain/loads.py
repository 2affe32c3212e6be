"""Constant loads of a model: its weight, and forces given in the case."""

from __future__ import annotations

import numpy as np

from flexcam.core import FloatArray
from flexcam.dynamics import ConstantSpeed, Load
from flexcam.fem.assembly import assemble_loads, distributed_load, element_weight
from flexcam.valvetrain.parts import PublishedLoad
from flexcam.valvetrain.published_load import constant_history, follower_train
from flexcam.valvetrain.structure import Structure, find_node, spring_parts, spring_row


def constant_loads(structure: Structure) -> list[Load]:
    """Return weight, springs' installed forces and given forces; given forces act only from the start of a run."""
    model = structure.model
    loads: list[Load] = []
    for name, load in model.loads.items():
        if load.member is None:
            vector = load.size * structure.row(load.at or "", load.direction, f"loads.{name}.at")
        else:
            vector = assemble_loads(structure.beams, _distribute(structure, name), structure.dofs)
        loads.append(Load(f"loads.{name}", vector, constant_history(1.0), steady=True))
    for name, spring in model.springs.items():
        if not spring.installed_force:
            continue
        row = spring_row(structure, name, spring)
        if not _of_a_published_load(structure, row):
            loads.append(
                Load(f"springs.{name}", -row, constant_history(spring.installed_force), installed=True, steady=True)
            )
    if any(model.gravity):
        loads.append(Load("gravity", _weight(structure), constant_history(1.0), installed=True, steady=True))
    return loads


def steady_load(structure: Structure) -> FloatArray:
    """Return the sum of all constant loads: weight, springs' installed forces and given forces."""
    still = ConstantSpeed(1.0).at(np.zeros(1))
    loads = (float(load.history(still)[0]) * load.vector for load in constant_loads(structure))
    return sum(loads, np.zeros(structure.dofs.size))


def _of_a_published_load(structure: Structure, row: FloatArray) -> bool:
    """Return whether a spring acts on the train of a published load, whose preload includes its installed force."""
    contacts = structure.model.cam_contacts.items()
    published = [(f"contacts.{n}.follower", one) for n, one in contacts if isinstance(one, PublishedLoad)]
    return any(float(follower_train(structure, one, where).motion @ row) != 0.0 for where, one in published)


def element_loads(structure: Structure) -> FloatArray:
    """Return the distributed element loads: given forces and weight."""
    total = np.zeros((len(structure.beams), 12))
    for name, load in structure.model.loads.items():
        total += _distribute(structure, name) if load.member is not None else 0.0
    return total + element_weight(structure.beams, np.array(structure.model.gravity))


def _distribute(structure: Structure, name: str) -> FloatArray:
    load = structure.model.loads[name]
    elements = structure.model.mesh.element_ranges()[load.member or ""]
    return distributed_load(structure.beams, elements, load.size * load.direction[:3])


def _weight(structure: Structure) -> FloatArray:
    """Return the weight of members, of bodies at nodes and of springs.

    Masses at a rocker's point are excluded because a lumped rocker does not define the direction of its valve.
    """
    model, gravity = structure.model, np.array(structure.model.gravity)
    load = assemble_loads(structure.beams, element_weight(structure.beams, gravity), structure.dofs)
    for name, part in model.masses.items():
        if model.rocker_at(part.at) is None:
            pull = part.body.matrix() @ np.concatenate([gravity, np.zeros(3)])
            load = load + structure.dofs.vector(find_node(model, part.at, f"masses.{name}.at"), pull)
    for name, spring in model.springs.items():
        if spring.mass > 0.0 and model.rocker_at(spring.at) is None:
            pull = spring.mass / spring.elements * float(gravity @ spring.direction[:3])
            load = load + sum(0.5 * pull * (low + high) for low, high in spring_parts(structure, name, spring))
    return load
