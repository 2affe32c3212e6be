"""The rows of a dataset, held against the checksum that was taken while they were written."""

from __future__ import annotations

import zlib
from typing import Any

import numpy as np

from flexcam.checks import Fault, InputError, in_words
from flexcam.io.sealed import SUM

_REMEDY = "flexcam info FILE --verify names everything that is damaged; compute the result again"
_ROWS = 1 << 16
"""Rows that are read at a time where none are kept."""


def taken(dataset: Any, rows: int | None = None) -> Any:  # noqa: ANN401 - h5py has no types
    """Return the rows of a dataset if they are as they were written."""
    if rows is not None and (not dataset.shape or dataset.shape[0] < rows or rows < 0):
        raise InputError(
            [Fault(dataset.name, f"shape {in_words(dataset.shape)}", f"{rows} rows", "a count is wrong", _REMEDY)]
        )
    try:
        values = dataset[()]
    except OSError as fault:
        raise InputError([damaged(dataset, str(fault))]) from None
    if SUM in dataset.attrs and zlib.crc32(np.ascontiguousarray(values).data) != int(dataset.attrs[SUM]):
        raise InputError([damaged(dataset, "its rows are not those that were written")])
    return values if rows is None else values[:rows]


def damaged(dataset: Any, why: str) -> Fault:  # noqa: ANN401
    """Return the fault of a dataset whose numbers are not what they were."""
    return Fault(dataset.name, "damaged numbers", "numbers whose checksum fits", why, _REMEDY)


def held(dataset: Any) -> Fault | None:  # noqa: ANN401
    """Read a dataset in pieces, to its end."""
    found = 0
    for part in _in_parts(dataset):
        if part.dtype.kind == "f" and not np.isfinite(part).all():
            return Fault(dataset.name, "numbers that are not finite", "finite numbers", "flexcam writes no others", "")
        found = zlib.crc32(np.ascontiguousarray(part).data, found)
    if SUM in dataset.attrs and found != int(dataset.attrs[SUM]):
        return damaged(dataset, "its rows are not those that were written")
    return None


def _in_parts(one: Any) -> Any:  # noqa: ANN401 - an iterator over arrays
    if not one.shape:
        return iter([np.asarray(one[()])])
    return (one[first : first + _ROWS] for first in range(0, one.shape[0], _ROWS))
