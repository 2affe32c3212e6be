"""Files that are there whole or not at all: written beside their place, and moved there once they are complete."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path

from flexcam.dynamics import Cause, RunFailedError, Status


@contextmanager
def whole(path: Path) -> Generator[Path]:
    """Give a name to write to; what is written takes the place of a file when all of it is there."""
    draft = path.with_name(f".flexcam-{os.getpid()}{path.suffix}") if path.is_file() or not path.exists() else path
    try:
        yield draft
        if draft != path:
            draft.replace(path)
    except OSError as fault:
        text = f"{path} could not be written: {fault.strerror or fault}"
        raise RunFailedError(Status(Cause.NOT_SAVED, text, "free space, or name another file or folder")) from None
    finally:
        if draft != path:
            with suppress(OSError):
                draft.unlink(missing_ok=True)


def hold(file: int) -> bool:
    """Take the lock of an open file; it ends with the process, however that ends, or with the descriptor.

    Where there are no such locks nobody is kept out: on some network drives, and where the system has none (Windows).
    """
    try:
        import fcntl
    except ImportError:
        return False
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise
    except OSError:
        return False
    return True


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
