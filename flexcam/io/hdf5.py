"""Low-level access to HDF5: results have hundreds of datasets and attributes, and h5py's high-level calls are slow."""

from __future__ import annotations

import math
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any

import h5py  # pyright: ignore[reportMissingTypeStubs]
import numpy as np
from numpy.typing import NDArray

from flexcam.core.errors import Fault, InputError, refuse, system_message
from flexcam.io.paths import file_size

_module: Any = h5py

Shape = tuple[int, ...]


@lru_cache(maxsize=64)
def create_dataspace(shape: Shape, limit: tuple[int | None, ...] | None = None) -> Any:  # noqa: ANN401 - h5py has no types
    """Return an HDF5 data space."""
    if not shape:
        return _module.h5s.create(_module.h5s.SCALAR)
    most = None if limit is None else tuple(_module.h5s.UNLIMITED if one is None else one for one in limit)
    return _module.h5s.create_simple(shape, most)


def create_dataset(
    group: Any, name: str, kind: Any, shape: Shape, *, limit: tuple[int | None, ...] | None = None, chunk: Shape = (),  # noqa: ANN401
) -> Any:  # noqa: ANN401  # fmt: skip
    """Return a new, empty dataset: contiguous, or chunked with a checksum per chunk (fletcher32).

    Data are not compressed: gzip takes longer than a run and halves the file at best.
    """
    type_ = _number_type(kind) if isinstance(kind, str) else kind
    made = _module.h5d.create(
        group.id,
        name.encode(),
        type_,
        create_dataspace(shape, limit),
        _chunk_properties(chunk),
        _link_creation_properties(),
    )
    return _module.Dataset(made)


def write_dataset(made: Any, values: NDArray[Any], kind: Any = None) -> None:  # noqa: ANN401
    """Write all values of a dataset."""
    everything = create_dataspace(values.shape)
    made.id.write(everything, everything, values, kind)


def write_attribute(one: Any, name: str, values: NDArray[Any], kind: Any = None) -> None:  # noqa: ANN401
    """Write an attribute; an existing one of the same type and shape is overwritten."""
    key, owner = name.encode(), one.id
    if _module.h5a.exists(owner, key):
        held = _module.h5a.open(owner, key)
    else:
        held = _module.h5a.create(owner, key, kind or _number_type(values.dtype.str), create_dataspace(values.shape))
    held.write(values)


@lru_cache(maxsize=64)
def string_type(length: int) -> Any:  # noqa: ANN401
    """Return the HDF5 type of UTF-8 strings of a fixed length in bytes."""
    return _module.h5t.py_create(_module.string_dtype("utf-8", length), logical=True)


@lru_cache(maxsize=16)
def _number_type(kind: str) -> Any:  # noqa: ANN401
    return _module.h5t.py_create(np.dtype(kind), logical=True)


@lru_cache(maxsize=64)
def _chunk_properties(chunk: Shape) -> Any:  # noqa: ANN401
    made = _module.h5p.create(_module.h5p.DATASET_CREATE)
    made.set_obj_track_times(False)  # identical runs write identical bytes
    if chunk:
        made.set_chunk(chunk)
        made.set_fletcher32()
    return made


@lru_cache(maxsize=1)
def _link_creation_properties() -> Any:  # noqa: ANN401
    made = _module.h5p.create(_module.h5p.LINK_CREATE)
    made.set_create_intermediate_group(True)
    return made


_module_guard: Any = h5py

SCALES = frozenset({"DIMENSION_LIST", "REFERENCE_LIST", "CLASS", "NAME"})
"""Attributes that attach dimension scales to datasets, for other readers; flexcam ignores them."""

_FILTERS = {_module_guard.h5z.FILTER_DEFLATE, _module_guard.h5z.FILTER_SHUFFLE, _module_guard.h5z.FILTER_FLETCHER32}

_ALLOWED_BYTES, _ALLOWED_RATIO = 1 << 28, 200
"""Limit of the declared size: bytes always allowed, plus a multiple of the file size, as constant data compress."""

READ_ERRORS = (OSError, LookupError, ValueError, TypeError, AttributeError, RuntimeError, ArithmeticError, MemoryError)
"""Exceptions that h5py and numpy raise on damaged content."""


@contextmanager
def open_checked(path: Path, where: str, allowed: str, remedy: str = "") -> Generator[Any]:
    """Open a file for reading, reject external links, and convert exceptions of the block into input errors."""
    try:
        size = file_size(path)
        with h5py.File(path, "r", locking=False) as opened:
            file: Any = opened
            if faults := list(_faults(file, size)):
                raise InputError(faults)
            yield file
    except InputError as refusal:
        raise InputError(
            _in_file(fault, path) if fault.where.startswith("/") else fault for fault in refusal.faults
        ) from None
    except READ_ERRORS as fault:
        raise refuse(where, str(path), allowed, _describe_read_error(fault), remedy) from None


def _in_file(fault: Fault, path: Path) -> Fault:
    return Fault(f"{path}, {fault.where}", fault.given, fault.allowed, fault.why, fault.remedy)


def _describe_read_error(fault: Exception) -> str:
    if isinstance(fault, FileNotFoundError):
        return "there is no such file"
    return f"it is damaged or none of flexcam's: {_system_message(fault)}"


def _system_message(fault: Exception) -> str:
    return system_message(fault) or type(fault).__name__


def iterate_children(group: Any) -> Iterator[tuple[bytes, int, Any]]:  # noqa: ANN401 - h5py has no types
    """Yield name, type and object of every hard link of a group, in order of names."""
    for name, address in iterate_links(group):
        yield name, address, _module_guard.h5o.open(group, name)


def iterate_links(group: Any) -> Iterator[tuple[bytes, int]]:  # noqa: ANN401
    """Yield every hard link of a group, in order of names."""
    for name in sorted(group):
        link = group.links.get_info(name)
        if link.type == _module_guard.h5l.TYPE_HARD:
            yield name, int(link.u)


def datasets(file: Any) -> list[Any]:  # noqa: ANN401
    """Return all datasets of a file; a dataset with several names is listed once."""
    found: dict[int, Any] = {}
    groups = [file.id]
    while groups:
        for _, address, one in iterate_children(groups.pop()):
            if isinstance(one, _module_guard.h5d.DatasetID):
                found.setdefault(address, one)
            else:
                groups.append(one)
    return [_module_guard.Dataset(one) for one in found.values()]


def _faults(file: Any, size: int) -> Iterator[Fault]:  # noqa: ANN401
    """Yield unsupported or unsafe content; a file with any is not read further."""
    seen: set[int] = set()
    declared, limit = 0, max(_ALLOWED_BYTES, _ALLOWED_RATIO * size)
    groups = [file.id]
    while groups:
        group = groups.pop()
        yield from (*_external_link_faults(group), *_attribute_faults(group))
        for _, address, one in iterate_children(group):
            if isinstance(one, _module_guard.h5d.DatasetID):
                yield from () if address in seen else _dataset_faults(one)
                declared += 0 if address in seen else math.prod(one.shape or (0,)) * one.dtype.itemsize
            elif isinstance(one, _module_guard.h5g.GroupID) and address not in seen:
                groups.append(one)
            elif isinstance(one, _module_guard.h5g.GroupID):
                yield Fault(_name(one), "a group that contains itself or stands twice", "a tree of groups", "", "")
            seen.add(address)
    if declared > limit:
        given, why = f"{declared:.3g} bytes declared in a file of {size}", "so much of nothing fills the memory"
        yield Fault("/", given, f"up to {limit:.3g} bytes", why, "do not trust where it comes from")


def _name(one: Any) -> str:  # noqa: ANN401
    return _module_guard.h5i.get_name(one).decode()


def _external_link_faults(group: Any) -> Iterator[Fault]:  # noqa: ANN401
    kinds = {_module_guard.h5l.TYPE_SOFT: "a soft link", _module_guard.h5l.TYPE_EXTERNAL: "an external link"}
    for name in group:
        kind = group.links.get_info(name).type
        if kind != _module_guard.h5l.TYPE_HARD:
            given = kinds.get(kind, "a link of an unknown kind")
            where = f"{_name(group).rstrip('/')}/{name.decode()}"
            yield Fault(where, given, "what the file itself holds", "no link is followed", "")


def _dataset_faults(one: Any) -> Iterator[Fault]:  # noqa: ANN401
    made, kind = one.get_create_plist(), one.dtype
    if made.get_layout() == _module_guard.h5d.VIRTUAL or made.get_external_count():
        yield Fault(_name(one), "numbers of another file", "numbers in the file itself", "no other file is opened", "")
    filters = {made.get_filter(i)[0] for i in range(made.get_nfilters())}
    if filters - _FILTERS:
        given = f"filter {min(filters - _FILTERS)}"
        yield Fault(_name(one), given, "shuffle, gzip and fletcher32", "other filters are code that is loaded", "")
    if kind.kind not in "fiubS":
        given = "references" if _module_guard.check_ref_dtype(kind) else f"values of type {kind}"
        yield Fault(_name(one), given, _PLAIN, _OTHER_KINDS, _OLD_VERSION_REMEDY)
    yield from _attribute_faults(one)


_PLAIN = "numbers and texts of fixed length"
_OTHER_KINDS = "others can lead out of the file, or HDF5 into an endless loop"
_OLD_VERSION_REMEDY = "if an earlier flexcam wrote it, compute it again"


def _attribute_faults(one: Any) -> Iterator[Fault]:  # noqa: ANN401
    for name in attribute_names(one):
        if name.decode() not in SCALES and _module_guard.h5a.open(one, name).dtype.kind not in "fiubS":
            where = f"{_name(one).rstrip('/')}, attribute {name.decode()}"
            given = "a text of variable length or a reference"
            yield Fault(where, given, _PLAIN, _OTHER_KINDS, _OLD_VERSION_REMEDY)


def attribute_names(one: Any) -> list[bytes]:  # noqa: ANN401
    """Return the names of all attributes in order."""
    names: list[bytes] = []
    _module_guard.h5a.iterate(one, names.append)
    return sorted(names)
