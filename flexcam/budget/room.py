"""What there is of memory and disk."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from pathlib import Path

_UNLIMITED = 2**60
"""Bytes from which a control group's limit is none."""


def free_memory() -> int | None:
    """Return the memory that this process may still take, bytes; None where the system does not tell.

    The least of what the machine has to give (``MemAvailable`` of Linux, all of it elsewhere) and what the limits of
    control groups leave, as those of containers and batch systems.
    """
    return min([*_of_machine(), *of_groups(Path("/sys/fs/cgroup"), Path("/proc/self/cgroup"))], default=None)


def free_disk(folder: Path) -> int | None:
    """Return what is free where a folder is or will be made, bytes; None where the system does not tell."""
    there = next((one for one in (folder, *folder.absolute().parents) if one.is_dir()), None)
    try:
        return None if there is None else shutil.disk_usage(there).free
    except OSError:
        return None


def _of_machine() -> Iterator[int]:
    for line in _lines(Path("/proc/meminfo")):
        name, _, value = line.partition(":")
        if name == "MemAvailable":
            yield 1024 * int(value.split()[0])
            return
    names = getattr(os, "sysconf_names", {})
    if "SC_PHYS_PAGES" in names and "SC_PAGE_SIZE" in names:
        yield os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")


def of_groups(root: Path, own: Path) -> Iterator[int]:
    """Yield what the limits of this process's control groups leave, of either version."""
    for line in _lines(own):
        _, kinds, path = line.split(":", 2)
        version = ("", "memory.max", "memory.current")
        if kinds:
            version = ("memory", "memory.limit_in_bytes", "memory.usage_in_bytes")
        if version[0] not in kinds.split(","):
            continue
        folder = root / version[0] / path.strip("/")
        for one in (folder, *(above for above in folder.parents if above.is_relative_to(root))):
            limit, used = (next(_lines(one / name), "") for name in version[1:])
            if limit.isdecimal() and used.isdecimal() and int(limit) < _UNLIMITED:
                yield max(int(limit) - int(used), 0)


def _lines(file: Path) -> Iterator[str]:
    """Yield the lines of a file of the system; none where it is not there."""
    try:
        yield from file.read_text(encoding="ascii", errors="replace").splitlines()
    except OSError:
        return
