"""Resume an incomplete run from its partial result."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from flexcam.core import FloatArray, IntArray
from flexcam.core.errors import InputError, refuse
from flexcam.dynamics import Block, Cause, Outline, SaveAt, Series, Status
from flexcam.dynamics.checkpoint import Checkpoint
from flexcam.io.hdf5 import open_checked
from flexcam.io.result_reader import check_integrity, nodal_values, read_status, verify_file
from flexcam.io.result_writer import SERIES, read_checkpoint
from flexcam.io.text_files import read_strings
from flexcam.io.vtk_groups import Geometry

_RESUME_REMEDY = "run the case again, with --overwrite"
_FAILED = (Cause.NOT_FINITE, Cause.NO_CONVERGENCE, Cause.SINGULAR, Cause.STEP_TOO_SMALL, Cause.ROUNDING)
"""Causes that would end a resumed run in the same way."""

_OPEN_MESSAGES = ("--resume", "a partial result of flexcam", _RESUME_REMEDY)


class PartialResult:
    """Partial result of an incomplete run.

    Parameters
    ----------
    path
        ``NAME.partial.vtkhdf``.
    geometry, outline, save
        As passed to the result file of the run.

    Attributes
    ----------
    about
        Texts stored with the result.
    status
        Status of the incomplete run.
    checkpoint
        Checkpoint at which the run continues.
    """

    def __init__(self, path: Path, geometry: Geometry, outline: Outline, save: SaveAt) -> None:
        self._path, self._geometry, self._outline, self._save = path, geometry, outline, save
        self._free = geometry.dofs.numbers >= 0
        with open_checked(path, *_OPEN_MESSAGES) as file:
            check_integrity(file, path)
            self.about: Mapping[str, str] = read_strings(file["about"])
            self.status: Status = read_status(file)
            found = read_checkpoint(file)
        if self.status.cause in _FAILED:
            given, why = f"{path}: {self.status.cause}", "it would end the same way again"
            raise refuse("--resume", given, "a run that was stopped or cut off", why, self.status.remedy)
        if found is None:
            why = "it broke off before the first block of its steps was saved"
            raise refuse("--resume", str(path), "a result with a checkpoint", why, _RESUME_REMEDY)
        self.checkpoint: Checkpoint = found

    def verify(self) -> None:
        """Read all datasets and verify their checksums."""
        verify_file(self._path)

    def blocks(self) -> Iterator[Block]:
        """Yield the blocks up to the checkpoint; only data read are verified, see `verify` for the rest."""
        size, field = self._save.block, 0
        with open_checked(self._path, *_OPEN_MESSAGES) as file:
            for first in range(0, self.checkpoint.steps, size):
                steps = np.arange(first, min(first + size, self.checkpoint.steps))
                saved = np.flatnonzero(steps % self._save.field_every == 0)  # does not include the last step of the run
                fields = slice(field, field + len(saved))
                yield self._block(file, slice(first, first + len(steps)), saved, fields)
                field += len(saved)

    def _block(self, file: Any, rows: slice, saved: IntArray, fields: slice) -> Block:  # noqa: ANN401 - h5py has no types
        history = file["history"]
        time, angle = _rows(history["time"], rows), _rows(history["cam_angle"], rows)
        probes = Series(*(self._probes(history["probes"], series, rows) for series in SERIES))
        channels = [_rows(history["channels"][name], rows) for name, _ in self._outline.channels]
        data = file["VTKHDF/PointData"]
        return Block(
            time=time, angle=angle, probes=probes, channels=np.column_stack([np.zeros((len(time), 0)), *channels]),
            field_time=time[saved], field_angle=angle[saved],
            fields=Series(*(self._unknowns(data, series, fields, getattr(probes, series)[saved]) for series in SERIES)),
        )  # fmt: skip

    def _probes(self, group: Any, series: str, rows: slice) -> FloatArray:  # noqa: ANN401
        parts = [_rows(group[name][series], rows) for name, _ in self._outline.probes]
        return np.concatenate([np.zeros((rows.stop - rows.start, 0)), *parts], axis=1)

    def _unknowns(self, data: Any, series: str, fields: slice, probes: FloatArray) -> FloatArray:  # noqa: ANN401
        """Return saved fields in the degrees of freedom of the run: nodal ones, then those recorded as probes."""
        node, nodes = self._geometry.node, len(self._geometry.mesh.nodes)
        which = slice(fields.start * len(node), fields.stop * len(node))
        nodal = nodal_values(lambda name: _rows(data[name], which), series, node, nodes).reshape(-1, nodes, 6)
        beside = self._outline.unknowns[int(self._free.sum()) :]
        return np.concatenate([nodal[:, self._free], *(self._internal_dofs(name, probes) for name in beside)], axis=1)

    def _internal_dofs(self, name: str, probes: FloatArray) -> FloatArray:
        try:
            return probes[:, self._outline.columns(name)]
        except InputError:  # internal nodes of a spring do not move in the rigid model and are not stored
            return np.zeros((len(probes), 1))


def _rows(dataset: Any, rows: slice) -> FloatArray:  # noqa: ANN401
    found = np.asarray(dataset[rows], dtype=float)
    if len(found) != rows.stop - rows.start:
        raise ValueError(f"{dataset.name} ends after {rows.start + len(found)} rows")
    return found
