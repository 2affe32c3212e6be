"""flexcam beside other solvers on one machine: ``python -m benchmarks.peers.compare`` (``make bench-peers``).

All must first give the same displacement; then ratios are printed and ``docs/performance-peers.json`` is written.
Every figure comes from a process of its own; the solvers take turns, and the least time of each counts.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import sys
import tempfile
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks import machine
from benchmarks.peers.work import B1, B5, FloatArray
from benchmarks.processes import ROOT, FailedError, seconds

KEPT = ROOT / "docs/performance-peers.json"
TOLERANCE = {"B1": 1e-10, "B5": 1e-9}
"""Largest difference as a part of the motion: direct solutions differ by rounding, 3e-12 and 2e-11, modes by 4e-11 and
more near resonance; another element (with rotary inertia, say) differs by 6e-7."""
SLOW, FEW = 0.3, 10
"""Seconds of B1 above which B5 is measured at a few of its speeds and multiplied."""


@dataclass(frozen=True)
class Peer:
    """A solver to be measured: its file here, its name in the table and what must be installed."""

    file: str
    title: str
    package: str


REFERENCE = Peer("with_scipy", "scipy `splu`, Python loop", "scipy")
PEERS = (
    Peer("with_flexcam", "flexcam", "flexcam"),
    Peer("with_flexcam_compiled", "flexcam, kernel solver", "flexcam"),
    Peer("with_flexcam_general", "flexcam, direct solver", "flexcam"),
    Peer("with_exudyn", "Exudyn, tuned (sparse, modified Newton)", "exudyn"),
    Peer("with_exudyn_default", "Exudyn, default (dense, modified Newton)", "exudyn"),
    Peer("with_exudyn_full", "Exudyn, full Newton", "exudyn"),
    REFERENCE,
    Peer("with_opensees", "OpenSeesPy (linear, factored once)", "openseespy"),
)


@dataclass
class Measured:
    """What was measured of a solver; what it did not do is None.

    Parameters
    ----------
    us_per_step, process_s
        Of B1: the call that integrates by its steps, and the whole process.
    b5_s, b5_speeds
        Of B5, without imports, and at how many speeds it was measured (the time is for all 100).
    agreement
        Largest difference from the reference by work, as a part of the motion.
    missing
        Why it was not measured.
    """

    title: str
    us_per_step: float | None = None
    process_s: float | None = None
    b5_s: float | None = None
    b5_speeds: int = 0
    agreement: dict[str, float] = field(default_factory=dict)
    missing: str = ""


@dataclass(frozen=True, eq=False)
class Once:
    """One process: displacements at the speeds it ran, and seconds."""

    displacement: FloatArray
    loop: float
    whole: float
    process: float


def once(peer: Peer, work: str, speeds: int) -> Once:
    """Run a work in a new process."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "result.npz"
        command = [sys.executable, "-m", "benchmarks.peers.once", peer.file, work, str(speeds), out]
        process = seconds(command)
        with np.load(out) as found:
            return Once(found["displacement"], float(found["loop"]), float(found["whole"]), process)


def difference(found: FloatArray, reference: FloatArray) -> float:
    """Return the largest difference, each speed and component by its own largest motion, shapes (speeds, steps, 2)."""
    size = np.abs(reference).max(axis=1)
    return float((np.abs(found - reference).max(axis=1) / size).max())


def compared(repeats: int, repeats_b5: int) -> list[Measured]:
    """Measure all, taking turns."""
    rows = {peer.file: Measured(peer.title, missing=absent(peer.package)) for peer in PEERS}
    runs = taken_in_turn("B1", {peer: 1 for peer in PEERS if not rows[peer.file].missing}, rows, repeats)
    for peer, its in runs.items():
        rows[peer.file].us_per_step = 1e6 * min(one.loop for one in its) / B1.steps
        rows[peer.file].process_s = min(one.process for one in its)
    check("B1", runs, rows)
    count = len(B5.frequencies)
    speeds = {peer: FEW if min(one.loop for one in its) > SLOW else count for peer, its in runs.items()}
    runs = taken_in_turn("B5", speeds, rows, repeats_b5)
    for peer, its in runs.items():
        rows[peer.file].b5_s = min(one.whole for one in its) * count / speeds[peer]
        rows[peer.file].b5_speeds = speeds[peer]
    check("B5", runs, rows)
    return list(rows.values())


def absent(package: str) -> str:
    """Return why a package cannot be used; nothing if it can."""
    return "" if importlib.util.find_spec(package) else "not installed: pip install 'flexcam[peers]'"


def taken_in_turn(
    work: str, speeds: dict[Peer, int], rows: dict[str, Measured], repeats: int
) -> dict[Peer, list[Once]]:
    """Return the runs of each; what fails is left out, and its row says why."""
    runs: dict[Peer, list[Once]] = {peer: [] for peer in speeds}
    for _ in range(repeats):
        for peer in [one for one in speeds if not rows[one.file].missing]:
            try:
                runs[peer].append(once(peer, work, speeds[peer]))
            except FailedError as fault:
                rows[peer.file].missing = f"did not run: {fault}"
    return {peer: its for peer, its in runs.items() if not rows[peer.file].missing}


def check(work: str, runs: dict[Peer, list[Once]], rows: dict[str, Measured]) -> None:
    """Refuse to compare what does not give the same displacement."""
    reference = runs[REFERENCE][0].displacement
    wrong = []
    for peer, its in runs.items():
        found = its[0].displacement
        picked = np.linspace(0, len(reference) - 1, len(found)).round().astype(int)
        rows[peer.file].agreement[work] = off = difference(found, reference[picked])
        if not off <= TOLERANCE[work]:  # not a number is wrong too
            wrong.append(f"{peer.title} by {off:.2g}")
    if wrong:
        message = f"{work}: other displacements than the reference: {'; '.join(wrong)} (allowed {TOLERANCE[work]:g})"
        raise SystemExit(message)


def table(rows: Iterable[Measured]) -> Table:
    """Return the comparison, ratios against the first row."""
    rows = list(rows)
    own = rows[0]
    shown = Table("solver", "us per step", "ratio", "process, s", "B5, s", "ratio", "agreement B1, B5", box=None)
    for row in rows:
        if row.us_per_step is None or row.process_s is None or row.b5_s is None:
            shown.add_row(row.title, *["-"] * 6)
            continue
        few = f" (from {row.b5_speeds})" if row.b5_speeds < len(B5.frequencies) else ""
        shown.add_row(
            row.title, f"{row.us_per_step:.3g}", f"{row.us_per_step / (own.us_per_step or np.nan):.3g}",
            f"{row.process_s:.2f}", f"{row.b5_s:.3g}{few}", f"{row.b5_s / (own.b5_s or np.nan):.3g}",
            ", ".join(f"{off:.1e}" for off in row.agreement.values()),
        )  # fmt: skip
    return shown


def main() -> None:
    """Measure, print, write."""
    asked = argparse.ArgumentParser(description="flexcam beside other solvers")
    asked.add_argument("--repeats", type=int, default=7, help="of B1")
    asked.add_argument("--repeats-b5", type=int, default=2, help="of B5")
    asked.add_argument("-o", "--out", type=Path, default=KEPT)
    given = asked.parse_args()
    rows = compared(given.repeats, given.repeats_b5)
    content = {
        "machine": machine.described(),
        "date": machine.today(),
        "versions": machine.versions("flexcam", "exudyn", "openseespy", "scipy", "numpy"),
        "repeats": {"B1": given.repeats, "B5": given.repeats_b5},
        "tolerance": TOLERANCE,
        "solvers": [asdict(row) for row in rows],
    }
    given.out.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    console = Console(width=150, markup=False, highlight=False)
    console.print(table(rows))
    for row in rows:
        if row.missing:
            console.print(f"{row.title}: {row.missing}")


if __name__ == "__main__":
    main()
