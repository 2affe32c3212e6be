"""VTK XML files: points with polylines or polygons, and collections."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from flexcam.core import FloatArray, IntArray
from flexcam.io.files import atomic_write_path

_TYPES = {"float64": "Float64", "int64": "Int64"}

Data = Mapping[str, FloatArray | IntArray]


def write_polylines(
    path: Path, points: FloatArray, lengths: Sequence[int], *, point_data: Data, cell_data: Data,
    field_data: Data | None = None,
) -> None:  # fmt: skip
    """Write polylines with consecutive points; points after the last polyline become vertices."""
    drawn = sum(lengths)
    vertices, ends = np.arange(drawn, len(points)), np.cumsum([0, *lengths])[1:]
    cells = {"Verts": (vertices, np.arange(len(vertices)) + 1), "Lines": (np.arange(drawn), ends)}
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
    for kind, (own, ends) in cells.items():
        lines += [f"<{kind}>", _array("connectivity", own), _array("offsets", ends), f"</{kind}>"]
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
