"""The finished part of a run that broke off, read from its partial result as the run handed it out."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import h5py  # pyright: ignore[reportMissingTypeStubs]
import numpy as np

from flexcam.checkpoint import Checkpoint
from flexcam.checks import InputError, refuse
from flexcam.io.geometry import Geometry
from flexcam.io.guard import guarded
from flexcam.io.kept_state import read_checkpoint
from flexcam.io.result import check_whole, nodal_fields, status_of, vectors_of
from flexcam.io.texts import read_texts
from flexcam.io.vtkhdf import SERIES
from flexcam.linalg import FloatArray, IntArray
from flexcam.response import Block, Cause, Outline, SaveAt, Series, Status

_AGAIN = "run the case again, with --overwrite"
_FAILED = (Cause.NOT_FINITE, Cause.NO_CONVERGENCE, Cause.SINGULAR, Cause.STEP_TOO_SMALL, Cause.ROUNDING)
"""How runs end that would end the same way again."""


class Unfinished:
    """A partial result that a run can go on from.

    Parameters
    ----------
    path
        ``NAME.partial.vtkhdf``.
    geometry, outline, save
        Of the run, as its result file takes them.

    Attributes
    ----------
    about
        Texts kept with it.
    status
        How it broke off.
    checkpoint
        Where the run goes on.

    Raises
    ------
    InputError
        If it is no partial result of flexcam, damaged, without a checkpoint, or the run would end the same way again.
    """

    def __init__(self, path: Path, geometry: Geometry, outline: Outline, save: SaveAt) -> None:
        self._path, self._geometry, self._outline, self._save = path, geometry, outline, save
        self._free = geometry.dofs.numbers >= 0
        with guarded(path, "--resume", "a partial result of flexcam") as file:
            check_whole(file, path)
        try:
            self._file: Any = h5py.File(path, "r", locking=False)
            self.about: Mapping[str, str] = read_texts(self._file["about"])
            self.status: Status = status_of(self._file)
            found = read_checkpoint(self._file)
        except (OSError, KeyError, ValueError, zipfile.BadZipFile) as fault:
            raise self._damaged(fault) from None
        if self.status.cause in _FAILED:
            given, why = f"{path}: {self.status.cause}", "it would end the same way again"
            raise refuse("--resume", given, "a run that was stopped or cut off", why, self.status.remedy)
        if found is None:
            why = "it broke off before the first block of its steps was saved"
            raise refuse("--resume", str(path), "a result with a checkpoint", why, _AGAIN)
        self.checkpoint: Checkpoint = found

    def verify(self) -> None:
        """Read everything once: HDF5 holds every chunk against its checksum.

        Raises
        ------
        InputError
            If something is damaged.
        """
        for _ in self.blocks():
            pass

    def blocks(self) -> Iterator[Block]:
        """Yield the blocks up to the checkpoint.

        Raises
        ------
        InputError
            If something is damaged.
        """
        size, field = self._save.block, 0
        try:
            for first in range(0, self.checkpoint.steps, size):
                steps = np.arange(first, min(first + size, self.checkpoint.steps))
                saved = np.flatnonzero(steps % self._save.field_every == 0)  # the last of the run is not among them
                yield self._block(slice(first, first + len(steps)), saved, slice(field, field + len(saved)))
                field += len(saved)
        except (OSError, KeyError, ValueError) as fault:
            raise self._damaged(fault) from None

    def _block(self, rows: slice, saved: IntArray, fields: slice) -> Block:
        history, time = self._file["history"], self._rows("history/time", rows)
        probes = Series(*(self._probes(history["probes"], series, rows) for series in SERIES))
        channels = [self._rows(f"history/channels/{name}", rows) for name, _ in self._outline.channels]
        angle = self._rows("history/cam_angle", rows)
        return Block(
            time=time, angle=angle, probes=probes, channels=np.column_stack([np.zeros((len(time), 0)), *channels]),
            field_time=time[saved], field_angle=angle[saved],
            fields=Series(*(self._unknowns(series, fields, getattr(probes, series)[saved]) for series in SERIES)),
        )  # fmt: skip

    def _rows(self, name: str, rows: slice) -> FloatArray:
        found = np.asarray(self._file[name][rows], dtype=float)
        if len(found) != rows.stop - rows.start:
            raise ValueError(f"{name} ends after {rows.start + len(found)} rows")
        return found

    def _probes(self, group: Any, series: str, rows: slice) -> FloatArray:  # noqa: ANN401 - h5py has no types
        parts = [self._rows(f"{group.name}/{name}/{series}", rows) for name, _ in self._outline.probes]
        return np.concatenate([np.zeros((rows.stop - rows.start, 0)), *parts], axis=1)

    def _unknowns(self, series: str, fields: slice, probes: FloatArray) -> FloatArray:
        """Return saved fields in the unknowns of the run: those of nodes, and behind them those that are probes."""
        nodes = len(self._geometry.mesh.nodes)
        data = self._file["VTKHDF/PointData"]
        node: IntArray = data["node"][()]
        rows = slice(fields.start * len(node), fields.stop * len(node))
        nodal = nodal_fields({name: data[name][rows] for name in vectors_of(series)}, node, nodes).reshape(-1, nodes, 6)
        beside = self._outline.unknowns[int(self._free.sum()) :]
        return np.concatenate([nodal[:, self._free], *(self._beside(name, probes) for name in beside)], axis=1)

    def _beside(self, name: str, probes: FloatArray) -> FloatArray:
        try:
            return probes[:, self._outline.columns(name)]
        except InputError:  # the inner parts of a spring lie still in a rigid train, which keeps none
            return np.zeros((len(probes), 1))

    def _damaged(self, fault: Exception) -> InputError:
        given, allowed = str(self._path), "a partial result of flexcam"
        return refuse("--resume", given, allowed, f"it is damaged: {fault}", _AGAIN)
