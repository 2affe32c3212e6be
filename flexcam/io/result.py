"""Read a result file back, losing nothing that was saved."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py  # pyright: ignore[reportMissingTypeStubs]
import numpy as np

from flexcam.checks import refuse
from flexcam.fem import COMPONENTS, Mesh
from flexcam.io.vtkhdf import FORMAT, VECTORS
from flexcam.linalg import FloatArray
from flexcam.response import Cause, Outline, Response, Series, Stats, Status


@dataclass(frozen=True, eq=False)
class Result:
    """A result file in memory.

    Parameters
    ----------
    mesh
        Geometry, with named points and members.
    response
        Histories, status and figures of the run; its fields hold six components per node, node after node.
    point_radius
        Drawn radius per node, m, shape (nodes,).
    about
        Texts kept with the result: case file, versions, date.
    """

    mesh: Mesh
    response: Response
    point_radius: FloatArray
    about: Mapping[str, str]

    def field(self, name: str) -> FloatArray:
        """Return a point vector over the saved instants.

        Parameters
        ----------
        name
            ``displacement``, ``rotation``, ``velocity``, ``angular_velocity``, ``acceleration`` or
            ``angular_acceleration``.

        Returns
        -------
        ndarray
            Shape (instants, nodes, 3), global axes, SI.
        """
        series, first, _ = VECTORS[name]
        nodal = getattr(self.response.fields, series).reshape(-1, len(self.mesh.nodes), 6)
        return nodal[..., first : first + 3]


def read_result(path: str | Path) -> Result:
    """Read a result file.

    Parameters
    ----------
    path
        A ``.vtkhdf`` file written by flexcam, complete or partial.

    Returns
    -------
    Result
        Everything in it.

    Raises
    ------
    InputError
        If it is no such file, or of a newer format.
    """
    source = Path(path)
    try:
        with h5py.File(source, "r", locking=False) as file:
            return _result(file, source)
    except (OSError, KeyError) as fault:
        why = "there is no such file" if not source.exists() else str(fault)
        raise refuse("result", str(source), "a result file of flexcam (.vtkhdf)", why) from None


def _result(file: Any, source: Path) -> Result:  # noqa: ANN401 - h5py has no types
    about = {name: item.asstr()[()] for name, item in file["about"].items()}
    if int(about["format"]) > FORMAT:
        raise refuse(
            "result", f"{source} of format {about['format']}", f"up to format {FORMAT}", "it is newer", "update flexcam"
        )
    vtk = file["VTKHDF"]
    return Result(_mesh(file), _response(file), vtk["PointData/radius"][()], about)


def _mesh(file: Any) -> Mesh:  # noqa: ANN401
    vtk = file["VTKHDF"]
    ids, ends = vtk["Lines/Connectivity"][()], vtk["Lines/Offsets"][()]
    names = [str(name) for name in vtk["CellData/member"].attrs["names"]]
    lines = {name: ids[a:b] for name, a, b in zip(names, ends[:-1], ends[1:], strict=True)}
    return Mesh(vtk["Points"][()], lines, {name: index[()] for name, index in file["points"].items()})


def _response(file: Any) -> Response:  # noqa: ANN401
    vtk, history = file["VTKHDF"], file["history"]
    nodes = int(vtk["NumberOfPoints"][0])
    count = min(int(vtk["Steps"].attrs["NSteps"]), len(vtk["Steps/Values"]))
    steps = len(history["time"])
    probes = tuple(
        (name, tuple(str(c) for c in group.attrs["components"])) for name, group in history.get("probes", {}).items()
    )
    channels = {name: data[:steps] for name, data in history.get("channels", {}).items()}
    units = tuple((name, str(data.attrs["units"])) for name, data in history.get("channels", {}).items())
    unknowns = tuple(f"node {n}.{c}" for n in range(nodes) for c in COMPONENTS)
    return Response(
        outline=Outline(unknowns, probes, units),
        time=history["time"][()], angle=history["cam_angle"][()],
        probes=Series(*(_side_by_side(history, probes, s, steps) for s in Series.__annotations__)),
        channels=channels,
        field_time=vtk["Steps/Values"][:count], field_angle=file["fields/cam_angle"][:count],
        fields=Series(*(_fields(vtk["PointData"], s, count, nodes) for s in Series.__annotations__)),
        status=_status(file), stats=_stats(file),
    )  # fmt: skip


def _side_by_side(history: Any, probes: tuple[tuple[str, tuple[str, ...]], ...], series: str, steps: int) -> FloatArray:  # noqa: ANN401
    columns = [history[f"probes/{name}/{series}"][:steps] for name, _ in probes]
    return np.concatenate(columns, axis=1) if columns else np.zeros((steps, 0))


def _fields(data: Any, series: str, count: int, nodes: int) -> FloatArray:  # noqa: ANN401
    parts = [data[name][: count * nodes].reshape(count, nodes, 3) for name, (s, _, _) in VECTORS.items() if s == series]
    return np.concatenate(parts, axis=2).reshape(count, nodes * 6)


def _status(file: Any) -> Status:  # noqa: ANN401
    if "status" not in file:
        return Status(Cause.INTERRUPTED, "the run was cut off before it could say why", "run it again")
    texts = {name: item.asstr()[()] for name, item in file["status"].items()}
    return Status(Cause(texts["cause"]), texts["text"], texts["remedy"])


def _stats(file: Any) -> Stats:  # noqa: ANN401
    if "status" not in file:
        return Stats()
    attrs = file["status"].attrs
    return Stats(**{name: type(default)(attrs[name]) for name, default in Stats().__dict__.items()})
