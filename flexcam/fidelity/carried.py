"""A start given at the nodes of one mesh, seen at those of another with more or fewer elements or parts of springs."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from flexcam.case import Case, build_model
from flexcam.case.tables.run import GivenStartRecord
from flexcam.fem.deflection import deflection
from flexcam.linalg import FloatArray
from flexcam.train import Structure, build_structure
from flexcam.train.springs import inner_name, spring_parts


def carried_start(case: Case, other: Case) -> Case:
    """Return a case that starts as another one does, where that is given at nodes.

    What lies between two nodes of a member follows the shape of its elements: otherwise a finer mesh would have points
    at rest between those that are moved, and begin with a blow that the given mesh does not know. Between the ends of a
    part of a spring the motion is linear.
    """
    start = case.record.run.start
    if not isinstance(start, GivenStartRecord):
        return other
    structure, its = (build_structure(build_model(one)) for one in (case, other))
    parts = {name: (one.elements, other.record.members[name].elements) for name, one in case.record.members.items()}
    seen = [_seen(structure, its, parts, values) for values in (start.displacement, start.velocity)]
    return other.with_run({"start": GivenStartRecord(displacement=seen[0], velocity=seen[1])})


def _seen(
    structure: Structure, its: Structure, parts: Mapping[str, tuple[int, int]], values: Mapping[str, float]
) -> dict[str, float]:
    """Return named values of one mesh as those of another; what names no node stays as it is."""
    names, mesh = structure.dofs.names, structure.model.mesh
    on_nodes = names[: int((structure.dofs.numbers >= 0).sum())]
    row = np.array([values.get(name, 0.0) if name in on_nodes else 0.0 for name in names])
    nodal = structure.dofs.nodal(row)
    found, given = np.zeros((len(its.model.mesh.nodes), 6)), len(mesh.nodes)
    for name, elements in mesh.element_ranges().items():
        found[its.model.mesh.lines[name]] = _along(structure, nodal, elements, *parts[name])
        given -= (elements.stop - elements.start) // parts[name][0] * (parts[name][0] - 1)
    found[:given] = nodal[:given]  # nodes of the case come first in every mesh of it
    free = its.dofs.numbers >= 0
    numbers: list[int] = its.dofs.numbers[free].tolist()
    amounts: list[float] = found[free].tolist()
    moved = {its.dofs.names[i]: x for i, x in zip(numbers, amounts, strict=True) if x}
    beside = {name: value for name, value in values.items() if name not in on_nodes}
    return moved | _within_springs(structure, its, values, beside)


def _within_springs(
    structure: Structure, its: Structure, values: Mapping[str, float], beside: Mapping[str, float]
) -> dict[str, float]:
    """Return values of what is no node, those within springs as the parts of another mesh have them."""
    found, row = dict(beside), np.array([values.get(name, 0.0) for name in structure.dofs.names])
    for name, spring in structure.model.springs.items():
        own, parts = spring.elements, its.model.springs[name].elements
        if own == parts:
            continue
        ends = spring_parts(structure, name, spring)
        line = [float(ends[0][0] @ row), *(float(high @ row) for _, high in ends)]
        for i in range(1, own):
            found.pop(inner_name(name, i), None)
        inner = np.interp(np.arange(1, parts) / parts, np.arange(own + 1) / own, line).tolist()
        found |= {inner_name(name, i): value for i, value in enumerate(inner, start=1) if value}
    return found


def _along(structure: Structure, nodal: FloatArray, elements: slice, parts: int, other: int) -> FloatArray:
    """Return the motion at the nodes of a member that has `other` elements per segment in place of `parts`."""
    local = deflection(structure.beams, nodal, other, elements)
    triads = structure.beams.triads[elements]
    turned = [np.einsum("eji,epj->epi", triads, local[..., kind]) for kind in (slice(0, 3), slice(3, 6))]
    whole = np.concatenate(turned, axis=-1)
    line = np.concatenate([whole[:, :-1].reshape(-1, 6), whole[-1:, -1]])
    return line[::parts]
