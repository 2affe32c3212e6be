"""Folders of the system's temporary one that are wanted for a while: none is left for long, however a process ended.

A process holds the lock of its folder as long as it lives. What nobody holds was left by one that was killed, and goes
at the next start.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path

from flexcam.io.lock import hold

_PREFIX = "flexcam-scratch-"
_FLAGS = os.O_RDONLY | getattr(os, "O_DIRECTORY", 0) | getattr(os, "O_NOFOLLOW", 0)


@contextmanager
def scratch() -> Generator[Path]:
    """Give a new folder, which is removed at the end; those that processes of this user left behind are removed first.

    Where the system has no locks (Windows, some network drives), nothing is removed but the folder itself.
    """
    for left in Path(tempfile.gettempdir()).glob(f"{_PREFIX}*"):
        with suppress(OSError):  # somebody holds it, or removes it too
            _remove_left(left)
    folder, lock = _held()
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        if lock is not None:
            os.close(lock)


def _remove_left(folder: Path) -> None:
    """Remove a folder of this user that nobody holds."""
    lock = os.open(folder, _FLAGS)
    try:
        if os.fstat(lock).st_uid == os.getuid() and hold(lock):
            shutil.rmtree(folder, ignore_errors=True)
    finally:
        os.close(lock)


def _held() -> tuple[Path, int | None]:
    """Return a new folder and its lock; None where there are no locks."""
    while True:  # until one is held before another process takes it for one that was left
        folder = Path(tempfile.mkdtemp(prefix=_PREFIX))
        try:
            lock = os.open(folder, _FLAGS)
        except FileNotFoundError:
            continue
        except OSError:  # a folder cannot be opened on this system
            return folder, None
        with suppress(BlockingIOError):
            hold(lock)
            if folder.exists():
                return folder, lock
        os.close(lock)
