"""Recompute every golden; write them with `--write`, else print the differences.

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
from tests.golden.records import Record, environment, run_record
from tests.golden.runs import Run, runs

DATA = Path(__file__).parent / "data"

RENAMES: dict[str, str] = {}
"""Renamed quantities and engines, old to new, as a part of a quantity's name or a complete word.

An intended rename of a JSON key, a channel or an engine gets an entry here until the goldens are written again.
"""

TOLERANCES = {"linear": 1e-10, "smooth": 1e-8, "switching": 1e-6, "reduced": 1e-5, "command": 1e-6}
"""Maximum difference of a quantity relative to its peak, by the kind of the run.

A linear run is a chain of products, with rounding differences of 1e-12. A smooth run finds contact forces by
iteration, to 1e-12 of the maximum force at every step. In a switching run, where contacts open and close, touchdowns
amplify the remaining error. A reduced run depends on an eigensolver, whose shapes are as accurate as the frequencies
are separated, or on the tolerance of an integrator of scipy. Commands compute runs, differences of runs and
eigenvalues. All values were measured with other machine code of the linear algebra (OPENBLAS_CORETYPE=Nehalem).
"""

REDUCED = ("modes/", "craig-bampton/", "radau/")
"""Prefixes of the names of reduced runs."""

FITTED = ("models-lift-table",)
"""Goldens whose lift is a spline fitted to points: the error of its least squares is 1e-10."""

TOLERANCE_FACTORS = {
    "torque.mean": 1e4, "power.mean": 1e4, "valve_loft": 1e3,  # differences of nearly equal numbers
    "acceleration": 1000.0, "velocity": 10.0, "force": 10.0, "torque": 10.0, "compression": 10.0, "pressure": 10.0,
    "buckling_use": 10.0, "stress": 10.0, "deflection": 10.0, "twist": 10.0,
}  # fmt: skip
"""Factors of the tolerance of a quantity: the rounding of a displacement is divided by the step, once or twice, or
multiplied by the contact stiffness."""

GROUP_SCALE = 0.1
"""Minimum scale of a quantity relative to the maximum of its group, below which it may be rounding."""

FLOOR = {"energy_lost": 1.0, "energy_numerical": 1.0, "imbalance": 1.0, "periodicity": 1.0, "gap": 1.0, "growth": 1e-3}
"""Minimum scale of some quantities, relative to one; that of all others is `MIN_SCALE`."""

MIN_SCALE = 1e-7
"""Minimum scale in SI units: smaller motions and forces are rounding."""


@dataclass(frozen=True)
class Deviation:
    """A difference of a quantity: its place, the maximum difference relative to its peak, and the tolerance."""

    golden: str
    run: str
    quantity: str
    difference: float
    allowed: float
    words: str = ""

    def __str__(self) -> str:
        text = self.words or f"{self.difference:.2e} of the peak, {self.allowed:.0e} allowed"
        return f"{self.golden:32} {self.run:28} {self.quantity:48} {text}"


Job = Run | Command


def jobs(only: str = "") -> list[Job]:
    """Return every run and command whose golden and name contain a text."""
    return [job for job in (*runs(), *COMMANDS) if only in f"{job.golden} {job.name}"]


def compute_record(job: Job) -> Record:
    """Return the record of a run or command, or the name of its error, so that other jobs continue."""
    environment()
    with tempfile.TemporaryDirectory(prefix="flexcam-golden-") as folder:
        try:
            if isinstance(job, Run):
                return run_record([_rename_engine(word) for word in job.words], Path(folder), job.samples)
            return job.record(Path(folder))
        except Exception as fault:  # noqa: BLE001 - any error of the command is recorded
            return {"raised": type(fault).__name__, "with": str(fault)[:200]}


def _rename_engine(word: str) -> str:
    """Return a word of a command line with the current name of its engine."""
    key, sign, engine = word.partition("=")
    return f"{key}={RENAMES.get(engine, engine)}" if sign and key == "run.engine" else word


def compute_records(selected: Sequence[Job], workers: int) -> Iterator[tuple[Job, Record]]:
    """Yield every record; a job that ends its process is recorded as such, and jobs lost with it run separately."""
    with ProcessPoolExecutor(workers) as pool:
        waiting = [(job, pool.submit(compute_record, job)) for job in selected]
        for job, future in waiting:
            yield job, _result_or(future, lambda job=job: _compute_alone(job))


def _result_or(future: Future[Record], otherwise: Callable[[], Record]) -> Record:
    try:
        return future.result()
    except BrokenProcessPool:
        return otherwise()


def _compute_alone(job: Job) -> Record:
    with ProcessPoolExecutor(1) as pool:
        return _result_or(pool.submit(compute_record, job), lambda: {"raised": "the process died"})


def read_golden(golden: str) -> dict[str, Record]:
    """Return the records of a golden by name, or an empty dict without such a file."""
    path = DATA / f"{golden}.json"
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def write(golden: str, records: dict[str, Record]) -> None:
    """Write a golden with one line per quantity."""
    blocks = [f"{json.dumps(name)}: {{\n{_lines(record)}\n}}" for name, record in sorted(records.items())]
    DATA.mkdir(exist_ok=True)
    (DATA / f"{golden}.json").write_text("{\n" + ",\n".join(blocks) + "\n}\n", encoding="utf-8")


def _lines(record: Record) -> str:
    return ",\n".join(f"{json.dumps(key)}:{json.dumps(value, separators=(',', ':'))}" for key, value in record.items())


def compare_records(golden: str, name: str, old: Record, new: Record) -> list[Deviation]:
    """Return the differences between two records of the same run."""
    old = _apply_renames(old)
    peaks = _peaks(old)
    moved = []
    for quantity in {**old, **new}:
        one, other = old.get(quantity, "absent"), new.get(quantity, "absent")
        least = FLOOR.get(quantity.rpartition("/")[2], MIN_SCALE)
        scale = max(peaks.get(quantity, 0.0), GROUP_SCALE * peaks.get(_group(quantity), 0.0), least)
        allowed = TOLERANCES[_kind(golden, name, old)] * _tolerance_factor(quantity)
        words, difference = _difference(one, other, scale)
        if words or difference > allowed:
            moved.append(Deviation(golden, name, quantity, difference, allowed, words))
    return moved


def _kind(golden: str, name: str, record: Record) -> str:
    kind = str(record.get("kind", "command"))
    if kind in ("linear", "smooth") and name.startswith(REDUCED):
        return "reduced"
    return "smooth" if kind == "linear" and golden in FITTED else kind


def _apply_renames(record: Record) -> Record:
    renamed = {}
    for key, value in record.items():
        for old, new in RENAMES.items():
            key = key.replace(old, new)
            value = new if value == old else value
        renamed[key] = value
    return renamed


def _tolerance_factor(quantity: str) -> float:
    return next((factor for word, factor in TOLERANCE_FACTORS.items() if word in quantity), 1.0)


def _group(quantity: str) -> str:
    """Return the group of a quantity: components of one kind, channels and columns of one unit."""
    parts = quantity.split("/")
    if parts[0] == "csv":
        return f"csv {quantity.rpartition('[')[2]}"
    if parts[0] == "probes" and len(parts) > 3:
        return f"probes {parts[2]} {'rotation' if parts[3] in ('rx', 'ry', 'rz') else 'way'}"
    return f"channels {quantity.rpartition('[')[2]}" if parts[0] == "channels" else quantity


def _peaks(record: Record) -> dict[str, float]:
    """Return the peak of every quantity and of every group."""
    peaks: dict[str, float] = {}
    for quantity, value in record.items():
        numbers = value if _are_numbers(value) else [value] if isinstance(value, float) else []
        peak = max(map(abs, numbers), default=0.0)
        peaks[quantity] = peak
        peaks[_group(quantity)] = max(peak, peaks.get(_group(quantity), 0.0))
    return peaks


def _difference(one: object, other: object, scale: float) -> tuple[str, float]:
    """Return a description of two values that are not numbers, or the relative difference of two that are."""
    if isinstance(one, float) and isinstance(other, int | float):
        one, other = [one], [float(other)]
    if _are_numbers(one) and _are_numbers(other):
        one, other = _equalize(one, other)
        if len(one) != len(other):
            return f"{len(other)} numbers instead of {len(one)}", 0.0
        apart = max((abs(a - b) for a, b in zip(one, other, strict=True)), default=0.0)
        return "", apart / scale
    return ("", 0.0) if one == other else (f"{_short(other)} instead of {_short(one)}", 0.0)


def _are_numbers(value: object) -> bool:
    return isinstance(value, list) and all(isinstance(item, int | float) for item in value)


def _equalize(one: list[float], other: list[float]) -> tuple[list[float], list[float]]:
    """Return two rows of equal length, where the single zero of a vanishing history is repeated."""
    if one == [0.0]:
        return [0.0] * len(other), other
    return (one, [0.0] * len(one)) if other == [0.0] else (one, other)


def _short(value: object) -> str:
    return f"{len(value)} numbers" if _are_numbers(value) and len(value) > 3 else str(value)


def _report(selected: Sequence[Job], workers: int, writes: bool) -> int:
    """Recompute, write or compare, and print; return the number of differing quantities."""
    goldens = {job.golden: read_golden(job.golden) for job in selected}
    count = 0
    for job, record in compute_records(selected, workers):
        moved = compare_records(job.golden, job.name, goldens[job.golden].get(job.name, {}), record)
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
    """Read the command line; return 1 if a quantity differs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help="write the goldens instead of comparing with them")
    parser.add_argument("--only", default="", help="only goldens and runs whose name holds this text")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    given = parser.parse_args()
    environment()
    started, selected = time.monotonic(), jobs(given.only)
    count = _report(selected, given.jobs, given.write)
    text = f"{len(selected)} runs and commands, {count} quantities moved, {time.monotonic() - started:.0f} s"
    print(text)  # noqa: T201
    return int(count > 0 and not given.write)


if __name__ == "__main__":
    raise SystemExit(main())
