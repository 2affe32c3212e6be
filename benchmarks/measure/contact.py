"""Steps of whole valve trains in contact, of two camshaft revolutions each."""

from __future__ import annotations

from benchmarks.paths import solved, ways
from benchmarks.processes import ROOT
from flexcam import prepare, read_case
from flexcam.response import Response
from flexcam.runner import Prepared

CASES = (
    "pushrod-engine/intake", "pushrod-engine/lever", "direct-acting/bucket", "direct-acting/finger",
    "camshaft-4cyl/camshaft", "li/valve-train", "petrescu/valve-spring",
)  # fmt: skip
REPEATS = 3


def measured() -> list[dict[str, object]]:
    """Return time per step and how much happens in it, by case and path."""
    rows = []
    for name in CASES:
        ready = revolution(name)
        rows += [_row(name, ready, *way) for way in ways(ready.problem, ready.scheme, ready.save).items()]
    return rows


def revolution(name: str) -> Prepared:
    """Return two revolutions of a case, ready to go."""
    return prepare(read_case(ROOT / f"cases/{name}.toml", ["run.revolutions=2"]))


def ran(ready: Prepared, path: str) -> Response:
    """Return a run by a path."""
    return solved(ready.problem, path, ready.save, ready.scheme)


def _row(name: str, ready: Prepared, path: str, automatic: bool) -> dict[str, object]:
    runs = [ran(ready, path) for _ in range(REPEATS)]
    stats = runs[0].stats
    return {
        "case": name, "forces": len(ready.problem.system.local_forces), "unknowns": stats.unknowns,
        "steps": stats.steps, "path": path, "automatic": automatic, "events": stats.events,
        "iterations": stats.iterations / stats.steps,
        "us_per_step": 1e6 * min(one.stats.seconds for one in runs) / stats.steps,
    }  # fmt: skip
