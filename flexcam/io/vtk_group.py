"""The group ``/VTKHDF`` as Kitware's file format lays it out: PolyData, version 2.0, the mesh stored once.

Point data that change have their offset per step; those that stay have offset zero at every step. Offsets that are the
same numbers are one dataset with several names (hard links of HDF5).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from flexcam.io.geometry import Geometry
from flexcam.io.growing import Growing, fixed
from flexcam.io.texts import note
from flexcam.linalg import FloatArray, IntArray

Still = Mapping[str, tuple[FloatArray | IntArray, str]]
"""Point data that do not change: name to values and unit."""


def still_data(geometry: Geometry) -> Still:
    """Return what is known of every point: radius, mesh node, local axes."""
    axes = {f"axis_{name}": (axis, "") for name, axis in zip("xyz", geometry.axes().swapaxes(0, 1), strict=True)}
    return {"radius": (geometry.radius(), "m"), "node": (geometry.node, ""), **axes}


class VtkGroup:
    """The group of a file that grows step by step.

    Parameters
    ----------
    file
        An open h5py file.
    geometry
        What is drawn.
    moving
        Point data that change: name to unit and width.
    still
        Point data that do not.
    rows
        Steps appended together, for the chunks.
    """

    def __init__(
        self,
        file: Any,  # noqa: ANN401 - h5py has no types
        geometry: Geometry,
        moving: Mapping[str, tuple[str, int]],
        still: Still,
        rows: int,
    ) -> None:
        self._points, self._steps = len(geometry.node), 0
        self._group: Any = file.create_group("VTKHDF")
        self._group.attrs["Version"] = (2, 0)
        self._group.attrs.create("Type", b"PolyData", dtype="S8")
        _write_lines(self._group, geometry)
        data = self._group.create_group("PointData")
        for name, (values, unit) in still.items():
            fixed(data, name, values, unit)
        self._data = {
            name: Growing(data, name, rows * self._points, unit, width=width if width > 1 else 0)
            for name, (unit, width) in moving.items()
        }
        self._create_steps(rows, still)

    def _create_steps(self, rows: int, still: Still) -> None:
        steps = self._group.create_group("Steps")
        steps.attrs["NSteps"] = 0

        def shared(names: Sequence[str], width: int = 0) -> Growing:
            made = Growing(steps, names[0], rows, "", width=width, kind="i8")
            for name in names[1:]:
                steps[name] = made.dataset
            return made

        of_still = [f"PointDataOffsets/{name}" for name in still]
        self._zeros = (
            shared(["PartOffsets", "PointOffsets", "CellDataOffsets/member", *of_still]),
            shared(["CellOffsets", "ConnectivityIdOffsets"], width=4),  # one column for each of VTK's kinds of cells
        )
        self._parts = shared(["NumberOfParts"])
        self._offsets = shared([f"PointDataOffsets/{name}" for name in self._data])
        self._times = Growing(steps, "Values", rows, "s")

    def append(self, values: Mapping[str, FloatArray], count: int) -> None:
        """Append the point data of some steps, shape (count, points) or (count, points, width); not yet counted."""
        for name, rows in values.items():
            self._data[name].extend(rows.reshape(-1, *rows.shape[2:]))
        for zeros in self._zeros:
            zeros.append_zeros(count)
        self._parts.extend(np.ones(count, int))
        self._offsets.extend((self._steps + np.arange(count)) * self._points)

    @property
    def grown(self) -> list[Growing]:
        """Datasets that grow."""
        return [*self._data.values(), *self._zeros, self._parts, self._offsets, self._times]

    def count(self, more: int) -> None:
        """Count appended steps; to be flushed before `stamp`, because VTK trusts the times to have their data."""
        self._steps += more
        self._group["Steps"].attrs.modify("NSteps", self._steps)

    def stamp(self, times: FloatArray) -> None:
        """Write the times of counted steps, s."""
        self._times.extend(times)


def _write_lines(vtk: Any, geometry: Geometry) -> None:  # noqa: ANN401 - h5py has no types
    mesh, points, ends = geometry.mesh, len(geometry.node), geometry.ends
    fixed(vtk, "NumberOfPoints", np.array([points]))
    fixed(vtk, "Points", mesh.nodes[geometry.node], "m")
    single, nothing = len(geometry.single), np.zeros(0, int)
    cells = {
        "Vertices": (np.arange(points - single, points), np.arange(single + 1)),
        "Lines": (np.arange(points - single), ends),
        "Polygons": (nothing, np.zeros(1, int)),
        "Strips": (nothing, np.zeros(1, int)),
    }
    for topology, (connectivity, offsets) in cells.items():
        group = vtk.create_group(topology)
        fixed(group, "NumberOfCells", np.array([len(offsets) - 1]))
        fixed(group, "NumberOfConnectivityIds", np.array([len(connectivity)]))
        fixed(group, "Connectivity", connectivity)
        fixed(group, "Offsets", offsets)
    member = fixed(vtk.create_group("CellData"), "member", geometry.cells())
    note(member, "names", list(mesh.lines))
