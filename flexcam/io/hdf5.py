"""Datasets and attributes made by HDF5's own calls: a result has some hundred of each, and h5py's take longer."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import h5py  # pyright: ignore[reportMissingTypeStubs]
import numpy as np
from numpy.typing import NDArray

_module: Any = h5py

Shape = tuple[int, ...]


@lru_cache(maxsize=64)
def space(shape: Shape, limit: tuple[int | None, ...] | None = None) -> Any:  # noqa: ANN401 - h5py has no types
    """Return a data space of HDF5."""
    if not shape:
        return _module.h5s.create(_module.h5s.SCALAR)
    most = None if limit is None else tuple(_module.h5s.UNLIMITED if one is None else one for one in limit)
    return _module.h5s.create_simple(shape, most)


def dataset(
    group: Any, name: str, kind: Any, shape: Shape, *, limit: tuple[int | None, ...] | None = None, chunk: Shape = (),  # noqa: ANN401
) -> Any:  # noqa: ANN401  # fmt: skip
    """Return a new dataset, empty: in one piece, or in chunks, each with a checksum (fletcher32).

    Not compressed: gzip takes longer than a run does, and halves a file at best.
    """
    type_ = _number(kind) if isinstance(kind, str) else kind
    made = _module.h5d.create(group.id, name.encode(), type_, space(shape, limit), _chunked(chunk), _within())
    return _module.Dataset(made)


def fill(made: Any, values: NDArray[Any], kind: Any = None) -> None:  # noqa: ANN401
    """Write all of a dataset."""
    everything = space(values.shape)
    made.id.write(everything, everything, values, kind)


def attribute(one: Any, name: str, values: NDArray[Any], kind: Any = None) -> None:  # noqa: ANN401
    """Write an attribute, over an earlier one of the same type and shape."""
    key, owner = name.encode(), one.id
    if _module.h5a.exists(owner, key):
        held = _module.h5a.open(owner, key)
    else:
        held = _module.h5a.create(owner, key, kind or _number(values.dtype.str), space(values.shape))
    held.write(values)


@lru_cache(maxsize=64)
def text(length: int) -> Any:  # noqa: ANN401
    """Return the type of UTF-8 texts of so many bytes."""
    return _module.h5t.py_create(_module.string_dtype("utf-8", length), logical=True)


@lru_cache(maxsize=16)
def _number(kind: str) -> Any:  # noqa: ANN401
    return _module.h5t.py_create(np.dtype(kind), logical=True)


@lru_cache(maxsize=64)
def _chunked(chunk: Shape) -> Any:  # noqa: ANN401
    made = _module.h5p.create(_module.h5p.DATASET_CREATE)
    made.set_obj_track_times(False)  # the same run makes the same bytes
    if chunk:
        made.set_chunk(chunk)
        made.set_fletcher32()
    return made


@lru_cache(maxsize=1)
def _within() -> Any:  # noqa: ANN401
    made = _module.h5p.create(_module.h5p.LINK_CREATE)
    made.set_create_intermediate_group(True)
    return made
