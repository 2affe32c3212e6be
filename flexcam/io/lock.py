"""The lock of a file that one process at a time writes."""

from __future__ import annotations


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
