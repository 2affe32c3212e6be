"""VTK files: geometry and growing fields of a model in VTKHDF, and VTK XML files.

A member is a polyline with separate points, any other movable node a vertex. A joint has one point per member and can
therefore have the section forces of each.
"""

from __future__ import annotations

import base64
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexcam.core import FloatArray, IntArray
from flexcam.fem.assembly import Damping
from flexcam.fem.dofs import DofMap
from flexcam.fem.elements.beam import Beams
from flexcam.fem.mesh import Mesh
from flexcam.fem.recovery import Fibres, fibres, section_forces
from flexcam.fem.sections import Section
from flexcam.io import result_schema as schema
from flexcam.io.files import atomic_write_path
from flexcam.io.hdf5 import GrowingDataset, create_fixed_dataset, encode

_TYPES = {"float64": "Float64", "int64": "Int64"}

Data = Mapping[str, FloatArray | IntArray]


def write_polylines(
    path: Path, points: FloatArray, lengths: Sequence[int], *, point_data: Data, cell_data: Data,
    field_data: Data | None = None,
) -> None:  # fmt: skip
    """Write polylines with consecutive points; points after the last polyline become vertices."""
    count = sum(lengths)
    vertices, ends = np.arange(count, len(points)), np.cumsum([0, *lengths])[1:]
    cells = {"Verts": (vertices, np.arange(len(vertices)) + 1), "Lines": (np.arange(count), ends)}
    write_polydata(path, points, cells, point_data=point_data, cell_data=cell_data, field_data=field_data)


def write_polydata(
    path: Path, points: FloatArray, cells: Mapping[str, tuple[IntArray, IntArray]], *, point_data: Data,
    cell_data: Data | None = None, field_data: Data | None = None,
) -> None:  # fmt: skip
    """Write points and cells (indices of their points, and their ends) of the kinds ``Verts``, ``Lines``, ``Polys``."""
    counts = " ".join(f'NumberOf{kind}="{len(ends)}"' for kind, (_, ends) in cells.items())
    lines = [
        "<FieldData>", *(_array(name, v, whole=True) for name, v in (field_data or {}).items()), "</FieldData>",
        f'<Piece NumberOfPoints="{len(points)}" {counts}>',
        "<PointData>", *(_array(name, values) for name, values in point_data.items()), "</PointData>",
        "<CellData>", *(_array(name, values) for name, values in (cell_data or {}).items()), "</CellData>",
        "<Points>", _array("Points", points), "</Points>",
    ]  # fmt: skip
    for kind, (connectivity, ends) in cells.items():
        lines += [f"<{kind}>", _array("connectivity", connectivity), _array("offsets", ends), f"</{kind}>"]
    write_vtk(path, "PolyData", [*lines, "</Piece>"])


def write_vtk(path: Path, kind: str, lines: Iterable[str]) -> None:
    """Write a VTK XML file of a kind, such as ``Collection``, from the lines of its element."""
    head = f'<VTKFile type="{kind}" version="1.0" byte_order="LittleEndian" header_type="UInt64">'
    text = ['<?xml version="1.0"?>', head, f"<{kind}>", *lines, f"</{kind}>", "</VTKFile>", ""]
    with atomic_write_path(path) as draft:
        draft.write_text("\n".join(text), encoding="utf-8")


def _array(name: str, values: FloatArray | IntArray, *, whole: bool = False) -> str:
    data = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("<"))
    width = data.shape[1] if data.ndim == 2 else 1
    raw = np.array([data.nbytes], dtype="<u8").tobytes() + data.tobytes()
    count = f'NumberOfTuples="{len(data)}"' if whole else f'NumberOfComponents="{width}"'
    head = f'<DataArray type="{_TYPES[values.dtype.name]}" Name="{name}" {count} format="binary">'
    return f"{head}{base64.b64encode(raw).decode('ascii')}</DataArray>"


@dataclass(frozen=True, eq=False)
class Geometry:
    """Points and polylines of a model, and the data to compute point fields."""

    mesh: Mesh  #: the mesh
    dofs: DofMap  #: numbering and elements, to expand and recover fields
    beams: Beams
    sections: Mapping[str, Sequence[Section]]  #: sections at the nodes of every member
    spread: FloatArray  #: distributed loads of the elements, shape (e, 12), local axes, N and N m
    damping: Damping  #: structural damping; the section forces include its Rayleigh part

    @cached_property
    def node(self) -> IntArray:
        """Mesh node of every point, shape (points,): member by member, then `single`."""
        return np.concatenate([*self.mesh.lines.values(), self.free_nodes])

    @cached_property
    def free_nodes(self) -> IntArray:
        """Movable nodes without a member, shape (k,)."""
        return np.flatnonzero(self.dofs.moving.any(axis=1) & ~self.mesh.on_members())

    @cached_property
    def ends(self) -> IntArray:
        """First point of every member, then the total number of member points, shape (members + 1,)."""
        return np.cumsum([0, *(len(line) for line in self.mesh.lines.values())])

    def cells(self) -> IntArray:
        """Return the member index of every cell, shape (cells,); vertices come first with -1."""
        return np.concatenate([np.full(len(self.free_nodes), -1), np.arange(len(self.mesh.lines))])

    @cached_property
    def fibres(self) -> Fibres:
        """Return the extreme fibres of all elements."""
        return fibres([self.sections[name] for name in self.mesh.lines])

    def recover_fields(
        self, nodal: FloatArray, velocity: FloatArray, acceleration: FloatArray
    ) -> dict[str, FloatArray]:
        """Return section forces and stresses at the points."""
        forces = section_forces(
            self.beams, nodal, velocity=velocity, acceleration=acceleration, damping=self.damping, spread=self.spread
        )
        fibre = self.fibres
        stresses = fibre.axial(forces), fibre.bending(forces), fibre.shear(forces), fibre.von_mises(forces)
        forces[:, self.bends, 1] = 0.0  # vectors have the axes of the element that begins at their point
        values = map(self._point_values, (forces[..., :3], forces[..., 3:], *stresses))
        return dict(zip(schema.RECOVERED_FIELDS, values, strict=True))

    @cached_property
    def bends(self) -> NDArray[np.bool_]:
        """Elements whose end has other axes than the next element of their member, shape (e,)."""
        mask = np.zeros(len(self.beams), dtype=bool)
        for part in self.mesh.element_ranges().values():
            mask[part][:-1] = np.abs(np.diff(self.beams.triads[part], axis=0)).max(axis=(1, 2)) > _SAME_AXES
        return mask

    def _point_values(self, values: FloatArray) -> FloatArray:
        """Return the larger of the adjacent element end values at every point, from shape (times, e, 2, ...)."""
        out = np.zeros((len(values), len(self.node), *values.shape[3:]))
        for first, part in zip(self.ends[:-1].tolist(), self.mesh.element_ranges().values(), strict=True):
            count = part.stop - part.start
            for end in (0, 1):
                points = slice(first + end, first + end + count)
                end_values = values[:, part, end]
                out[:, points] = np.where(np.abs(end_values) > np.abs(out[:, points]), end_values, out[:, points])
        return out


_SAME_AXES = 1e-9
"""Difference of unit vectors that is rounding."""

ConstantData = Mapping[str, tuple[FloatArray | IntArray, str]]
"""Constant point data: name to values and unit."""


def constant_data(geometry: Geometry) -> ConstantData:
    """Return the constant point data: display radius, mesh node, local axes of the element that starts at a point.

    A vertex has the radius zero and the global axes.
    """
    mesh, single = geometry.mesh, len(geometry.free_nodes)
    radii = [[section.radius for section in geometry.sections[name]] for name in mesh.lines]
    member_triads = [
        geometry.beams.triads[part][np.minimum(np.arange(len(line)), len(line) - 2)]
        for line, part in zip(mesh.lines.values(), mesh.element_ranges().values(), strict=True)
    ]
    triads = np.concatenate([*member_triads, np.tile(np.eye(3), (single, 1, 1))])
    axes = {name: (axis, "") for name, axis in zip(schema.AXES, triads.swapaxes(0, 1), strict=True)}
    radius = np.concatenate([*radii, np.zeros(single)])
    return {schema.RADIUS: (radius, "m"), schema.NODE: (geometry.node, ""), **axes}


class VtkGroup:
    """VTKHDF group of a file, extended step by step.

    Time-dependent point data have a unit and a width by name, constant ones values and a unit; `rows` is the number of
    steps per append.
    """

    def __init__(
        self, file: Any, geometry: Geometry, moving: Mapping[str, tuple[str, int]], still: ConstantData, rows: int,  # noqa: ANN401
    ) -> None:  # fmt: skip
        self._points, self._steps = len(geometry.node), 0
        vtk = file.create_group(schema.VTK)
        vtk.attrs[schema.VTK_VERSION] = (2, 0)
        vtk.attrs.create(schema.VTK_TYPE, schema.VTK_TYPE_NAME, dtype="S8")
        _write_lines(file, geometry)
        data = file.create_group(schema.POINT_DATA)
        for name, (values, unit) in still.items():
            create_fixed_dataset(data, name, values, unit)
        self._data = {
            name: GrowingDataset(data, name, rows * max(self._points, 1), unit, width=width if width > 1 else 0)
            for name, (unit, width) in moving.items()
        }
        self._group: Any = file.create_group(schema.FIELD_STEPS)
        self._group.attrs[schema.VTK_STEPS] = 0
        of_still = [f"{schema.POINT_DATA_OFFSETS}/{name}" for name in still]
        self._zeros = (
            self._shared([schema.PART_OFFSETS, schema.POINT_OFFSETS, schema.MEMBER_OFFSETS, *of_still], rows),
            self._shared([schema.CELL_OFFSETS, schema.CONNECTIVITY_OFFSETS], rows, len(schema.TOPOLOGIES)),
        )
        self._parts = self._shared([schema.PART_COUNT], rows)
        self._offsets = self._shared([f"{schema.POINT_DATA_OFFSETS}/{name}" for name in self._data], rows)
        self._times = GrowingDataset(file, schema.FIELD_TIME, rows, "s")

    def _shared(self, names: Sequence[str], rows: int, width: int = 0) -> GrowingDataset:
        """Return a new dataset of integers that has several names."""
        dataset = GrowingDataset(self._group, names[0], rows, "", width=width, kind="i8")
        for name in names[1:]:
            self._group[name] = dataset.dataset
        return dataset

    def append(self, values: Mapping[str, FloatArray], count: int) -> None:
        """Append the point data of steps, shape (count, points) or (count, points, width), without counting them."""
        for name, rows in values.items():
            self._data[name].append(rows.reshape(-1, *rows.shape[2:]))
        for zeros in self._zeros:
            zeros.append_empty(count)
        self._parts.append(np.ones(count, int))
        self._offsets.append((self._steps + np.arange(count)) * self._points)

    def count(self, times: FloatArray) -> None:
        """Count steps and write their times, s; VTK expects data for every time, so times are written last."""
        self._steps += len(times)
        self._group.attrs.modify(schema.VTK_STEPS, self._steps)
        self._times.append(times)


def _write_lines(file: Any, geometry: Geometry) -> None:  # noqa: ANN401 - h5py has no types
    mesh, points, ends = geometry.mesh, len(geometry.node), geometry.ends
    create_fixed_dataset(file, schema.POINT_COUNT, np.array([points]))
    create_fixed_dataset(file, schema.POINTS, mesh.nodes[geometry.node], "m")
    single, empty = len(geometry.free_nodes), np.zeros(0, int)
    vertices = (np.arange(points - single, points), np.arange(single + 1))
    lines, no_cells = (np.arange(points - single), ends), (empty, np.zeros(1, int))
    for topology, (connectivity, offsets) in zip(schema.TOPOLOGIES, (vertices, lines, no_cells, no_cells), strict=True):
        group = file.create_group(f"{schema.VTK}/{topology}")
        create_fixed_dataset(group, schema.CELL_COUNT, np.array([len(offsets) - 1]))
        create_fixed_dataset(group, schema.CONNECTIVITY_COUNT, np.array([len(connectivity)]))
        create_fixed_dataset(group, schema.CONNECTIVITY, connectivity)
        create_fixed_dataset(group, schema.OFFSETS, offsets)
    member = create_fixed_dataset(file, schema.MEMBER, geometry.cells())
    member.attrs[schema.MEMBER_NAMES] = encode(list(mesh.lines))
