"""Where the numbers of a dataset stand in the file: HDF5 reads zeros where a chunk is lost, and says nothing."""

from __future__ import annotations

from collections.abc import Iterable
from math import ceil, prod
from typing import Any

import numpy as np

from flexcam.checks import Fault, InputError
from flexcam.linalg import IntArray

_REMEDY = "flexcam info FILE --verify names everything that is damaged; compute the result again"


def taken(dataset: Any, rows: int | None = None) -> Any:  # noqa: ANN401 - h5py has no types
    """Return the first rows of a dataset, or all of it, if every chunk of them is there and as it was written.

    Parameters
    ----------
    dataset
        Of h5py.
    rows
        How many; None for all.

    Returns
    -------
    ndarray
        As h5py reads it.

    Raises
    ------
    InputError
        If it is shorter, a chunk of it is lost, or its checksum does not fit.

    Examples
    --------
    ``taken(file["history/time"], 100)`` are the first hundred instants.
    """
    if rows is not None and (not dataset.shape or dataset.shape[0] < rows or rows < 0):
        raise InputError([Fault(dataset.name, f"shape {dataset.shape}", f"{rows} rows", "it was cut off", _REMEDY)])
    if fault := lost(dataset, rows):
        raise InputError([fault])
    try:
        return dataset[()] if rows is None else dataset[:rows]
    except OSError as fault:
        raise InputError([damaged(dataset, fault)]) from None


def damaged(dataset: Any, fault: BaseException) -> Fault:  # noqa: ANN401
    """Return the fault of a dataset that cannot be read.

    Parameters
    ----------
    dataset
        Of h5py.
    fault
        What reading it raised.

    Returns
    -------
    Fault
        With its name.
    """
    return Fault(dataset.name, "damaged numbers", "numbers whose checksum fits", str(fault), _REMEDY)


def lost(dataset: Any, rows: int | None = None) -> Fault | None:  # noqa: ANN401
    """Return which of the chunks that hold the first rows are lost, doubled or written without their checksum.

    Parameters
    ----------
    dataset
        Of h5py.
    rows
        How many; None for all.

    Returns
    -------
    Fault or None
        None for a dataset without chunks.
    """
    if dataset.chunks is None:
        return None
    shape = dataset.shape if rows is None else (rows, *dataset.shape[1:])
    wanted = prod(ceil(length / step) for length, step in zip(shape, dataset.chunks, strict=True))
    found = {one.chunk_offset for one in _stored(dataset) if one.chunk_offset[0] < shape[0] and not one.filter_mask}
    if len(found) == wanted:
        return None
    given = f"{len(found)} of {wanted} chunks"
    return Fault(dataset.name, given, "all of them", "HDF5 would read zeros in their place", _REMEDY)


def _stored(dataset: Any) -> list[Any]:  # noqa: ANN401
    stored: list[Any] = []
    dataset.id.chunk_iter(stored.append)
    return stored


def doubly_used(datasets: Iterable[Any]) -> Fault | None:
    """Return whether two chunks claim the same bytes of a file, which a damaged index makes of two different ones.

    Parameters
    ----------
    datasets
        Of h5py, all of one file, each once.

    Returns
    -------
    Fault or None
        The fault of the file.
    """
    spans = [(one.byte_offset, one.size) for dataset in datasets if dataset.chunks for one in _stored(dataset)]
    if not spans:
        return None
    places: IntArray = np.array(spans, dtype=np.intp)
    places = places[np.argsort(places[:, 0], kind="stable")]
    if (places[:-1].sum(axis=1) <= places[1:, 0]).all():
        return None
    return Fault(
        "the whole file", "bytes that belong to two datasets", "each byte to one", "its index is damaged", _REMEDY
    )
