"""Time of Newmark steps of shafts with ten to a hundred thousand unknowns."""

from __future__ import annotations

import math
from dataclasses import replace

from benchmarks.engines import available_engines, run_engine
from benchmarks.peers.shaft import Shaft
from benchmarks.peers.shaft_flexcam import shaft_system
from benchmarks.timing import minimum_time
from flexcam.dynamics import ConstantSpeed, Problem, SaveAt

SHAFTS = (Shaft(elements=2), *(Shaft(spans=spans) for spans in (1, 2, 4, 17, 52, 172, 517, 1724)))
"""From 12 to 99994 unknowns; the second is B1."""
STEPS, MIN_STEPS = 7200, 48


def measure_table() -> list[dict[str, object]]:
    """Return time per step and before the first step, by size, engine and saved quantities."""
    rows = []
    for short, long in map(_problems, SHAFTS):
        for engine, automatic in available_engines(long).items():
            labels = {"unknowns": long.system.size, "steps": long.steps, "path": engine, "automatic": automatic}
            rows += [labels | {"saved": saved} | _row(short, long, engine, saved) for saved in ("probes", "all")]
    return rows


def run_shaft(shaft: Shaft) -> None:
    """Run the long problem of a shaft with its probes saved."""
    _, problem = _problems(shaft)
    run_engine(problem, save=_save("probes", problem))


def _problems(shaft: Shaft) -> tuple[Problem, Problem]:
    """Return a short and a long run of a shaft; the longer the shaft, the fewer steps."""
    system = shaft_system(shaft)
    steps = max(MIN_STEPS, min(STEPS, 7_200_000 // system.size // 12 * 12))
    drive, step = ConstantSpeed(2.0 * math.pi * 25.0), shaft.step(25.0)
    long = Problem(system, drive, step=step, steps=steps)
    return replace(long, steps=steps // 4), long


def _row(short: Problem, long: Problem, engine: str, saved: str) -> dict[str, float | str]:
    """Return the times of an engine; the difference of a short and a long run is the time of the additional steps."""
    try:
        short_time, long_time = (_seconds(run, engine, _save(saved, run)) for run in (short, long))
    except MemoryError:
        return {"missing": "more memory than there is"}
    per_step = (long_time - short_time) / (long.steps - short.steps)
    before = max(short_time - short.steps * per_step, 0.0)
    return {"us_per_step": 1e6 * per_step, "before_ms": 1e3 * before, "seconds": long_time}


def _seconds(problem: Problem, engine: str, save: SaveAt) -> float:
    return minimum_time(lambda: run_engine(problem, engine, save), 5 if problem.system.size < 1000 else 3)


def _save(saved: str, problem: Problem) -> SaveAt:
    if saved == "all":
        return SaveAt(field_every=1, channels=False)
    return SaveAt(field_every=problem.steps, fields_per_block=1, channels=False)
