"""Recompute every golden; write them with `--write`, else print what moved.

`python tests/golden/make_golden.py [--write] [--only SUBSTRING] [--jobs 2]`, from the top of the repository.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[2]))

from tests.golden.commands import COMMANDS, Command
from tests.golden.runs import Run, runs
from tests.golden.surface import Record, environment, run_record

DATA = Path(__file__).parent / "data"

RENAMED: dict[str, str] = {}
"""What stands in the goldens under another name now: old to new, as a part of a quantity's name or a whole word.

A JSON key, a channel or an engine that is renamed on purpose gets a row here, until the goldens are written anew.
"""

TOLERANCES = {"linear": 1e-10, "smooth": 1e-8, "switching": 1e-6, "reduced": 1e-5, "command": 1e-6}
"""Largest difference of a quantity, as a part of its peak, by the kind of the run.

A linear run is a chain of products, which rounding moves by parts of 1e12. In a smooth one forces of contacts are found
by iteration, to 1e-12 of the largest force at every step. Where contacts open and close, a touchdown multiplies
what is left of it. A reduced one rests on an eigensolver, whose shapes are as exact as their frequencies lie apart, or
on the tolerance of an integrator of scipy. Commands ask runs, differences of runs and eigenvalues. All were measured by
other machine code of the linear algebra (OPENBLAS_CORETYPE=Nehalem).
"""

REDUCED = ("modes/", "craig-bampton/", "radau/")
"""Runs that are reduced: beginnings of their names."""

FITTED = ("models-lift-table",)
"""Goldens whose lift is a spline fitted to points: its least squares leave 1e-10."""

RATES = {
    "torque.mean": 1e4, "power.mean": 1e4, "valve_loft": 1e3,  # differences of nearly equal numbers
    "acceleration": 1000.0, "velocity": 10.0, "force": 10.0, "torque": 10.0, "compression": 10.0, "pressure": 10.0,
    "buckling_use": 10.0, "stress": 10.0, "deflection": 10.0, "twist": 10.0,
}  # fmt: skip
"""By how much more a quantity may differ: rounding of a displacement is divided by the step, once or twice, or it is
multiplied by the stiffness of what touches."""

GROUND = 0.1
"""A quantity below this part of the largest of its kind is measured by that part: it may be rounding alone."""

FLOOR = {"energy_lost": 1.0, "energy_numerical": 1.0, "imbalance": 1.0, "periodicity": 1.0, "gap": 1.0, "growth": 1e-3}
"""Least scale of some quantities, parts of one; that of all others is `MIN_REDUCTION`."""

LEAST = 1e-7
"""In SI units: motions and forces below it are what rounding leaves."""


@dataclass(frozen=True)
class Moved:
    """A quantity that differs: where it stands, the largest difference relative to its peak, what is allowed."""

    golden: str
    run: str
    quantity: str
    difference: float
    allowed: float
    words: str = ""

    def __str__(self) -> str:
        told = self.words or f"{self.difference:.2e} of the peak, {self.allowed:.0e} allowed"
        return f"{self.golden:32} {self.run:28} {self.quantity:48} {told}"


Job = Run | Command


def jobs(only: str = "") -> list[Job]:
    """Return every run and command whose golden and name hold a text."""
    return [job for job in (*runs(), *COMMANDS) if only in f"{job.golden} {job.name}"]


def computed(job: Job) -> Record:
    """Return the record of a run or command, or the name of the error that left it: one fault hides no other."""
    environment()
    with tempfile.TemporaryDirectory(prefix="flexcam-golden-") as folder:
        try:
            if isinstance(job, Run):
                return run_record([_laid(word) for word in job.words], Path(folder), job.samples)
            return job.record(Path(folder))
        except Exception as fault:  # noqa: BLE001 - whatever leaves the command is what is recorded
            return {"raised": type(fault).__name__, "with": str(fault)[:200]}


def _laid(word: str) -> str:
    """Return a word of a command line with the engine it names as that is called now."""
    key, sign, engine = word.partition("=")
    return f"{key}={RENAMED.get(engine, engine)}" if sign and key == "run.engine" else word


def recomputed(asked: Sequence[Job], workers: int) -> Iterator[tuple[Job, Record]]:
    """Yield every record; a job that ends its process is recorded so, and those it took with it are run alone."""
    with ProcessPoolExecutor(workers) as pool:
        waiting = [(job, pool.submit(computed, job)) for job in asked]
        for job, future in waiting:
            yield job, _taken(future, lambda job=job: _alone(job))


def _taken(future: Future[Record], otherwise: Callable[[], Record]) -> Record:
    try:
        return future.result()
    except BrokenProcessPool:
        return otherwise()


def _alone(job: Job) -> Record:
    with ProcessPoolExecutor(1) as pool:
        return _taken(pool.submit(computed, job), lambda: {"raised": "the process died"})


def kept(golden: str) -> dict[str, Record]:
    """Return the records of a golden by name; none where there is no such file."""
    path = DATA / f"{golden}.json"
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def write(golden: str, records: dict[str, Record]) -> None:
    """Write a golden with a line per quantity."""
    blocks = [f"{json.dumps(name)}: {{\n{_lines(record)}\n}}" for name, record in sorted(records.items())]
    DATA.mkdir(exist_ok=True)
    (DATA / f"{golden}.json").write_text("{\n" + ",\n".join(blocks) + "\n}\n", encoding="utf-8")


def _lines(record: Record) -> str:
    return ",\n".join(f"{json.dumps(key)}:{json.dumps(value, separators=(',', ':'))}" for key, value in record.items())


def compared(golden: str, name: str, old: Record, new: Record) -> list[Moved]:
    """Return what differs between two records of the same run."""
    old = _renamed(old)
    peaks = _peaks(old)
    moved = []
    for quantity in {**old, **new}:
        one, other = old.get(quantity, "absent"), new.get(quantity, "absent")
        least = FLOOR.get(quantity.rpartition("/")[2], LEAST)
        scale = max(peaks.get(quantity, 0.0), GROUND * peaks.get(_group(quantity), 0.0), least)
        allowed = TOLERANCES[_kind(golden, name, old)] * _rate(quantity)
        words, difference = _difference(one, other, scale)
        if words or difference > allowed:
            moved.append(Moved(golden, name, quantity, difference, allowed, words))
    return moved


def _kind(golden: str, name: str, record: Record) -> str:
    kind = str(record.get("kind", "command"))
    if kind in ("linear", "smooth") and name.startswith(REDUCED):
        return "reduced"
    return "smooth" if kind == "linear" and golden in FITTED else kind


def _renamed(record: Record) -> Record:
    renamed = {}
    for key, value in record.items():
        for old, new in RENAMED.items():
            key = key.replace(old, new)
            value = new if value == old else value
        renamed[key] = value
    return renamed


def _rate(quantity: str) -> float:
    return next((factor for word, factor in RATES.items() if word in quantity), 1.0)


def _group(quantity: str) -> str:
    """Return what a quantity is measured with: components of one kind, channels and columns of one unit."""
    parts = quantity.split("/")
    if parts[0] == "csv":
        return f"csv {quantity.rpartition('[')[2]}"
    if parts[0] == "probes":
        return f"probes {parts[2]} {'rotation' if parts[3] in ('rx', 'ry', 'rz') else 'way'}"
    return f"channels {quantity.rpartition('[')[2]}" if parts[0] == "channels" else quantity


def _peaks(record: Record) -> dict[str, float]:
    """Return the peak of every quantity, and of every group of them."""
    peaks: dict[str, float] = {}
    for quantity, value in record.items():
        numbers = value if _are_numbers(value) else [value] if isinstance(value, float) else []
        peak = max(map(abs, numbers), default=0.0)
        peaks[quantity] = peak
        peaks[_group(quantity)] = max(peak, peaks.get(_group(quantity), 0.0))
    return peaks


def _difference(one: object, other: object, scale: float) -> tuple[str, float]:
    """Return what is to be said of two values that cannot be measured, and how far apart two are that can."""
    if isinstance(one, float) and isinstance(other, int | float):
        one, other = [one], [float(other)]
    if _are_numbers(one) and _are_numbers(other):
        one, other = _even(one, other)
        if len(one) != len(other):
            return f"{len(other)} numbers instead of {len(one)}", 0.0
        apart = max((abs(a - b) for a, b in zip(one, other, strict=True)), default=0.0)
        return "", apart / scale
    return ("", 0.0) if one == other else (f"{_short(other)} instead of {_short(one)}", 0.0)


def _are_numbers(value: object) -> bool:
    return isinstance(value, list) and all(isinstance(item, int | float) for item in value)


def _even(one: list[float], other: list[float]) -> tuple[list[float], list[float]]:
    """Return two rows with the one zero of a history that vanishes drawn out to the length of the other."""
    if one == [0.0]:
        return [0.0] * len(other), other
    return (one, [0.0] * len(one)) if other == [0.0] else (one, other)


def _short(value: object) -> str:
    return f"{len(value)} numbers" if _are_numbers(value) and len(value) > 3 else str(value)


def _report(asked: Sequence[Job], workers: int, writes: bool) -> int:
    """Recompute, write or compare, print; return how many quantities moved."""
    goldens = {job.golden: kept(job.golden) for job in asked}
    count = 0
    for job, record in recomputed(asked, workers):
        moved = compared(job.golden, job.name, goldens[job.golden].get(job.name, {}), record)
        count += len(moved)
        if not writes:
            for one in sorted(moved, key=lambda one: -one.difference)[:20]:
                print(one, flush=True)  # noqa: T201
        goldens[job.golden][job.name] = record
    if writes:
        named = {(job.golden, job.name) for job in jobs()}
        for golden, records in goldens.items():
            write(golden, {name: record for name, record in records.items() if (golden, name) in named})
    return count


def main() -> int:
    """Read the command line; return 1 where something moved."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help="write the goldens instead of comparing with them")
    parser.add_argument("--only", default="", help="only goldens and runs whose name holds this text")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    given = parser.parse_args()
    environment()
    began, asked = time.monotonic(), jobs(given.only)
    count = _report(asked, given.jobs, given.write)
    told = f"{len(asked)} runs and commands, {count} quantities moved, {time.monotonic() - began:.0f} s"
    print(told)  # noqa: T201
    return int(count > 0 and not given.write)


if __name__ == "__main__":
    raise SystemExit(main())
