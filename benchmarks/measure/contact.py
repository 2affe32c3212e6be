"""Time steps of complete valve trains in contact, over two camshaft revolutions."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.engines import available_engines, run_engine
from benchmarks.processes import ROOT
from flexcam import prepare, read_case
from flexcam.analysis.preparation import PreparedRun
from flexcam.dynamics import Response, SaveAt

STRAIGHT = ("members.pushrod.geometric_stiffness=false", "members.pushrod.bow=0")
"""Overrides of the pushrod engine that leave its contacts and its spring, without bending of the pushrod under load."""
CASES: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("pushrod-engine/intake", ()), ("pushrod-engine/intake", STRAIGHT), ("pushrod-engine/lever", ()),
    ("direct-acting/bucket", ()), ("direct-acting/finger", ()), ("camshaft-4cyl/camshaft", ()),
    ("li/valve-train", ()), ("petrescu/valve-spring", ()),
)  # fmt: skip
"""Cases with their overrides."""
REPEATS = 3


def measure_table() -> list[dict[str, object]]:
    """Return time, iterations and events per step, by case and engine."""
    rows = []
    for name, overrides in CASES:
        ready = prepare_run(name, overrides)
        labels = {"case": name, "overrides": list(overrides)}
        engines = available_engines(ready.problem, ready.scheme)
        rows += [labels | _row(ready, *engine) for engine in engines.items()]
    return rows


def prepare_run(name: str, overrides: Sequence[str] = ()) -> PreparedRun:
    """Prepare two revolutions of a case with Newmark's method, which all engines have."""
    newmark = "run.integrator.method=newmark"
    return prepare(read_case(ROOT / f"cases/{name}.toml", ["run.revolutions=2", newmark, *overrides]))


def run(ready: PreparedRun, engine: str, save: SaveAt | None = None) -> Response:
    """Run a case with an engine."""
    return run_engine(ready.problem, engine, save or ready.save, ready.scheme)


def _row(ready: PreparedRun, engine: str, automatic: bool) -> dict[str, object]:
    minimal = SaveAt(field_every=ready.problem.steps, channels=False)
    runs, minimal_runs = ([run(ready, engine, save) for _ in range(REPEATS)] for save in (ready.save, minimal))
    stats = runs[0].stats
    return {
        "forces": len(ready.problem.system.local_forces), "unknowns": stats.unknowns,
        "steps": stats.steps, "path": engine, "automatic": automatic, "events": stats.events,
        "iterations": stats.iterations / stats.steps,
        "us_per_step": 1e6 * min(response.stats.seconds for response in runs) / stats.steps,
        "us_probes": 1e6 * min(response.stats.seconds for response in minimal_runs) / stats.steps,
    }  # fmt: skip
