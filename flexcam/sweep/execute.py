"""Chunks given to workers until every one has its rows, whatever happens to the workers."""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait

from flexcam.response import Cause, RunFailedError, Status
from flexcam.sweep.bundle import Bundle
from flexcam.sweep.chunks import Chunk, Outcome
from flexcam.sweep.evaluate import Row
from flexcam.sweep.workers import Pool, Workers

Outcomes = list[Outcome]

_KILLER = Status(
    Cause.WORKER_LOST,
    "the process that ran this variant alone was killed, as the ones before it",
    "memory is the usual cause: save fewer fields (output.field_every), or run fewer at a time (--workers)",
)
_GONE = Status(Cause.WORKER_LOST, "the connection to the scheduler was lost", "--resume does the rest")


def executed(
    bundle: Bundle, chunks: Sequence[Chunk], workers: Workers, *, histories: bool = False
) -> Generator[tuple[Chunk, Outcomes]]:
    """Run chunks and yield each with its outcomes, as they come.

    A chunk whose worker was killed is tried again by itself, and then its variants one by one: one that kills its
    worker alone becomes a row that says so.
    """
    waiting, suspects = deque(chunks), deque[Chunk]()
    while waiting:
        with workers.ready(bundle, histories=histories) as pool:
            for chunk, future in _through(pool, waiting):
                if _lost(pool, future):
                    suspects.append(chunk)
                else:
                    yield chunk, future.result()
        while suspects:
            chunk = suspects.popleft()
            yield chunk, _alone(bundle, chunk, workers, histories)


def _through(pool: Pool, waiting: deque[Chunk]) -> Iterator[tuple[Chunk, Future[Outcomes]]]:
    """Yield chunks and their finished futures; those that a broken pool did not take go on waiting."""
    running: dict[Future[Outcomes], Chunk] = {}
    broken = False
    while running or (waiting and not broken):
        while waiting and not broken and len(running) < pool.window:
            try:
                running[pool.submit(waiting[0].variants)] = waiting[0]
                waiting.popleft()
            except pool.lost:
                broken = True
        for future in wait(running, return_when=FIRST_COMPLETED).done:
            yield running.pop(future), future


def _lost(pool: Pool, future: Future[Outcomes]) -> bool:
    if future.cancelled():
        raise RunFailedError(_GONE)
    fault = future.exception()
    return isinstance(fault, pool.lost)


def _alone(bundle: Bundle, chunk: Chunk, workers: Workers, histories: bool) -> Outcomes:
    """Return the outcomes of a chunk during which a worker was killed."""
    whole = _tried(bundle, chunk.variants, workers, histories)
    if whole is not None:
        return whole
    single = [_tried(bundle, (variant,), workers, histories) for variant in chunk.variants]
    return [outcome for one in single for outcome in one or [Outcome(Row(_KILLER))]]


def _tried(bundle: Bundle, variants: Sequence[tuple[str, ...]], workers: Workers, histories: bool) -> Outcomes | None:
    """Return the outcomes of variants that nothing else runs beside; None if their worker was killed again."""
    with workers.ready(bundle, histories=histories) as pool:
        try:
            return pool.submit(variants).result()
        except pool.lost:
            return None
