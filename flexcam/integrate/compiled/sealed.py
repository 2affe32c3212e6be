"""Machine code that is kept, under a checksum: what a full disk cut short is compiled anew and never run.

The compiler reads what it kept without a check, and raises whatever reading raises.
"""

from __future__ import annotations

import pickle
from collections.abc import Mapping
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import Any

from numba.core.caching import IndexDataCacheFile  # pyright: ignore[reportMissingTypeStubs]

_SIZE = sha256().digest_size


class SealedFile(IndexDataCacheFile):  # pyright: ignore[reportUntypedBaseClass]
    """The files of one compiled function, each with the checksum of its content before it."""

    def save(self, key: object, data: object) -> None:
        """Keep a compiled function; without room for it, it is compiled again another time."""
        with suppress(OSError):
            super().save(key, data)  # pyright: ignore[reportUnknownMemberType]

    def _dump(self, obj: object) -> bytes:
        data: bytes = super()._dump(obj)  # pyright: ignore[reportUnknownMemberType]
        return sha256(data).digest() + data

    def _load_index(self) -> Mapping[object, str]:
        """Return the names of the files; none where the index is missing, spoiled or of other code."""
        try:
            with Path(self._index_path).open("rb") as file:
                if pickle.load(file) != self._version:  # noqa: S301 - of the user's own folder
                    return {}
                stamp, names = _opened(file.read())
        except (OSError, EOFError, pickle.UnpicklingError, ValueError):
            return {}
        return names if stamp == self._source_stamp else {}

    def _load_data(self, name: str) -> Any:  # noqa: ANN401
        return _opened((Path(self._cache_path) / name).read_bytes())  # pyright: ignore[reportUnknownArgumentType]


def _opened(data: bytes) -> Any:  # noqa: ANN401
    """Return what is under a checksum."""
    if sha256(data[_SIZE:]).digest() != data[:_SIZE]:
        message = "kept machine code is spoiled"
        raise OSError(message)  # by which the compiler knows that there is none
    return pickle.loads(data[_SIZE:])  # noqa: S301 - what this process's like has written, whole


def sealed(function: Any) -> Any:  # noqa: ANN401 - the compiler has no types
    """Return a compiled function that keeps its code under a checksum."""
    cache = function._cache
    cache._cache_file = SealedFile(cache._cache_path, cache._impl.filename_base, cache._impl.locator.get_source_stamp())
    return function
