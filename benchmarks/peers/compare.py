"""flexcam beside other solvers on one machine: ``python -m benchmarks.peers.compare`` (``make bench-peers``).

All must first give the same displacement, or the same cam force in contact; then ratios are printed and
``docs/performance-peers.json`` is written, where a comparison that is not asked for stays as it was.
Every figure comes from a process of its own; the solvers take turns, and the least time of each counts.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import sys
import tempfile
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Protocol, TypeVar

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks import machine
from benchmarks.peers.train import C1, ENOUGH, TrainResult
from benchmarks.peers.work import B1, B5, FloatArray
from benchmarks.processes import ROOT, FailedError, seconds
from benchmarks.valves import times_by_valves
from flexcam.dynamics import collocation

KEPT = ROOT / "docs/performance-peers.json"
TOLERANCE = {"B1": 1e-10, "B5": 1e-9}
"""Largest difference as a part of the motion: direct solutions differ by rounding, 3e-12 and 2e-11, modes by 4e-11 and
more near resonance; another element (with rotary inertia, say) differs by 6e-7."""
FORCE_TOLERANCE, REFERENCE_TOLERANCE = 1e-3, 1e-5
"""Largest relative rms error of the cam force of C1: of the finest setting of every method, and between references."""
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
TRAIN_PEERS = (
    Peer("train_flexcam", "flexcam", "flexcam"),
    Peer("train_scipy", "scipy", "scipy"),
    Peer("train_exudyn", "Exudyn", "exudyn"),
    Peer("train_casadi", "CVODES (CasADi)", "casadi"),
    Peer("train_diffrax", "diffrax", "diffrax"),
    Peer("train_mujoco", "MuJoCo", "mujoco"),
)
"""Solvers of C1; a file has several methods and settings."""


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


class Row(Protocol):
    """What was measured of a solver, or why it was not."""

    missing: str


R = TypeVar("R")


def once(peer: Peer, work: str, speeds: int) -> Once:
    """Run a work in a new process."""
    found, process = _in_process(peer, work, speeds)
    return Once(found["displacement"], float(found["loop"]), float(found["whole"]), process)


def train_once(peer: Peer, enough: float) -> TrainResult:
    """Run all settings of a solver on C1 in a new process, each for so many seconds."""
    found, _ = _in_process(peer, "C1", enough)
    names = (found[name].tolist() for name in ("methods", "names"))
    return TrainResult(*names, *(found[name] for name in ("motion", "seconds", "first_seconds")))


def _in_process(peer: Peer, work: str, amount: float) -> tuple[dict[str, FloatArray], float]:
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "result.npz"
        process = seconds([sys.executable, "-m", "benchmarks.peers.once", peer.file, work, str(amount), out])
        with np.load(out) as found:
            return dict(found), process


def difference(found: FloatArray, reference: FloatArray) -> float:
    """Return the largest difference, each speed and component by its own largest motion, shapes (speeds, steps, 2)."""
    size = np.abs(reference).max(axis=1)
    return float((np.abs(found - reference).max(axis=1) / size).max())


def compared(repeats: int, repeats_b5: int) -> list[Measured]:
    """Measure all, taking turns."""
    rows = {peer.file: Measured(peer.title, missing=absent(peer.package)) for peer in PEERS}
    runs = taken_in_turn(PEERS, lambda peer: once(peer, "B1", 1), rows, repeats)
    for peer, its in runs.items():
        rows[peer.file].us_per_step = 1e6 * min(one.loop for one in its) / B1.steps
        rows[peer.file].process_s = min(one.process for one in its)
    check("B1", runs, rows)
    count = len(B5.frequencies)
    speeds = {peer: FEW if min(one.loop for one in its) > SLOW else count for peer, its in runs.items()}
    runs = taken_in_turn(speeds, lambda peer: once(peer, "B5", speeds[peer]), rows, repeats_b5)
    for peer, its in runs.items():
        rows[peer.file].b5_s = min(one.whole for one in its) * count / speeds[peer]
        rows[peer.file].b5_speeds = speeds[peer]
    check("B5", runs, rows)
    return list(rows.values())


def absent(package: str) -> str:
    """Return why a package cannot be used; nothing if it can."""
    return "" if importlib.util.find_spec(package) else "not installed: pip install 'flexcam[peers]'"


def taken_in_turn(
    peers: Iterable[Peer], run: Callable[[Peer], R], rows: Mapping[str, Row], repeats: int
) -> dict[Peer, list[R]]:
    """Return the runs of each; what fails is left out, and its row says why."""
    runs: dict[Peer, list[R]] = {peer: [] for peer in peers if not rows[peer.file].missing}
    for _ in range(repeats):
        for peer in [one for one in runs if not rows[one.file].missing]:
            try:
                runs[peer].append(run(peer))
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


@dataclass
class MeasuredTrain:
    """A solver of C1: what a row of `settings` has is in `compared_trains`."""

    title: str
    missing: str = ""
    settings: list[dict[str, object]] = field(default_factory=list)


def compared_trains(rounds: int, enough: float) -> list[MeasuredTrain]:
    """Measure all solvers of C1, taking turns.

    A setting has its method and name, the error of the force (relative, rms), the least processor time in ms and the
    seconds of its preparation and first run.
    """
    rows = {peer.file: MeasuredTrain(peer.title, absent(peer.package)) for peer in TRAIN_PEERS}
    runs = taken_in_turn(TRAIN_PEERS, partial(train_once, enough=enough), rows, rounds)
    exact = train_reference()
    for peer, its in runs.items():
        fast, first = (np.min([getattr(one, name) for one in its], axis=0) for name in ("seconds", "first_seconds"))
        rows[peer.file].settings = [
            {"method": method, "name": name, "error": force_error(motion, exact), "ms": 1e3 * time, "first_s": begin}
            for method, name, motion, time, begin in zip(
                its[0].methods, its[0].names, its[0].motion, fast.tolist(), first.tolist(), strict=True
            )
        ]
    check_forces(rows.values())
    return list(rows.values())


Solution = Callable[[FloatArray], FloatArray]
"""Displacements and velocities of C1 at some instants (n,), shape (6, n)."""


def train_reference() -> Solution:
    """Return a tight solution of C1."""
    from benchmarks.peers.train_scipy import reference

    return reference(C1)


def reference_differences(exact: Solution) -> dict[str, float]:
    """Return the errors of other tight solutions; refuse a reference that they do not confirm."""
    from benchmarks.peers.train_flexcam import FINE_STEPS, motion
    from benchmarks.peers.train_scipy import reference

    radau = np.column_stack([C1.times, reference(C1, "Radau")(C1.times).T])
    found = {"Radau": radau, "flexcam": motion(C1, collocation(), FINE_STEPS)}
    differences = {name: force_error(one, exact) for name, one in found.items()}
    if not max(differences.values()) <= REFERENCE_TOLERANCE:
        raise SystemExit(f"C1: the references differ: {differences} (allowed {REFERENCE_TOLERANCE:g})")
    return differences


def force_error(motion: FloatArray, exact: Solution) -> float:
    """Return the rms error of the cam force relative to its rms, of time, displacements and velocities (n, 7)."""
    force = C1.cam_force(motion[:, 0], exact(motion[:, 0]).T)
    missed = C1.cam_force(motion[:, 0], motion[:, 1:]) - force
    return float(np.sqrt(np.mean(missed**2) / np.mean(force**2)))


def check_forces(rows: Iterable[MeasuredTrain]) -> None:
    """Refuse to compare methods that do not come close to the reference."""
    best: dict[str, float] = {}
    for row in rows:
        for one in row.settings:
            method, error = str(one["method"]), float(str(one["error"]))
            best[method] = error if not error >= best.get(method, np.inf) else best[method]
    wrong = [f"{method} by {error:.2g}" for method, error in best.items() if not error <= FORCE_TOLERANCE]
    if wrong:
        raise SystemExit(f"C1: other forces than the reference: {'; '.join(wrong)} (allowed {FORCE_TOLERANCE:g})")


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


def train_table(rows: Iterable[MeasuredTrain]) -> Table:
    """Return errors and times of C1."""
    shown = Table("solver", "setting", "error", "ms", "first run, s", box=None)
    for row in rows:
        for one in row.settings:
            shown.add_row(
                str(one["method"]), str(one["name"]), *(f"{one[name]:.3g}" for name in ("error", "ms", "first_s"))
            )
    return shown


def main() -> None:
    """Measure, print, write."""
    asked = argparse.ArgumentParser(description="flexcam beside other solvers")
    asked.add_argument(
        "works", nargs="*", choices=[[], "shaft", "train"], metavar="work", help="shaft, train; else both"
    )
    asked.add_argument("--repeats", type=int, default=7, help="of B1")
    asked.add_argument("--repeats-b5", type=int, default=2, help="of B5")
    asked.add_argument("--rounds", type=int, default=3, help="of C1")
    asked.add_argument("-o", "--out", type=Path, default=KEPT)
    given = asked.parse_args()
    works = given.works or ["shaft", "train"]
    content = json.loads(given.out.read_text(encoding="utf-8")) if given.out.exists() else {}
    about = {"machine": machine.described(), "date": machine.today()}
    console = Console(width=150, markup=False, highlight=False)
    if "shaft" in works:
        rows = compared(given.repeats, given.repeats_b5)
        content |= about | {
            "versions": machine.versions("flexcam", "exudyn", "openseespy", "scipy", "numpy"),
            "repeats": {"B1": given.repeats, "B5": given.repeats_b5},
            "tolerance": TOLERANCE,
            "solvers": [asdict(row) for row in rows],
        }
        console.print(table(rows))
        report_missing(console, rows)
    if "train" in works:
        trains = compared_trains(given.rounds, ENOUGH)
        content["train"] = about | {
            "versions": machine.versions(
                "flexcam", "scipy", "numba", "numpy", "exudyn", "casadi", "diffrax", "jax", "mujoco"
            ),
            "rounds": given.rounds,
            "tolerance": FORCE_TOLERANCE,
            "references": reference_differences(train_reference()),
            "solvers": [asdict(row) for row in trains],
            "valves": times_by_valves(),
        }
        console.print(train_table(trains))
        report_missing(console, trains)
    given.out.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def report_missing(console: Console, rows: Iterable[Measured | MeasuredTrain]) -> None:
    """Print which solvers are left out, and why."""
    for row in rows:
        if row.missing:
            console.print(f"{row.title}: {row.missing}")


if __name__ == "__main__":
    main()
