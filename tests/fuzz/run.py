"""Run the fuzzer: ``python -m tests.fuzz.run --inputs 20000 --seed 1``.

Every process has a limit of memory; one that takes more than ten seconds of its processor over an input, or dies, is
replaced, and the input counts as broken. Broken inputs are kept in a folder, with what they raised.
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
"""Address space of a process, bytes: three times what the interpreter and its libraries map."""


class Hang(BaseException):
    """Raised by the alarm: nothing may swallow it."""


def _alarm(*_: object) -> None:
    raise Hang


def _work(seed: int, only: str, pipe: Connection) -> None:
    """Feed the inputs whose numbers come in; say what came of each."""
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    from tests.fuzz.targets import tried  # before the limit: libraries are mapped, not filled

    resource.setrlimit(resource.RLIMIT_AS, (LIMIT_MEMORY, LIMIT_MEMORY))
    folder = Path(tempfile.mkdtemp(prefix="flexcam-fuzz-"))
    signal.signal(signal.SIGPROF, _alarm)
    while (number := pipe.recv()) is not None:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.setitimer(signal.ITIMER_PROF, LIMIT_SECONDS)
        start = time.monotonic()
        try:
            name, outcome = tried(number, seed, folder, only)
            detail = ""
        except Hang:
            name, outcome, detail = "", "broken", "hang\n" + traceback.format_exc()
        except BaseException as fault:  # noqa: BLE001 - that is what is looked for
            name, outcome, detail = "", "broken", f"{type(fault).__name__}\n" + traceback.format_exc()
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0.0)
        pipe.send((number, name, outcome, detail, time.monotonic() - start))
        signal.signal(signal.SIGPROF, _alarm)
    shutil.rmtree(folder, ignore_errors=True)


@dataclass
class Hand:
    """A worker process and the input it has in hand."""

    process: multiprocessing.Process
    pipe: Connection
    number: int = -1
    since: float = 0.0


@dataclass
class Found:
    """What came of all inputs."""

    outcomes: Counter[tuple[str, str]] = field(default_factory=Counter)
    broken: dict[int, str] = field(default_factory=dict)
    slowest: tuple[float, int] = (0.0, -1)


def _hand(seed: int, only: str) -> Hand:
    mine, theirs = multiprocessing.Pipe()
    context = multiprocessing.get_context("spawn")
    process = context.Process(target=_work, args=(seed, only, theirs), daemon=True)
    process.start()
    theirs.close()
    return Hand(process, mine)


def fuzz(inputs: int, seed: int, processes: int, only: str = "", first: int = 0, tell: bool = False) -> Found:
    """Feed inputs and return what came of them."""
    from tests.fuzz.targets import make_seeds

    make_seeds()
    found, numbers = Found(), iter(range(first, first + inputs))
    hands = [_hand(seed, only) for _ in range(processes)]
    for hand in hands:
        _next(hand, numbers)
    while busy := [hand for hand in hands if hand.number >= 0]:
        heard = wait([one.pipe for one in busy], timeout=1.0)
        for hand in busy:
            if hand.pipe in heard:
                _heard(hand, found)
            elif time.monotonic() - hand.since > LIMIT_SECONDS + 290.0:
                found.broken[hand.number] = "hang that no alarm ends"
                hand.process.kill()
                hand.process.join()
            else:
                continue
            if not hand.process.is_alive():
                hands.remove(hand)
                hand = _hand(seed, only)
                hands.append(hand)
            _next(hand, numbers)
            done = sum(found.outcomes.values()) + len(found.broken)
            if tell and done % 500 == 0:
                sys.stderr.write(f"{done} inputs, {len(found.broken)} broken\n")
    for hand in hands:
        hand.pipe.send(None)
        hand.process.join(5.0)
    return found


def _next(hand: Hand, numbers: object) -> None:
    hand.number = next(numbers, -1)  # type: ignore[call-overload]
    hand.since = time.monotonic()
    if hand.number >= 0:
        hand.pipe.send(hand.number)


def _heard(hand: Hand, found: Found) -> None:
    try:
        number, name, outcome, detail, seconds = hand.pipe.recv()
    except (EOFError, ConnectionResetError):
        hand.process.join(5.0)
        found.broken[hand.number] = f"the process died, exit code {hand.process.exitcode}"
        return
    found.slowest = max(found.slowest, (seconds, number))
    if detail:
        found.broken[number] = detail
    else:
        found.outcomes[name, outcome] += 1


def _keep(found: Found, seed: int, only: str, folder: Path) -> None:
    """Write the broken inputs again, with what they raised."""
    from random import Random

    from tests.fuzz.targets import TARGETS, write_input

    for number, detail in found.broken.items():
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
    found = fuzz(given.inputs, given.seed, given.processes, given.only, given.first, tell=True)
    _keep(found, given.seed, given.only, given.keep)
    for (name, outcome), count in sorted(found.outcomes.items()):
        sys.stdout.write(f"{name:12} {outcome:9} {count}\n")
    for number, detail in sorted(found.broken.items()):
        last = detail.strip().rpartition("\n")[2]
        sys.stdout.write(f"broken {number}: {detail.partition(chr(10))[0]}: {last[:200]}\n")
    sys.stdout.write(f"slowest input: {found.slowest[0]:.1f} s, number {found.slowest[1]}\n")
    return 1 if found.broken else 0


if __name__ == "__main__":
    raise SystemExit(_main())
