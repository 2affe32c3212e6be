"""Growing HDF5 datasets."""

from __future__ import annotations

import zlib
from typing import Any

import numpy as np

from flexcam.core import FloatArray, IntArray
from flexcam.io.hdf5 import create_dataset, create_dataspace, write_dataset
from flexcam.io.integrity import write_checksum
from flexcam.io.text_files import write_string_attribute

_MAX_CHUNK_SIZE = 4096
"""Maximum number of values in a chunk, as far as blocks can be halved."""


def chunk_rows(rows: int, width: int) -> int:
    """Return the rows of a chunk: those of a block, halved while too many because the last chunk is stored in full."""
    while rows % 2 == 0 and rows * width > _MAX_CHUNK_SIZE:
        rows //= 2
    return rows


def _chunk_shape(shape: tuple[int, ...]) -> tuple[int, ...]:
    """Return the chunk shape of a fixed dataset: as many full rows as one chunk may contain."""
    width = int(np.prod(shape[1:], dtype=int))
    return (max(1, min(shape[0], _MAX_CHUNK_SIZE // max(width, 1))), *shape[1:])


def create_ordered_group(group: Any, name: str) -> Any:  # noqa: ANN401 - h5py has no types
    """Return a new group that preserves the creation order of its members."""
    return group.create_group(name, track_order=True)


class GrowingDataset:
    """Empty dataset with an extensible first axis.

    Rows are written without h5py's selections and look-ups: a result has about forty such datasets that grow together.

    Parameters
    ----------
    group
        Parent group.
    name
        Name of the dataset.
    rows
        Rows per block: chunks divide a block, so that no two blocks share a chunk.
    unit
        Unit of the values.
    width
        Number of columns; 0 for a one-dimensional dataset.
    kind
        Data type of the values.
    """

    def __init__(self, group: Any, name: str, rows: int, unit: str, *, width: int = 0, kind: str = "f8") -> None:  # noqa: ANN401
        self._columns = (width,) if width else ()
        shape, limit = (0, *self._columns), (None, *self._columns)
        chunk = (chunk_rows(rows, width or 1), *self._columns)
        self.dataset: Any = create_dataset(group, name, kind, shape, limit=limit, chunk=chunk)
        write_string_attribute(self.dataset, "units", unit)
        self._length, self._kind, self._sum = 0, kind, 0
        self.write_checksum()

    def __len__(self) -> int:
        return self._length

    def append_zeros(self, count: int) -> None:
        """Append rows of zeros, which take no space in the file."""
        self.append_empty(count)
        self._sum = zlib.crc32(np.zeros((count, *self._columns), self._kind).data, self._sum)

    def append_empty(self, count: int) -> None:
        """Extend the dataset by empty rows."""
        self._length += count
        self.dataset.id.set_extent((self._length, *self._columns))

    def append(self, rows: FloatArray | IntArray) -> None:
        """Append rows of the width of the dataset."""
        first = self._length
        self.append_empty(len(rows))
        if len(rows):
            there: Any = self.dataset.id.get_space()
            there.select_hyperslab((first, *(0 for _ in self._columns)), rows.shape)
            values = np.ascontiguousarray(rows, dtype=self._kind)
            self._sum = zlib.crc32(values.data, self._sum)
            self.dataset.id.write(create_dataspace(rows.shape), there, values)

    def write_checksum(self) -> None:
        """Write the checksum of all rows."""
        write_checksum(self.dataset, self._sum)


def create_fixed_dataset(group: Any, name: str, values: FloatArray | IntArray, unit: str = "") -> Any:  # noqa: ANN401
    """Return a new dataset of fixed size with its unit."""
    array = np.ascontiguousarray(values)
    chunk = _chunk_shape(array.shape) if array.size else ()  # an empty dataset has no chunks
    made = create_dataset(group, name, array.dtype.str, array.shape, chunk=chunk)
    if array.size:
        write_dataset(made, array)
    write_string_attribute(made, "units", unit)
    write_checksum(made, zlib.crc32(array.data))
    return made
