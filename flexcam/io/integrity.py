"""Checksums of a result file.

The root has one SHA-256 digest over names, types, lengths, attributes and texts, and over the checksums of all numeric
datasets. HDF5 stores a checksum per chunk (fletcher32), but its metadata have none in the oldest and most compatible
format: a flipped bit could rename a probe, lose a unit or point to another chunk, even to zeros with a valid checksum.
Every numeric dataset therefore has a CRC-32 over all its rows as an attribute, computed while it is written, and the
digest covers these values.
"""

from __future__ import annotations

import hashlib
import zlib
from collections.abc import Iterator
from typing import Any

import h5py  # pyright: ignore[reportMissingTypeStubs]
import numpy as np
from numpy.typing import NDArray

from flexcam.core.errors import Fault, InputError, format_shape
from flexcam.io.hdf5 import SCALES, attribute_names, iterate_links, write_attribute

DIGEST = "seal"
"""Root attribute with the digest, hexadecimal."""

CHECKSUM = "crc32"
"""Dataset attribute with the CRC-32 of its rows."""

_EXCLUDED = frozenset(name.encode() for name in (*SCALES, DIGEST))

_module: Any = h5py


def write_checksum(dataset: Any, value: int) -> None:  # noqa: ANN401 - h5py has no types
    """Write the CRC-32 of a dataset."""
    write_attribute(dataset, CHECKSUM, np.array(value, np.uint32))


def digest(file: Any) -> str:  # noqa: ANN401
    """Return the SHA-256 digest of a file; numeric datasets enter by their CRC-32."""
    sum_ = hashlib.sha256()
    for part in _digest_input(file):
        sum_.update(len(part).to_bytes(8, "little") + part)
    return sum_.hexdigest()


def write_digest(file: Any) -> None:  # noqa: ANN401
    """Write the digest into a file open for writing."""
    file.attrs[DIGEST] = np.bytes_(digest(file).encode())


def digest_fault(file: Any) -> Fault | None:  # noqa: ANN401
    """Return the fault of the digest of a file; None if it is correct."""
    remedy = "compute it again, or take it from a sound copy"
    if DIGEST not in file.attrs:
        return Fault("/, seal", "nothing", "the seal every such file has", "names and texts may be damaged", remedy)
    if bytes(file.attrs[DIGEST]).decode("ascii", "replace") == digest(file):
        return None
    why = "a name, a unit, a text or a length is not what was written"
    return Fault("/, seal", "a seal that does not fit", "a file as it was written", why, remedy)


def _digest_input(file: Any) -> Iterator[bytes]:  # noqa: ANN401
    groups: list[tuple[Any, bytes]] = [(file.id, b"")]
    seen: set[int] = set()
    while groups:
        group, path = groups.pop()
        yield from _attributes(group)
        for name, address in iterate_links(group):
            yield (path or b"/") + b"/" + name
            if address in seen:
                continue
            seen.add(address)
            one = _module.h5o.open(group, name)
            if isinstance(one, _module.h5d.DatasetID):
                yield from _dataset(one)
            else:
                groups.append((one, path + b"/" + name))


def _attributes(one: Any) -> Iterator[bytes]:  # noqa: ANN401
    for name in attribute_names(one):
        if name not in _EXCLUDED:
            value = _value(_module.h5a.open(one, name))
            yield f"{name.decode()} {value.dtype.kind} {value.shape} {value.tolist()!r}".encode()


def _value(attribute: Any) -> NDArray[Any]:  # noqa: ANN401
    value = np.empty(attribute.shape, attribute.dtype)
    attribute.read(value)
    return value


def _dataset(one: Any) -> Iterator[bytes]:  # noqa: ANN401
    yield f"{one.dtype.str} {one.shape}".encode()
    yield from _attributes(one)
    if not _module.h5a.exists(one, CHECKSUM.encode()):
        whole = np.empty(one.shape, one.dtype)
        if whole.size:
            one.read(_module.h5s.ALL, _module.h5s.ALL, whole)
            yield whole.tobytes()


_REMEDY = "flexcam info FILE --verify names everything that is damaged; compute the result again"
_ROWS = 1 << 16
"""Rows read at a time from contiguous datasets."""


def read_rows(dataset: Any, rows: int | None = None) -> Any:  # noqa: ANN401 - h5py has no types
    """Return the rows of a dataset after verifying their checksum."""
    if rows is not None and (not dataset.shape or dataset.shape[0] < rows or rows < 0):
        raise InputError(
            [Fault(dataset.name, f"shape {format_shape(dataset.shape)}", f"{rows} rows", "a count is wrong", _REMEDY)]
        )
    try:
        values = dataset[()]
    except OSError as fault:
        raise InputError([damage_fault(dataset, str(fault))]) from None
    if CHECKSUM in dataset.attrs and zlib.crc32(np.ascontiguousarray(values).data) != int(dataset.attrs[CHECKSUM]):
        raise InputError([damage_fault(dataset, "its rows are not those that were written")])
    return values if rows is None else values[:rows]


def damage_fault(dataset: Any, why: str) -> Fault:  # noqa: ANN401
    """Return the fault of a dataset with damaged numbers."""
    return Fault(dataset.name, "damaged numbers", "numbers whose checksum fits", why, _REMEDY)


def dataset_fault(dataset: Any) -> Fault | None:  # noqa: ANN401
    """Return the fault of a dataset, read in pieces; None if it is sound."""
    found = 0
    for part in _iterate_rows(dataset):
        if part.dtype.kind == "f" and not np.isfinite(part).all():
            return Fault(dataset.name, "numbers that are not finite", "finite numbers", "flexcam writes no others", "")
        found = zlib.crc32(np.ascontiguousarray(part).data, found)
    if CHECKSUM in dataset.attrs and found != int(dataset.attrs[CHECKSUM]):
        return damage_fault(dataset, "its rows are not those that were written")
    return None


def _iterate_rows(one: Any) -> Any:  # noqa: ANN401 - an iterator over arrays
    if not one.shape:
        return iter([np.asarray(one[()])])
    return (one[first : first + _ROWS] for first in range(0, one.shape[0], _ROWS))
