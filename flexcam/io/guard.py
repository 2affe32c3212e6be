"""Open HDF5 files of unknown origin: only what stands in the file itself is followed, and only plain numbers and texts.

HDF5 can lead out of a file (external and soft links, external storage, virtual datasets), run code (filters that are
loaded as plug-ins), and declare sizes that no file has. None of it is needed here, so none of it is taken.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py  # pyright: ignore[reportMissingTypeStubs]

from flexcam.checks import Fault, InputError, refuse, said
from flexcam.io.regular import size_of

_module: Any = h5py

SCALES = frozenset({"DIMENSION_LIST", "REFERENCE_LIST", "CLASS", "NAME"})
"""Attributes by which HDF5 joins an axis to its scale; written for other readers, never followed."""

_FILTERS = {_module.h5z.FILTER_DEFLATE, _module.h5z.FILTER_SHUFFLE, _module.h5z.FILTER_FLETCHER32}

_ALWAYS, _TIMES = 1 << 28, 200
"""Bytes that a file may always declare, and how many times its own size beyond them: a still motion compresses well."""

DAMAGE = (OSError, LookupError, ValueError, TypeError, AttributeError, RuntimeError, ArithmeticError, MemoryError)
"""What h5py and numpy raise on damaged content."""


@contextmanager
def guarded(path: Path, where: str, allowed: str, remedy: str = "") -> Generator[Any]:
    """Open a file for reading, refuse what leads out of it, and give whatever is raised within as a refusal."""
    try:
        size = size_of(path)
        with h5py.File(path, "r", locking=False) as opened:
            file: Any = opened
            if faults := list(_faults(file, size)):
                raise InputError(faults)
            yield file
    except InputError as refusal:
        raise InputError(
            _in_file(fault, path) if fault.where.startswith("/") else fault for fault in refusal.faults
        ) from None
    except DAMAGE as fault:
        raise refuse(where, str(path), allowed, _why(fault), remedy) from None


def _in_file(fault: Fault, path: Path) -> Fault:
    return Fault(f"{path}, {fault.where}", fault.given, fault.allowed, fault.why, fault.remedy)


def _why(fault: Exception) -> str:
    if isinstance(fault, FileNotFoundError):
        return "there is no such file"
    return f"it is damaged or none of flexcam's: {_said(fault)}"


def _said(fault: Exception) -> str:
    return said(fault) or type(fault).__name__


def children(group: Any) -> Iterator[tuple[bytes, int, Any]]:  # noqa: ANN401 - h5py has no types
    """Yield every hard link of a group with what it leads to, in order of names."""
    for name, address in links(group):
        yield name, address, _module.h5o.open(group, name)


def links(group: Any) -> Iterator[tuple[bytes, int]]:  # noqa: ANN401
    """Yield every hard link of a group, in order of names."""
    for name in sorted(group):
        link = group.links.get_info(name)
        if link.type == _module.h5l.TYPE_HARD:
            yield name, int(link.u)


def datasets(file: Any) -> list[Any]:  # noqa: ANN401
    """Return all datasets of a file, each once however many names it has."""
    found: dict[int, Any] = {}
    groups = [file.id]
    while groups:
        for _, address, one in children(groups.pop()):
            if isinstance(one, _module.h5d.DatasetID):
                found.setdefault(address, one)
            else:
                groups.append(one)
    return [_module.Dataset(one) for one in found.values()]


def _faults(file: Any, size: int) -> Iterator[Fault]:  # noqa: ANN401
    """Yield what is not taken; a file with any of it is not read further."""
    seen: set[int] = set()
    declared, limit = 0, max(_ALWAYS, _TIMES * size)
    groups = [file.id]
    while groups:
        group = groups.pop()
        yield from (*_leading_out(group), *_of_attributes(group))
        for _, address, one in children(group):
            if isinstance(one, _module.h5d.DatasetID):
                yield from () if address in seen else _of_dataset(one)
                declared += 0 if address in seen else math.prod(one.shape or (0,)) * one.dtype.itemsize
            elif isinstance(one, _module.h5g.GroupID) and address not in seen:
                groups.append(one)
            elif isinstance(one, _module.h5g.GroupID):
                yield Fault(_name(one), "a group that contains itself or stands twice", "a tree of groups", "", "")
            seen.add(address)
    if declared > limit:
        given, why = f"{declared:.3g} bytes declared in a file of {size}", "so much of nothing fills the memory"
        yield Fault("/", given, f"up to {limit:.3g} bytes", why, "do not trust where it comes from")


def _name(one: Any) -> str:  # noqa: ANN401
    return _module.h5i.get_name(one).decode()


def _leading_out(group: Any) -> Iterator[Fault]:  # noqa: ANN401
    kinds = {_module.h5l.TYPE_SOFT: "a soft link", _module.h5l.TYPE_EXTERNAL: "an external link"}
    for name in group:
        kind = group.links.get_info(name).type
        if kind != _module.h5l.TYPE_HARD:
            given = kinds.get(kind, "a link of an unknown kind")
            where = f"{_name(group).rstrip('/')}/{name.decode()}"
            yield Fault(where, given, "what the file itself holds", "no link is followed", "")


def _of_dataset(one: Any) -> Iterator[Fault]:  # noqa: ANN401
    made, kind = one.get_create_plist(), one.dtype
    if made.get_layout() == _module.h5d.VIRTUAL or made.get_external_count():
        yield Fault(_name(one), "numbers of another file", "numbers in the file itself", "no other file is opened", "")
    filters = {made.get_filter(i)[0] for i in range(made.get_nfilters())}
    if filters - _FILTERS:
        given = f"filter {min(filters - _FILTERS)}"
        yield Fault(_name(one), given, "shuffle, gzip and fletcher32", "other filters are code that is loaded", "")
    if kind.kind not in "fiubS":
        given = "references" if _module.check_ref_dtype(kind) else f"values of type {kind}"
        yield Fault(_name(one), given, _PLAIN, _OTHER_KINDS, _EARLIER)
    yield from _of_attributes(one)


_PLAIN = "numbers and texts of fixed length"
_OTHER_KINDS = "others can lead out of the file, or HDF5 into an endless loop"
_EARLIER = "if an earlier flexcam wrote it, compute it again"


def _of_attributes(one: Any) -> Iterator[Fault]:  # noqa: ANN401
    for name in attribute_names(one):
        if name.decode() not in SCALES and _module.h5a.open(one, name).dtype.kind not in "fiubS":
            where = f"{_name(one).rstrip('/')}, attribute {name.decode()}"
            given = "a text of variable length or a reference"
            yield Fault(where, given, _PLAIN, _OTHER_KINDS, _EARLIER)


def attribute_names(one: Any) -> list[bytes]:  # noqa: ANN401
    """Return the names of all attributes, in order."""
    names: list[bytes] = []
    _module.h5a.iterate(one, names.append)
    return sorted(names)
