"""Who runs the chunks: this process, processes of this machine, or a Dask cluster.

All get the same plain data and give the same rows: the linear algebra of every worker has one thread.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from multiprocessing import resource_tracker
from pathlib import Path
from typing import Protocol

from flexcam import __version__
from flexcam.checks import refuse
from flexcam.io import scratch
from flexcam.response import Cause, RunFailedError, Status
from flexcam.sweep.bundle import Bundle
from flexcam.sweep.chunks import Outcome, evaluated

Variants = Sequence[tuple[str, ...]]
_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True, eq=False)
class Pool:
    """Workers that are ready.

    Parameters
    ----------
    submit
        Gives them some variants; the future holds the outcomes.
    window
        How many chunks should be under way; more only wait.
    lost
        What a future raises whose worker died.
    """

    submit: Callable[[Variants], Future[list[Outcome]]]
    window: int
    lost: tuple[type[BaseException], ...]


class Workers(Protocol):
    """Who runs chunks."""

    def ready(self, bundle: Bundle, *, histories: bool) -> AbstractContextManager[Pool]:
        """Return workers that have the case; they end with the context."""
        ...


@dataclass(frozen=True)
class Here:
    """The process that asks, one chunk after the other: for few variants, and to see what happens."""

    def ready(self, bundle: Bundle, *, histories: bool) -> AbstractContextManager[Pool]:
        """Return this process."""
        return _here(bundle, histories)


@dataclass(frozen=True)
class Processes:
    """Processes of this machine.

    Parameters
    ----------
    count
        How many; each has one thread of linear algebra.
    """

    count: int

    def __post_init__(self) -> None:
        if self.count < 1:
            raise refuse("--workers", self.count, "a whole number from 1")

    def ready(self, bundle: Bundle, *, histories: bool) -> AbstractContextManager[Pool]:
        """Return new processes, started as they are needed."""
        return _processes(bundle, self.count, histories)


@contextmanager
def _unpacked(bundle: Bundle) -> Generator[Path]:
    with scratch() as folder:
        yield bundle.unpacked(folder)


@contextmanager
def _here(bundle: Bundle, histories: bool) -> Generator[Pool]:
    def submit(variants: Variants) -> Future[list[Outcome]]:
        future: Future[list[Outcome]] = Future()
        future.set_result(evaluated(case, variants, histories=histories, runs=bundle.runs, channels=bundle.channels))
        return future

    with _unpacked(bundle) as case:
        yield Pool(submit, 1, ())


@contextmanager
def _processes(bundle: Bundle, count: int, histories: bool) -> Generator[Pool]:
    with _unpacked(bundle) as case, one_thread(), pipes_may_break():
        before = {process.pid for process in multiprocessing.active_children()}
        # spawn: threads and locks of this process stay out of the workers, on every system
        executor = ProcessPoolExecutor(count, multiprocessing.get_context("spawn"), initializer=end_with_parent)

        def submit(variants: Variants) -> Future[list[Outcome]]:
            with undisturbed():
                return executor.submit(
                    evaluated, case, variants, histories=histories, runs=bundle.runs, channels=bundle.channels
                )

        with undisturbed():
            awake = executor.submit(_version)
        try:
            yield Pool(submit, count + 1, (BrokenProcessPool,))
            if awake.done() and awake.exception() is not None:
                raise RunFailedError(_ASLEEP)
        finally:
            ended(executor, before)


_ASLEEP = Status(
    Cause.WORKER_LOST,
    "no worker process could begin",
    'a script that sweeps needs its last part under: if __name__ == "__main__":',
)


def _version() -> str:
    return __version__


def ended(executor: Executor, before: set[int | None]) -> None:
    """End the processes of an executor, in the middle of a run if need be."""
    for process in multiprocessing.active_children():
        if process.pid not in before:
            process.terminate()
    # Once, and waiting: a second call would forget to cancel, and a thread left behind trips over its own exit.
    executor.shutdown(wait=True, cancel_futures=True)


def end_with_parent() -> None:
    """Make a worker process end when its parent is gone, however it went."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent.join,), daemon=True).start()


def _end_with(joined: Callable[[], None]) -> None:
    joined()
    os._exit(1)


@contextmanager
def one_thread() -> Generator[None]:
    """Give the linear algebra of processes started meanwhile one thread each."""
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name) if value is None else os.environ.__setitem__(name, value)


@contextmanager
def pipes_may_break() -> Generator[None]:
    """Let a pipe to a process that died raise, as Python means it to, instead of ending this process.

    Libraries such as Gmsh's give the signal its deadly default back behind Python's back.
    """
    if not hasattr(signal, "SIGPIPE") or threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGPIPE, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGPIPE, signal.SIG_IGN if before is None else before)


@contextmanager
def undisturbed() -> Generator[None]:
    """Let processes and threads started meanwhile not see a Ctrl-C: this process decides how a sweep ends."""
    if not hasattr(signal, "pthread_sigmask"):  # not on every system
        yield
        return
    resource_tracker.ensure_running()  # its own start would end the block
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
