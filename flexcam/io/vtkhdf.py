"""Result files: one HDF5 file that is flexcam's archive and opens in ParaView.

The group ``/VTKHDF`` follows Kitware's file format (PolyData, version 2.0, one polyline per member, the mesh stored
once); VTK ignores the groups beside it, which hold histories, case, status and provenance. Blocks are appended in the
order data, ``NSteps``, ``Values``, each flushed, because VTK's reader trusts ``Values`` to have its data.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py  # pyright: ignore[reportMissingTypeStubs]
import numpy as np

from flexcam.checks import refuse
from flexcam.fem import DofMap, Mesh
from flexcam.linalg import FloatArray, IntArray
from flexcam.response import Block, Outline, Stats, Status

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

_TOPOLOGIES = ("Vertices", "Lines", "Polygons", "Strips")
_PACKED: dict[str, Any] = {"compression": "gzip", "compression_opts": 4, "shuffle": True, "fletcher32": True}


class ResultFile:
    """Sink that writes ``NAME.vtkhdf``, as ``NAME.partial.vtkhdf`` until the run is complete.

    Parameters
    ----------
    path
        The final file; its folder exists.
    mesh, dofs
        Geometry and numbering of the fields.
    outline
        Names of what will come.
    radius
        Drawn radius of each member, m.
    about
        Texts kept with the result: name to text, such as the case file.
    overwrite
        Whether an existing result may be replaced, once the new one is complete.

    Raises
    ------
    InputError
        If the result exists and may not be replaced.
    """

    def __init__(
        self, path: Path, mesh: Mesh, dofs: DofMap, outline: Outline, *,
        radius: Mapping[str, float], about: Mapping[str, str], overwrite: bool = False,
    ) -> None:  # fmt: skip
        if path.exists() and not overwrite:
            raise refuse(
                "result", str(path), "a file that does not exist yet", "nothing is written over", "add --overwrite"
            )
        self.path = path
        self.partial = path.with_name(f"{path.stem}.partial.vtkhdf")
        self._dofs, self._outline = dofs, outline
        self._file: Any = h5py.File(self.partial, "w", locking=False)
        self._vtk: Any = self._file.create_group("VTKHDF")
        _write_geometry(self._vtk, mesh, radius)
        self._create_steps(len(mesh.nodes))
        self._create_history()
        _write_texts(self._file.create_group("about"), {"format": str(FORMAT), **about})
        self._file.flush()

    def _create_steps(self, points: int) -> None:
        data = self._vtk.require_group("PointData")
        for name, (_, _, unit) in VECTORS.items():
            _growing(data, name, (points * 8, 3), unit, width=3)
        steps = self._vtk.create_group("Steps")
        steps.attrs["NSteps"] = 0
        for name, width in (
            ("PartOffsets", 0),
            ("NumberOfParts", 0),
            ("PointOffsets", 0),
            ("CellOffsets", 4),
            ("ConnectivityIdOffsets", 4),
        ):
            _growing(steps, name, (64, width) if width else (64,), "", width=width, kind="i8")
        for group, names in (("PointDataOffsets", [*VECTORS, "radius"]), ("CellDataOffsets", ["member"])):
            for name in names:
                _growing(steps.require_group(group), name, (64,), "", kind="i8")
        _growing(steps, "Values", (64,), "s")
        _growing(self._file.create_group("fields"), "cam_angle", (64,), "rad")

    def _create_history(self) -> None:
        history = self._file.create_group("history")
        _growing(history, "time", (1024,), "s").make_scale("time")
        _growing(history, "cam_angle", (1024,), "rad")
        for name, components in self._outline.probes:
            group = history.create_group(f"probes/{name}")
            group.attrs["components"] = list(components)
            for series, unit in (("displacement", "m"), ("velocity", "m/s"), ("acceleration", "m/s^2")):
                told = unit if len(components) == 1 else f"{unit}; rotations {unit.replace('m', 'rad', 1)}"
                _growing(group, series, (1024, len(components)), told, width=len(components)).dims[0].attach_scale(
                    history["time"]
                )
        for name, unit in self._outline.channels:
            _growing(history, f"channels/{name}", (1024,), unit).dims[0].attach_scale(history["time"])

    def write(self, block: Block) -> None:
        """Append a block."""
        self._append_history(block)
        count = len(block.field_time)
        steps = self._vtk["Steps"]
        before = int(steps.attrs["NSteps"])
        points = self._append_fields(block)
        for name in ("PartOffsets", "PointOffsets", "CellOffsets", "ConnectivityIdOffsets"):
            _extend(steps[name], np.zeros((count, *steps[name].shape[1:]), int))
        _extend(steps["NumberOfParts"], np.ones(count, int))
        for name in VECTORS:
            _extend(steps["PointDataOffsets"][name], (before + np.arange(count)) * points)
        for still in (steps["PointDataOffsets"]["radius"], steps["CellDataOffsets"]["member"]):
            _extend(still, np.zeros(count, int))
        self._file.flush()
        steps.attrs["NSteps"] = before + count
        self._file.flush()
        _extend(steps["Values"], block.field_time)
        self._file.flush()

    def _append_fields(self, block: Block) -> int:
        data = self._vtk["PointData"]
        nodal = {
            series: self._dofs.nodal(getattr(block.fields, series))
            for series in ("displacement", "velocity", "acceleration")
        }
        for name, (series, first, _) in VECTORS.items():
            _extend(data[name], nodal[series][..., first : first + 3].reshape(-1, 3))
        _extend(self._file["fields/cam_angle"], block.field_angle)
        return nodal["displacement"].shape[-2]

    def _append_history(self, block: Block) -> None:
        history = self._file["history"]
        _extend(history["time"], block.time)
        _extend(history["cam_angle"], block.angle)
        for name, _ in self._outline.probes:
            columns = self._outline.columns(name)
            for series in ("displacement", "velocity", "acceleration"):
                _extend(history[f"probes/{name}/{series}"], getattr(block.probes, series)[:, columns])
        for i, (name, _) in enumerate(self._outline.channels):
            _extend(history[f"channels/{name}"], block.channels[:, i])

    def close(self, status: Status, stats: Stats) -> None:
        """Write how the run ended; a complete result takes its final name, any other keeps the partial one."""
        group = self._file.create_group("status")
        _write_texts(group, {"cause": str(status.cause), "text": status.text, "remedy": status.remedy})
        for name in stats.__dataclass_fields__:
            group.attrs[name] = getattr(stats, name)
        self._file.close()
        if status.ok:
            self.partial.replace(self.path)


def _growing(group: Any, name: str, chunk: tuple[int, ...], unit: str, *, width: int = 0, kind: str = "f8") -> Any:  # noqa: ANN401 - h5py has no types
    shape, limit = ((0, width), (None, width)) if width else ((0,), (None,))
    dataset = group.create_dataset(name, shape, kind, maxshape=limit, chunks=chunk, **_PACKED)
    dataset.attrs["units"] = unit
    return dataset


def _extend(dataset: Any, rows: FloatArray | IntArray) -> None:  # noqa: ANN401
    first = dataset.shape[0]
    dataset.resize(first + len(rows), axis=0)
    if len(rows):
        dataset[first:] = rows


def _write_texts(group: Any, texts: Mapping[str, str]) -> None:  # noqa: ANN401
    for name, text in texts.items():
        group.create_dataset(name, data=text, dtype=h5py.string_dtype())  # pyright: ignore[reportUnknownMemberType]


def _write_geometry(vtk: Any, mesh: Mesh, radius: Mapping[str, float]) -> None:  # noqa: ANN401
    vtk.attrs["Version"] = (2, 0)
    vtk.attrs.create("Type", b"PolyData", dtype="S8")
    lengths = [len(line) for line in mesh.lines.values()]
    vtk["NumberOfPoints"] = np.array([len(mesh.nodes)])
    vtk["Points"] = mesh.nodes
    vtk["Points"].attrs["units"] = "m"
    for topology in _TOPOLOGIES:
        lines = topology == "Lines"
        group = vtk.create_group(topology)
        group["NumberOfCells"] = np.array([len(lengths) if lines else 0])
        group["NumberOfConnectivityIds"] = np.array([sum(lengths) if lines else 0])
        group["Connectivity"] = np.concatenate(list(mesh.lines.values())) if lines else np.zeros(0, np.intp)
        group["Offsets"] = np.cumsum([0, *lengths]) if lines else np.zeros(1, int)
    vtk["CellData/member"] = np.arange(len(lengths))
    vtk["CellData/member"].attrs["names"] = list(mesh.lines)
    vtk["PointData/radius"] = _point_radius(mesh, radius)
    vtk["PointData/radius"].attrs["units"] = "m"
    sets = vtk.parent.create_group("points")
    for name, index in mesh.points.items():
        sets[name] = index


def _point_radius(mesh: Mesh, radius: Mapping[str, float]) -> FloatArray:
    values = np.zeros(len(mesh.nodes))
    for name, line in mesh.lines.items():
        values[line] = np.maximum(values[line], radius[name])
    return values
