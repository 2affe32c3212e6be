"""A case as plain data: its text and the files it names, as they were when the sweep began, to be read anywhere."""

from __future__ import annotations

import atexit
import hashlib
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path, PurePosixPath
from typing import Any, cast

from flexcam.case import CaseFile
from flexcam.io import file_beside, scratch
from flexcam.sweep.plan import Plan

_LONGEST = 255
"""Letters of a file's name."""


@dataclass(frozen=True)
class Bundle:
    """A case file and every file beside it that it names.

    Parameters
    ----------
    name
        Of the case file.
    digest
        A number that tells it from any other.
    files
        Path from the case file's folder, with ``/``, to what the file holds; the case itself among them.
    runs
        How many variants of it are to be run in all: the more, the sooner machine code pays.
    channels
        Whether contacts, members and energies are asked for; else runs compute the motion of the probes alone.
    """

    name: str
    digest: str
    files: Mapping[str, bytes] = field(compare=False)
    runs: int = 1
    channels: bool = True

    def unpacked(self, folder: Path) -> Path:
        """Write the files into a folder, placed to each other as they were, and return the case file."""
        ups = max(PurePosixPath(path).parts.count("..") for path in self.files)
        home = folder.joinpath(*["up"] * ups)
        for path, content in self.files.items():
            target = Path(os.path.normpath(home / path))
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(content)
        return home / self.name


def bundle_of(file: CaseFile, plan: Plan | None = None) -> Bundle:
    """Return a case as plain data."""
    given = [value.text.strip("\"'") for one in plan.axes for value in one.values] if plan else []
    files = {file.path.name: file.text.encode()}
    for text in dict.fromkeys([*_texts(file.raw), *given]):
        if len(text) <= _LONGEST and not os.path.isabs(text) and (found := file_beside(file.path, text)):
            files[PurePosixPath(Path(os.path.normpath(text))).as_posix()] = found.read_bytes()
    return Bundle(file.path.name, _digest(files), files, len(plan) if plan else 1)


def _digest(files: Mapping[str, bytes]) -> str:
    found = hashlib.sha256()
    for path, content in sorted(files.items()):
        found.update(f"{path} {len(content)}\n".encode())
        found.update(content)
    return found.hexdigest()


def _texts(raw: object) -> Iterator[str]:
    """Yield every text of a table."""
    if isinstance(raw, str):
        yield raw
    elif isinstance(raw, Mapping):
        for value in cast("Mapping[str, Any]", raw).values():
            yield from _texts(value)
    elif isinstance(raw, Sequence):
        for value in cast("Sequence[Any]", raw):
            yield from _texts(value)


@lru_cache(maxsize=1)
def opened(source: Bundle | Path) -> CaseFile:
    """Return the case file of a bundle, unpacked once per process, or of a path."""
    if isinstance(source, Path):
        return CaseFile.opened(source)
    return CaseFile.opened(source.unpacked(_folders.enter_context(scratch())))


_folders = ExitStack()
"""Folders that are removed when the process ends."""

atexit.register(_folders.close)
