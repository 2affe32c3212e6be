"""Run the fuzzer: ``python -m tests.fuzz.run --inputs 20000 --seed 1``.

Each process has a memory limit; a process that uses more than ten seconds of CPU time for an input, or dies, is
replaced, and the input counts as broken. Broken inputs are saved in a folder, with the exception that they raised.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from pathlib import Path

LIMIT_SECONDS = 10.0
LIMIT_MEMORY = 3 << 30
"""Address space of a process, bytes: three times the memory mapped by the interpreter and its libraries."""


class Hang(BaseException):
    """Raised by the alarm; no handler of Exception can catch it."""


def _alarm(*_: object) -> None:
    raise Hang


def _work(seed: int, only: str, pipe: Connection) -> None:
    """Run the inputs whose numbers arrive through the pipe and send back their outcomes."""
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    from tests.fuzz.targets import run_input  # before the limit, since libraries map much memory

    resource.setrlimit(resource.RLIMIT_AS, (LIMIT_MEMORY, LIMIT_MEMORY))
    folder = Path(tempfile.mkdtemp(prefix="flexcam-fuzz-"))
    signal.signal(signal.SIGPROF, _alarm)
    while (number := pipe.recv()) is not None:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.setitimer(signal.ITIMER_PROF, LIMIT_SECONDS)
        start = time.monotonic()
        try:
            name, outcome = run_input(number, seed, folder, only)
            detail = ""
        except Hang:
            name, outcome, detail = "", "broken", "hang\n" + traceback.format_exc()
        except BaseException as fault:  # noqa: BLE001 - the fuzzer looks for any exception
            name, outcome, detail = "", "broken", f"{type(fault).__name__}\n" + traceback.format_exc()
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0.0)
        pipe.send((number, name, outcome, detail, time.monotonic() - start))
        signal.signal(signal.SIGPROF, _alarm)
    shutil.rmtree(folder, ignore_errors=True)


@dataclass
class Worker:
    """A worker process and its current input."""

    process: multiprocessing.Process
    pipe: Connection
    number: int = -1
    since: float = 0.0


@dataclass
class Outcomes:
    """Outcomes of all inputs."""

    outcomes: Counter[tuple[str, str]] = field(default_factory=Counter)
    broken: dict[int, str] = field(default_factory=dict)
    slowest: tuple[float, int] = (0.0, -1)


def _start_worker(seed: int, only: str) -> Worker:
    mine, theirs = multiprocessing.Pipe()
    context = multiprocessing.get_context("spawn")
    process = context.Process(target=_work, args=(seed, only, theirs), daemon=True)
    process.start()
    theirs.close()
    return Worker(process, mine)


def fuzz(inputs: int, seed: int, processes: int, only: str = "", first: int = 0, tell: bool = False) -> Outcomes:
    """Run inputs and return their outcomes."""
    from tests.fuzz.targets import make_seeds

    make_seeds()
    results, numbers = Outcomes(), iter(range(first, first + inputs))
    workers = [_start_worker(seed, only) for _ in range(processes)]
    for worker in workers:
        _send_next(worker, numbers)
    while busy := [worker for worker in workers if worker.number >= 0]:
        ready = wait([one.pipe for one in busy], timeout=1.0)
        for worker in busy:
            if worker.pipe in ready:
                _receive(worker, results)
            elif time.monotonic() - worker.since > LIMIT_SECONDS + 290.0:
                results.broken[worker.number] = "hang that no alarm ends"
                worker.process.kill()
                worker.process.join()
            else:
                continue
            if not worker.process.is_alive():
                workers.remove(worker)
                worker = _start_worker(seed, only)
                workers.append(worker)
            _send_next(worker, numbers)
            done = sum(results.outcomes.values()) + len(results.broken)
            if tell and done % 500 == 0:
                sys.stderr.write(f"{done} inputs, {len(results.broken)} broken\n")
    for worker in workers:
        worker.pipe.send(None)
        worker.process.join(5.0)
    return results


def _send_next(worker: Worker, numbers: object) -> None:
    worker.number = next(numbers, -1)  # type: ignore[call-overload]
    worker.since = time.monotonic()
    if worker.number >= 0:
        worker.pipe.send(worker.number)


def _receive(worker: Worker, results: Outcomes) -> None:
    try:
        number, name, outcome, detail, seconds = worker.pipe.recv()
    except (EOFError, ConnectionResetError):
        worker.process.join(5.0)
        results.broken[worker.number] = f"the process died, exit code {worker.process.exitcode}"
        return
    results.slowest = max(results.slowest, (seconds, number))
    if detail:
        results.broken[number] = detail
    else:
        results.outcomes[name, outcome] += 1


def _save_broken(results: Outcomes, seed: int, only: str, folder: Path) -> None:
    """Write the broken inputs again, with the exceptions that they raised."""
    from random import Random

    from tests.fuzz.targets import TARGETS, write_input

    for number, detail in results.broken.items():
        random = Random(f"{seed}-{number}")
        name = only or random.choices(list(TARGETS), [target.share for target in TARGETS.values()])[0]
        place = folder / f"{seed}-{number}"
        place.mkdir(parents=True, exist_ok=True)
        write_input(TARGETS[name], place, random)
        (place / "raised.txt").write_text(f"{name}\n{detail}", encoding="utf-8")


def _main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--inputs", type=int, default=20_000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--only", default="")
    parser.add_argument("--keep", type=Path, default=Path("build/fuzz"))
    given = parser.parse_args()
    results = fuzz(given.inputs, given.seed, given.processes, given.only, given.first, tell=True)
    _save_broken(results, given.seed, given.only, given.keep)
    for (name, outcome), count in sorted(results.outcomes.items()):
        sys.stdout.write(f"{name:12} {outcome:9} {count}\n")
    for number, detail in sorted(results.broken.items()):
        last = detail.strip().rpartition("\n")[2]
        sys.stdout.write(f"broken {number}: {detail.partition(chr(10))[0]}: {last[:200]}\n")
    sys.stdout.write(f"slowest input: {results.slowest[0]:.1f} s, number {results.slowest[1]}\n")
    return 1 if results.broken else 0


if __name__ == "__main__":
    raise SystemExit(_main())
