"""Buckling loads of members."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexcam.core import DENSE_LIMIT, FloatArray, null_space, select_constraints
from flexcam.fem.assembly import geometric, stiffness
from flexcam.fem.dofs import DofMap, dof_map
from flexcam.fem.elements.beam import Beams
from flexcam.fem.members import beams
from flexcam.fem.mesh import Mesh, refine
from flexcam.valvetrain.model import Model
from flexcam.valvetrain.structure import Structure, build_structure


def buckling_load(structure: Structure, member: str) -> float:
    """Return the buckling load of a single member in its supports.

    The lowest P of ``K + P Kg(-1)`` over the member's own elements, with the supports of its nodes. Other members and
    springs are neglected, so that a pushrod between guides has Euler's load. Ends that the supports leave free are
    hinged. Elements are divided if fewer than four lie between supports, as a single one is up to 50 % too stiff.
    """
    own = structure.beams.part(structure.model.mesh.element_ranges()[member])
    if math.isinf(load := _lowest_load(own, structure.dofs)) or (parts := _parts(structure.model, member)) == 1:
        return load
    return _lowest_load(*_divide(structure.model, member, parts))


@dataclass(frozen=True)
class StiffStrut:
    """Member with too few elements for its geometric stiffness.

    Parameters
    ----------
    member
        Its name.
    excess
        Relative excess of the buckling load of the discretized member; infinite if no node is free to bend.
    elements
        Sufficient number of elements.
    """

    member: str
    excess: float
    elements: int


def stiff_struts(model: Model) -> list[StiffStrut]:
    """Return the members with too few elements for their geometric stiffness, whose buckling load is too high."""
    asked = [name for name, member in model.members.items() if member.geometric_stiffness]
    return list(_stiff(build_structure(model), asked)) if asked else []


def _stiff(structure: Structure, members: list[str]) -> Iterator[StiffStrut]:
    model, ranges = structure.model, structure.model.mesh.element_ranges()
    for name in members:
        count = len(model.mesh.lines[name]) - 1
        if 6 * count > DENSE_LIMIT or (parts := _parts(model, name)) == 1:
            continue
        borne, right = (
            _lowest_load(structure.beams.part(ranges[name]), structure.dofs),
            _lowest_load(*_divide(model, name, parts)),
        )
        if borne > (1.0 + _EXCESS_LIMIT) * right:
            yield StiffStrut(name, borne / right - 1.0, parts * count)


_EXCESS_LIMIT = 0.05
"""Relative excess of the buckling load to report: two elements between supports stay below it."""


def _lowest_load(alone: Beams, dofs: DofMap) -> float:
    """Return the lowest buckling load of elements, N."""
    K, G = stiffness(alone, dofs), geometric(alone, np.full(len(alone), -1.0), dofs)
    numbers = dofs.numbers[np.unique(alone.nodes)]
    used = np.unique(numbers[numbers >= 0])
    K, squeezed = K.part(used), -G.part(used).dense()
    free = np.linalg.qr(null_space(K))[0]
    kept = np.setdiff1d(np.arange(len(used)), select_constraints(free) if free.shape[1] else [])
    if not len(kept):
        return math.inf
    ends = np.isin(used, dofs.numbers[[alone.nodes[0, 0], alone.nodes[-1, 1]], :3])
    pressed = _hinge_free_ends(squeezed, free, ends)[np.ix_(kept, kept)]
    root = np.linalg.cholesky(K.part(kept).dense())
    scaled = np.linalg.solve(root, np.linalg.solve(root, pressed).T)
    largest = float(np.linalg.eigvalsh(0.5 * (scaled + scaled.T)).max())
    return 1.0 / largest if largest > 1e-12 * float(np.abs(scaled).max(initial=1.0)) else math.inf


_SUFFICIENT_ELEMENTS = 4
"""Elements between supports for which the buckling load is accurate to 1 % with any supports."""

_MANY = 100
"""Number of elements of a member up to which they are divided: their matrices are dense."""


def _parts(model: Model, member: str) -> int:
    """Return the number of parts of each element for sufficient resolution."""
    line, points = model.mesh.lines[member], model.mesh.points
    held = {node for point in model.supports for node in points[point].tolist()}
    inner = [i for i in range(1, len(line) - 1) if int(line[i]) in held]
    wanted = math.ceil(_SUFFICIENT_ELEMENTS / int(np.diff([0, *inner, len(line) - 1]).min()))
    return min(wanted, max(2, _MANY // len(line)))


def _divide(model: Model, member: str, parts: int) -> tuple[Beams, DofMap]:
    """Return the divided elements of a member and their numbering with supports."""
    nodes, line = np.unique(model.mesh.lines[member], return_inverse=True)
    points = {point: np.flatnonzero(np.isin(nodes, model.mesh.points[point])) for point in model.supports}
    mesh = refine(Mesh(model.mesh.nodes[nodes], {member: line}, points), {member: parts})
    return beams(mesh, model.members), dof_map(mesh, model.supports.items())


def _hinge_free_ends(pressed: FloatArray, free: FloatArray, ends: NDArray[np.bool_]) -> FloatArray:
    """Return a geometric stiffness in which free motions are added such that the ends stay in place.

    A free motion has no strain energy, so it can be chosen to minimize the motion of the ends. Twist does not move the
    ends; the pseudo-inverse omits it.
    """
    seen = free * ends[:, None]
    still = np.eye(len(free)) - free @ np.linalg.pinv(free.T @ seen, rcond=_MOTION_TOLERANCE, hermitian=True) @ seen.T
    return still.T @ pressed @ still


_MOTION_TOLERANCE = 1e-14
"""Relative square of the ends' motion that counts as zero."""
