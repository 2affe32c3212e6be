"""Whether what a run takes is there; refused with figures where it is not."""

from __future__ import annotations

from pathlib import Path

from flexcam.budget.needs import Budget
from flexcam.budget.room import free_disk, free_memory
from flexcam.checks import Fault, InputError
from flexcam.fem import Mesh

_SPARED = 0.9
"""Part of what is free that a run may take: others work on the machine, and estimates are estimates."""

_ELEMENT = 8000
"""Bytes that matrices, factor and start of a model take per element at least, measured from 3e3 to 2e5 elements."""

_SMALL = 1_000_000
"""Bytes of matrices for which nobody is asked: a run of a sweep takes little longer than to ask."""

_UNITS = ("B", "kB", "MB", "GB", "TB", "PB")

_LARGE = "or --allow-large to try it all the same"


def affordable(needs: Budget, folder: Path | None = None, *, together: int = 1) -> None:
    """Refuse a run for which there is no room."""
    faults = [_memory(needs, together), None if folder is None else _disk(needs, folder)]
    if found := [fault for fault in faults if fault]:
        raise InputError(found)


def affordable_mesh(mesh: Mesh) -> None:
    """Refuse a mesh for whose matrices there is no memory, before they are made."""
    count = sum(len(line) - 1 for line in mesh.lines.values())
    free = free_memory() if _ELEMENT * count > _SMALL else None
    if free is None or _ELEMENT * count <= _SPARED * free:
        return
    given = f"{count} elements, whose matrices take {size(_ELEMENT * count)}"
    remedy = "fewer elements, or flexcam run --allow-large to try it all the same"
    raise InputError([Fault("memory", given, f"up to {size(int(_SPARED * free))}", f"{size(free)} are free", remedy)])


def _memory(needs: Budget, together: int) -> Fault | None:
    free, asked = free_memory(), together * needs.memory
    if free is None or asked <= _SPARED * free:
        return None
    parts = {
        "programs": needs.machine,
        "matrices": needs.equations,
        "blocks of steps": needs.blocks,
        "histories": needs.histories,
    }
    told = ", ".join(f"{size(one)} of {name}" for name, one in parts.items())
    given = f"a run of {size(needs.memory)}: {told}" + (f"; {together} side by side" if together > 1 else "")
    remedy = f"fewer elements, steps or probes, fields saved more seldom (output.field_every), {_LARGE}"
    return Fault("memory", given, f"up to {size(int(_SPARED * free))}", f"{size(free)} are free", remedy)


def _disk(needs: Budget, folder: Path) -> Fault | None:
    free = free_disk(folder)
    if free is None or needs.file <= _SPARED * free:
        return None
    remedy = f"fewer steps or probes, fields saved more seldom (output.field_every), another disk (-o), {_LARGE}"
    given, allowed = f"a result file of {size(needs.file)}", f"up to {size(int(_SPARED * free))}"
    return Fault("disk", given, allowed, f"{size(free)} are free at {folder}", remedy)


def size(count: float) -> str:
    """Return bytes in words."""
    power = 0
    while count >= 1000.0 and power < len(_UNITS) - 1:
        count, power = count / 1000.0, power + 1
    return f"{count:.2g} {_UNITS[power]}" if count < 100.0 else f"{count:.0f} {_UNITS[power]}"
