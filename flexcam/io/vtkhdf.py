"""Result files: one HDF5 file that is flexcam's archive and opens in ParaView.

The group ``/VTKHDF`` is VTK's (one polyline per member, see `vtk_group`); VTK ignores the groups beside it, which hold
histories, case, status and provenance. Blocks wait until they are worth writing, and are appended in the order data,
counts (``NSteps`` and the rows of the histories), ``Values``: a run may end between them, VTK's reader trusts
``Values`` to have its data, and flexcam's reads no row that is not counted. What others see are whole copies (`draft`).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import h5py  # pyright: ignore[reportMissingTypeStubs]

from flexcam.checkpoint import Checkpoint
from flexcam.checks import refuse
from flexcam.fem import ROTATIONS
from flexcam.io.draft import Draft, plainly
from flexcam.io.geometry import RECOVERED, Geometry
from flexcam.io.growing import Growing, fixed, ordered
from flexcam.io.kept_state import drop_checkpoint, make_checkpoint, write_checkpoint
from flexcam.io.sealed import seal
from flexcam.io.target import free_to_write
from flexcam.io.texts import note, texts
from flexcam.io.vtk_group import VtkGroup, still_data
from flexcam.linalg import FloatArray
from flexcam.response import Block, Outline, SaveAt, Stats, Status

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
    size = _HEAD * datasets + sum(map(len, about.values())) + _STILL * len(geometry.node)
    with path.open("wb") as file:
        file.write(bytes(size))


_DATASETS, _HEAD, _STILL = 45, 1650, 8 * 24
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
