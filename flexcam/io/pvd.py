"""ParaView collections: a ``.pvd`` file that names one ``.vtp`` per instant, for ParaView up to 5.11.

The point data are those of the result file; the cam angle is field data.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from flexcam.checks import did_you_mean, refuse
from flexcam.fem import Mesh
from flexcam.io.result import Result
from flexcam.io.target import free_to_write, made_folder
from flexcam.io.vtkhdf import VECTORS
from flexcam.io.vtp import write_polylines
from flexcam.io.whole import whole
from flexcam.linalg import FloatArray, IntArray

CAM_ANGLE = "cam_angle_deg"
"""Field data of every instant: the cam angle, deg."""


@dataclass(frozen=True, eq=False)
class Frame:
    """One instant: a mesh, the mesh node of every point, point data by name, and numbers of the whole by name."""

    mesh: Mesh
    node: IntArray
    data: Mapping[str, FloatArray | IntArray]
    whole: Mapping[str, float] = field(default_factory=dict[str, float])


def write_pvd(
    result: Result, path: Path, *, every: int = 1, fields: Sequence[str] | None = None, overwrite: bool = False
) -> list[Path]:
    """Write a result as a ParaView collection."""
    if every < 1:
        raise refuse("every", every, "a whole number from 1")
    free_to_write("export", path, overwrite=overwrite)
    node = result.still["node"].astype(np.intp)
    known = {**{name: result.field(name)[:, node] for name in VECTORS}, **result.recovered}
    for name in fields or ():
        if name not in known:
            raise refuse("fields", repr(name), ", ".join(known), remedy=did_you_mean(name, known))
    moving = {name: known[name] for name in fields or known}
    instants = range(0, len(result.response.field_time), every)
    degrees = np.degrees(result.response.field_angle).tolist()
    frames = (
        Frame(result.mesh, node, {**{n: v[i] for n, v in moving.items()}, **result.still}, {CAM_ANGLE: degrees[i]})
        for i in instants
    )
    return write_collection(path, result.response.field_time[::every], frames)


def write_collection(path: Path, times: FloatArray, frames: Iterable[Frame]) -> list[Path]:
    """Write frames as ``.vtp`` files into a folder, and the ``.pvd`` file that names them beside it."""
    from xml.sax.saxutils import quoteattr  # loads what opens web pages

    folder = made_folder(path.with_suffix(""))
    written = [folder / f"{path.stem}_{i:06d}.vtp" for i in range(len(times))]
    for piece, frame in zip(written, frames, strict=True):
        write_vtp(piece, frame)
    entries = [
        f'    <DataSet timestep="{time!r}" part="0" file={quoteattr(f"{folder.name}/{piece.name}")}/>'
        for time, piece in zip(times.tolist(), written, strict=True)
    ]
    head = (
        '<?xml version="1.0"?>\n<VTKFile type="Collection" version="1.0" byte_order="LittleEndian">\n  <Collection>\n'
    )
    with whole(path) as draft:
        draft.write_text(head + "\n".join(entries) + "\n  </Collection>\n</VTKFile>\n", encoding="utf-8")
    return [path, *written]


def write_vtp(path: Path, frame: Frame) -> None:
    """Write one instant as VTK PolyData XML, one polyline per member, and a vertex per node on no member that moves."""
    lengths = [len(line) for line in frame.mesh.lines.values()]
    points = frame.mesh.nodes[frame.node]
    vertices = np.full(len(points) - sum(lengths), -1)
    members = np.concatenate([vertices, np.arange(len(lengths))])
    whole = {name: np.array([value]) for name, value in frame.whole.items()}
    write_polylines(path, points, lengths, point_data=frame.data, cell_data={"member": members}, field_data=whole)
