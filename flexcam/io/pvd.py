"""ParaView collections: a ``.pvd`` file that names one ``.vtp`` per instant, for ParaView up to 5.11.

The point data are those of the result file; XML with base64 data, as VTK's XML file formats describe it.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from flexcam.checks import refuse
from flexcam.fem import Mesh
from flexcam.io.result import Result
from flexcam.io.target import free_to_write, made_folder
from flexcam.io.vtkhdf import VECTORS
from flexcam.linalg import FloatArray, IntArray

_TYPES = {"float64": "Float64", "int64": "Int64"}


def write_pvd(result: Result, path: Path, *, every: int = 1, overwrite: bool = False) -> list[Path]:
    """Write a result as a ParaView collection.

    Parameters
    ----------
    result
        The result.
    path
        The ``.pvd`` file; its instants go to a folder of the same name beside it.
    every
        Take every so many of the saved instants.
    overwrite
        Whether existing files may be replaced.

    Returns
    -------
    list
        The files written, the collection first.

    Raises
    ------
    InputError
        If the collection exists and may not be replaced, or `every` is below 1.
    """
    if every < 1:
        raise refuse("every", every, "a whole number from 1")
    free_to_write("export", path, overwrite=overwrite)
    folder = made_folder(path.with_suffix(""))
    node = result.still["node"].astype(int)
    fields = {**{name: result.field(name)[:, node] for name in VECTORS}, **result.recovered}
    times = result.response.field_time
    written: list[Path] = []
    for i in range(0, len(times), every):
        piece = folder / f"{path.stem}_{i:06d}.vtp"
        data = {**{name: values[i] for name, values in fields.items()}, **result.still}
        piece.write_text(_vtp(result.mesh, node, data), encoding="ascii")
        written.append(piece)
    entries = [
        f'    <DataSet timestep="{float(times[i])!r}" part="0" file={quoteattr(f"{folder.name}/{piece.name}")}/>'
        for i, piece in zip(range(0, len(times), every), written, strict=True)
    ]
    head = (
        '<?xml version="1.0"?>\n<VTKFile type="Collection" version="1.0" byte_order="LittleEndian">\n  <Collection>\n'
    )
    path.write_text(head + "\n".join(entries) + "\n  </Collection>\n</VTKFile>\n", encoding="utf-8")
    return [path, *written]


def _vtp(mesh: Mesh, node: IntArray, data: Mapping[str, FloatArray]) -> str:
    ends = np.cumsum([len(line) for line in mesh.lines.values()])
    return "\n".join([
        '<?xml version="1.0"?>',
        '<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64">',
        f'<PolyData><Piece NumberOfPoints="{len(node)}" NumberOfLines="{len(ends)}">',
        '<PointData Vectors="displacement">', *(_array(name, values) for name, values in data.items()), "</PointData>",
        "<CellData>", _array("member", np.arange(len(ends))), "</CellData>",
        "<Points>", _array("Points", mesh.nodes[node]), "</Points>",
        "<Lines>", _array("connectivity", np.arange(len(node))), _array("offsets", ends), "</Lines>",
        "</Piece></PolyData></VTKFile>", "",
    ])  # fmt: skip


def _array(name: str, values: FloatArray | IntArray) -> str:
    data = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("<"))
    width = data.shape[1] if data.ndim == 2 else 1
    raw = np.array([data.nbytes], dtype="<u8").tobytes() + data.tobytes()
    head = f'<DataArray type="{_TYPES[values.dtype.name]}" Name="{name}" NumberOfComponents="{width}" format="binary">'
    return f"{head}{base64.b64encode(raw).decode('ascii')}</DataArray>"
