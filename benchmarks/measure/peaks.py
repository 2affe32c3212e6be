"""The most memory that processes of large models hold."""

from __future__ import annotations

from benchmarks.memory import peak

WORKS = {
    "Python, numpy and scipy": "import scipy.sparse.linalg",
    "mass and stiffness, 100000 elements": "from benchmarks.measure.assembly import assembled; assembled(100_000)",
    "twenty modes, 99596 unknowns": "from benchmarks.measure.modes import SHAFTS, lowest; lowest(SHAFTS[3])",
    "transient, 99994 unknowns, probes saved": "from benchmarks.measure.linear import SHAFTS, steps; steps(SHAFTS[7])",
}
"""What is said of it, and statements for a process of its own."""


def measured() -> list[dict[str, object]]:
    """Return the peak of each process, MB."""
    return [{"work": work, "mb": peak(statements)} for work, statements in WORKS.items()]
