"""Newmark steps of shafts from ten to a hundred thousand unknowns."""

from __future__ import annotations

import math
from dataclasses import replace

from benchmarks.paths import solved, ways
from benchmarks.peers.with_flexcam import shaft
from benchmarks.peers.work import Work
from benchmarks.timing import least
from flexcam.dynamics import ConstantSpeed, Problem, SaveAt

SHAFTS = (Work(elements=2), *(Work(spans=spans) for spans in (1, 2, 4, 17, 52, 172, 517, 1724)))
"""From 12 to 99994 unknowns; the second is B1."""
STEPS, FEWEST = 7200, 48


def measured() -> list[dict[str, object]]:
    """Return time per step and before the first one, by size, path and what is saved."""
    rows = []
    for few, many in map(_problems, SHAFTS):
        for path, automatic in ways(many).items():
            about = {"unknowns": many.system.size, "steps": many.steps, "path": path, "automatic": automatic}
            rows += [about | {"saved": saved} | _row(few, many, path, saved) for saved in ("probes", "all")]
    return rows


def steps(work: Work) -> None:
    """Walk through the long run of a shaft, its probes saved."""
    _, many = _problems(work)
    solved(many, save=_save("probes", many))


def _problems(work: Work) -> tuple[Problem, Problem]:
    """Return a short and a long run of a shaft; the longer the shaft, the fewer steps."""
    system = shaft(work)
    steps = max(FEWEST, min(STEPS, 7_200_000 // system.size // 12 * 12))
    drive, step = ConstantSpeed(2.0 * math.pi * 25.0), work.step(25.0)
    many = Problem(system, drive, step=step, steps=steps)
    return replace(many, steps=steps // 4), many


def _row(few: Problem, many: Problem, path: str, saved: str) -> dict[str, float | str]:
    """Return figures of a short and a long run by one path; their difference is steps and nothing else."""
    try:
        short, long = (_seconds(one, path, _save(saved, one)) for one in (few, many))
    except MemoryError:
        return {"missing": "more memory than there is"}
    each = (long - short) / (many.steps - few.steps)
    return {"us_per_step": 1e6 * each, "before_ms": 1e3 * max(short - few.steps * each, 0.0), "seconds": long}


def _seconds(problem: Problem, path: str, save: SaveAt) -> float:
    return least(lambda: solved(problem, path, save), 5 if problem.system.size < 1000 else 3)


def _save(saved: str, problem: Problem) -> SaveAt:
    if saved == "all":
        return SaveAt(field_every=1, channels=False)
    return SaveAt(field_every=problem.steps, fields_per_block=1, channels=False)
