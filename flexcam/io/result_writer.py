"""How large a result file will be."""

from __future__ import annotations

import math
import os
import re
import shutil
import time
import zlib
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager, suppress
from io import BytesIO
from pathlib import Path
from typing import Any

import h5py  # pyright: ignore[reportMissingTypeStubs]
import numpy as np

from flexcam.core import FloatArray
from flexcam.core.errors import refuse, said
from flexcam.dynamics import Block, Outline, SaveAt, Stats, Status
from flexcam.dynamics.checkpoint import Checkpoint
from flexcam.fem.frames import ROTATIONS
from flexcam.fem.mesh import Mesh
from flexcam.io.atomic_write import hold
from flexcam.io.integrity import keep_sum, seal, taken
from flexcam.io.paths import free_to_write
from flexcam.io.result_datasets import Growing, chunk_rows, fixed, ordered
from flexcam.io.text_files import note, texts
from flexcam.io.vtk_groups import RECOVERED, Geometry, VtkGroup, still_data

_SHARE = 0.02
"""Part of the time of a run that copies may take."""

_SPARE = 2
"""Times the size of the file that must be free for a copy: what is still to be written needs room too."""

_LAID_OUT = 1 << 19
"""Bytes that a file takes before its first step, with room to spare for a few hundred nodes."""


class Draft:
    """A file that one process at a time writes.

    Parameters
    ----------
    path
        Where it is written.
    shown
        Where copies of it are shown.
    """

    def __init__(self, path: Path, shown: Path) -> None:
        self.path, self._shown, self._copy = path, shown, path.with_suffix(".copying")
        if path.is_symlink():
            allowed, why = "a file of its own", "a symbolic link stands there: what it leads to would be written over"
            raise refuse("result", str(path), allowed, why, "remove the link, or name another folder")
        try:
            self._held = _locked(path)
            self._try()
        except BlockingIOError:
            allowed, why = "a result that nobody else is writing", "another run is writing it now"
            raise refuse("result", str(shown), allowed, why, "wait for its end, or name another folder") from None
        except OSError as fault:
            allowed, remedy = "a file that can be written", "free space or name another folder"
            raise refuse("result", str(path), allowed, said(fault), remedy) from None
        self._last, self._cost = time.perf_counter(), 0.0

    def _try(self) -> None:
        """Find out now whether the disk is full: HDF5 does not survive that while it lays out a file."""
        try:
            done = 0
            while done < _LAID_OUT:  # what does not fit is cut off without a word; behind it the system says why
                done += os.pwrite(self._held, bytes(_LAID_OUT - done), done)
            os.truncate(self._held, 0)
        except OSError:
            self.discard()
            raise

    def begin(self) -> None:
        """Say that the file is laid out: the first copy is taken to cost as much as that."""
        now = time.perf_counter()
        self._last, self._cost = now, now - self._last

    @property
    def due(self) -> bool:
        """Whether it is time for a copy."""
        return self._cost <= _SHARE * (time.perf_counter() - self._last)

    def show(self, prepared: float | None = None) -> None:
        """Show a copy of what is written by now; without room for it the last one stays."""
        began = time.perf_counter() if prepared is None else prepared
        try:
            if shutil.disk_usage(self.path.parent).free > _SPARE * self.path.stat().st_size:
                self._copy.unlink(missing_ok=True)  # a link there would lead the copy elsewhere
                shutil.copyfile(self.path, self._copy)
                os.replace(self._copy, self._shown)
        except OSError:  # the run itself may still find the room that its copy does not
            with suppress(OSError):
                self._copy.unlink(missing_ok=True)
        self._last = time.perf_counter()
        self._cost = self._last - began

    def become(self, path: Path) -> None:
        """Take a name for good, once the disk has it all; nothing else may follow."""
        try:
            os.fsync(self._held)
            os.replace(self.path, path)
            _sync_folder(path.parent)
        finally:
            self._release()

    def discard(self) -> None:
        """Remove what is written; what was shown stays."""
        with suppress(OSError):
            self.path.unlink(missing_ok=True)
        self._release()

    def _release(self) -> None:
        with suppress(OSError):
            self._copy.unlink(missing_ok=True)
        os.close(self._held)


def _sync_folder(folder: Path) -> None:
    """Have the disk keep the names in a folder; Windows has no such call, and some network drives refuse it."""
    with suppress(OSError):
        held = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(held)
        finally:
            os.close(held)


def _locked(path: Path) -> int:
    """Return a descriptor that holds the lock of a file, which ends with the process however that ends."""
    while True:
        held = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            hold(held)
            with suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(held), path.stat()):
                    return held
        except OSError:
            os.close(held)
            raise
        os.close(held)  # its process gave it a name meanwhile; ours is another file


@contextmanager
def plainly() -> Generator[None]:
    """Say in the system's own words why a file cannot be written; HDF5 tells addresses and buffers as well."""
    try:
        yield
    except (OSError, RuntimeError) as fault:
        told = _SYSTEM.search(str(fault))
        raise OSError(os.strerror(int(told[1])) if told else str(fault).partition(" (")[0]) from None


_SYSTEM = re.compile(r"errno = (\d+)")
"""What the system said, within what HDF5 says."""


CHECKPOINT = "checkpoint"
"""Name of the dataset."""

_STEPS, _PROBLEM = "steps", "problem"
_CHUNK_KEPT_STATE = 4096


def make_checkpoint(file: Any) -> None:  # noqa: ANN401 - h5py has no types
    """Make the place of the checkpoint in a new result file, empty."""
    file.create_dataset(CHECKPOINT, (0,), "u1", maxshape=(None,), chunks=(_CHUNK_KEPT_STATE,), fletcher32=True)
    keep_sum(file[CHECKPOINT], zlib.crc32(b""))


def write_checkpoint(file: Any, checkpoint: Checkpoint) -> None:  # noqa: ANN401
    """Write a checkpoint into an open result file, in the place of an earlier one."""
    packed = BytesIO()
    own = {_STEPS: np.array(checkpoint.steps), _PROBLEM: np.array(checkpoint.problem)}
    arrays: dict[str, Any] = {**checkpoint.arrays, **own}
    np.savez(packed, **arrays)
    content = np.frombuffer(packed.getvalue(), dtype=np.uint8)
    file[CHECKPOINT].resize((len(content),))
    file[CHECKPOINT][:] = content
    keep_sum(file[CHECKPOINT], zlib.crc32(content.data))


def read_checkpoint(file: Any) -> Checkpoint | None:  # noqa: ANN401
    """Return the checkpoint of an open result file."""
    if CHECKPOINT not in file or not len(file[CHECKPOINT]):
        return None
    with np.load(BytesIO(taken(file[CHECKPOINT]).tobytes()), allow_pickle=False) as packed:
        arrays: dict[str, Any] = dict(packed.items())
    return Checkpoint(int(arrays.pop(_STEPS)), str(arrays.pop(_PROBLEM)), arrays)


def drop_checkpoint(file: Any) -> None:  # noqa: ANN401
    """Take the checkpoint out of an open result file: a complete run needs none."""
    del file[CHECKPOINT]


_module: Any = h5py

FORMAT = 2
"""Version of flexcam's own groups; a reader refuses a higher one. Since 2 a file has a seal."""

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
    steps
        Of the whole run.
    save
        How the run hands out its blocks.
    about
        Texts kept with the result: name to text, such as the case file.
    overwrite
        Whether an existing result may be replaced, once the new one is complete.
    resume
        The state from which the run goes on with the partial result, which stays until all that it holds is written.
    warnings
        Asked at the end for what is doubtful about the run; None for nothing.
    """

    def __init__(
        self, path: Path, geometry: Geometry, outline: Outline, *,
        steps: int, save: SaveAt, about: Mapping[str, str], overwrite: bool = False, resume: Checkpoint | None = None,
        warnings: Callable[[Stats], Sequence[str]] | None = None,
    ) -> None:  # fmt: skip
        free_to_write("result", path, overwrite=overwrite)
        self.path = path
        self.partial = partial_of(path)
        self._geometry, self._outline = geometry, outline
        self._checkpoint = resume
        self._warnings = warnings
        self._waiting: list[Block] = []
        self._taken, self._all, self._bytes = 0, steps + 1, 0
        self._draft = Draft(path.with_suffix(".writing"), self.partial)
        try:
            free_to_write(
                "partial result", self.partial, overwrite=overwrite or resume is not None,
                remedy="go on with it by --resume, or overwrite it by --overwrite or overwrite=True",
            )  # fmt: skip
            with plainly():
                self._create(geometry, save, about)
        except OSError as fault:
            self._abandon()
            allowed, remedy = "a file that can be written", "free space or name another folder"
            raise refuse("result", str(self.path), allowed, str(fault), remedy) from None
        except BaseException:
            self._draft.discard()
            raise
        self._draft.begin()

    def _create(self, geometry: Geometry, save: SaveAt, about: Mapping[str, str]) -> None:
        _need_room(self._draft.path, geometry, self._outline, about)
        # Chunks are written once and whole: a cache would keep them all, to be looked through at every flush.
        self._file: Any = h5py.File(self._draft.path, "w", locking=False, rdcc_nbytes=0)
        _bound(self._file)
        moving = {**{name: (unit, 3) for name, (_, _, unit) in VECTORS.items()}, **RECOVERED}
        fields = max(save.block // save.field_every, 1)
        self._vtk = VtkGroup(self._file, geometry, moving, still_data(geometry), fields)
        self._field_angle = Growing(self._file.create_group("fields"), "cam_angle", fields, "rad")
        self._create_history(save.block)
        _write_mesh(self._file, geometry)
        texts(self._file.create_group("about"), {"format": str(FORMAT), **about})
        make_checkpoint(self._file)

    def _create_history(self, rows: int) -> None:
        history = self._file.create_group("history")
        history.attrs["steps"] = 0
        history.attrs["size"] = len(self._outline.unknowns)
        self._time = Growing(history, "time", rows, "s")
        self._time.dataset.make_scale("time")
        self._angle = Growing(history, "cam_angle", rows, "rad")
        probes = ordered(history, "probes")
        self._probes: list[tuple[str, slice, Growing]] = []
        for name, components in self._outline.probes:
            group = ordered(probes, name)
            note(group, "components", components)
            turns = any(one in ROTATIONS for one in components)
            for series, unit in SERIES.items():
                told = f"{unit}; rotations {unit.replace('m', 'rad', 1)}" if turns else unit
                made = Growing(group, series, rows, told, width=len(components))
                self._probes.append((series, self._outline.columns(name), made))
        channels = ordered(history, "channels")
        self._channels = [Growing(channels, name, rows, unit) for name, unit in self._outline.channels]
        for one in (self._angle, *(made for _, _, made in self._probes), *self._channels):
            _module.h5ds.attach_scale(one.dataset.id, self._time.dataset.id, 0)

    def write(self, block: Block) -> None:
        """Append a block, now or together with later ones."""
        self._waiting.append(block)
        self._taken += len(block.time)
        self._bytes += _size(block)
        if self._bytes > _WORTH or self._taken == self._all:  # what may be interrupted is not left to the end
            with plainly():
                self._append()

    def _append(self) -> None:
        """Write the blocks that wait."""
        if not self._waiting:
            return
        block = Block.joined(self._waiting)
        self._waiting, self._bytes = [], 0
        self._append_history(block)
        self._vtk.append(self._point_data(block), len(block.field_time))
        self._field_angle.extend(block.field_angle)
        self._vtk.count(len(block.field_time))
        self._file["history"].attrs.modify("steps", len(self._time))
        self._vtk.stamp(block.field_time)

    def keep(self, checkpoint: Checkpoint) -> None:
        """Take the state behind the last block, and show what is written when it is time to."""
        self._checkpoint = checkpoint
        if self._draft.due:
            began = time.perf_counter()
            with plainly():
                self._append()
                write_checkpoint(self._file, checkpoint)
                self._seal()
                self._file.flush()
            self._draft.show(began)

    def _point_data(self, block: Block) -> dict[str, FloatArray]:
        geometry = self._geometry
        nodal = {series: geometry.dofs.nodal(getattr(block.fields, series)) for series in SERIES}
        vectors = {
            name: nodal[series][:, geometry.node, first : first + 3] for name, (series, first, _) in VECTORS.items()
        }
        return {**vectors, **geometry.recovered(*(nodal[series] for series in SERIES))}

    def _seal(self) -> None:
        """Make the file one that a reader can hold against what was written."""
        grown = [self._time, self._angle, self._field_angle, *self._channels, *(one for _, _, one in self._probes)]
        for one in (*grown, *self._vtk.grown):
            one.sum()
        seal(self._file)

    def _append_history(self, block: Block) -> None:
        self._time.extend(block.time)
        self._angle.extend(block.angle)
        for series, columns, history in self._probes:
            history.extend(getattr(block.probes, series)[:, columns])
        for values, history in zip(block.channels.T, self._channels, strict=True):
            history.extend(values)

    def close(self, status: Status, stats: Stats) -> None:
        """Write how the run ended; a complete result takes its final name, any other becomes the partial one."""
        if self._checkpoint is not None and self._taken < self._checkpoint.steps:
            self._abandon()  # it was stopped before it held what the earlier one holds: that one stays
            return
        try:
            with plainly():
                self._end(status, stats)
        except OSError:
            self._abandon()
            raise
        self._draft.become(self.path if status.ok else self.partial)
        if status.ok:
            self.partial.unlink(missing_ok=True)

    def _abandon(self) -> None:
        """Give up what is written; HDF5 may not be able to close it."""
        with suppress(OSError, RuntimeError, AttributeError):
            self._file.close()
        self._draft.discard()

    def _end(self, status: Status, stats: Stats) -> None:
        self._append()
        group = self._file.create_group("status")
        doubtful = self._warnings(stats) if self._warnings else ()
        told = {"cause": str(status.cause), "text": status.text, "remedy": status.remedy}
        texts(group, {**told, "warnings": "\n".join(doubtful)})
        for name in stats.__dataclass_fields__:
            value = getattr(stats, name)
            if isinstance(value, str):
                note(group, name, value)
            else:
                group.attrs[name] = value
        if status.ok:
            drop_checkpoint(self._file)
        elif self._checkpoint is not None:
            write_checkpoint(self._file, self._checkpoint)
        self._seal()
        self._file.close()


_WORTH = 2**20
"""Bytes of blocks that are written together: each of some hundred datasets takes its time however little it gets."""


def _size(block: Block) -> int:
    """Return how many bytes a block has, but for its instants."""
    arrays = (block.channels, *(getattr(one, name) for one in (block.probes, block.fields) for name in SERIES))
    return sum(one.nbytes for one in arrays)


def partial_of(path: Path) -> Path:
    """Return where the partial result of a run is shown."""
    return path.with_name(f"{path.stem}.partial.vtkhdf")


def _need_room(path: Path, geometry: Geometry, outline: Outline, about: Mapping[str, str]) -> None:
    """Write as much as an empty result takes, to fail as other files do: HDF5 without room can end the process."""
    datasets = _DATASETS + len(SERIES) * len(outline.probes) + len(outline.channels) + len(geometry.mesh.points)
    size = _HEAD * datasets + sum(map(len, about.values())) + _STILL_VTKHDF * len(geometry.node)
    with path.open("wb") as file:
        file.write(bytes(size))


_DATASETS, _HEAD, _STILL_VTKHDF = 45, 1650, 8 * 24
"""Datasets of any result; bytes of one's head and of the first of its index; of what stands still at a point."""


def _bound(file: Any) -> None:  # noqa: ANN401
    """Keep HDF5 from holding the places of all chunks of a long run: it counts a tenth of what that takes in memory."""
    config = file.id.get_mdc_config()
    config.set_initial_size, config.initial_size = 1, _INDEX
    config.min_size = config.max_size = _INDEX
    file.id.set_mdc_config(config)


_INDEX = 2**18
"""Bytes of a file's index that stay in memory, as they are on disk; enough for the blocks that are being written."""


def _write_mesh(file: Any, geometry: Geometry) -> None:  # noqa: ANN401 - h5py has no types
    group = file.create_group("mesh")
    fixed(group, "nodes", geometry.mesh.nodes, "m")
    points = ordered(group, "points")
    for name, index in geometry.mesh.points.items():
        fixed(points, name, index)


_NUMBER, _CHUNK, _DATASET = 8, 80, 2900
"""Bytes of a number, of a chunk's checksum and entry in the index, of a dataset's head and the first of its index."""

_ABOUT = 125_000
"""Bytes of the case, of what else is kept as text, and of the mesh for what does not grow with it."""

_STILL = 24
"""Numbers of a point that do not change, such as its place and its axes."""


def result_bytes(outline: Outline, mesh: Mesh, save: SaveAt, steps: int) -> int:
    """Return the size of the result file of a run."""
    rows, fields = steps + 1, -(-steps // save.field_every) + 1
    widths = [1, 1, *(len(parts) for _, parts in outline.probes for _ in SERIES), *(1 for _ in outline.channels)]
    points, together = points_drawn(mesh), max(save.block // save.field_every, 1)
    vectors = [*(3 for _ in VECTORS), *(width for _, width in RECOVERED.values())]
    size = sum(_growing(rows, save.block, width) for width in widths)
    size += sum(_growing(fields * points, together * points, width) for width in vectors)
    size += 4 * _growing(fields, together, 1)  # times, angles, parts, offsets
    return size + _NUMBER * _STILL * points + _ABOUT


def points_drawn(mesh: Mesh) -> int:
    """Return at how many points fields are drawn: those of every member, and the nodes on none."""
    return sum(len(line) for line in mesh.lines.values()) + int((~mesh.on_members()).sum())


def _growing(rows: int, block: int, width: int) -> int:
    """Return the bytes of a dataset whose last chunk is stored whole."""
    chunk = chunk_rows(block, width)
    return math.ceil(rows / chunk) * (chunk * width * _NUMBER + _CHUNK) + _DATASET
