"""HDF5 files: growing datasets, texts of fixed length, one digest, and safe opening of files from elsewhere.

Texts have a fixed length: those of variable length lie on an HDF5 heap without a checksum, and a damaged heap can cause
an endless loop in HDF5. Every chunk has HDF5's own checksum (fletcher32), but names, attributes and the index have none
in the format that old readers support: a flipped bit could rename a probe, lose a unit, or make HDF5 read zeros. The
root therefore has one SHA-256 digest over everything in the file.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py  # pyright: ignore[reportMissingTypeStubs]
import numpy as np

from flexcam.core import FloatArray, IntArray
from flexcam.core.errors import Fault, InputError, format_shape, refuse, system_message
from flexcam.io.files import READ_ERRORS, file_size
from flexcam.io.result_schema import DIGEST, UNITS

_module: Any = h5py
_DATASET: Any = _module.h5d.DatasetID

_CHUNK_VALUES = 4096  # maximum number in a chunk, as far as blocks can be halved
_ROWS = 1 << 16  # read at a time for the digest
_LARGEST = 1e300  # absolute value that no number of a file reaches: units could not be converted
_REMEDY = "compute the result again, or restore the file from a copy"

SCALES = frozenset({"DIMENSION_LIST", "REFERENCE_LIST", "CLASS", "NAME"})
"""Attributes that attach dimension scales to datasets, for other readers; flexcam ignores them."""

_FILTERS = {_module.h5z.FILTER_DEFLATE, _module.h5z.FILTER_SHUFFLE, _module.h5z.FILTER_FLETCHER32}
_CHECKSUM_BYTES = 4

_ALLOWED_BYTES, _ALLOWED_RATIO = 1 << 28, 200
"""Limit of the declared size: bytes always allowed, plus a multiple of the file size, as constant data compress."""


def chunk_rows(rows: int, width: int) -> int:
    """Return the rows of a chunk: those of a block, halved while too many because the last chunk is stored in full."""
    while rows % 2 == 0 and rows * width > _CHUNK_VALUES:
        rows //= 2
    return rows


class GrowingDataset:
    """Empty dataset of one or `width` columns with an extensible first axis, in chunks that divide a block of `rows`.

    Rows are written without h5py's selections: a result has about a hundred such datasets that grow together.
    """

    def __init__(self, group: Any, name: str, rows: int, unit: str, *, width: int = 0, kind: str = "f8") -> None:  # noqa: ANN401 - h5py has no types
        self._columns = (width,) if width else ()
        self.dataset: Any = group.create_dataset(
            name, (0, *self._columns), kind, maxshape=(None, *self._columns), fletcher32=True,
            chunks=(chunk_rows(rows, width or 1), *self._columns), track_times=False,
        )  # fmt: skip
        self.dataset.attrs[UNITS] = encode(unit)
        self._length, self._kind = 0, kind

    def __len__(self) -> int:
        return self._length

    def append_empty(self, count: int) -> None:
        """Extend the dataset by rows of zeros, which take no space in the file."""
        self._length += count
        self.dataset.id.set_extent((self._length, *self._columns))

    def append(self, rows: FloatArray | IntArray) -> None:
        """Append rows of the width of the dataset."""
        first = self._length
        self.append_empty(len(rows))
        if len(rows):
            selection: Any = self.dataset.id.get_space()
            selection.select_hyperslab((first, *(0 for _ in self._columns)), rows.shape)
            values = np.ascontiguousarray(rows, dtype=self._kind)
            self.dataset.id.write(_module.h5s.create_simple(rows.shape), selection, values)


def create_fixed_dataset(group: Any, name: str, values: FloatArray | IntArray, unit: str = "") -> Any:  # noqa: ANN401
    """Return a new dataset of fixed size with its unit; an empty one has no chunks."""
    array = np.asarray(values)
    width = max(math.prod(array.shape[1:]), 1)
    chunk = (max(1, min(len(array), _CHUNK_VALUES // width)), *array.shape[1:])
    options = {"chunks": chunk, "fletcher32": True} if array.size else {}
    dataset = group.create_dataset(name, data=array, track_times=False, **options)
    dataset.attrs[UNITS] = encode(unit)
    return dataset


def encode(content: str | Sequence[str]) -> Any:  # noqa: ANN401 - an array
    """Return one or more texts as UTF-8 bytes of one length, for an attribute or a dataset."""
    single = isinstance(content, str)
    parts = [text.encode(errors="backslashreplace") for text in ([content] if single else content)]
    return np.array(parts[0] if single else parts, dtype=_module.string_dtype("utf-8", max([1, *map(len, parts)])))


def write_texts(group: Any, content: Mapping[str, str | Sequence[str]]) -> None:  # noqa: ANN401
    """Write texts into a group, a dataset per name of one text or several."""
    for name, text in content.items():
        group.create_dataset(name, data=encode(text), track_times=False)


def read_texts(group: Any) -> dict[str, str]:  # noqa: ANN401
    """Return the texts of a group by name."""
    return {name: read_text_column(item)[0] for name, item in group.items()}


def read_text_column(item: Any) -> list[str]:  # noqa: ANN401
    """Return the texts of a dataset, at least one of which is expected."""
    if not isinstance(item, _module.Dataset) or item.dtype.kind != "S" or not item.size:
        raise refuse(item.name, "numbers, a group or nothing", "texts", "", _REMEDY)
    return [bytes(text).decode(errors="replace") for text in np.atleast_1d(item[()])]


def read_text_attribute(one: Any, name: str) -> str:  # noqa: ANN401
    """Return the text of an attribute."""
    return bytes(one.attrs[name]).decode()


def read_text_list(one: Any, name: str) -> tuple[str, ...]:  # noqa: ANN401
    """Return the texts of an attribute."""
    return tuple(bytes(content).decode() for content in one.attrs[name])


def _walk(file: Any) -> Iterator[tuple[str, Any, bool]]:  # noqa: ANN401
    """Yield path and object of every link, group by group in order of names, and whether the object is new.

    The object is None for a link that leads to a path or to another file.
    """
    addresses: set[int] = set()
    groups = [("", file.id)]
    while groups:
        path, group = groups.pop()
        for name in sorted(group):
            link = group.links.get_info(name)
            hard = link.type == _module.h5l.TYPE_HARD
            item, new = _module.h5o.open(group, name) if hard else None, hard and int(link.u) not in addresses
            yield f"{path}/{name.decode()}", item, new
            if new:
                addresses.add(int(link.u))
                if not isinstance(item, _DATASET):
                    groups.append((f"{path}/{name.decode()}", item))


def _attribute_names(item: Any) -> list[str]:  # noqa: ANN401
    names: list[bytes] = []
    _module.h5a.iterate(item, names.append)
    return [name.decode() for name in sorted(names) if name.decode() not in SCALES]


def digest(file: Any) -> str:  # noqa: ANN401
    """Return the SHA-256 digest of a file; raise an error that names every dataset whose numbers cannot be read."""
    checksum, faults = hashlib.sha256(), list[Fault]()
    for part in _digest_input(file, faults):
        checksum.update(len(part).to_bytes(8, "little"))
        checksum.update(part)
    if faults:
        raise InputError(faults)
    return checksum.hexdigest()


def _digest_input(file: Any, faults: list[Fault]) -> Iterator[Any]:  # noqa: ANN401
    """Yield names, attributes and numbers; append the faults of damaged datasets."""
    yield from _attributes(file.id)
    for path, item, new in _walk(file):
        yield path.encode()
        if new:
            yield from _attributes(item)
        if new and isinstance(item, _DATASET):
            yield f"{item.dtype.str} {item.shape}".encode()
            dataset = _module.Dataset(item)
            rows = dataset.shape[0] if dataset.shape else 0
            try:
                for part in [slice(i, i + _ROWS) for i in range(0, rows, _ROWS)] if dataset.shape else [()]:
                    yield np.ascontiguousarray(dataset[part]).reshape(-1).view(np.uint8).data
            except READ_ERRORS:
                why = "they cannot be read, or do not match their checksum"
                faults.append(Fault(path, "damaged numbers", "intact numbers", why, _REMEDY))


def _attributes(item: Any) -> Iterator[bytes]:  # noqa: ANN401
    for name in _attribute_names(item):
        if name != DIGEST:
            attribute = _module.h5a.open(item, name.encode())
            value = np.empty(attribute.shape, attribute.dtype)
            attribute.read(value)
            yield f"{name} {value.dtype.kind} {value.shape} {value.tolist()!r}".encode()


def write_digest(file: Any) -> None:  # noqa: ANN401
    """Write the digest into a file open for writing."""
    file.attrs[DIGEST] = np.bytes_(digest(file).encode())


def check_digest(file: Any) -> None:  # noqa: ANN401
    """Raise an error if the content of a file does not match its digest."""
    if DIGEST not in file.attrs:
        raise refuse("/, seal", "nothing", "a seal", "without it the content may be damaged", _REMEDY)
    if bytes(file.attrs[DIGEST]).decode("ascii", "replace") != digest(file):
        why = "a number, a name, a unit, a text or a length has changed since the file was written"
        raise refuse("/, seal", "a seal that does not match", "an intact file", why, _REMEDY)


def read_numbers(item: Any, rows: int | slice | None = None, width: tuple[int, ...] = (), kind: str = "f8") -> Any:  # noqa: ANN401
    """Return rows of a dataset; raise an error for another type or shape, or a number that is not finite."""
    part = slice(rows) if isinstance(rows, int) else rows or slice(None)
    allowed = f"{np.dtype(kind)}, shape {format_shape((part.stop, *width))}"
    if not isinstance(item, _module.Dataset):
        raise refuse(item.name, "a group", allowed, "", _REMEDY)
    shape: tuple[int, ...] = item.shape or ()
    if item.dtype != kind or not shape or shape[1:] != width or not 0 <= (part.stop or 0) <= shape[0]:
        raise refuse(item.name, f"{item.dtype}, shape {format_shape(shape)}", allowed, "a count is wrong", _REMEDY)
    values = item[part]
    if not (np.abs(values) < _LARGEST).all():
        raise refuse(item.name, "a number that is not finite", "finite numbers", "", _REMEDY)
    return values


@contextmanager
def open_hdf5(path: Path, where: str, allowed: str, remedy: str = "") -> Generator[Any]:
    """Open a file for reading, reject unsafe content, and convert exceptions of the block into input errors."""
    try:
        size = file_size(path)
        with h5py.File(path, "r", locking=False) as opened:
            file: Any = opened
            if faults := list(_faults(file, size)):
                raise InputError(faults)
            yield file
    except InputError as refusal:
        faults = (replace(f, where=f"{path}, {f.where}") if f.where[:1] == "/" else f for f in refusal.faults)
        raise InputError(faults) from None
    except FileNotFoundError:
        raise refuse(where, str(path), allowed, "there is no such file", remedy) from None
    except MemoryError:
        allowed, why = "a file that fits into the free memory", "the file is larger"
        raise refuse(where, str(path), allowed, why, "free memory") from None
    except READ_ERRORS as fault:
        why = "it is damaged or not from flexcam"
        if isinstance(fault, OSError) and "signature" in str(fault):  # message of HDF5 for another kind of file
            why = "it is not an HDF5 file"
        elif "file locking flag" in str(fault):
            why, remedy = "this process has the file open in another way", remedy or "close it first"
        elif sizes := re.search(r"truncated file: eof = (\d+),.* stored_eof = (\d+)", str(fault)):
            why = f"it is incomplete: {sizes[1]} of {sizes[2]} bytes"
            remedy = remedy or "copy it again, or compute it again"
        elif isinstance(fault, OSError) and not re.match("Unable to|Can't", str(fault)):  # not a message of HDF5
            why = system_message(fault)
        raise refuse(where, str(path), allowed, why, remedy) from None


def _faults(file: Any, size: int) -> Iterator[Fault]:  # noqa: ANN401
    """Yield unsupported or unsafe content; a file with any is not read further."""
    declared, limit = 0, max(_ALLOWED_BYTES, _ALLOWED_RATIO * size)
    allowed, why = "numbers and texts of fixed length", "other content can lead to other files, load code or crash HDF5"
    for path, item, new in (("/", file.id, True), *_walk(file)):
        for given in _unsafe_contents(item, new):
            yield Fault(path, given, allowed, why, "if an earlier flexcam wrote it, compute it again")
        if new and isinstance(item, _DATASET):
            declared += math.prod(item.shape or (0,)) * item.dtype.itemsize
    if declared > limit:
        given, why = f"{declared:.3g} bytes declared in a file of {size}", "reading them would exhaust the memory"
        yield Fault("/", given, f"up to {limit:.3g} bytes", why, "flexcam writes no such file; use another one")


def _unsafe_contents(item: Any, new: bool) -> Iterator[str]:  # noqa: ANN401
    """Yield descriptions of what is unsafe in a link, group or dataset."""
    if item is None:
        yield "a soft link or an external link"
        return
    is_dataset = isinstance(item, _DATASET)
    if not new and not is_dataset:
        yield "a group that contains itself or occurs twice"
    for name in _attribute_names(item) if new else ():
        if _module.h5a.open(item, name.encode()).dtype.kind not in "fiubS":
            yield f"attribute {name}, a text of variable length or a reference"
    if not new or not is_dataset:
        return
    plist, chunks = item.get_create_plist(), list[Any]()
    if plist.get_layout() == _module.h5d.VIRTUAL or plist.get_external_count():
        yield "data stored in another file"
    filters = {plist.get_filter(i)[0] for i in range(plist.get_nfilters())}
    if filters - _FILTERS:
        yield f"filter {min(filters - _FILTERS)}"
    if item.dtype.kind not in "fiubS":
        yield "references" if _module.check_ref_dtype(item.dtype) else f"values of type {item.dtype}"
    if _module.h5z.FILTER_FLETCHER32 in filters:
        item.chunk_iter(chunks.append)
    if min((chunk.size for chunk in chunks), default=_CHECKSUM_BYTES) < _CHECKSUM_BYTES:
        yield "a chunk shorter than its checksum"
