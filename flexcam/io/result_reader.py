"""Read and verify result files."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flexcam.core import FloatArray, IntArray
from flexcam.core.errors import Fault, InputError, refuse, suggest_name
from flexcam.dynamics import Cause, Outline, Response, Series, Stats, Status
from flexcam.fem.frames import COMPONENTS
from flexcam.fem.mesh import Mesh
from flexcam.io.hdf5 import READ_ERRORS, datasets, open_checked
from flexcam.io.integrity import CHECKSUM, damage_fault, dataset_fault, digest_fault, read_rows
from flexcam.io.result_writer import FORMAT, SERIES, VECTORS, partial_path
from flexcam.io.text_files import read_string_attribute, read_string_attributes, read_strings
from flexcam.io.vtk_groups import RECOVERED_FIELDS

_RESULT, _PARTIAL, _WRITING = ".vtkhdf", ".partial.vtkhdf", (".writing", ".copying")


def suggest_alternative(path: Path) -> str:
    """Suggest an alternative file for a result that cannot be read: its partial or final result."""
    if path.suffix == ".toml":
        return f"a case is solved first: flexcam run {path}"
    try:
        return _find_alternative(path)
    except OSError:  # not a valid file name or no access to the folder: the error message says so
        return ""


def _find_alternative(path: Path) -> str:
    final = path.with_name(path.name.removesuffix(_PARTIAL) + _RESULT) if path.name.endswith(_PARTIAL) else path
    final = final.with_suffix(_RESULT) if final.suffix in _WRITING else final
    partial, writing = partial_path(final), final.with_suffix(_WRITING[0])
    if path.exists() and path.suffix not in _WRITING:
        return ""
    if final != path and final.exists():
        return f"its run is complete: {final}"
    if partial != path and partial.exists():
        return f"{partial} is there: what a run that is going on or broke off has finished"
    if writing.exists():
        return (
            f"{writing} is there: a run is going on, or was killed before its first copy; ask again once it has ended"
        )
    return suggest_name(path.name, [one.name for one in path.parent.glob(f"*{_RESULT}")])


CONSTANT_DATA = ("radius", "node", "axis_x", "axis_y", "axis_z")
"""Constant point data."""


@dataclass(frozen=True, eq=False)
class Result:
    """Result file in memory.

    Parameters
    ----------
    mesh
        Mesh with named points and members.
    response
        Histories, status and statistics of the run; fields have six components per node, node by node.
    still
        Constant point data: ``radius`` (m), ``node``, ``axis_x``, ``axis_y``, ``axis_z`` (global axes).
    recovered
        Section forces (N, N m, local axes) and stresses (Pa) at the points of the members, shape (instants, points, 3)
        or (instants, points).
    about
        Texts stored with the result: case file, versions, date.
    warnings
        Warnings of the run.

    Examples
    --------
    ``result.field("displacement")[-1]`` is the last saved displacement of every node.
    """

    mesh: Mesh
    response: Response
    still: Mapping[str, FloatArray]
    recovered: Mapping[str, FloatArray]
    about: Mapping[str, str]
    warnings: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """Return the title of the result without its numbers."""
        return f"<Result of {self.about.get('title') or self.about.get('case_file', 'a run')!r}: {self.response!r}>"

    @property
    def field_names(self) -> tuple[str, ...]:
        """Names of the nodal vectors, for `field`."""
        return tuple(VECTORS)

    def field(self, name: str) -> FloatArray:
        """Return a nodal vector over the saved instants.

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
        A ``.vtkhdf`` file written by flexcam, complete or partial; of a partial result, the finished part is read.

    Returns
    -------
    Result
        Content of the file.

    Raises
    ------
    InputError
        If the file is not a flexcam result, is damaged, or has a newer format.

    Examples
    --------
    ``read_result("results/model-3-shm.vtkhdf").response["valve"].velocity`` is the velocity of the valve.
    """
    source = Path(path)
    with open_checked(source, "result", "a result file of flexcam (.vtkhdf)", suggest_alternative(source)) as file:
        check_integrity(file, source)
        return _result(file)


def check_integrity(file: Any, source: Path) -> None:  # noqa: ANN401 - h5py has no types
    """Raise an error for a newer format, or if names, texts or index do not match the digest."""
    if "VTKHDF" not in file and {"inputs", "scalars"} <= set(file):
        remedy = "flexcam.studies.tables.read_table reads it, and flexcam info --verify says whether it is sound"
        raise refuse("result", source, "a result file of flexcam (.vtkhdf)", "it is the table of a sweep", remedy)
    form = int(bytes(file["about/format"][()]))
    if form > FORMAT:
        given = f"{source} of format {form}"
        raise refuse("result", given, f"up to format {FORMAT}", "it is newer", "update flexcam")
    if fault := digest_fault(file):
        raise InputError([fault])


def _result(file: Any) -> Result:  # noqa: ANN401
    about = read_strings(file["about"])
    vtk = file["VTKHDF"]
    data, mesh = vtk["PointData"], _mesh(file)
    count, points = min(int(vtk["Steps"].attrs["NSteps"]), len(vtk["Steps/Values"])), int(vtk["NumberOfPoints"][0])
    recovered = {name: read_rows(data[name], count * points) for name in RECOVERED_FIELDS}
    return Result(
        mesh=mesh,
        response=_response(file, count, len(mesh.nodes)),
        still={name: read_rows(data[name]) for name in CONSTANT_DATA},
        recovered={name: values.reshape(count, points, *values.shape[1:]) for name, values in recovered.items()},
        about=about,
        warnings=_warnings(file),
    )


def _warnings(file: Any) -> tuple[str, ...]:  # noqa: ANN401
    told = file.get("status/warnings")
    return () if told is None else tuple(str(told.asstr()[()]).splitlines())


def _mesh(file: Any) -> Mesh:  # noqa: ANN401
    vtk, group = file["VTKHDF"], file["mesh"]
    node, ends = read_rows(vtk["PointData/node"]), read_rows(vtk["Lines/Offsets"]).tolist()
    names = read_string_attributes(vtk["CellData/member"], "names")
    lines = {name: node[a:b] for name, a, b in zip(names, ends[:-1], ends[1:], strict=True)}
    return Mesh(read_rows(group["nodes"]), lines, {name: read_rows(index) for name, index in group["points"].items()})


def _response(file: Any, count: int, nodes: int) -> Response:  # noqa: ANN401
    vtk, history = file["VTKHDF"], file["history"]
    steps = int(history.attrs["steps"])
    probes = tuple((name, read_string_attributes(one, "components")) for name, one in history["probes"].items())
    channels, data = history["channels"].items(), vtk["PointData"]
    node = read_rows(data["node"])

    def fields(name: str) -> FloatArray:
        return read_rows(data[name], count * len(node))

    return Response(
        outline=Outline(
            tuple(f"node {n}.{c}" for n in range(nodes) for c in COMPONENTS),
            probes,
            tuple((name, read_string_attribute(data, "units")) for name, data in channels),
        ),
        time=read_rows(history["time"], steps),
        angle=read_rows(history["cam_angle"], steps),
        probes=Series(*(_join_probes(history, probes, series, steps) for series in SERIES)),
        channels={name: read_rows(data, steps) for name, data in channels},
        field_time=read_rows(vtk["Steps/Values"], count),
        field_angle=read_rows(file["fields/cam_angle"], count),
        fields=Series(*(nodal_values(fields, series, node, nodes) for series in SERIES)),
        status=read_status(file),
        stats=_stats(file),
    )


def _join_probes(history: Any, probes: tuple[tuple[str, tuple[str, ...]], ...], series: str, steps: int) -> FloatArray:  # noqa: ANN401
    columns = [read_rows(history["probes"][name][series], steps) for name, _ in probes]
    return np.concatenate(columns, axis=1) if columns else np.zeros((steps, 0))


def nodal_values(read: Callable[[str], FloatArray], series: str, node: IntArray, nodes: int) -> FloatArray:
    """Return one series of saved fields at the nodes; coincident points of a joint have the same values."""
    parts = {first: read(name).reshape(-1, len(node), 3) for name, (of, first, _) in VECTORS.items() if of == series}
    spread = np.zeros((len(parts[0]), nodes, 6))
    for first, values in parts.items():
        spread[:, node, first : first + 3] = values
    return spread.reshape(-1, 6 * nodes)


def read_status(file: Any) -> Status:  # noqa: ANN401
    """Return the status of the run in an open result file."""
    if "status" not in file:
        return Status(Cause.INTERRUPTED, "the run was cut off before it could say why", "flexcam run --resume goes on")
    texts = read_strings(file["status"])
    return Status(Cause(texts["cause"]), texts["text"], texts["remedy"])


def _stats(file: Any) -> Stats:  # noqa: ANN401
    if "status" not in file:  # the run was killed: engine and time are unknown
        told = file["history"].attrs
        return Stats(engine="", steps=max(int(told["steps"]) - 1, 0), size=int(told.get("size", 0)), seconds=-1.0)
    group = file["status"]
    known = {name: default for name, default in Stats().__dict__.items() if name in group.attrs}
    kept: dict[str, Any] = {
        name: read_string_attribute(group, name) if isinstance(default, str) else type(default)(group.attrs[name])
        for name, default in known.items()
    }
    return Stats(**kept)


@dataclass(frozen=True)
class VerificationSummary:
    """Summary of a verified file.

    Parameters
    ----------
    datasets
        Number of datasets.
    checked
        Number of datasets with a checksum of their rows; the digest covers the others.
    bytes
        Size of all numbers and texts.
    complete
        Whether the run that wrote the file reached its end.
    """

    datasets: int
    checked: int
    bytes: int
    complete: bool


def verify_file(path: str | Path) -> VerificationSummary:
    """Read and verify every dataset of a result or of a sweep table."""
    source = Path(path)
    allowed = "a result file of flexcam (.vtkhdf) or the table of a sweep (.h5)"
    with open_checked(source, "result", allowed, suggest_alternative(source)) as file:
        found = datasets(file)
        if faults := [fault for fault in (digest_fault(file), *map(_fault, found)) if fault]:
            raise InputError(faults)
        complete = "history" not in file or read_status(file).ok
        checked = sum(CHECKSUM in one.attrs for one in found)
        return VerificationSummary(len(found), checked, sum(int(one.nbytes) for one in found), complete)


def _fault(one: Any) -> Fault | None:  # noqa: ANN401 - h5py has no types
    try:
        return dataset_fault(one)
    except READ_ERRORS as fault:
        return damage_fault(one, str(fault))
