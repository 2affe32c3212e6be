"""Memory and disk space: available and required by a run."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from flexcam.core import DENSE_LIMIT
from flexcam.core.errors import Fault, InputError
from flexcam.dynamics import Method, Problem, SaveAt, integrated_size, outline
from flexcam.dynamics.engine_selection import MAX_MODES, candidate_engines
from flexcam.dynamics.solve import AT_ONCE, LEAST_AT_ONCE
from flexcam.fem.mesh import Mesh
from flexcam.io import RECOVERED_FIELDS, VECTORS, count_output_points, result_bytes

_UNLIMITED = 2**60
"""Bytes from which the limit of a control group means unlimited."""


def free_memory() -> int | None:
    """Return the memory available to this process, bytes; None if the system does not report it.

    Minimum of the memory available on the machine (``MemAvailable`` of Linux, total memory elsewhere) and of the limits
    of control groups, which containers and batch systems use.
    """
    return min(
        [*_machine_memory(), *control_group_memory(Path("/sys/fs/cgroup"), Path("/proc/self/cgroup"))], default=None
    )


def free_disk(folder: Path) -> int | None:
    """Return the free disk space of an existing or future folder, bytes; None if the system does not report it."""
    there = next((one for one in (folder, *folder.absolute().parents) if one.is_dir()), None)
    try:
        return None if there is None else shutil.disk_usage(there).free
    except OSError:
        return None


def _machine_memory() -> Iterator[int]:
    for line in _read_lines(Path("/proc/meminfo")):
        name, _, value = line.partition(":")
        if name == "MemAvailable":
            yield 1024 * int(value.split()[0])
            return
    names = getattr(os, "sysconf_names", {})
    if "SC_PHYS_PAGES" in names and "SC_PAGE_SIZE" in names:
        yield os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")


def control_group_memory(root: Path, own: Path) -> Iterator[int]:
    """Yield the memory left by the control groups of this process, of version 1 or 2."""
    for line in _read_lines(own):
        _, kinds, path = line.split(":", 2)
        version = ("", "memory.max", "memory.current")
        if kinds:
            version = ("memory", "memory.limit_in_bytes", "memory.usage_in_bytes")
        if version[0] not in kinds.split(","):
            continue
        folder = root / version[0] / path.strip("/")
        for one in (folder, *(above for above in folder.parents if above.is_relative_to(root))):
            limit, used = (next(_read_lines(one / name), "") for name in version[1:])
            if limit.isdecimal() and used.isdecimal() and int(limit) < _UNLIMITED:
                yield max(int(limit) - int(used), 0)


def _read_lines(file: Path) -> Iterator[str]:
    """Yield the lines of a system file; none if it does not exist."""
    try:
        yield from file.read_text(encoding="ascii", errors="replace").splitlines()
    except OSError:
        return


_NUMBER = 8
"""Bytes per number."""

_DENSE, _NATURAL = 12, 40
"""Square matrices of a small system: M, C and K as triplets and dense, an operator and its inverse; with modal
coordinates and their refinement.
"""

_ENTRY = 250
"""Bytes per entry of M, C and K of a large system: triplets, compressed rows, their sums and a factorization."""

_BLOCK_ARRAYS = 24
"""Arrays over all degrees of freedom and the steps of a block: motion, loads and terms of the energies."""

_BASE_BYTES, _COMPILER = 4_000_000, 110_000_000
"""Bytes of any run for modules and output, and of a compiled run for the compiler."""

_STEP_BYTES = 3000
"""Bytes per step computed individually, for Python objects."""

_STRESS_POINTS = 36
"""Points of a section outline at which stresses are recorded."""

_POINT_VALUES = 3 * len(VECTORS) + sum(width for _, width in RECOVERED_FIELDS.values())
"""Values per output point."""

_TEMPORARY_COPIES = 2
"""Temporary copies: blocks are joined from parts, and histories from blocks."""


@dataclass(frozen=True)
class ResourceEstimate:
    """Resources required by a run, bytes."""

    machine: int  #: modules for computation and output
    equations: int  #: matrices and factorizations
    blocks: int  #: steps computed and written together
    histories: int  #: data in memory until the end
    file: int  #: result file on disk

    @property
    def memory(self) -> int:
        """Total memory, bytes."""
        return self.machine + self.equations + self.blocks + self.histories


def estimate_resources(
    problem: Problem, method: Method, mesh: Mesh, save: SaveAt, *, kept: int | None = None
) -> ResourceEstimate:
    """Return the resources required by a run."""
    names = outline(problem.system, channels=save.channels)
    row = 2 + 3 * sum(len(components) for _, components in names.probes) + len(names.channels)
    unknowns, rows, fields = len(names.unknowns), problem.steps + 1, problem.steps // save.field_every + 2
    histories = (
        rows * row + 3 * unknowns * fields if kept is None else min(kept + save.block, rows) * row + 3 * unknowns
    )
    inside, paths = integrated_size(problem), candidate_engines(problem, method)
    return ResourceEstimate(
        machine=_BASE_BYTES + (_COMPILER if "kernel" in paths else 0),
        equations=_equations(problem, inside, natural=paths[0] != "direct" and inside <= MAX_MODES),
        blocks=_blocks(inside, mesh, save, min(save.block, rows), row, unknowns),
        histories=_TEMPORARY_COPIES * _NUMBER * histories,
        file=result_bytes(names, mesh, save, problem.steps),
    )


def _equations(problem: Problem, inside: int, *, natural: bool) -> int:
    system = problem.system
    entries = sum(len(matrix.values) for matrix in (system.mass, system.damping, system.stiffness))
    small = _NUMBER * (_NATURAL * inside**2 if natural else _DENSE * min(inside, DENSE_LIMIT) ** 2)
    basis = _NUMBER * inside * system.size if problem.basis is not None else 0
    return small + basis + _ENTRY * entries


def _blocks(inside: int, mesh: Mesh, save: SaveAt, block: int, row: int, unknowns: int) -> int:
    """Return the memory of a block, bytes: computed steps, their joined copy and output fields."""
    walked = min(max(AT_ONCE // max(inside, 1), LEAST_AT_ONCE), block)
    fields = block // save.field_every + 1
    drawn = 2 * (_POINT_VALUES * count_output_points(mesh) + 3 * unknowns)
    stressed = 3 * 2 * _STRESS_POINTS * len(mesh.elements())
    numbers = (
        walked * (_BLOCK_ARRAYS * inside + 3 * row) + _TEMPORARY_COPIES * block * row + fields * (drawn + stressed)
    )
    return _NUMBER * numbers + _STEP_BYTES * walked


_USABLE_FRACTION = 0.9
"""Fraction of the free memory that a run may use: other processes need memory too, and estimates are inexact."""

_ELEMENT = 8000
"""Minimum bytes per element for matrices, factorization and start, measured from 3e3 to 2e5 elements."""

_SMALL = 1_000_000
"""Bytes of matrices below which free memory is not queried, as the query takes almost as long as a short run."""

_UNITS = ("B", "kB", "MB", "GB", "TB", "PB")

_LARGE = "or use --allow-large"


def check_resources(needs: ResourceEstimate, folder: Path | None = None, *, together: int = 1) -> None:
    """Raise an error if memory or disk space is insufficient for a run."""
    faults = [_check_memory(needs, together), None if folder is None else _check_disk(needs, folder)]
    if found := [fault for fault in faults if fault]:
        raise InputError(found)


def check_mesh_memory(mesh: Mesh) -> None:
    """Raise an error if memory is insufficient for the matrices of a mesh, before they are assembled."""
    count = sum(len(line) - 1 for line in mesh.lines.values())
    free = free_memory() if _ELEMENT * count > _SMALL else None
    if free is None or _ELEMENT * count <= _USABLE_FRACTION * free:
        return
    given = f"{count} elements, whose matrices take {format_size(_ELEMENT * count)}"
    remedy = "take fewer elements, or use flexcam run --allow-large"
    raise InputError([_lack("memory", given, free, f"{format_size(free)} are free", remedy)])


def _lack(where: str, given: str, free: int, why: str, remedy: str) -> Fault:
    return Fault(where, given, f"up to {format_size(int(_USABLE_FRACTION * free))}", why, remedy)


def _check_memory(needs: ResourceEstimate, together: int) -> Fault | None:
    free, asked = free_memory(), together * needs.memory
    if free is None or asked <= _USABLE_FRACTION * free:
        return None
    parts = {
        "programs": needs.machine,
        "matrices": needs.equations,
        "blocks of steps": needs.blocks,
        "histories": needs.histories,
    }
    shares = ", ".join(f"{format_size(size)} of {name}" for name, size in parts.items())
    given = f"a run of {format_size(needs.memory)}: {shares}" + (f"; {together} side by side" if together > 1 else "")
    remedy = f"take fewer elements, steps or probes, save fewer fields (output.field_every), {_LARGE}"
    return _lack("memory", given, free, f"{format_size(free)} are free", remedy)


def _check_disk(needs: ResourceEstimate, folder: Path) -> Fault | None:
    free = free_disk(folder)
    if free is None or needs.file <= _USABLE_FRACTION * free:
        return None
    remedy = f"take fewer steps or probes, save fewer fields (output.field_every), choose another disk, {_LARGE}"
    given = f"a result file of {format_size(needs.file)}"
    return _lack("disk", given, free, f"{format_size(free)} are free at {folder}", remedy)


def format_size(count: float) -> str:
    """Return a size in bytes as text."""
    power = 0
    while count >= 1000.0 and power < len(_UNITS) - 1:
        count, power = count / 1000.0, power + 1
    return f"{count:.2g} {_UNITS[power]}" if count < 100.0 else f"{count:.0f} {_UNITS[power]}"
