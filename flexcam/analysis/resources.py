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
from flexcam.dynamics.kernel_step import PROGRAM
from flexcam.dynamics.solve import AT_ONCE, LEAST_AT_ONCE
from flexcam.fem.mesh import Mesh
from flexcam.io import RECOVERED_FIELDS, VECTORS, count_output_points, result_bytes

_UNLIMITED = 2**60  # bytes from which the limit of a control group means unlimited


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
    existing = next((parent for parent in (folder, *folder.absolute().parents) if parent.is_dir()), None)
    try:
        return None if existing is None else shutil.disk_usage(existing).free
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
        for group in (folder, *(above for above in folder.parents if above.is_relative_to(root))):
            limit, used = (next(_read_lines(group / name), "") for name in version[1:])
            if limit.isdecimal() and used.isdecimal() and int(limit) < _UNLIMITED:
                yield max(int(limit) - int(used), 0)


def _read_lines(file: Path) -> Iterator[str]:
    """Yield the lines of a system file; none if it does not exist."""
    try:
        yield from file.read_text(encoding="ascii", errors="replace").splitlines()
    except OSError:
        return


_NUMBER = 8  # bytes per number
# bytes of any run for modules and output, and of a compiled run for the compiler
_BASE, _COMPILER = 4_000_000, 110_000_000
_DENSE, _NATURAL = 12, 40
"""Square matrices of a small system: M, C and K as triplets and dense, an operator and its inverse; with modal
coordinates and their refinement.
"""

# bytes per entry of M, C and K of a large system: triplets, compressed rows, their sums and a factorization
_ENTRY = 250
# arrays over the degrees of freedom per step computed at once: motion, loads and energies; bytes of Python objects
_STEP_ARRAYS, _STEP = 24, 3000
_STRESSES = 216  # numbers of an element for its stresses
_POINT_VALUES = 3 * len(VECTORS) + sum(width for _, width in RECOVERED_FIELDS.values())  # values per output point


@dataclass(frozen=True)
class ResourceEstimate:
    """Resources required by a run, bytes."""

    memory: int  #: memory
    file: int  #: result file on disk


def estimate_resources(
    problem: Problem, method: Method, mesh: Mesh, save: SaveAt, *, kept: int | None = None
) -> ResourceEstimate:
    """Return the resources required by a run that keeps all steps in memory, or only the last `kept`."""
    system, names = problem.system, outline(problem.system, save)
    row = 2 + 3 * sum(len(components) for _, components in names.probes) + len(names.channels)
    unknowns, rows, fields = len(names.unknowns), problem.steps + 1, problem.steps // save.field_every + 2
    size, engines = integrated_size(problem), candidate_engines(problem, method)
    block = min(save.block, rows)
    together = min(max(AT_ONCE // max(size, 1), LEAST_AT_ONCE), block)
    if kept is not None:
        rows, fields = min(kept + save.block, rows), 1
    matrices = (_NATURAL if engines[0] != "direct" and size <= MAX_MODES else _DENSE) * min(size, DENSE_LIMIT) ** 2
    matrices += size * system.size if problem.basis is not None else 0
    entries = sum(len(matrix.values) for matrix in (system.mass, system.damping, system.stiffness))
    field_values = 2 * _POINT_VALUES * count_output_points(mesh) + 6 * unknowns + _STRESSES * len(mesh.elements())
    histories = rows * row + 3 * unknowns * fields
    # blocks are joined from parts, and histories from blocks
    numbers = matrices + together * (_STEP_ARRAYS * size + 3 * row) + 2 * (block * row + histories)
    numbers += (block // save.field_every + 1) * field_values
    compiler = _COMPILER if "kernel" in engines and PROGRAM.load_extension() is None else 0
    machine = _BASE + compiler + _ENTRY * entries + _STEP * together
    return ResourceEstimate(machine + _NUMBER * numbers, result_bytes(names, mesh, save, problem.steps))


# fraction of the free memory that a run may use: other processes need memory too, and estimates are inexact
_USABLE_FRACTION = 0.9
_ELEMENT = 8000  # minimum bytes per element for matrices, factorization and start, measured from 3e3 to 2e5 elements
# bytes of matrices below which free memory is not queried, as the query takes almost as long as a short run
_SMALL = 1_000_000
_UNITS = ("B", "kB", "MB", "GB", "TB", "PB")


def check_resources(needs: ResourceEstimate, folder: Path | None = None, *, together: int = 1) -> None:
    """Raise an error if memory or disk space is insufficient for a run."""
    run = f"a run of {format_size(needs.memory)}" + (f"; {together} side by side" if together > 1 else "")
    less, fewer = "steps or probes, save fewer fields (output.field_every)", "or use --allow-large"
    faults = _space_faults(
        "memory", run, together * needs.memory, free_memory(), f"use fewer elements, {less}, {fewer}"
    )
    if folder is not None:
        file, remedy = f"a result file of {format_size(needs.file)}", f"use fewer {less}, choose another disk, {fewer}"
        faults += _space_faults("disk", file, needs.file, free_disk(folder), remedy)
    if faults:
        raise InputError(faults)


def check_mesh_memory(mesh: Mesh) -> None:
    """Raise an error if memory is insufficient for the matrices of a mesh, before they are assembled."""
    count = sum(len(line) - 1 for line in mesh.lines.values())
    given = f"{count} elements, whose matrices need {format_size(_ELEMENT * count)}"
    remedy = "use fewer elements, or flexcam run --allow-large"
    free = free_memory() if _ELEMENT * count > _SMALL else None
    if faults := _space_faults("memory", given, _ELEMENT * count, free, remedy):
        raise InputError(faults)


def _space_faults(where: str, given: str, needed: int, free: int | None, remedy: str) -> list[Fault]:
    if free is None or needed <= _USABLE_FRACTION * free:
        return []
    allowed = f"up to {format_size(int(_USABLE_FRACTION * free))}"
    return [Fault(where, given, allowed, f"{format_size(free)} are free", remedy)]


def format_size(count: float) -> str:
    """Return a size in bytes as text."""
    power = 0
    while count >= 1000.0 and power < len(_UNITS) - 1:
        count, power = count / 1000.0, power + 1
    return f"{count:.2g} {_UNITS[power]}" if count < 100.0 else f"{count:.0f} {_UNITS[power]}"
