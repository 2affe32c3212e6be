"""Result files: one HDF5 file that is flexcam's archive and opens in ParaView.

The group ``/VTKHDF`` follows Kitware's file format (PolyData, version 2.0, one polyline per member, the mesh stored
once); VTK ignores the groups beside it, which hold histories, case, status and provenance. Blocks are appended in the
order data, counts (``NSteps`` and the rows of the histories), ``Values``, each flushed: VTK's reader trusts ``Values``
to have its data, and flexcam's reads no row that is not counted.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py  # pyright: ignore[reportMissingTypeStubs]
import numpy as np

from flexcam.checks import refuse
from flexcam.io.geometry import RECOVERED, Geometry
from flexcam.io.growing import extend, fixed, growing, ordered, texts
from flexcam.io.target import free_to_write
from flexcam.response import Block, Outline, SaveAt, Stats, Status

FORMAT = 1
"""Version of flexcam's own groups; a reader refuses a higher one."""

VECTORS = {
    "displacement": ("displacement", 0, "m"),
    "rotation": ("displacement", 3, "rad"),
    "velocity": ("velocity", 0, "m/s"),
    "angular_velocity": ("velocity", 3, "rad/s"),
    "acceleration": ("acceleration", 0, "m/s^2"),
    "angular_acceleration": ("acceleration", 3, "rad/s^2"),
}
"""Point vectors: name to the series they come from, their first component and their unit."""

SERIES = {"displacement": "m", "velocity": "m/s", "acceleration": "m/s^2"}
STILL = ("radius", "node", "axis_x", "axis_y", "axis_z")
"""Point data that do not change."""


class ResultFile:
    """Sink that writes ``NAME.vtkhdf``, as ``NAME.partial.vtkhdf`` until the run is complete.

    Parameters
    ----------
    path
        The final file; its folder exists.
    geometry
        What the fields are drawn on.
    outline
        Names of what will come.
    save
        How the run hands out its blocks.
    about
        Texts kept with the result: name to text, such as the case file.
    overwrite
        Whether an existing result may be replaced, once the new one is complete.

    Raises
    ------
    InputError
        If the result, or the partial one of a run that broke off, exists and may not be replaced, or the file cannot
        be made.
    """

    def __init__(
        self, path: Path, geometry: Geometry, outline: Outline, *,
        save: SaveAt, about: Mapping[str, str], overwrite: bool = False,
    ) -> None:  # fmt: skip
        free_to_write("result", path, overwrite=overwrite)
        self.path = path
        self.partial = path.with_name(f"{path.stem}.partial.vtkhdf")
        free_to_write("partial result", self.partial, overwrite=overwrite)
        self._geometry, self._outline = geometry, outline
        try:
            self._file: Any = h5py.File(self.partial, "w", locking=False)
        except OSError as fault:
            raise refuse("result", str(self.partial), "a file that can be written", str(fault)) from None
        self._vtk: Any = self._file.create_group("VTKHDF")
        _write_geometry(self._vtk, geometry)
        self._create_steps(save.fields_per_block)
        self._create_history(save.fields_per_block * save.field_every)
        texts(self._file.create_group("about"), {"format": str(FORMAT), **about})
        self._file.flush()

    def _create_steps(self, rows: int) -> None:
        data = self._vtk["PointData"]
        points = len(self._geometry.node)
        for name, (unit, width) in {**{v: (u, 3) for v, (_, _, u) in VECTORS.items()}, **RECOVERED}.items():
            growing(data, name, rows * points, unit, width=width if width > 1 else 0)
        steps = self._vtk.create_group("Steps")
        steps.attrs["NSteps"] = 0
        for name in ("PartOffsets", "NumberOfParts", "PointOffsets"):
            growing(steps, name, rows, "", kind="i8")
        for name in ("CellOffsets", "ConnectivityIdOffsets"):  # one column for each of VTK's four kinds of cells
            growing(steps, name, rows, "", width=4, kind="i8")
        for name in (*VECTORS, *RECOVERED, *STILL):
            growing(steps.require_group("PointDataOffsets"), name, rows, "", kind="i8")
        growing(steps.require_group("CellDataOffsets"), "member", rows, "", kind="i8")
        growing(steps, "Values", rows, "s")
        growing(self._file.create_group("fields"), "cam_angle", rows, "rad")

    def _create_history(self, rows: int) -> None:
        history = self._file.create_group("history")
        history.attrs["steps"] = 0
        time = growing(history, "time", rows, "s")
        time.make_scale("time")
        made = [growing(history, "cam_angle", rows, "rad")]
        probes = ordered(history, "probes")
        for name, components in self._outline.probes:
            group = ordered(probes, name)
            group.attrs["components"] = list(components)
            for series, unit in SERIES.items():
                told = unit if len(components) == 1 else f"{unit}; rotations {unit.replace('m', 'rad', 1)}"
                made.append(growing(group, series, rows, told, width=len(components)))
        channels = ordered(history, "channels")
        made += [growing(channels, name, rows, unit) for name, unit in self._outline.channels]
        for dataset in made:
            dataset.dims[0].attach_scale(time)

    def write(self, block: Block) -> None:
        """Append a block."""
        steps, history = self._vtk["Steps"], self._file["history"]
        before, count = int(steps.attrs["NSteps"]), len(block.field_time)
        self._append_history(history, block)
        self._append_fields(block)
        points = len(self._geometry.node)
        for name in ("PartOffsets", "PointOffsets", "CellOffsets", "ConnectivityIdOffsets"):
            extend(steps[name], np.zeros((count, *steps[name].shape[1:]), int))
        extend(steps["NumberOfParts"], np.ones(count, int))
        for name in (*VECTORS, *RECOVERED):
            extend(steps["PointDataOffsets"][name], (before + np.arange(count)) * points)
        for still in (*(steps["PointDataOffsets"][name] for name in STILL), steps["CellDataOffsets/member"]):
            extend(still, np.zeros(count, int))
        self._file.flush()
        steps.attrs["NSteps"] = before + count
        history.attrs["steps"] = len(history["time"])
        self._file.flush()
        extend(steps["Values"], block.field_time)
        self._file.flush()

    def _append_fields(self, block: Block) -> None:
        data, geometry = self._vtk["PointData"], self._geometry
        nodal = {series: geometry.dofs.nodal(getattr(block.fields, series)) for series in SERIES}
        for name, (series, first, _) in VECTORS.items():
            extend(data[name], nodal[series][:, geometry.node, first : first + 3].reshape(-1, 3))
        for name, values in geometry.recovered(nodal["displacement"]).items():
            extend(data[name], values.reshape(-1, *values.shape[2:]))
        extend(self._file["fields/cam_angle"], block.field_angle)

    def _append_history(self, history: Any, block: Block) -> None:  # noqa: ANN401 - h5py has no types
        extend(history["time"], block.time)
        extend(history["cam_angle"], block.angle)
        for name, _ in self._outline.probes:
            columns = self._outline.columns(name)
            for series in SERIES:
                extend(history["probes"][name][series], getattr(block.probes, series)[:, columns])
        for i, (name, _) in enumerate(self._outline.channels):
            extend(history["channels"][name], block.channels[:, i])

    def close(self, status: Status, stats: Stats) -> None:
        """Write how the run ended; a complete result takes its final name, any other keeps the partial one."""
        group = self._file.create_group("status")
        texts(group, {"cause": str(status.cause), "text": status.text, "remedy": status.remedy})
        for name in stats.__dataclass_fields__:
            group.attrs[name] = getattr(stats, name)
        self._file.close()
        if status.ok:
            self.partial.replace(self.path)


def _write_geometry(vtk: Any, geometry: Geometry) -> None:  # noqa: ANN401 - h5py has no types
    vtk.attrs["Version"] = (2, 0)
    vtk.attrs.create("Type", b"PolyData", dtype="S8")
    mesh, points, ends = geometry.mesh, len(geometry.node), geometry.ends
    fixed(vtk, "NumberOfPoints", np.array([points]))
    fixed(vtk, "Points", mesh.nodes[geometry.node], "m")
    for topology in ("Vertices", "Lines", "Polygons", "Strips"):
        lines = topology == "Lines"
        group = vtk.create_group(topology)
        fixed(group, "NumberOfCells", np.array([len(mesh.lines) if lines else 0]))
        fixed(group, "NumberOfConnectivityIds", np.array([points if lines else 0]))
        fixed(group, "Connectivity", np.arange(points if lines else 0))
        fixed(group, "Offsets", ends if lines else np.zeros(1, int))
    member = fixed(vtk.create_group("CellData"), "member", np.arange(len(mesh.lines)))
    member.attrs["names"] = list(mesh.lines)
    data, axes = vtk.create_group("PointData"), geometry.axes()
    fixed(data, "radius", geometry.radius(), "m")
    fixed(data, "node", geometry.node)
    for i, name in enumerate(("axis_x", "axis_y", "axis_z")):
        fixed(data, name, axes[:, i])
    _write_mesh(vtk.parent, geometry)


def _write_mesh(file: Any, geometry: Geometry) -> None:  # noqa: ANN401 - h5py has no types
    group = file.create_group("mesh")
    fixed(group, "nodes", geometry.mesh.nodes, "m")
    points = ordered(group, "points")
    for name, index in geometry.mesh.points.items():
        fixed(points, name, index)
