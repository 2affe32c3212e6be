"""Members as lines in space, with their modes and the motion of the run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from flexcam.fem import Beams, Mesh
from flexcam.fem.deflection import deflection
from flexcam.linalg import FloatArray, IntArray
from flexcam.report.content import Scene, Shape
from flexcam.report.subject import Subject
from flexcam.train import Structure

_PARTS = 6
"""Of an element, where a page has room for them."""

_POINTS = 240
"""Of all scenes of a page: with modes and frames some 250 kB."""

_FRAMES = 48
"""Of the motion of a run."""

_SAME_PLACE = 1e-9
"""m."""


@dataclass(frozen=True, eq=False)
class _Lines:
    """Points on members: of which element, and at which of its parts, shape (p,) each."""

    element: IntArray
    part: IntArray
    parts: int
    ranges: dict[str, tuple[int, int]]

    def of_nodes(self, ends: IntArray, nodal: FloatArray) -> FloatArray:
        """Return what nodes have, straight between them: shape (..., nodes, 3) to (..., p, 3)."""
        x = (self.part / self.parts)[:, None]
        first, second = ends[self.element].T
        return (1.0 - x) * nodal[..., first, :] + x * nodal[..., second, :]

    def of_beams(self, beams: Beams, nodal: FloatArray) -> FloatArray:
        """Return the deflection, from shape (..., nodes, 6) to (..., p, 3), global axes."""
        local = deflection(beams, nodal, self.parts)[..., self.element, self.part, :3]
        return np.einsum("pji,...pj->...pi", beams.triads[self.element], local)


def scene(about: Subject, share: int = 1) -> Scene | None:
    """Return the members of a result and how they move."""
    mesh = about.result.mesh
    ends = mesh.elements()
    if not len(ends):
        return None
    lines = _lines(mesh, _POINTS // share)
    points = lines.of_nodes(ends, mesh.nodes)
    shapes = (*_modes(about, lines), *_motion(about, lines))
    return Scene(points, lines.ranges, _names(mesh, points), shapes) if shapes else None


def _lines(mesh: Mesh, room: int) -> _Lines:
    """Return points along the members, as many as there is room for, ends and at least one between among them."""
    elements = len(mesh.elements())
    parts = min(max(room // elements, 1), _PARTS)
    every = -(-elements * parts // room)
    element: list[IntArray] = []
    ranges: dict[str, tuple[int, int]] = {}
    count = 0
    for name, part in mesh.element_ranges().items():
        last = (part.stop - part.start) * parts
        along = np.array(sorted({*range(0, last, every), last // 2, last}))
        element.append(part.start * parts + along)
        ranges[name] = (count, count + len(along))
        count += len(along)
    of = [
        np.minimum(one // parts, part.stop - 1)
        for one, part in zip(element, mesh.element_ranges().values(), strict=True)
    ]
    return _Lines(np.concatenate(of), np.concatenate(element) - parts * np.concatenate(of), parts, ranges)


def _names(mesh: Mesh, points: FloatArray) -> dict[str, int]:
    """Return the named places that lie on the lines; names of one place stand together."""
    found: dict[int, list[str]] = {}
    for name, nodes in mesh.points.items():
        if len(nodes) == 1:
            away = np.linalg.norm(points - mesh.nodes[nodes[0]], axis=1)
            if away.min() < _SAME_PLACE:
                found.setdefault(int(np.argmin(away)), []).append(name)
    return {", ".join(names): at for at, names in found.items()}


def _modes(about: Subject, lines: _Lines) -> list[Shape]:
    if about.known is None or about.modes is None:
        return []
    found, structure = about.modes, about.known.structure
    moved = lines.of_beams(structure.beams, structure.dofs.nodal_modes(found.modes.shapes.T, about.result.mesh.extent))
    return [
        Shape(f"mode {i + 1}, {frequency:.4g} Hz", found.words(i) + _unseen(structure, shares), moved[i : i + 1])
        for i, (frequency, shares) in enumerate(zip(found.modes.frequencies.tolist(), found.shares, strict=True))
    ]


def _unseen(structure: Structure, shares: Mapping[str, float]) -> str:
    """Return that what moves most in a mode is no member, and so not among the lines; empty where it is one."""
    most = max(shares, key=lambda part: shares[part], default="")
    return f". What moves most, {most}, is no member: the lines show only what moves with it" * (
        most in _beside(structure)
    )


def _beside(structure: Structure) -> set[str]:
    """Return the parts of modes that no line shows: rockers, springs, and masses off the members."""
    model = structure.model
    lines = set(model.mesh.elements().ravel().tolist())
    off = (
        name
        for name, part in model.masses.items()
        if model.rocker_at(part.at) is not None or model.mesh.node(part.at) not in lines
    )
    return {
        *(f"mass {name}" for name in off),
        *(f"rocker {name}" for name in model.rockers),
        *(f"spring {name}" for name in model.springs),
    }


def _motion(about: Subject, lines: _Lines) -> list[Shape]:
    """Return the motion of the run over its last revolution, or over what there is of it."""
    response = about.result.response
    if len(response.field_time) < 2:
        return []
    last = response.field_angle > response.field_angle[-1] - 2.0 * np.pi * (1.0 + 1e-9)
    at = np.flatnonzero(last)[:: -(-int(last.sum()) // _FRAMES)]
    nodal = response.fields.displacement[at].reshape(len(at), -1, 6)
    beams = None if about.known is None else about.known.structure.beams
    ends = about.result.mesh.elements()
    moved = lines.of_nodes(ends, nodal[..., :3]) if beams is None else lines.of_beams(beams, nodal)
    degrees = np.degrees(response.field_angle[at[[0, -1]]])
    words = f"The computed motion from {degrees[0]:.4g} to {degrees[1]:.4g} deg of cam angle"
    return [Shape("the run", words, moved)]
