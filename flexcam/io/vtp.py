"""VTK PolyData XML: polylines with data, base64, as VTK's XML file formats describe it."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from flexcam.io.whole import whole
from flexcam.linalg import FloatArray, IntArray

_TYPES = {"float64": "Float64", "int64": "Int64"}

Data = Mapping[str, FloatArray | IntArray]


def write_polylines(
    path: Path,
    points: FloatArray,
    lengths: Sequence[int],
    *,
    point_data: Data,
    cell_data: Data,
    field_data: Data | None = None,
) -> None:
    """Write polylines whose points follow each other; points behind the last one's become vertices."""
    drawn = sum(lengths)
    vertices, ends = np.arange(drawn, len(points)), np.cumsum([0, *lengths])[1:]
    text = "\n".join([
        '<?xml version="1.0"?>',
        '<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64">',
        "<PolyData>",
        "<FieldData>", *(_array(name, v, whole=True) for name, v in (field_data or {}).items()), "</FieldData>",
        f'<Piece NumberOfPoints="{len(points)}" NumberOfVerts="{len(vertices)}" NumberOfLines="{len(lengths)}">',
        "<PointData>", *(_array(name, values) for name, values in point_data.items()), "</PointData>",
        "<CellData>", *(_array(name, values) for name, values in cell_data.items()), "</CellData>",
        "<Points>", _array("Points", points), "</Points>",
        "<Verts>", _array("connectivity", vertices), _array("offsets", np.arange(len(vertices)) + 1), "</Verts>",
        "<Lines>", _array("connectivity", np.arange(drawn)), _array("offsets", ends), "</Lines>",
        "</Piece></PolyData></VTKFile>", "",
    ])  # fmt: skip
    with whole(path) as draft:
        draft.write_text(text, encoding="ascii")


def _array(name: str, values: FloatArray | IntArray, *, whole: bool = False) -> str:
    data = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("<"))
    width = data.shape[1] if data.ndim == 2 else 1
    raw = np.array([data.nbytes], dtype="<u8").tobytes() + data.tobytes()
    told = f'NumberOfTuples="{len(data)}"' if whole else f'NumberOfComponents="{width}"'
    head = f'<DataArray type="{_TYPES[values.dtype.name]}" Name="{name}" {told} format="binary">'
    return f"{head}{base64.b64encode(raw).decode('ascii')}</DataArray>"
