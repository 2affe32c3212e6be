"""What checksums of HDF5 do not cover: names, types, attributes and texts, under one SHA-256, the seal of the file.

Numbers that grow have a checksum per chunk (fletcher32), but HDF5's own records have none in its oldest and best-known
format: a flipped byte would rename a probe, lose a unit or take a chunk for another. The seal is written twice: with
what is fixed when a file begins, and with everything when it is complete.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from typing import Any

import h5py  # pyright: ignore[reportMissingTypeStubs]
import numpy as np

from flexcam.checks import Fault
from flexcam.io.guard import SCALES, children

SEAL = "seal"
"""Attribute of the root that holds the digest, hexadecimal."""

_COUNTERS = frozenset({"steps", "NSteps"})
_ENDING = "status"
"""Attributes that change while a file grows, and the group that is written at its end."""

_module: Any = h5py


def digest(file: Any, *, complete: bool) -> str:  # noqa: ANN401 - h5py has no types
    """Return the SHA-256 of everything that no checksum covers.

    Parameters
    ----------
    file
        Of h5py.
    complete
        Whether lengths, counters and the status count, which change while a file grows.

    Returns
    -------
    str
        Hexadecimal.
    """
    sum_ = hashlib.sha256()
    for part in _parts(file, complete):
        sum_.update(len(part).to_bytes(8, "little") + part)
    return sum_.hexdigest()


def seal(file: Any, *, complete: bool) -> None:  # noqa: ANN401
    """Write the seal into a file that is open for writing.

    Parameters
    ----------
    file
        Of h5py.
    complete
        As for `digest`.
    """
    file.attrs[SEAL] = np.bytes_(digest(file, complete=complete).encode())


def seal_fault(file: Any, *, complete: bool) -> Fault | None:  # noqa: ANN401
    """Return what is wrong with the seal of a file; None if nothing is.

    Parameters
    ----------
    file
        Of h5py.
    complete
        As for `digest`.

    Returns
    -------
    Fault
        That there is no seal, or that what it covers is not what was written.
    """
    remedy = "compute it again, or take it from a sound copy"
    if SEAL not in file.attrs:
        return Fault("/, seal", "nothing", "the seal every such file has", "names and texts may be damaged", remedy)
    if bytes(file.attrs[SEAL]).decode("ascii", "replace") == digest(file, complete=complete):
        return None
    why = "a name, a unit, a text or a length is not what was written"
    return Fault("/, seal", "a seal that does not fit", "a file as it was written", why, remedy)


def _parts(file: Any, complete: bool) -> Iterator[bytes]:  # noqa: ANN401
    groups: list[Any] = [file]
    seen: set[int] = set()
    while groups:
        group = groups.pop()
        yield from _attributes(group, complete)
        for name, one in children(group):
            if group.name == "/" and name == _ENDING and not complete:
                continue
            yield f"{group.name}/{name}".encode()
            address = int(_module.h5o.get_info(one.id).addr)
            if address in seen:
                continue
            seen.add(address)
            if isinstance(one, _module.Dataset):
                yield from _dataset(one, complete)
            else:
                groups.append(one)


def _attributes(one: Any, complete: bool) -> Iterator[bytes]:  # noqa: ANN401
    for name in sorted(one.attrs):
        if name not in SCALES and name != SEAL and (complete or name not in _COUNTERS):
            value = np.asarray(one.attrs[name])
            yield f"{name} {value.dtype.kind} {value.shape} {value.tolist()!r}".encode()


def _dataset(one: Any, complete: bool) -> Iterator[bytes]:  # noqa: ANN401
    grows = one.maxshape is not None and None in one.maxshape
    shape = one.maxshape if grows and not complete else one.shape
    yield f"{one.dtype.str} {shape}".encode()
    yield from _attributes(one, complete)
    if not one.fletcher32 and one.size:
        value = np.asarray(one[()])
        yield repr(value.tolist()).encode() if one.dtype.kind == "O" else value.tobytes()
