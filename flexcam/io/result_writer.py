"""Write result files: partial results, checkpoints and the estimated file size."""

from __future__ import annotations

import math
import os
import re
import shutil
import time
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from io import BytesIO
from pathlib import Path
from typing import Any

import h5py  # pyright: ignore[reportMissingTypeStubs]
import numpy as np

from flexcam.core.errors import refuse, system_message
from flexcam.dynamics import SERIES, Block, Outline, SaveAt, Stats, Status
from flexcam.dynamics.blocks import Checkpoint
from flexcam.fem.dofs import ROTATIONS
from flexcam.fem.mesh import Mesh
from flexcam.io import hdf5
from flexcam.io import result_schema as schema
from flexcam.io.files import check_writable, open_with_lock
from flexcam.io.result_schema import VECTORS
from flexcam.io.vtk import Geometry, VtkGroup, constant_data

_module: Any = h5py

_MAX_COPY_TIME = 0.02  # maximum fraction of the run time spent on copies
_REQUIRED_SPACE = 2  # free space for a copy, relative to the file size: the rest of the run needs space too
_LAYOUT_BYTES = 1 << 19  # bytes of a file before its first step, without its texts, points and channels
_CHECKPOINT_CHUNK = 4096
_MIN_WRITE_BYTES = 1 << 20  # of buffered blocks: each of some hundred datasets has a fixed cost per write
_INDEX_CACHE_BYTES = 1 << 18  # of the chunk index in the format on disk: enough for the blocks being written

_NUMBER, _CHUNK, _DATASET = 8, 80, 2900
"""Bytes of a number, of a chunk's checksum and index entry, of a dataset's header and first index."""

_METADATA_BYTES = 125_000  # of the case, of the other texts, and of the part of the mesh that its size does not change
_CONSTANT_VALUES = 24  # per point, such as position and axes


def partial_path(path: Path) -> Path:
    """Return the path of the partial result of a run."""
    return path.with_name(f"{path.stem}{schema.PARTIAL_SUFFIX}")


class TemporaryResult:
    """Temporary result file, locked by one process."""

    def __init__(self, path: Path, shown: Path) -> None:
        self.path, self._shown, self._copy = path, shown, path.with_suffix(schema.COPYING_SUFFIX)
        if path.is_symlink():
            allowed, why = "a regular file", "it is a symbolic link, and its target would be overwritten"
            raise refuse("result", str(path), allowed, why, "remove the link, or name another folder")
        try:
            self._lock = open_with_lock(path)
        except BlockingIOError:
            allowed, why = "a result that no other run is writing", "another run is writing it now"
            raise refuse("result", str(shown), allowed, why, "wait for its end, or name another folder") from None
        except OSError as fault:
            raise _unwritable(path, fault) from None

    def show(self) -> None:
        """Publish a copy of the file; without space for it the previous copy remains."""
        try:
            if shutil.disk_usage(self.path.parent).free > _REQUIRED_SPACE * self.path.stat().st_size:
                self._copy.unlink(missing_ok=True)  # a link there would redirect the copy
                shutil.copyfile(self.path, self._copy)
                os.replace(self._copy, self._shown)
        except OSError:  # the run may still have space when its copy does not
            with suppress(OSError):
                self._copy.unlink(missing_ok=True)

    def rename(self, path: Path) -> None:
        """Synchronize the file to disk and rename it to its final name; no further writes are possible."""
        try:
            os.fsync(self._lock)
            os.replace(self.path, path)
            with suppress(OSError):  # the entries of the folder; not on Windows and some network drives
                folder = os.open(path.parent, os.O_RDONLY)
                try:
                    os.fsync(folder)
                finally:
                    os.close(folder)
        finally:
            self._release()

    def discard(self) -> None:
        """Remove the temporary file; published copies remain."""
        with suppress(OSError):
            self.path.unlink(missing_ok=True)
        self._release()

    def _release(self) -> None:
        with suppress(OSError):
            self._copy.unlink(missing_ok=True)
        os.close(self._lock)


def _unwritable(path: Path, fault: OSError) -> Exception:
    allowed, remedy = "a file that can be written", "free space or name another folder"
    return refuse("result", str(path), allowed, system_message(fault), remedy)


@contextmanager
def convert_write_errors() -> Generator[None]:
    """Convert HDF5 write errors to the message of the operating system, without addresses and buffer sizes."""
    try:
        yield
    except (OSError, RuntimeError) as fault:
        match = re.search(r"errno = (\d+)", str(fault))
        raise OSError(os.strerror(int(match[1])) if match else str(fault).partition(" (")[0]) from None


def write_checkpoint(file: Any, checkpoint: Checkpoint) -> None:  # noqa: ANN401 - h5py has no types
    """Write a checkpoint into an open result file; an earlier one is replaced."""
    packed = BytesIO()
    arrays: dict[str, Any] = dict(checkpoint.arrays)
    arrays |= {schema.CHECKPOINT_STEPS: checkpoint.steps, schema.CHECKPOINT_PROBLEM: checkpoint.problem}
    np.savez(packed, **arrays)
    content = np.frombuffer(packed.getvalue(), dtype=np.uint8)
    if schema.CHECKPOINT not in file:
        options = {"maxshape": (None,), "chunks": (_CHECKPOINT_CHUNK,), "fletcher32": True}
        file.create_dataset(schema.CHECKPOINT, (0,), "u1", **options)
    file[schema.CHECKPOINT].resize((len(content),))
    file[schema.CHECKPOINT][:] = content


def read_checkpoint(file: Any) -> Checkpoint | None:  # noqa: ANN401
    """Return the checkpoint of an open result file."""
    if schema.CHECKPOINT not in file:
        return None
    with np.load(BytesIO(file[schema.CHECKPOINT][()].tobytes()), allow_pickle=False) as packed:
        arrays: dict[str, Any] = dict(packed.items())
    steps, problem = int(arrays.pop(schema.CHECKPOINT_STEPS)), str(arrays.pop(schema.CHECKPOINT_PROBLEM))
    return Checkpoint(steps, problem, arrays)


class ResultFile:
    """Sink that writes ``NAME.vtkhdf``, named ``NAME.partial.vtkhdf`` until the run of `steps` steps is complete.

    A resumed run rewrites its partial result, which remains until then. `warnings` is called at the end.
    """

    def __init__(
        self, path: Path, geometry: Geometry, outline: Outline, *,
        steps: int, save: SaveAt, about: Mapping[str, str], overwrite: bool = False, resume: Checkpoint | None = None,
        warnings: Callable[[Stats], Sequence[str]] | None = None,
    ) -> None:  # fmt: skip
        remedy = "use --overwrite: the older result is replaced when the run is complete"
        check_writable("result", path, overwrite=overwrite, remedy=remedy)
        start = time.perf_counter()
        self.path, self.partial, self._overwrite = path, partial_path(path), overwrite
        self._geometry, self._outline = geometry, outline
        self._checkpoint, self._warnings = resume, warnings
        self._waiting: list[Block] = []
        self._received, self._total, self._bytes = 0, steps + 1, 0
        self._draft = TemporaryResult(path.with_suffix(schema.WRITING_SUFFIX), self.partial)
        with ExitStack() as undo:
            undo.callback(self._discard)
            remedy = "replace it with --overwrite, or, if it has a checkpoint, continue it with --resume"
            overwrite = overwrite or resume is not None
            check_writable("partial result", self.partial, overwrite=overwrite, remedy=remedy)
            try:
                self._create(geometry, save, about)
            except OSError as fault:
                raise _unwritable(self.path, fault) from None
            undo.pop_all()
        self._schedule_copy(start)  # the first one is assumed to take as long as the layout

    def _schedule_copy(self, start: float) -> None:
        """Set the time of the next copy, which is assumed to take as long as the time since a start."""
        now = time.perf_counter()
        self._next_copy = now + (now - start) / _MAX_COPY_TIME

    @convert_write_errors()
    def _create(self, geometry: Geometry, save: SaveAt, about: Mapping[str, str]) -> None:
        size = sum(map(len, about.values())) + _NUMBER * _CONSTANT_VALUES * len(geometry.node)
        size += _DATASET * len(self._outline.channels) + _LAYOUT_BYTES
        self._draft.path.write_bytes(bytes(size))  # HDF5 can abort the process on a full disk, which shows here
        # Every chunk is written once and in full: a cache would keep all chunks and search them at every flush.
        self._file: Any = h5py.File(self._draft.path, "w", locking=False, rdcc_nbytes=0)
        # HDF5 caches the chunk index of a long run, and counts only a tenth of its memory.
        config = self._file.id.get_mdc_config()
        config.set_initial_size, config.initial_size = 1, _INDEX_CACHE_BYTES
        config.min_size = config.max_size = _INDEX_CACHE_BYTES
        self._file.id.set_mdc_config(config)
        fields = max(save.block // save.field_every, 1)
        self._vtk = VtkGroup(self._file, geometry, schema.FIELDS, constant_data(geometry), fields)
        self._field_angle = hdf5.GrowingDataset(self._file, schema.FIELD_CAM_ANGLE, fields, "rad")
        self._create_history(save.block)
        hdf5.create_fixed_dataset(self._file, schema.MESH_NODES, geometry.mesh.nodes, "m")
        points = self._file.create_group(schema.MESH_POINTS, track_order=True)
        for name, index in geometry.mesh.points.items():
            hdf5.create_fixed_dataset(points, name, index)
        hdf5.write_texts(self._file.create_group(schema.ABOUT), {schema.ABOUT_FORMAT: str(schema.FORMAT), **about})

    def _create_history(self, rows: int) -> None:
        history = self._file.create_group(schema.HISTORY)
        history.attrs[schema.STEPS] = 0
        history.attrs[schema.SIZE] = len(self._outline.unknowns)
        self._time = hdf5.GrowingDataset(self._file, schema.TIME, rows, "s")
        self._time.dataset.make_scale(schema.TIME_SCALE)
        self._angle = hdf5.GrowingDataset(self._file, schema.CAM_ANGLE, rows, "rad")
        probes = self._file.create_group(schema.PROBES, track_order=True)
        self._probes: list[tuple[str, slice, hdf5.GrowingDataset]] = []
        for name, components in self._outline.probes:
            group = probes.create_group(name, track_order=True)
            group.attrs[schema.COMPONENTS] = hdf5.encode(components)
            turns = any(component in ROTATIONS for component in components)
            for series, unit in SERIES.items():
                units = f"{unit}; rotations {unit.replace('m', 'rad', 1)}" if turns else unit
                dataset = hdf5.GrowingDataset(group, series, rows, units, width=len(components))
                self._probes.append((series, self._outline.columns(name), dataset))
        channels = self._file.create_group(schema.CHANNELS, track_order=True)
        self._channels = [hdf5.GrowingDataset(channels, name, rows, unit) for name, unit in self._outline.channels]
        for dataset in (self._angle, *(dataset for _, _, dataset in self._probes), *self._channels):
            _module.h5ds.attach_scale(dataset.dataset.id, self._time.dataset.id, 0)

    def write(self, block: Block) -> None:
        """Append a block, immediately or together with later ones."""
        self._waiting.append(block)
        self._received += len(block.time)
        arrays = (block.channels, *(getattr(rows, name) for rows in (block.probes, block.fields) for name in SERIES))
        self._bytes += sum(array.nbytes for array in arrays)
        if self._bytes > _MIN_WRITE_BYTES or self._received == self._total:  # an interrupted run loses little
            self._append_waiting()

    @convert_write_errors()
    def _append_waiting(self) -> None:
        if not self._waiting:
            return
        block = Block.concatenate(self._waiting)
        self._waiting, self._bytes = [], 0
        self._time.append(block.time)
        self._angle.append(block.angle)
        for series, columns, history in self._probes:
            history.append(getattr(block.probes, series)[:, columns])
        for values, history in zip(block.channels.T, self._channels, strict=True):
            history.append(values)
        nodal = {series: self._geometry.dofs.nodal(getattr(block.fields, series)) for series in SERIES}
        node = self._geometry.node
        vectors = {name: nodal[series][:, node, first : first + 3] for name, (series, first, _) in VECTORS.items()}
        recovered = self._geometry.recover_fields(*nodal.values())
        self._vtk.append({**vectors, **recovered}, len(block.field_time))
        self._field_angle.append(block.field_angle)
        self._file[schema.HISTORY].attrs.modify(schema.STEPS, len(self._time))
        self._vtk.count(block.field_time)

    def write_checkpoint(self, checkpoint: Checkpoint) -> None:
        """Store the checkpoint after the last block, and publish a copy when one is due."""
        self._checkpoint = checkpoint
        start = time.perf_counter()
        if start >= self._next_copy:
            with convert_write_errors():
                self._append_waiting()
                write_checkpoint(self._file, checkpoint)
                hdf5.write_digest(self._file)
                self._file.flush()
            self._draft.show()
            self._schedule_copy(start)

    def close(self, status: Status, stats: Stats) -> None:
        """Write the status of the run and rename the file: to its final name if complete, else to the partial one."""
        if self._checkpoint is not None and self._received < self._checkpoint.steps:
            self._discard()  # stopped before it reached the end of the earlier partial result, which remains
            return
        try:
            self._write_status(status, stats)
        except OSError:
            self._discard()
            raise
        if status.ok and not self._overwrite and self.path.exists():
            self._draft.rename(self.partial)
            raise FileExistsError(f"another file appeared at {self.path} during the run; {self.partial} is the result")
        self._draft.rename(self.path if status.ok else self.partial)
        if status.ok:
            self.partial.unlink(missing_ok=True)

    def _discard(self) -> None:
        with suppress(OSError, RuntimeError, AttributeError):  # closing may fail in HDF5
            self._file.close()
        self._draft.discard()

    @convert_write_errors()
    def _write_status(self, status: Status, stats: Stats) -> None:
        self._append_waiting()
        group = self._file.create_group(schema.STATUS)
        warnings = "\n".join(self._warnings(stats) if self._warnings else ())
        texts = {schema.CAUSE: str(status.cause), schema.TEXT: status.text, schema.REMEDY: status.remedy}
        hdf5.write_texts(group, {**texts, schema.WARNINGS: warnings})
        for name, value in vars(stats).items():
            group.attrs[name] = hdf5.encode(value) if isinstance(value, str) else value
        if status.ok and schema.CHECKPOINT in self._file:  # a complete run needs none
            del self._file[schema.CHECKPOINT]
        elif not status.ok and self._checkpoint is not None:
            write_checkpoint(self._file, self._checkpoint)
        hdf5.write_digest(self._file)
        self._file.close()


def result_bytes(outline: Outline, mesh: Mesh, save: SaveAt, steps: int) -> int:
    """Return the estimated size of the result file of a run, bytes."""
    rows, fields = steps + 1, -(-steps // save.field_every) + 1
    widths = [1, 1, *(len(parts) for _, parts in outline.probes for _ in SERIES), *(1 for _ in outline.channels)]
    points, together = count_output_points(mesh), max(save.block // save.field_every, 1)
    size = sum(_growing_bytes(rows, save.block, width) for width in widths)
    size += sum(_growing_bytes(fields * points, together * points, width) for _, width in schema.FIELDS.values())
    size += 4 * _growing_bytes(fields, together, 1)  # times, angles, parts, offsets
    return size + _NUMBER * _CONSTANT_VALUES * points + _METADATA_BYTES


def count_output_points(mesh: Mesh) -> int:
    """Return the number of output points: those of every member and the nodes without a member."""
    return sum(len(line) for line in mesh.lines.values()) + int((~mesh.on_members()).sum())


def _growing_bytes(rows: int, block: int, width: int) -> int:
    chunk = hdf5.chunk_rows(block, width)  # the last one is stored in full
    return math.ceil(rows / chunk) * (chunk * width * _NUMBER + _CHUNK) + _DATASET
