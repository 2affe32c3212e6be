"""Constant loads of a model: its weight, and forces given in the case."""

from __future__ import annotations

import numpy as np

from flexcam import fem
from flexcam.fem import direction
from flexcam.fem.loads import line_load
from flexcam.linalg import FloatArray
from flexcam.system import Load
from flexcam.train.model import GivenLoad
from flexcam.train.published import steady
from flexcam.train.structure import Structure, find_node


def constant_loads(structure: Structure) -> list[Load]:
    """Return weight and given forces; the weight is there before the cam turns, the others act from the start of a run.

    Parameters
    ----------
    structure
        The structure.

    Returns
    -------
    list
        One load each, with a constant history.
    """
    model = structure.model
    loads = [
        Load(f"loads.{name}", _vector(structure, name, load), steady(load.size)) for name, load in model.loads.items()
    ]
    if any(model.gravity):
        loads.append(Load("gravity", weight(structure, np.array(model.gravity)), steady(1.0), installed=True))
    return loads


def _vector(structure: Structure, name: str, load: GivenLoad) -> FloatArray:
    if load.member is not None:
        elements = structure.model.mesh.element_ranges()[load.member]
        return line_load(structure.beams, elements, load.direction[:3], structure.dofs)
    return structure.row(load.at or "", load.direction, f"loads.{name}.at")


def weight(structure: Structure, gravity: FloatArray) -> FloatArray:
    """Return the weight of members and bodies at nodes as a load vector.

    It is the mass matrix times a rigid motion, with the rows and columns of held components still in it: half an
    element's weight at a support is carried there. A mass at a rocker's point is left out, as a lumped rocker does not
    say in which direction its valve moves.

    Parameters
    ----------
    structure
        The structure.
    gravity
        Acceleration, m/s^2, shape (3,), global axes.

    Returns
    -------
    ndarray
        Shape (n,), N and N m.
    """
    mesh = structure.model.mesh
    everything = fem.dof_map(mesh, [])
    mass = fem.mass(structure.beams, everything)
    for name, part in structure.model.masses.items():
        if structure.model.rocker_at(part.at) is None:
            mass = mass + fem.mass_at(find_node(structure.model, part.at, f"masses.{name}.at"), part.body, everything)
    size = float(np.linalg.norm(gravity))
    pulled = mass.times(size * everything.rigid_motion(mesh, direction(gravity)))
    free, number = structure.dofs.numbers >= 0, everything.numbers
    out = np.zeros(structure.dofs.size)
    out[structure.dofs.numbers[free]] = pulled[number[free]]
    return out
