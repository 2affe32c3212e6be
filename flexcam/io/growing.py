"""HDF5 datasets that grow block by block."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import h5py  # pyright: ignore[reportMissingTypeStubs]
import numpy as np

from flexcam.linalg import FloatArray, IntArray

_PACKED: dict[str, Any] = {"compression": "gzip", "compression_opts": 4, "shuffle": True, "fletcher32": True}
"""gzip with shuffle reads everywhere; the checksum refuses a flipped byte."""


def ordered(group: Any, name: str) -> Any:  # noqa: ANN401 - h5py has no types
    """Return a new group that keeps its members in the order they are made.

    Parameters
    ----------
    group
        Where it goes.
    name
        Of the new group.

    Returns
    -------
    Group
        Of h5py.
    """
    return group.create_group(name, track_order=True)


def growing(group: Any, name: str, rows: int, unit: str, *, width: int = 0, kind: str = "f8") -> Any:  # noqa: ANN401
    """Return a new, empty dataset whose first axis grows.

    Parameters
    ----------
    group
        Where it goes.
    name
        Of the dataset.
    rows
        Rows of a chunk: as many as a block brings, so that no block touches the chunk of another.
    unit
        Of its numbers.
    width
        Columns; 0 for a dataset of one axis.
    kind
        Type of its numbers.

    Returns
    -------
    Dataset
        Of h5py.
    """
    shape, limit, chunk = ((0, width), (None, width), (rows, width)) if width else ((0,), (None,), (rows,))
    dataset = group.create_dataset(name, shape, kind, maxshape=limit, chunks=chunk, **_PACKED)
    dataset.attrs["units"] = unit
    return dataset


def extend(dataset: Any, rows: FloatArray | IntArray) -> None:  # noqa: ANN401
    """Append rows to a dataset.

    Parameters
    ----------
    dataset
        Made by `growing`.
    rows
        As wide as the dataset.
    """
    first = dataset.shape[0]
    dataset.resize(first + len(rows), axis=0)
    if len(rows):
        dataset[first:] = rows


def fixed(group: Any, name: str, values: FloatArray | IntArray, unit: str = "") -> Any:  # noqa: ANN401
    """Return a new dataset that does not grow, with its unit.

    Parameters
    ----------
    group
        Where it goes.
    name
        Of the dataset.
    values
        Its numbers.
    unit
        Of its numbers.

    Returns
    -------
    Dataset
        Of h5py.
    """
    dataset = group.create_dataset(name, data=np.asarray(values))
    dataset.attrs["units"] = unit
    return dataset


def texts(group: Any, content: Mapping[str, str]) -> None:  # noqa: ANN401
    """Write texts into a group, one dataset each.

    Parameters
    ----------
    group
        Where they go.
    content
        Name to text.
    """
    for name, text in content.items():
        group.create_dataset(name, data=text, dtype=h5py.string_dtype())  # pyright: ignore[reportUnknownMemberType]
