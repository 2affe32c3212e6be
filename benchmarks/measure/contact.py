"""Steps of whole valve trains in contact, of two camshaft revolutions each."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.paths import solved, ways
from benchmarks.processes import ROOT
from flexcam import prepare, read_case
from flexcam.analysis.preparation import PreparedRun
from flexcam.dynamics import Response, SaveAt

STRAIGHT = ("members.pushrod.geometric_stiffness=false", "members.pushrod.bow=0")
"""Of the pushrod engine: its contacts and its spring alone, without the pushrod's bending under its load."""
CASES: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("pushrod-engine/intake", ()), ("pushrod-engine/intake", STRAIGHT), ("pushrod-engine/lever", ()),
    ("direct-acting/bucket", ()), ("direct-acting/finger", ()), ("camshaft-4cyl/camshaft", ()),
    ("li/valve-train", ()), ("petrescu/valve-spring", ()),
)  # fmt: skip
"""With what is laid over them."""
REPEATS = 3


def measured() -> list[dict[str, object]]:
    """Return time per step and how much happens in it, by case and path."""
    rows = []
    for name, overrides in CASES:
        ready = revolution(name, overrides)
        about = {"case": name, "overrides": list(overrides)}
        rows += [about | _row(ready, *way) for way in ways(ready.problem, ready.scheme, ready.save).items()]
    return rows


def revolution(name: str, overrides: Sequence[str] = ()) -> PreparedRun:
    """Return two revolutions of a case with the method that all engines have, ready to go."""
    newmark = "run.integrator.method=newmark"
    return prepare(read_case(ROOT / f"cases/{name}.toml", ["run.revolutions=2", newmark, *overrides]))


def ran(ready: PreparedRun, path: str, save: SaveAt | None = None) -> Response:
    """Return a run by a path."""
    return solved(ready.problem, path, save or ready.save, ready.scheme)


def _row(ready: PreparedRun, path: str, automatic: bool) -> dict[str, object]:
    few = SaveAt(field_every=ready.problem.steps, channels=False)
    runs, lean = ([ran(ready, path, save) for _ in range(REPEATS)] for save in (ready.save, few))
    stats = runs[0].stats
    return {
        "forces": len(ready.problem.system.local_forces), "unknowns": stats.unknowns,
        "steps": stats.steps, "path": path, "automatic": automatic, "events": stats.events,
        "iterations": stats.iterations / stats.steps,
        "us_per_step": 1e6 * min(one.stats.seconds for one in runs) / stats.steps,
        "us_probes": 1e6 * min(one.stats.seconds for one in lean) / stats.steps,
    }  # fmt: skip
