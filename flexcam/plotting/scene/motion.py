"""Motion of a structure for animation, its state at one instant, and the deformed centre lines of its members."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from flexcam.case.case import Case
from flexcam.core import FloatArray, IntArray
from flexcam.core.errors import InputError, refuse, suggest_name
from flexcam.core.units import to_display_unit
from flexcam.dynamics import SERIES, CamMotion, Response
from flexcam.fem.elements.beam import Beams
from flexcam.fem.recovery import deflection
from flexcam.io import Result
from flexcam.io.result_reader import unknown_fields
from flexcam.io.result_schema import FIELDS
from flexcam.valvetrain import Model, Structure
from flexcam.valvetrain import rigid_motion as find_rigid_motion


def model_size(model: Model) -> float:
    """Return the diagonal of the bounding box of all nodes, m."""
    return model.mesh.extent or 0.1


@dataclass(frozen=True, eq=False)
class SceneState:
    """State of a scene at one instant."""

    structure: Structure  # structure of the model
    angle: float  # cam angle, rad
    unknowns: FloatArray  # displacements of the degrees of freedom of the structure as drawn, m and rad, shape (n,)
    # colour values of members at the points of their polylines, member by member, shape (points,); None for no colours
    values: FloatArray | None = None

    @cached_property
    def nodal(self) -> FloatArray:
        """Displacements of all nodes, m and rad, shape (nodes, 6)."""
        return self.structure.dofs.nodal(self.unknowns)

    def at(self, point: str, away: FloatArray) -> FloatArray:
        """Return the displacement of a named point, m, shape (3,); the point of a rocker moves along `away`."""
        if self.structure.is_node(point):
            return self.nodal[self.structure.model.mesh.node(point), :3]
        return float(self.structure.row(point, np.zeros(6)) @ self.unknowns) * away


@dataclass(frozen=True, eq=False)
class CentreLine:
    """Stations along a member."""

    points: FloatArray  # positions, m, global axes, shape (m, 3)
    triads: FloatArray  # axes of the section as rows, x along the member, shape (m, 3, 3)
    # position in elements from the first node of the member, shape (m,): 1.5 is the middle of the second element
    part: FloatArray


def centre_line(beams: Beams, elements: slice, nodes: FloatArray, nodal: FloatArray, parts: int = 8) -> CentreLine:
    """Return the deformed centre line of a chain of elements, with `parts` segments per element."""
    ends = beams.nodes[elements]
    bent = deflection(beams, nodal, parts, elements)
    translations, rotations = np.hsplit(np.concatenate([bent[:, :-1].reshape(-1, 6), bent[-1, -1:]]), 2)
    part = np.arange(len(ends) * parts + 1) / parts
    element = np.minimum(part.astype(np.intp), len(ends) - 1)
    along, triads = (part - element)[:, None], beams.triads[elements][element]
    straight = (1.0 - along) * nodes[ends[element, 0]] + along * nodes[ends[element, 1]]
    points = straight + np.einsum("ni,nij->nj", translations, triads)
    axes = triads @ rotation_matrices(np.einsum("ni,nij->nj", rotations, triads))
    return CentreLine(points, axes, part)


def rotation_matrices(vectors: FloatArray) -> FloatArray:
    """Return rotation matrices of rotation vectors: the rows are the rotated axes."""
    return np.asarray(Rotation.from_rotvec(vectors).as_matrix().swapaxes(1, 2), dtype=float)


def sweep_outline(outline: FloatArray, line: CentreLine) -> FloatArray:
    """Return the rings of an outline swept along a centre line."""
    return line.points[:, None] + outline @ line.triads[:, 1:]


@dataclass(frozen=True, eq=False)
class Motion:
    """Motion of a structure."""

    structure: Structure
    angle: FloatArray  # cam angles, rad, shape (f,)
    rigid: FloatArray  # displacements of the degrees of freedom by the rigid mechanism, m and rad, shape (f, n)
    elastic: FloatArray  # additional elastic displacements, shape (f, n): only these are exaggerated
    # colour values at the points of the members' polylines, shape (f, points); None for no colours
    values: FloatArray | None = None
    label: str = ""  # name of the colour values with unit

    def __len__(self) -> int:
        return len(self.angle)

    def instant(self, i: int, scale: float = 1.0) -> SceneState:
        """Return instant i with its elastic part multiplied by `scale`."""
        values = None if self.values is None else self.values[i]
        return SceneState(self.structure, float(self.angle[i]), self.rigid[i] + scale * self.elastic[i], values)

    def at(self, instants: Sequence[int] | IntArray) -> Motion:
        """Return selected instants."""
        values = None if self.values is None else self.values[instants]
        return replace(
            self, angle=self.angle[instants], rigid=self.rigid[instants], elastic=self.elastic[instants], values=values
        )

    def last_revolution(self) -> Motion:
        """Return the last revolution, or the whole of a shorter motion."""
        return self.at(np.flatnonzero(self.angle > self.angle[-1] - math.tau * (1.0 - 1e-9)))

    def spread(self, count: int) -> list[int]:
        """Return the indices of up to `count` instants, evenly distributed over the motion."""
        return sorted({i * len(self) // count for i in range(count)} if count < len(self) else range(len(self)))

    def words(self, i: int, title: str, scale: float) -> str:
        """Return the title, the cam angle of an instant within its revolution, and the scale of the elastic part."""
        angle = ""
        if np.ptp(self.angle) > 0.0:
            turns = math.floor(float(self.angle[0]) / math.tau + 1e-9)
            angle = f"cam angle {math.degrees(float(self.angle[i])) - 360.0 * turns:.1f} deg"
            angle += " of the last revolution" if turns else ""
        return "\n".join(filter(None, [title, angle, f"elastic part x {scale:g}" if scale != 1.0 else ""]))

    def nearest(self, angle: float) -> int:
        """Return the index of the instant nearest to a cam angle (rad, modulo a revolution), the last of equal ones."""
        away = np.abs(np.angle(np.exp(1j * (self.angle - angle))))
        return len(away) - 1 - int(np.argmin(away[::-1].round(9)))


def full_lift(case: Case, response: Response, angle: FloatArray) -> int:
    """Return the index of the instant at which the valve is farthest from its installed position."""
    at = np.minimum(np.searchsorted(response.angle, angle - 1e-9), len(response.angle) - 1)
    points = {rocker.to for rocker in case.record.rockers.values()}
    names = [name for name, _ in response.outline.probes]
    for candidates in ([name for name in names if name in points], [name for name in names if "." not in name]):
        paths = [
            np.abs(path[at])
            for name, series, unit, path in (response.motions(candidates) if candidates else ())
            if series == "displacement" and (unit == "m" or name in candidates)  # no rotation beside others
        ]
        farthest = max(paths, key=lambda path: float(np.ptp(path)), default=np.zeros(1))
        if np.ptp(farthest) > 0.0:
            return int(np.argmax(farthest))
    return len(angle) - 1


def result_motion(structure: Structure, result: Result, speed: float, colour: str | None = None) -> Motion:
    """Return the motion of a result at its saved fields."""
    response = result.response
    if not len(response.field_time):
        raise refuse("result", "no saved field", "at least one", "", "run the case again")
    rigid = rigid_motion(structure, response.field_angle, speed)[0]
    free = structure.dofs.numbers >= 0
    count = int(free.sum())
    fields = unknown_fields(response, free, structure.dofs.names[count:], rigid[:, count:])
    motion = Motion(structure, response.field_angle, rigid, fields.displacement - rigid)
    if colour is None:
        return motion
    if colour not in FIELDS:
        raise refuse("field", repr(colour), ", ".join(FIELDS), remedy=suggest_name(colour, FIELDS))
    if colour in result.recovered:
        values = result.recovered[colour]
    else:
        values = result.field(colour)[:, result.constant["node"].astype(np.intp)]
    return _coloured(motion, values, colour)


def case_motion(structure: Structure, speed: float, colour: str | None = None, count: int = 180) -> Motion:
    """Return the motion of the rigid mechanism over one revolution."""
    angle = np.linspace(0.0, math.tau, count, endpoint=False)
    series = dict(zip(SERIES, rigid_motion(structure, angle, speed), strict=True))
    rigid = series["displacement"]
    motion = Motion(structure, angle, rigid, np.zeros_like(rigid))
    if colour is None:
        return motion
    if colour not in series:
        why, remedy = "a case is shown as a rigid mechanism", "solve it with flexcam run and view the result"
        raise refuse("field", repr(colour), ", ".join(series), why, remedy)
    return _coloured(motion, _member_translations(structure, series[colour]), colour)


def mode_motion(structure: Structure, shape: FloatArray, *, coloured: bool = False, count: int = 24) -> Motion:
    """Return one period of a mode about the installed mechanism; it moves by up to 5 % of the model size."""
    moved = np.linalg.norm(structure.dofs.nodal(shape)[:, :3], axis=1).max(initial=0.0)
    others = np.abs(shape[int((structure.dofs.numbers >= 0).sum()) :]).max(initial=0.0)
    largest = float(max(moved, others)) or 1.0
    swing = np.cos(math.tau * np.arange(count) / count)[:, None]
    elastic = 0.05 * model_size(structure.model) / largest * swing * shape
    motion = Motion(structure, np.zeros(count), np.zeros_like(elastic), elastic)
    if not coloured:
        return motion
    values = np.abs(swing) * np.linalg.norm(_member_translations(structure, shape[None] / largest), axis=-1)
    return replace(motion, values=values, label="displacement\n(max = 1)")


def rigid_motion(structure: Structure, angle: FloatArray, speed: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return displacement, velocity and acceleration of the rigid mechanism at constant speed; zeros without one."""
    motion = CamMotion(angle, np.full_like(angle, speed), np.zeros_like(angle), angle / speed)
    try:
        return find_rigid_motion(structure.model).at(motion)
    except InputError:  # such as a follower on a leaf spring
        zeros = np.zeros((len(angle), structure.dofs.size))
        return zeros, zeros, zeros


def _member_translations(structure: Structure, unknowns: FloatArray) -> FloatArray:
    """Return translations at the points of the members' polylines, shape (f, points, 3)."""
    points = np.concatenate([np.zeros(0, np.intp), *structure.model.mesh.lines.values()])
    return structure.dofs.nodal(unknowns)[:, points, :3]


def _coloured(motion: Motion, values: FloatArray, colour: str) -> Motion:
    """Return the motion with the values of a field, or the lengths of its vectors, in display units."""
    factor, unit = to_display_unit(FIELDS[colour][0])
    sizes = values if values.ndim == 2 else np.linalg.norm(values, axis=-1)
    return replace(motion, values=factor * sizes, label=f"{colour.replace('_', ' ')}\n{unit}")
