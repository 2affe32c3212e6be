"""A file in the making: written under one name, shown under another as whole copies, so that no reader sees half of it.

A process that is killed while HDF5 writes its index leaves a file that cannot be read. Nobody reads ``NAME.writing``
therefore: at times it is copied, and the copy takes the place of ``NAME.partial.vtkhdf`` in one step, which happens or
does not. The copies take a fiftieth of the time of a run at most, however large the file becomes.
"""

from __future__ import annotations

import os
import re
import shutil
import time
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path

from flexcam.checks import refuse, said
from flexcam.io.lock import hold

_SHARE = 0.02
"""Part of the time of a run that copies may take."""

_SPARE = 2
"""Times the size of the file that must be free for a copy: what is still to be written needs room too."""

_LAID_OUT = 1 << 19
"""Bytes that a file takes before its first step, with room to spare for a few hundred nodes."""


class Draft:
    """A file that one process at a time writes.

    Parameters
    ----------
    path
        Where it is written.
    shown
        Where copies of it are shown.
    """

    def __init__(self, path: Path, shown: Path) -> None:
        self.path, self._shown, self._copy = path, shown, path.with_suffix(".copying")
        if path.is_symlink():
            allowed, why = "a file of its own", "a symbolic link stands there: what it leads to would be written over"
            raise refuse("result", str(path), allowed, why, "remove the link, or name another folder")
        try:
            self._held = _locked(path)
            self._try()
        except BlockingIOError:
            allowed, why = "a result that nobody else is writing", "another run is writing it now"
            raise refuse("result", str(shown), allowed, why, "wait for its end, or name another folder") from None
        except OSError as fault:
            allowed, remedy = "a file that can be written", "free space or name another folder"
            raise refuse("result", str(path), allowed, said(fault), remedy) from None
        self._last, self._cost = time.perf_counter(), 0.0

    def _try(self) -> None:
        """Find out now whether the disk is full: HDF5 does not survive that while it lays out a file."""
        try:
            done = 0
            while done < _LAID_OUT:  # what does not fit is cut off without a word; behind it the system says why
                done += os.pwrite(self._held, bytes(_LAID_OUT - done), done)
            os.truncate(self._held, 0)
        except OSError:
            self.discard()
            raise

    def begin(self) -> None:
        """Say that the file is laid out: the first copy is taken to cost as much as that."""
        now = time.perf_counter()
        self._last, self._cost = now, now - self._last

    @property
    def due(self) -> bool:
        """Whether it is time for a copy."""
        return self._cost <= _SHARE * (time.perf_counter() - self._last)

    def show(self, prepared: float | None = None) -> None:
        """Show a copy of what is written by now; without room for it the last one stays."""
        began = time.perf_counter() if prepared is None else prepared
        try:
            if shutil.disk_usage(self.path.parent).free > _SPARE * self.path.stat().st_size:
                self._copy.unlink(missing_ok=True)  # a link there would lead the copy elsewhere
                shutil.copyfile(self.path, self._copy)
                os.replace(self._copy, self._shown)
        except OSError:  # the run itself may still find the room that its copy does not
            with suppress(OSError):
                self._copy.unlink(missing_ok=True)
        self._last = time.perf_counter()
        self._cost = self._last - began

    def become(self, path: Path) -> None:
        """Take a name for good, once the disk has it all; nothing else may follow."""
        try:
            os.fsync(self._held)
            os.replace(self.path, path)
            _sync_folder(path.parent)
        finally:
            self._release()

    def discard(self) -> None:
        """Remove what is written; what was shown stays."""
        with suppress(OSError):
            self.path.unlink(missing_ok=True)
        self._release()

    def _release(self) -> None:
        with suppress(OSError):
            self._copy.unlink(missing_ok=True)
        os.close(self._held)


def _sync_folder(folder: Path) -> None:
    """Have the disk keep the names in a folder; Windows has no such call, and some network drives refuse it."""
    with suppress(OSError):
        held = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(held)
        finally:
            os.close(held)


def _locked(path: Path) -> int:
    """Return a descriptor that holds the lock of a file, which ends with the process however that ends."""
    while True:
        held = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            hold(held)
            with suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(held), path.stat()):
                    return held
        except OSError:
            os.close(held)
            raise
        os.close(held)  # its process gave it a name meanwhile; ours is another file


@contextmanager
def plainly() -> Generator[None]:
    """Say in the system's own words why a file cannot be written; HDF5 tells addresses and buffers as well."""
    try:
        yield
    except (OSError, RuntimeError) as fault:
        told = _SYSTEM.search(str(fault))
        raise OSError(os.strerror(int(told[1])) if told else str(fault).partition(" (")[0]) from None


_SYSTEM = re.compile(r"errno = (\d+)")
"""What the system said, within what HDF5 says."""
