"""Atomic writes: a file is written under a temporary name and renamed once it is complete."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path

from flexcam.dynamics import Cause, RunFailedError, Status


@contextmanager
def atomic_write_path(path: Path) -> Generator[Path]:
    """Yield a temporary path, which replaces the target file once the block completes without error."""
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


def lock_file(file: int) -> bool:
    """Lock an open file until the process ends or the descriptor is closed; raise BlockingIOError if it is locked.

    Without file locks (Windows, some network drives) return False; concurrent access is not prevented then.
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
def temporary_folder() -> Generator[Path]:
    """Yield a new temporary folder, removed at the end; first remove folders left by earlier processes of this user.

    Without file locks (Windows, some network drives) only the new folder is removed.
    """
    for left in Path(tempfile.gettempdir()).glob(f"{_PREFIX}*"):
        with suppress(OSError):  # locked or removed by another process
            _remove_stale(left)
    folder, lock = _locked_folder()
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        if lock is not None:
            os.close(lock)


def _remove_stale(folder: Path) -> None:
    """Remove a folder of this user that no process has locked."""
    lock = os.open(folder, _FLAGS)
    try:
        if os.fstat(lock).st_uid == os.getuid() and lock_file(lock):
            shutil.rmtree(folder, ignore_errors=True)
    finally:
        os.close(lock)


def _locked_folder() -> tuple[Path, int | None]:
    """Return a new folder and the descriptor of its lock; None without file locks."""
    while True:  # another process may remove the new folder before it is locked
        folder = Path(tempfile.mkdtemp(prefix=_PREFIX))
        try:
            lock = os.open(folder, _FLAGS)
        except FileNotFoundError:
            continue
        except OSError:  # this system cannot open folders
            return folder, None
        with suppress(BlockingIOError):
            lock_file(lock)
            if folder.exists():
                return folder, lock
        os.close(lock)
