"""Comparison of flexcam with other solvers: ``python -m benchmarks.peers.comparison`` (``make bench-peers``).

All solvers have to compute the same displacement, or in contact the same cam force. Then the command prints ratios and
writes ``docs/performance-peers.json``, which keeps the values of a benchmark that is not run. Every run has a new
process, the solvers run in turn, and the minimum time of each counts.
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
from benchmarks.peers.shaft import B1, B5, FloatArray, ShaftResult
from benchmarks.peers.train import C1, REPEAT_SECONDS, TrainResult
from benchmarks.processes import ROOT, ProcessError, time_command
from benchmarks.train_copies import measure_step_times
from flexcam.dynamics import collocation

FIGURES = ROOT / "docs/performance-peers.json"
TOLERANCE = {"B1": 1e-10, "B5": 1e-9}
"""Maximum difference relative to the motion: direct solutions differ by rounding, 3e-12 and 2e-11, modal ones by 4e-11
and more near resonance; a different element, for example with rotary inertia, differs by 6e-7."""
FORCE_TOLERANCE, REFERENCE_TOLERANCE = 1e-3, 1e-5
"""Maximum relative rms error of the cam force of C1: of every method at its best setting, and between references."""
SLOW_SECONDS, FEW_SPEEDS = 0.3, 10
"""Solvers that need more seconds for B1 run only a few speeds of B5, and their time is scaled."""


@dataclass(frozen=True)
class Peer:
    """A solver: its module here with a variant, its name in the table and the package that it needs."""

    solver: str
    title: str
    package: str


REFERENCE = Peer("shaft_scipy", "scipy `splu`, Python loop", "scipy")
PEERS = (
    Peer("shaft_flexcam", "flexcam", "flexcam"),
    Peer("shaft_flexcam:kernel", "flexcam, kernel solver", "flexcam"),
    Peer("shaft_flexcam:direct", "flexcam, direct solver", "flexcam"),
    Peer("shaft_exudyn:tuned", "Exudyn, tuned (sparse, modified Newton)", "exudyn"),
    Peer("shaft_exudyn:default", "Exudyn, default (dense, modified Newton)", "exudyn"),
    Peer("shaft_exudyn:full", "Exudyn, full Newton", "exudyn"),
    REFERENCE,
    Peer("shaft_opensees", "OpenSeesPy (linear, factored once)", "openseespy"),
)
TRAIN_PEERS = (
    Peer("train_flexcam", "flexcam", "flexcam"),
    Peer("train_scipy", "scipy", "scipy"),
    Peer("train_exudyn", "Exudyn", "exudyn"),
    Peer("train_casadi", "CVODES (CasADi)", "casadi"),
    Peer("train_diffrax", "diffrax", "diffrax"),
    Peer("train_mujoco", "MuJoCo", "mujoco"),
)
"""Solvers of C1, with several methods and settings each."""


@dataclass
class ShaftRow:
    """Figures of a solver on B1 and B5; None for a benchmark that it did not run.

    Parameters
    ----------
    us_per_step, process_s
        Time of B1: integration per step, and complete process.
    b5_s, b5_speeds
        Time of B5 without imports, scaled to all 100 speeds, and the number of measured speeds.
    agreement
        Maximum difference from the reference by benchmark, relative to the motion.
    missing
        Reason of missing figures.
    """

    title: str
    us_per_step: float | None = None
    process_s: float | None = None
    b5_s: float | None = None
    b5_speeds: int = 0
    agreement: dict[str, float] = field(default_factory=dict)
    missing: str = ""


@dataclass(frozen=True, eq=False)
class ShaftRun(ShaftResult):
    """Displacements and times of one process."""

    process_seconds: float


class Row(Protocol):
    """Figures of a solver, or the reason of missing ones."""

    missing: str


R = TypeVar("R")


def run_shaft(peer: Peer, benchmark: str, speeds: int) -> ShaftRun:
    """Run B1 or B5 at a number of speeds in a new process."""
    found, process = _run_process(peer, benchmark, speeds)
    return ShaftRun(found["displacement"], float(found["loop_seconds"]), float(found["total_seconds"]), process)


def run_train(peer: Peer, seconds: float) -> TrainResult:
    """Run all settings of a solver on C1 in a new process, with repeats of each for some seconds."""
    found, _ = _run_process(peer, "C1", seconds)
    names = (found[name].tolist() for name in ("methods", "names"))
    return TrainResult(*names, *(found[name] for name in ("motion", "seconds", "first_seconds")))


def _run_process(peer: Peer, benchmark: str, amount: float) -> tuple[dict[str, FloatArray], float]:
    module = "benchmarks.peers.solver_process"
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "result.npz"
        seconds = time_command([sys.executable, "-m", module, peer.solver, benchmark, str(amount), out])
        with np.load(out) as found:
            return dict(found), seconds


def difference(found: FloatArray, reference: FloatArray) -> float:
    """Return the maximum difference relative to the maximum of each speed and component; shapes (speeds, steps, 2)."""
    size = np.abs(reference).max(axis=1)
    return float((np.abs(found - reference).max(axis=1) / size).max())


def compare_shafts(repeats: int, repeats_b5: int) -> list[ShaftRow]:
    """Measure all solvers on B1 and B5 in turn."""
    rows = {peer.solver: ShaftRow(peer.title, missing=missing_reason(peer.package)) for peer in PEERS}
    by_peer = run_in_turn(PEERS, lambda peer: run_shaft(peer, "B1", 1), rows, repeats)
    loops = {peer: min(run.loop_seconds for run in runs) for peer, runs in by_peer.items()}
    for peer, runs in by_peer.items():
        rows[peer.solver].us_per_step = 1e6 * loops[peer] / B1.steps
        rows[peer.solver].process_s = min(run.process_seconds for run in runs)
    check_displacements("B1", by_peer, rows)
    count = len(B5.frequencies)
    speeds = {peer: FEW_SPEEDS if loop > SLOW_SECONDS else count for peer, loop in loops.items()}
    by_peer = run_in_turn(speeds, lambda peer: run_shaft(peer, "B5", speeds[peer]), rows, repeats_b5)
    for peer, runs in by_peer.items():
        rows[peer.solver].b5_s = min(run.total_seconds for run in runs) * count / speeds[peer]
        rows[peer.solver].b5_speeds = speeds[peer]
    check_displacements("B5", by_peer, rows)
    return list(rows.values())


def missing_reason(package: str) -> str:
    """Return a message if a package is not installed, otherwise an empty string."""
    return "" if importlib.util.find_spec(package) else "not installed: pip install 'flexcam[peers]'"


def run_in_turn(
    peers: Iterable[Peer], run: Callable[[Peer], R], rows: Mapping[str, Row], repeats: int
) -> dict[Peer, list[R]]:
    """Return the runs of each solver without failed ones, whose rows get the reason."""
    by_peer: dict[Peer, list[R]] = {peer: [] for peer in peers if not rows[peer.solver].missing}
    for _ in range(repeats):
        for peer, runs in by_peer.items():
            if rows[peer.solver].missing:
                continue
            try:
                runs.append(run(peer))
            except ProcessError as error:
                rows[peer.solver].missing = f"did not run: {error}"
    return {peer: runs for peer, runs in by_peer.items() if not rows[peer.solver].missing}


def check_displacements(benchmark: str, by_peer: dict[Peer, list[ShaftRun]], rows: dict[str, ShaftRow]) -> None:
    """Exit if a solver does not compute the displacements of the reference."""
    reference = by_peer[REFERENCE][0].displacement
    tolerance = TOLERANCE[benchmark]
    wrong = []
    for peer, runs in by_peer.items():
        found = runs[0].displacement
        selected = np.linspace(0, len(reference) - 1, len(found)).round().astype(int)
        rows[peer.solver].agreement[benchmark] = error = difference(found, reference[selected])
        if not error <= tolerance:  # also true for nan
            wrong.append(f"{peer.title} by {error:.2g}")
    if wrong:
        raise SystemExit(
            f"{benchmark}: other displacements than the reference: {'; '.join(wrong)} (allowed {tolerance:g})"
        )


@dataclass
class TrainRow:
    """Figures of a solver on C1; `compare_trains` describes the settings."""

    title: str
    missing: str = ""
    settings: list[dict[str, object]] = field(default_factory=list)


def compare_trains(rounds: int, seconds: float) -> list[TrainRow]:
    """Measure all solvers of C1 in turn.

    A setting has its method and name, the relative rms error of the force, the minimum processor time in ms and the
    seconds of its preparation and first run.
    """
    rows = {peer.solver: TrainRow(peer.title, missing_reason(peer.package)) for peer in TRAIN_PEERS}
    by_peer = run_in_turn(TRAIN_PEERS, partial(run_train, seconds=seconds), rows, rounds)
    exact = train_reference()
    for peer, runs in by_peer.items():
        times, first = (np.min([getattr(run, name) for run in runs], axis=0) for name in ("seconds", "first_seconds"))
        rows[peer.solver].settings = [
            {"method": method, "name": name, "error": force_error(motion, exact), "ms": 1e3 * time, "first_s": begin}
            for method, name, motion, time, begin in zip(
                runs[0].methods, runs[0].names, runs[0].motion, times.tolist(), first.tolist(), strict=True
            )
        ]
    check_forces(rows.values())
    return list(rows.values())


Solution = Callable[[FloatArray], FloatArray]
"""Displacements and velocities (6, n) of C1 at times (n,)."""


def train_reference() -> Solution:
    """Return a solution of C1 with a tight tolerance."""
    from benchmarks.peers.train_scipy import reference  # imports numba

    return reference(C1)


def reference_differences(exact: Solution) -> dict[str, float]:
    """Return the errors of other accurate solutions; exit if they differ from the reference."""
    from benchmarks.peers.train_flexcam import FINE_STEPS, integrate
    from benchmarks.peers.train_scipy import reference

    radau = np.column_stack([C1.times, reference(C1, "Radau")(C1.times).T])
    motions = {"Radau": radau, "flexcam": integrate(C1, collocation(), FINE_STEPS)}
    differences = {name: force_error(motion, exact) for name, motion in motions.items()}
    if not max(differences.values()) <= REFERENCE_TOLERANCE:
        raise SystemExit(f"C1: the references differ: {differences} (allowed {REFERENCE_TOLERANCE:g})")
    return differences


def force_error(motion: FloatArray, exact: Solution) -> float:
    """Return the relative rms error of the cam force for times, displacements and velocities (n, 7)."""
    force = C1.cam_force(motion[:, 0], exact(motion[:, 0]).T)
    error = C1.cam_force(motion[:, 0], motion[:, 1:]) - force
    return float(np.sqrt(np.mean(error**2) / np.mean(force**2)))


def check_forces(rows: Iterable[TrainRow]) -> None:
    """Exit if the best setting of a method is too far from the reference."""
    best: dict[str, float] = {}
    for row in rows:
        for setting in row.settings:
            method, error = str(setting["method"]), float(str(setting["error"]))
            best[method] = error if not error >= best.get(method, np.inf) else best[method]
    wrong = [f"{method} by {error:.2g}" for method, error in best.items() if not error <= FORCE_TOLERANCE]
    if wrong:
        raise SystemExit(f"C1: other forces than the reference: {'; '.join(wrong)} (allowed {FORCE_TOLERANCE:g})")


def shaft_table(rows: Iterable[ShaftRow]) -> Table:
    """Return the comparison with ratios relative to the first row."""
    rows = list(rows)
    first = rows[0]
    table = Table("solver", "us per step", "ratio", "process, s", "B5, s", "ratio", "agreement B1, B5", box=None)
    for row in rows:
        if row.us_per_step is None or row.process_s is None or row.b5_s is None:
            table.add_row(row.title, *["-"] * 6)
            continue
        few = f" (from {row.b5_speeds})" if row.b5_speeds < len(B5.frequencies) else ""
        table.add_row(
            row.title, f"{row.us_per_step:.3g}", f"{row.us_per_step / (first.us_per_step or np.nan):.3g}",
            f"{row.process_s:.2f}", f"{row.b5_s:.3g}{few}", f"{row.b5_s / (first.b5_s or np.nan):.3g}",
            ", ".join(f"{error:.1e}" for error in row.agreement.values()),
        )  # fmt: skip
    return table


def train_table(rows: Iterable[TrainRow]) -> Table:
    """Return errors and times of C1."""
    table = Table("solver", "setting", "error", "ms", "first run, s", box=None)
    for row in rows:
        for setting in row.settings:
            figures = (f"{setting[name]:.3g}" for name in ("error", "ms", "first_s"))
            table.add_row(str(setting["method"]), str(setting["name"]), *figures)
    return table


def main() -> None:
    """Measure, print and write the figures."""
    parser = argparse.ArgumentParser(description="comparison of flexcam with other solvers")
    parser.add_argument(
        "benchmarks", nargs="*", choices=[[], "shaft", "train"], metavar="benchmark", help="shaft, train; default: both"
    )
    parser.add_argument("--repeats", type=int, default=7, help="repeats of B1")
    parser.add_argument("--repeats-b5", type=int, default=2, help="repeats of B5")
    parser.add_argument("--rounds", type=int, default=3, help="repeats of C1")
    parser.add_argument("-o", "--out", type=Path, default=FIGURES)
    options = parser.parse_args()
    benchmarks = options.benchmarks or ["shaft", "train"]
    content = json.loads(options.out.read_text(encoding="utf-8")) if options.out.exists() else {}
    conditions = {"machine": machine.describe(), "date": machine.today()}
    console = Console(width=150, markup=False, highlight=False)
    if "shaft" in benchmarks:
        rows = compare_shafts(options.repeats, options.repeats_b5)
        content |= conditions | {
            "versions": machine.package_versions("flexcam", "exudyn", "openseespy", "scipy", "numpy"),
            "repeats": {"B1": options.repeats, "B5": options.repeats_b5},
            "tolerance": TOLERANCE,
            "solvers": [asdict(row) for row in rows],
        }
        console.print(shaft_table(rows))
        report_missing(console, rows)
    if "train" in benchmarks:
        trains = compare_trains(options.rounds, REPEAT_SECONDS)
        content["train"] = conditions | {
            "versions": machine.package_versions(
                "flexcam", "scipy", "numba", "numpy", "exudyn", "casadi", "diffrax", "jax", "mujoco"
            ),
            "rounds": options.rounds,
            "tolerance": FORCE_TOLERANCE,
            "references": reference_differences(train_reference()),
            "solvers": [asdict(row) for row in trains],
            "valves": measure_step_times(),
        }
        console.print(train_table(trains))
        report_missing(console, trains)
    options.out.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def report_missing(console: Console, rows: Iterable[ShaftRow | TrainRow]) -> None:
    """Print the solvers without figures, with the reason."""
    for row in rows:
        if row.missing:
            console.print(f"{row.title}: {row.missing}")


if __name__ == "__main__":
    main()
