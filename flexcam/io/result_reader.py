"""Read and verify result files, and resume an incomplete run from its partial result."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexcam.core import FloatArray
from flexcam.core.errors import InputError, refuse, suggest_name
from flexcam.dynamics import SERIES, Block, Cause, Outline, Response, SaveAt, Series, Stats, Status
from flexcam.dynamics.blocks import Checkpoint
from flexcam.fem.dofs import COMPONENTS
from flexcam.fem.mesh import Mesh
from flexcam.io import hdf5
from flexcam.io import result_schema as schema
from flexcam.io.result_schema import RESULT_SUFFIX, VECTORS
from flexcam.io.result_writer import partial_path, read_checkpoint
from flexcam.io.vtk import Geometry

_SUFFIXES = re.compile(r"((\.partial)?\.vtkhdf|\.writing|\.copying)$")


def suggest_alternative(path: Path) -> str:
    """Suggest an alternative file for a result that cannot be read: its partial or final result."""
    if path.suffix == ".toml":
        return f"run the case first: flexcam run {path}"
    temporary = (schema.WRITING_SUFFIX, schema.COPYING_SUFFIX)
    try:
        if path.exists() and path.suffix not in temporary:
            return ""
        final = path.with_name(_SUFFIXES.sub("", path.name) + RESULT_SUFFIX)
        partial, writing = partial_path(final), final.with_suffix(schema.WRITING_SUFFIX)
        for file, remedy in (
            (final, f"the result of the complete run is {final}"),
            (partial, f"{partial} contains the finished part of a run that is running or was stopped"),
            (writing, f"a run is writing {writing}, or was killed before its first copy; try again after its end"),
        ):
            if file != path and file.exists():
                return remedy
        return suggest_name(path.name, [result.name for result in path.parent.glob(f"*{RESULT_SUFFIX}")])
    except (OSError, ValueError):  # not a valid file name or no access to the folder: the error message says so
        return ""


@dataclass(frozen=True, eq=False)
class Result:
    """Result file in memory.

    Parameters
    ----------
    mesh
        Mesh with named points and members.
    response
        Histories, status and statistics of the run; fields have six components per node, node by node.
    constant
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
    constant: Mapping[str, FloatArray]
    recovered: Mapping[str, FloatArray]
    about: Mapping[str, str]
    warnings: tuple[str, ...] = ()

    def __repr__(self) -> str:
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


def unknown_fields(
    response: Response, free: NDArray[np.bool_], internal: Sequence[str], missing: FloatArray | None = None
) -> Series:
    """Return the saved fields in unknowns: the free components of the nodes, shape (nodes, 6), then internal ones.

    Internal ones are stored as probes at every step; one that is not has the values of its column in `missing`.
    Without these it raises an InputError.
    """
    rows = np.searchsorted(response.time, response.field_time - 1e-12 * np.abs(response.field_time))
    rows = np.minimum(rows, len(response.time) - 1)

    def internal_values(series: str, name: str, i: int) -> FloatArray:
        try:
            return getattr(response[name], series)[rows]
        except InputError:
            if missing is None:
                raise
            return missing[:, i]

    def columns(series: str) -> FloatArray:
        nodal = getattr(response.fields, series).reshape(-1, *free.shape)[:, free]
        return np.column_stack([nodal, *(internal_values(series, name, i) for i, name in enumerate(internal))])

    return Series(*map(columns, SERIES))


def read_result(path: str | Path, *, empty: bool = True) -> Result:
    """Read a result file.

    Parameters
    ----------
    path
        A ``.vtkhdf`` file written by flexcam, complete or partial; of a partial result, the finished part is read.
    empty
        Whether a result of a run that ended before its first step is accepted.

    Returns
    -------
    Result
        Content of the file.

    Raises
    ------
    InputError
        If the file is not a flexcam result, is damaged, has a newer format, or is empty and `empty` is false.

    Examples
    --------
    ``read_result("results/model-3-shm.vtkhdf").response["valve"].velocity`` is the velocity of the valve.
    """
    source = Path(path)
    with hdf5.open_hdf5(source, "result", "a result file of flexcam (.vtkhdf)", suggest_alternative(source)) as file:
        _check_result(file, source)
        result = _result(file)
    if not (empty or len(result.response.time)):
        why = f"the run ended before its first step: {result.response.status.text}"
        raise refuse("result", source, "a result with at least one step", why, "run the case again")
    return result


def _check_result(file: Any, source: Path) -> None:  # noqa: ANN401 - h5py has no types
    """Raise an error for a sweep table, or for a result of another format or damaged."""
    if schema.VTK not in file and {"inputs", "scalars"} <= set(file):
        remedy = "flexcam.io.sweep_table.read_table reads it"
        raise refuse("result", source, "a result file of flexcam (.vtkhdf)", "it is the table of a sweep", remedy)
    check_integrity(file, "result", source, schema.FORMAT)


def check_integrity(file: Any, where: str, source: Path, expected: int) -> None:  # noqa: ANN401
    """Raise an error for a file of another format, or if the content does not match the digest."""
    form = hdf5.read_texts(file[schema.ABOUT])[schema.ABOUT_FORMAT]
    if form != str(expected):
        why, remedy = "an earlier flexcam wrote it", "compute it again"
        if form.isdigit() and int(form) > expected:
            why, remedy = "it is newer", "update flexcam"
        raise refuse(where, f"{source} of format {form}", f"format {expected}", why, remedy)
    hdf5.check_digest(file)


def _result(file: Any) -> Result:  # noqa: ANN401
    data, history = file[schema.POINT_DATA], file[schema.HISTORY]
    count = min(int(file[schema.FIELD_STEPS].attrs[schema.VTK_STEPS]), len(file[schema.FIELD_TIME]))
    points, mesh = int(hdf5.read_numbers(file[schema.POINT_COUNT], 1, kind="i8")[0]), _mesh(file)
    outline = Outline(
        tuple(f"node {n}.{c}" for n in range(len(mesh.nodes)) for c in COMPONENTS),
        tuple((name, hdf5.read_text_list(probe, schema.COMPONENTS)) for name, probe in file[schema.PROBES].items()),
        tuple((name, hdf5.read_text_attribute(item, schema.UNITS)) for name, item in file[schema.CHANNELS].items()),
    )

    def values(name: str, rows: int, width: int, kind: str = "f8") -> Any:  # noqa: ANN401
        return hdf5.read_numbers(data[name], rows, (width,) if width > 1 else (), kind)

    moving = {name: values(name, count * points, width) for name, (_, width) in schema.RECOVERED_FIELDS.items()}
    return Result(
        mesh=mesh,
        response=_response(file, outline, slice(0, int(history.attrs[schema.STEPS])), slice(0, count)),
        constant={name: values(name, points, width, kind) for name, (kind, width) in schema.CONSTANT_DATA.items()},
        recovered={name: rows.reshape(count, points, *rows.shape[1:]) for name, rows in moving.items()},
        about=_read_about(file),
        warnings=tuple(_status_texts(file).get(schema.WARNINGS, "").splitlines()),
    )


def _read_about(file: Any) -> dict[str, str]:  # noqa: ANN401
    """Return the texts about a run; raise an error if its case is missing or cannot be read."""
    from pydantic import TypeAdapter

    about = hdf5.read_texts(file[schema.ABOUT])
    for name, kind in schema.ABOUT_CASE.items():
        try:
            text = about.get(name, "{}") if name == schema.ABOUT_FILES else about[name]
            if kind is not str:
                TypeAdapter(kind).validate_python(json.loads(text), strict=True)
        except (KeyError, ValueError, RecursionError):
            given, allowed = f"nothing about {name!r} of its case, or something else", "a result that keeps its case"
            raise refuse(f"/{schema.ABOUT}", given, allowed, "", "compute it again") from None
    return about


def _mesh(file: Any) -> Mesh:  # noqa: ANN401
    node = hdf5.read_numbers(file[schema.POINT_DATA][schema.NODE], kind="i8")
    ends = hdf5.read_numbers(file[schema.LINE_OFFSETS], kind="i8").tolist()
    names = hdf5.read_text_list(file[schema.MEMBER], schema.MEMBER_NAMES)
    lines = {name: node[a:b] for name, a, b in zip(names, ends[:-1], ends[1:], strict=True)}
    points = {name: hdf5.read_numbers(item, kind="i8") for name, item in file[schema.MESH_POINTS].items()}
    try:
        nodes = hdf5.read_numbers(file[schema.MESH_NODES], width=(3,))
        # A result does not name its couplings: the nodes that may coincide were checked before its run.
        return Mesh(nodes, lines, points, couplings={"all": np.arange(len(nodes))})
    except InputError as refusal:
        fault = refusal.faults[0]
        raise refuse(f"/{schema.MESH_NODES}", f"{fault.where}, {fault.given}", fault.allowed, fault.why) from None


def _response(file: Any, outline: Outline, rows: slice, fields: slice) -> Response:  # noqa: ANN401
    """Return some rows of the histories and some saved fields, with six components per node."""
    time, field_time = (_read_times(file[name], r) for name, r in ((schema.TIME, rows), (schema.FIELD_TIME, fields)))
    probes, channels, data = (file[name] for name in (schema.PROBES, schema.CHANNELS, schema.POINT_DATA))
    node, nodes = hdf5.read_numbers(data[schema.NODE], kind="i8"), len(file[schema.MESH_NODES])

    def probe_columns(series: str) -> FloatArray:
        parts = [hdf5.read_numbers(probes[name][series], rows, (len(names),)) for name, names in outline.probes]
        return np.column_stack([np.zeros((len(time), 0)), *parts])

    def nodal_values(series: str) -> FloatArray:
        values = np.zeros((len(field_time), nodes, 6))  # coincident points of a joint have the same values
        points = slice(fields.start * len(node), fields.stop * len(node))
        for name, (source, first, _) in VECTORS.items():
            if source == series:
                vectors = hdf5.read_numbers(data[name], points, (3,))
                values[:, node, first : first + 3] = vectors.reshape(len(values), len(node), 3)
        return values.reshape(-1, 6 * nodes)

    return Response(
        outline=outline, time=time, angle=hdf5.read_numbers(file[schema.CAM_ANGLE], rows),
        probes=Series(*map(probe_columns, SERIES)),
        channels={name: hdf5.read_numbers(channels[name], rows) for name, _ in outline.channels},
        field_time=field_time, field_angle=hdf5.read_numbers(file[schema.FIELD_CAM_ANGLE], fields),
        fields=Series(*map(nodal_values, SERIES)), status=read_status(file), stats=_stats(file),
    )  # fmt: skip


def _read_times(item: Any, rows: slice) -> FloatArray:  # noqa: ANN401
    times = hdf5.read_numbers(item, rows)
    if not (np.diff(times) > 0.0).all():
        raise refuse(item.name, "times that do not ascend", "a time per step")
    return times


def _status_texts(file: Any) -> dict[str, str]:  # noqa: ANN401
    """Return the texts of the status; empty if the run was cut off."""
    return hdf5.read_texts(file[schema.STATUS]) if schema.STATUS in file else {}


def read_status(file: Any) -> Status:  # noqa: ANN401
    """Return the status of the run in an open result file."""
    texts = _status_texts(file)
    if not texts:
        return Status(Cause.INTERRUPTED, "the run was killed", "continue it with flexcam run --resume")
    return Status(Cause(texts[schema.CAUSE]), texts[schema.TEXT], texts[schema.REMEDY])


def _stats(file: Any) -> Stats:  # noqa: ANN401
    if schema.STATUS not in file:  # the run was killed: engine and time are unknown
        attributes = file[schema.HISTORY].attrs
        steps, size = int(attributes[schema.STEPS]), int(attributes.get(schema.SIZE, 0))
        return Stats(engine="", steps=max(steps - 1, 0), size=size, seconds=-1.0)
    group = file[schema.STATUS]
    values: dict[str, Any] = {
        name: hdf5.read_text_attribute(group, name) if isinstance(default, str) else type(default)(group.attrs[name])
        for name, default in Stats().__dict__.items()
        if name in group.attrs
    }
    return Stats(**values)


_RESUME_REMEDY = "run the case again, with --overwrite"
_FAILED = (Cause.NOT_FINITE, Cause.NO_CONVERGENCE, Cause.SINGULAR, Cause.STEP_TOO_SMALL, Cause.ROUNDING)
"""Causes that would end a resumed run in the same way."""

_OPEN_MESSAGES = ("--resume", "a partial result of flexcam", _RESUME_REMEDY)


class PartialResult:
    """Partial result of an incomplete run: its texts, its status and the checkpoint at which the run continues."""

    def __init__(self, path: Path, geometry: Geometry, outline: Outline, save: SaveAt) -> None:
        self._path, self._outline, self._save = path, outline, save
        self._free = geometry.dofs.numbers >= 0
        with hdf5.open_hdf5(path, *_OPEN_MESSAGES) as file:
            _check_result(file, path)
            self.about: Mapping[str, str] = _read_about(file)
            self.status: Status = read_status(file)
            checkpoint = read_checkpoint(file)
        if self.status.cause in _FAILED:
            given, why = f"{path}: {self.status.cause}", "it would end in the same way"
            raise refuse("--resume", given, "a run that was stopped or cut off", why, self.status.remedy)
        if checkpoint is None:
            why = "it ended before its first checkpoint"
            raise refuse("--resume", str(path), "a result with a checkpoint", why, _RESUME_REMEDY)
        self.checkpoint: Checkpoint = checkpoint

    def blocks(self) -> Iterator[Block]:
        """Yield the blocks up to the checkpoint."""
        every, last = self._save.field_every, self.checkpoint.steps
        internal = self._outline.unknowns[int(self._free.sum()) :]
        with hdf5.open_hdf5(self._path, *_OPEN_MESSAGES) as file:
            for first in range(0, last, self._save.block):
                rows = slice(first, min(first + self._save.block, last))
                fields = slice(-(-rows.start // every), -(-rows.stop // every))  # without the last step of the run
                part = _response(file, self._outline, rows, fields)
                # Internal nodes of a spring do not move in the rigid model and are not stored.
                unknowns = unknown_fields(part, self._free, internal, np.zeros((len(part.field_time), len(internal))))
                channels = np.column_stack([np.zeros((len(part.time), 0)), *part.channels.values()])
                saved = part.field_time, part.field_angle, unknowns
                yield Block(part.time, part.angle, part.probes, channels, *saved)
