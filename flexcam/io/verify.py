"""Read everything in a file and say whether it is as it was written."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flexcam.checks import Fault, InputError
from flexcam.io.extents import damaged, doubly_used, lost
from flexcam.io.guard import DAMAGE, datasets, guarded
from flexcam.io.kept_state import CHECKPOINT
from flexcam.io.sealed import SEAL, seal_fault

_ROWS = 1 << 16
"""Rows that are read at a time."""


@dataclass(frozen=True)
class Verified:
    """What was read of a sound file.

    Parameters
    ----------
    datasets
        How many.
    checked
        How many of them have a checksum of their own; the seal covers the others.
    bytes
        Of their numbers and texts.
    sealed
        Whether the file has a seal over its names, units, texts and lengths.
    complete
        Whether the run that wrote it came to its end and said so.
    """

    datasets: int
    checked: int
    bytes: int
    sealed: bool
    complete: bool


def verified(path: str | Path) -> Verified:
    """Read every dataset of a result, and the table of a sweep, to the last byte.

    Parameters
    ----------
    path
        A ``.vtkhdf`` or ``.h5`` file that flexcam wrote.

    Returns
    -------
    Verified
        What was read.

    Raises
    ------
    InputError
        With a fault for every dataset that is damaged, and for the seal.

    Examples
    --------
    ``verified("results/model-3-shm.vtkhdf").datasets``
    """
    source = Path(path)
    with guarded(source, "result", "a result file of flexcam (.vtkhdf) or the table of a sweep (.h5)") as file:
        sealed, complete = SEAL in file.attrs or _form(file) > 1, "history" not in file or "status" in file
        found = datasets(file)
        if faults := list(_faults(file, found, sealed, complete)):
            raise InputError(faults)
        checked = sum(bool(one.fletcher32) for one in found)
        return Verified(len(found), checked, sum(int(one.nbytes) for one in found), sealed, complete)


def _faults(file: Any, found: list[Any], sealed: bool, complete: bool) -> Iterator[Fault]:  # noqa: ANN401
    whole = [seal_fault(file, complete=complete) if sealed else None, doubly_used(found)]
    yield from (fault for fault in whole if fault)
    for one in found:
        rows = None if complete else _counted(file, one)
        missing = lost(one, rows) if rows != 0 and not _empty_by_design(one) else None
        yield from [missing] if missing else _unreadable(one, rows)


def _form(file: Any) -> int:  # noqa: ANN401
    if "format" not in file["about"]:  # modes
        return 0
    return int(np.ravel(file["about/format"].asstr()[()])[0])


def _empty_by_design(one: Any) -> bool:  # noqa: ANN401
    """Tell whether a dataset is one of VTK's offsets that are zero at every step and take no room."""
    return str(one.name).startswith("/VTKHDF/Steps/") and one.chunks is not None and not one.id.get_num_chunks()


def _counted(file: Any, one: Any) -> int | None:  # noqa: ANN401
    """Return how many rows of a dataset count in a file that still grows; None for all."""
    if one.maxshape is None or None not in one.maxshape or one.name == f"/{CHECKPOINT}":
        return None
    if one.name.startswith("/history/"):
        return int(file["history"].attrs["steps"])
    fields = int(file["VTKHDF/Steps"].attrs["NSteps"])
    per_field = int(file["VTKHDF/NumberOfPoints"][0]) if one.name.startswith("/VTKHDF/PointData/") else 1
    return min(fields, len(file["VTKHDF/Steps/Values"])) * per_field


def _unreadable(one: Any, rows: int | None) -> Iterator[Fault]:  # noqa: ANN401
    """Yield the fault of a dataset that cannot be read, or holds what no result may hold."""
    try:
        for part in _in_parts(one, rows):
            if part.dtype.kind == "f" and not np.isfinite(part).all():
                yield Fault(one.name, "numbers that are not finite", "finite numbers", "flexcam writes no others", "")
                return
    except DAMAGE as fault:
        yield damaged(one, fault)


def _in_parts(one: Any, rows: int | None) -> Iterator[Any]:  # noqa: ANN401
    if not one.shape:
        yield np.asarray(one[()])
        return
    last = one.shape[0] if rows is None else rows
    yield from (one[first : min(first + _ROWS, last)] for first in range(0, last, _ROWS))
