"""Newmark steps of shafts from ten to a hundred thousand unknowns."""

from __future__ import annotations

import math

from benchmarks.paths import BOTH, solved
from benchmarks.peers.with_flexcam import shaft
from benchmarks.peers.work import Work
from benchmarks.timing import least
from flexcam.integrate import Problem, SaveAt
from flexcam.system import ConstantSpeed

SHAFTS = (Work(elements=2), *(Work(spans=spans) for spans in (1, 2, 4, 17, 52, 172, 517, 1724)))
"""From 12 to 99994 unknowns; the second is B1."""
STEPS, FEWEST = 7200, 48


def measured() -> list[dict[str, object]]:
    """Return time per step and before the first one, by size, path and what is saved."""
    ways = [(path, saved) for path in BOTH for saved in ("probes", "all")]
    return [_row(problems, *way) for problems in map(_problems, SHAFTS) for way in ways]


def _problems(work: Work) -> list[Problem]:
    """Return a short and a long run of a shaft; the longer the shaft, the fewer steps."""
    system = shaft(work)
    steps = max(FEWEST, min(STEPS, 7_200_000 // system.size // 12 * 12))
    drive, step = ConstantSpeed(2.0 * math.pi * 25.0), work.step(25.0)
    return [Problem(system, drive, step=step, steps=n) for n in (steps // 4, steps)]


def _row(problems: list[Problem], path: str, saved: str) -> dict[str, object]:
    asked = {"unknowns": problems[1].system.size, "steps": problems[1].steps, "path": path, "saved": saved}
    try:
        return asked | _figures(problems, path, saved)
    except MemoryError:
        return asked | {"missing": "more memory than there is"}


def _figures(problems: list[Problem], path: str, saved: str) -> dict[str, object]:
    """Return figures of a short and a long run by one way; their difference is steps and nothing else."""
    way = solved(problems[1], path, _save(saved, problems[1])).stats.path
    few, many = (one.steps for one in problems)
    took = [least(lambda one=one: solved(one, way, _save(saved, one)), _repeats(one)) for one in problems]
    each = (took[1] - took[0]) / (many - few)
    before = max(took[0] - few * each, 0.0)
    return {"used": way, "us_per_step": 1e6 * each, "before_ms": 1e3 * before, "seconds": took[1]}


def _save(saved: str, problem: Problem) -> SaveAt:
    return SaveAt(field_every=1) if saved == "all" else SaveAt(field_every=problem.steps, fields_per_block=1)


def _repeats(problem: Problem) -> int:
    return 5 if problem.system.size < 1000 else 3
