"""VTK geometry of a model: a polyline with separate points per member and a vertex per other movable node.

A joint has one point per member and can therefore carry the section forces of each.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from flexcam.core import FloatArray, IntArray
from flexcam.fem.assembly import Damping
from flexcam.fem.dofs import DofMap
from flexcam.fem.elements.beam import Beams
from flexcam.fem.mesh import Mesh
from flexcam.fem.recovery import Fibres, fibres, section_forces
from flexcam.fem.sections import Section
from flexcam.io.result_datasets import GrowingDataset, create_fixed_dataset
from flexcam.io.text_files import write_string_attribute

RECOVERED_FIELDS = {
    "section_force": ("N", 3),
    "section_moment": ("N m", 3),
    "stress_axial": ("Pa", 1),
    "stress_bending": ("Pa", 1),
    "stress_torsion": ("Pa", 1),
    "stress_von_mises": ("Pa", 1),
}
"""Point data computed from displacements: unit and width. Forces are N, Vy, Vz and T, My, Mz in local axes."""


@dataclass(frozen=True, eq=False)
class Geometry:
    """Points and polylines of a model, and the data to compute point fields.

    Parameters
    ----------
    mesh
        The mesh.
    dofs, beams
        Numbering and elements, to expand and recover fields.
    sections
        Section by member name.
    spread
        Distributed loads of the elements, shape (e, 12), local axes, N and N m.
    damping
        Structural damping; the section forces include its Rayleigh part.
    """

    mesh: Mesh
    dofs: DofMap
    beams: Beams
    sections: Mapping[str, Section]
    spread: FloatArray
    damping: Damping

    @cached_property
    def node(self) -> IntArray:
        """Mesh node of every point, shape (points,): member by member, then `single`."""
        return np.concatenate([*self.mesh.lines.values(), self.free_nodes])

    @cached_property
    def free_nodes(self) -> IntArray:
        """Movable nodes without a member, shape (k,)."""
        return np.flatnonzero((self.dofs.numbers >= 0).any(axis=1) & ~self.mesh.on_members())

    @cached_property
    def ends(self) -> IntArray:
        """First point of every member, then the total number of member points, shape (members + 1,)."""
        return np.cumsum([0, *(len(line) for line in self.mesh.lines.values())])

    def cells(self) -> IntArray:
        """Return the member index of every cell, shape (cells,); vertices come first with -1."""
        return np.concatenate([np.full(len(self.free_nodes), -1), np.arange(len(self.mesh.lines))])

    def radius(self) -> FloatArray:
        """Return the display radius at every point, m, shape (points,); zero at a vertex."""
        radii = [np.full(len(line), self.sections[name].radius) for name, line in self.mesh.lines.items()]
        return np.concatenate([*radii, np.zeros(len(self.free_nodes))])

    def axes(self) -> FloatArray:
        """Return the local axes at every point, shape (points, 3, 3).

        These are the axes of the element that starts there; at a vertex, the global axes.
        """
        along = [
            self.beams.triads[part][np.minimum(np.arange(len(line)), len(line) - 2)]
            for line, part in zip(self.mesh.lines.values(), self.mesh.element_ranges().values(), strict=True)
        ]
        return np.concatenate([*along, np.tile(np.eye(3), (len(self.free_nodes), 1, 1))])

    @cached_property
    def fibres(self) -> Fibres:
        """Return the extreme fibres of all elements."""
        counts = [len(line) - 1 for line in self.mesh.lines.values()]
        return fibres([s for name, n in zip(self.mesh.lines, counts, strict=True) for s in [self.sections[name]] * n])

    def recover_fields(
        self, nodal: FloatArray, velocity: FloatArray, acceleration: FloatArray
    ) -> dict[str, FloatArray]:
        """Return section forces and stresses at the points."""
        forces = section_forces(
            self.beams, nodal, velocity=velocity, acceleration=acceleration, damping=self.damping, spread=self.spread
        )
        fibre = self.fibres
        return {
            "section_force": self._point_values(forces[..., :3]),
            "section_moment": self._point_values(forces[..., 3:]),
            "stress_axial": self._point_values(fibre.axial(forces)),
            "stress_bending": self._point_values(fibre.bending(forces)),
            "stress_torsion": self._point_values(fibre.shear(forces)),
            "stress_von_mises": self._point_values(fibre.von_mises(forces)),
        }

    def _point_values(self, values: FloatArray) -> FloatArray:
        """Return the larger of the adjacent element end values at every point, from shape (times, e, 2, ...)."""
        out = np.zeros((len(values), len(self.node), *values.shape[3:]))
        for first, part in zip(self.ends[:-1].tolist(), self.mesh.element_ranges().values(), strict=True):
            count = part.stop - part.start
            for end in (0, 1):
                points = slice(first + end, first + end + count)
                there = values[:, part, end]
                out[:, points] = np.where(np.abs(there) > np.abs(out[:, points]), there, out[:, points])
        return out


ConstantData = Mapping[str, tuple[FloatArray | IntArray, str]]
"""Constant point data: name to values and unit."""


def constant_data(geometry: Geometry) -> ConstantData:
    """Return the constant point data: radius, mesh node, local axes."""
    axes = {f"axis_{name}": (axis, "") for name, axis in zip("xyz", geometry.axes().swapaxes(0, 1), strict=True)}
    return {"radius": (geometry.radius(), "m"), "node": (geometry.node, ""), **axes}


class VtkGroup:
    """VTKHDF group of a file, extended step by step.

    Parameters
    ----------
    file
        Open h5py file.
    geometry
        Geometry of the model.
    moving
        Time-dependent point data: name to unit and width.
    still
        Constant point data.
    rows
        Steps per append, which sets the chunk size.
    """

    def __init__(
        self,
        file: Any,  # noqa: ANN401 - h5py has no types
        geometry: Geometry,
        moving: Mapping[str, tuple[str, int]],
        still: ConstantData,
        rows: int,
    ) -> None:
        self._points, self._steps = len(geometry.node), 0
        self._group: Any = file.create_group("VTKHDF")
        self._group.attrs["Version"] = (2, 0)
        self._group.attrs.create("Type", b"PolyData", dtype="S8")
        _write_lines(self._group, geometry)
        data = self._group.create_group("PointData")
        for name, (values, unit) in still.items():
            create_fixed_dataset(data, name, values, unit)
        self._data = {
            name: GrowingDataset(data, name, rows * self._points, unit, width=width if width > 1 else 0)
            for name, (unit, width) in moving.items()
        }
        self._create_steps(rows, still)

    def _create_steps(self, rows: int, still: ConstantData) -> None:
        steps = self._group.create_group("Steps")
        steps.attrs["NSteps"] = 0

        def shared(names: Sequence[str], width: int = 0) -> GrowingDataset:
            made = GrowingDataset(steps, names[0], rows, "", width=width, kind="i8")
            for name in names[1:]:
                steps[name] = made.dataset
            return made

        of_still = [f"PointDataOffsets/{name}" for name in still]
        self._zeros = (
            shared(["PartOffsets", "PointOffsets", "CellDataOffsets/member", *of_still]),
            shared(["CellOffsets", "ConnectivityIdOffsets"], width=4),  # one column per VTK cell type
        )
        self._parts = shared(["NumberOfParts"])
        self._offsets = shared([f"PointDataOffsets/{name}" for name in self._data])
        self._times = GrowingDataset(steps, "Values", rows, "s")

    def append(self, values: Mapping[str, FloatArray], count: int) -> None:
        """Append the point data of steps, shape (count, points) or (count, points, width), without counting them."""
        for name, rows in values.items():
            self._data[name].append(rows.reshape(-1, *rows.shape[2:]))
        for zeros in self._zeros:
            zeros.append_zeros(count)
        self._parts.append(np.ones(count, int))
        self._offsets.append((self._steps + np.arange(count)) * self._points)

    @property
    def growing_datasets(self) -> list[GrowingDataset]:
        """Growing datasets of the group."""
        return [*self._data.values(), *self._zeros, self._parts, self._offsets, self._times]

    def count(self, more: int) -> None:
        """Increase the number of steps; flush before `stamp`, because VTK expects data for every time."""
        self._steps += more
        self._group["Steps"].attrs.modify("NSteps", self._steps)

    def write_times(self, times: FloatArray) -> None:
        """Write the times of the counted steps, s."""
        self._times.append(times)


def _write_lines(vtk: Any, geometry: Geometry) -> None:  # noqa: ANN401 - h5py has no types
    mesh, points, ends = geometry.mesh, len(geometry.node), geometry.ends
    create_fixed_dataset(vtk, "NumberOfPoints", np.array([points]))
    create_fixed_dataset(vtk, "Points", mesh.nodes[geometry.node], "m")
    single, nothing = len(geometry.free_nodes), np.zeros(0, int)
    cells = {
        "Vertices": (np.arange(points - single, points), np.arange(single + 1)),
        "Lines": (np.arange(points - single), ends),
        "Polygons": (nothing, np.zeros(1, int)),
        "Strips": (nothing, np.zeros(1, int)),
    }
    for topology, (connectivity, offsets) in cells.items():
        group = vtk.create_group(topology)
        create_fixed_dataset(group, "NumberOfCells", np.array([len(offsets) - 1]))
        create_fixed_dataset(group, "NumberOfConnectivityIds", np.array([len(connectivity)]))
        create_fixed_dataset(group, "Connectivity", connectivity)
        create_fixed_dataset(group, "Offsets", offsets)
    member = create_fixed_dataset(vtk.create_group("CellData"), "member", geometry.cells())
    write_string_attribute(member, "names", list(mesh.lines))
