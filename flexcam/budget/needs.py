"""What a run takes, estimated from its sizes: a few products, no array.

What counts is counted: rows and columns of what is kept, the entries of the matrices, the chunks of a result file. What
lives for the length of a few steps is taken by a factor, fitted to measured runs (`tests/unit/test_budget.py`).
"""

from __future__ import annotations

from dataclasses import dataclass

from flexcam.fem import Mesh
from flexcam.integrate import Problem, integrated, outline
from flexcam.integrate.paths import MOST, wanted_engines
from flexcam.integrate.solve import AT_ONCE, LEAST_AT_ONCE
from flexcam.io import RECOVERED, VECTORS, points_drawn, result_bytes
from flexcam.linalg import DENSE_LIMIT
from flexcam.response import SaveAt

_NUMBER = 8
"""Bytes."""

_DENSE, _NATURAL = 12, 40
"""Square matrices of a small system: M, C, K as entries and dense, an operator, its inverse; with natural motions, and
what refines them."""

_ENTRY = 250
"""Bytes per entry of M, C and K of a large system: triplets, rows, sums of them and a factor."""

_WALKED = 24
"""Arrays of all unknowns over the steps that are walked together: motion, loads, what the energies need."""

_ANY, _COMPILER = 4_000_000, 110_000_000
"""Bytes of any run, for what it loads and writes, and of one in machine code, for the compiler."""

_STEP = 3000
"""Bytes per step that is walked one at a time, for Python's own objects."""

_PLACES = 36
"""Places on an outline where stresses are followed."""

_DRAWN = 3 * len(VECTORS) + sum(width for _, width in RECOVERED.values())
"""Numbers at a drawn point."""

_COPIES = 2
"""Blocks are joined of their parts, and histories of their blocks: both are there for a moment."""


@dataclass(frozen=True)
class Budget:
    """What a run takes, in bytes.

    Parameters
    ----------
    machine
        What is loaded to compute and to write.
    equations
        Matrices and factors.
    blocks
        The steps that are computed and written together.
    histories
        What stays in memory until the end.
    file
        The result file, on disk.
    """

    machine: int
    equations: int
    blocks: int
    histories: int
    file: int

    @property
    def memory(self) -> int:
        """Everything in memory together."""
        return self.machine + self.equations + self.blocks + self.histories


def budget(problem: Problem, mesh: Mesh, save: SaveAt, *, kept: int | None = None) -> Budget:
    """Return what a run takes."""
    names = outline(problem.system, channels=save.channels)
    row = 2 + 3 * sum(len(components) for _, components in names.probes) + len(names.channels)
    unknowns, rows, fields = len(names.unknowns), problem.steps + 1, problem.steps // save.field_every + 2
    histories = (
        rows * row + 3 * unknowns * fields if kept is None else min(kept + save.block, rows) * row + 3 * unknowns
    )
    inside, paths = integrated(problem), wanted_engines(problem)
    return Budget(
        machine=_ANY + (_COMPILER if "kernel" in paths else 0),
        equations=_equations(problem, inside, natural=paths[0] != "direct" and inside <= MOST),
        blocks=_blocks(inside, mesh, save, min(save.block, rows), row, unknowns),
        histories=_COPIES * _NUMBER * histories,
        file=result_bytes(names, mesh, save, problem.steps),
    )


def _equations(problem: Problem, inside: int, *, natural: bool) -> int:
    system = problem.system
    entries = sum(len(matrix.values) for matrix in (system.mass, system.damping, system.stiffness))
    small = _NUMBER * (_NATURAL * inside**2 if natural else _DENSE * min(inside, DENSE_LIMIT) ** 2)
    basis = _NUMBER * inside * system.size if problem.basis is not None else 0
    return small + basis + _ENTRY * entries


def _blocks(inside: int, mesh: Mesh, save: SaveAt, block: int, row: int, unknowns: int) -> int:
    """Return what the steps in hand take: walked, joined to a block, and their fields as they are drawn."""
    walked = min(max(AT_ONCE // max(inside, 1), LEAST_AT_ONCE), block)
    fields = block // save.field_every + 1
    drawn = 2 * (_DRAWN * points_drawn(mesh) + 3 * unknowns)
    stressed = 3 * 2 * _PLACES * len(mesh.elements())
    numbers = walked * (_WALKED * inside + 3 * row) + _COPIES * block * row + fields * (drawn + stressed)
    return _NUMBER * numbers + _STEP * walked
