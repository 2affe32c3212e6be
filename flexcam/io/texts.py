"""Texts in HDF5 files, all of one fixed length: those of variable length stand on a heap that has no checksum.

A damaged heap can keep HDF5 in an endless loop, so that no reader here touches one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import h5py  # pyright: ignore[reportMissingTypeStubs]
import numpy as np

from flexcam.io.hdf5 import attribute, dataset, fill, text

_module: Any = h5py


def encoded(texts: Sequence[str]) -> Any:  # noqa: ANN401 - an array
    """Return texts as an array of UTF-8 of one length, as HDF5 takes it."""
    parts = [one.encode() for one in texts]
    return np.array(parts, dtype=_module.string_dtype("utf-8", max([1, *map(len, parts)])))


def texts(group: Any, content: Mapping[str, str]) -> None:  # noqa: ANN401 - h5py has no types
    """Write texts into a group, one dataset each."""
    for name, one in content.items():
        value = encoded([one]).reshape(())
        kind = text(value.dtype.itemsize)
        fill(dataset(group, name, kind, ()), value, kind)


def read_texts(group: Any) -> dict[str, str]:  # noqa: ANN401
    """Return the texts of a group, by name."""
    return {name: bytes(item[()]).decode() for name, item in group.items()}


def note(one: Any, name: str, content: str | Sequence[str]) -> None:  # noqa: ANN401
    """Write a text, or several, as an attribute."""
    values = encoded([content] if isinstance(content, str) else content)
    attribute(one, name, values.reshape(()) if isinstance(content, str) else values, text(values.dtype.itemsize))


def noted(one: Any, name: str) -> str:  # noqa: ANN401
    """Return the text of an attribute."""
    return bytes(one.attrs[name]).decode()


def notes(one: Any, name: str) -> tuple[str, ...]:  # noqa: ANN401
    """Return the texts of an attribute."""
    return tuple(bytes(content).decode() for content in one.attrs[name])
