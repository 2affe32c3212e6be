"""Peak memory of processes with large models."""

from __future__ import annotations

from benchmarks.processes import peak_memory

STATEMENTS = {
    "Python, numpy and scipy": "import scipy.sparse.linalg",
    "mass and stiffness, 100000 elements": "from benchmarks.measure.assembly import assemble; assemble(100_000)",
    "twenty modes, 99596 unknowns": "from benchmarks.measure.modes import SHAFTS, find_modes; find_modes(SHAFTS[3])",
    "transient, 99994 unknowns, probes saved": (
        "from benchmarks.measure.linear import SHAFTS, run_shaft; run_shaft(SHAFTS[7])"
    ),
}
"""Statements of a process by their description."""


def measure_table() -> list[dict[str, object]]:
    """Return the peak memory of each process, MB."""
    return [{"work": name, "mb": peak_memory(statements)} for name, statements in STATEMENTS.items()]
