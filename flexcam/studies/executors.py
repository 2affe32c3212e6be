"""Distribution of chunks of variants to workers: this process, worker processes or a Dask cluster.

All of them are executors of `concurrent.futures`. A killed worker costs only the variant that kills it every time.
"""

from __future__ import annotations

import logging
import multiprocessing
import os
import signal
import threading
import warnings
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, ExitStack, contextmanager
from copy import copy
from dataclasses import dataclass
from functools import partial
from multiprocessing import resource_tracker
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from flexcam import __version__
from flexcam.case.case import Case
from flexcam.case.reader import CaseFile
from flexcam.core.errors import refuse, require_packages, system_message
from flexcam.dynamics import Cause, ProgressCallback, RunFailedError, Status, track_progress
from flexcam.io import temporary_folder
from flexcam.studies.plan import Bundle, Plan, Row, evaluate_each, make_bundle, open_case
from flexcam.studies.variables import Runs

Variants = Sequence[tuple[str, ...]]  # overrides by variant

# Function that evaluates variants of a case in a worker; it and its rows can be pickled.
Evaluate = Callable[[Bundle | Path, Variants], list[Row]]


@dataclass(frozen=True)
class Chunk:
    """Consecutive variants of a plan."""

    index: int  #: index of the chunk, from 0
    first: int  #: index of its first variant
    variants: tuple[tuple[str, ...], ...]  #: overrides by variant


def divide_variants(variants: Sequence[tuple[str, ...]], size: int) -> tuple[Chunk, ...]:
    """Divide variants into chunks."""
    starts = range(0, len(variants), size)
    return tuple(Chunk(i, first, tuple(variants[first : first + size])) for i, first in enumerate(starts))


@dataclass(frozen=True, eq=False)
class Pool:
    """Started workers."""

    #: function that submits a function and the variants it evaluates; its future returns their rows
    submit: Callable[[Evaluate, Variants], Future[list[Row]]]
    window: int  #: number of chunks submitted at a time; more would only wait
    lost: tuple[type[BaseException], ...]  #: exceptions of a future whose worker died
    has_workers: Callable[[], bool] | None = None  #: function that returns whether any worker is left; None if one is


@dataclass(frozen=True)
class SerialWorkers:
    """Serial execution in the calling process, for few variants and for debugging."""

    @contextmanager
    def open_pool(self, source: Bundle | Path) -> Generator[Pool]:
        """Yield a pool of this process."""
        open_case.cache_clear()  # files may have changed since an earlier pool of this process
        with _unpack(source) as case:

            def submit(evaluate: Evaluate, variants: Variants) -> Future[list[Row]]:
                future: Future[list[Row]] = Future()
                future.set_result(evaluate(case, variants))
                return future

            yield Pool(submit, 1, ())


@dataclass(frozen=True)
class ProcessWorkers:
    """Worker processes on this machine."""

    count: int  #: number of processes; each has one thread for linear algebra

    def __post_init__(self) -> None:
        if self.count < 1:
            raise refuse("--workers", self.count, "a whole number, at least 1")

    @contextmanager
    def open_pool(self, source: Bundle | Path) -> Generator[Pool]:
        """Yield a pool of new processes, started on demand."""
        with _unpack(source) as case, open_processes(self.count) as submit:
            yield Pool(lambda run, variants: submit(run, case, variants), self.count + 1, (BrokenProcessPool,))


def count_cores() -> int:
    """Return the number of cores available to this process."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def open_processes(count: int) -> Generator[Callable[..., Future[Any]]]:
    """Yield a function that submits a call to new processes, started on demand; they end with the context."""
    existing = {process.pid for process in multiprocessing.active_children()}
    # spawn: workers do not inherit threads and locks of this process, on all systems
    executor = ProcessPoolExecutor(count, multiprocessing.get_context("spawn"), initializer=_start_worker)

    def submit(function: Callable[..., Any], *arguments: object) -> Future[Any]:
        with _block_interrupts():
            return executor.submit(function, *arguments)

    first_call = submit(_get_version)
    try:
        yield submit
        if first_call.done() and first_call.exception() is not None:
            remedy = 'a script that sweeps needs its last part under: if __name__ == "__main__":'
            raise RunFailedError(Status(Cause.WORKER_LOST, "no worker process could begin", remedy))
    finally:
        for process in multiprocessing.active_children():
            if process.pid not in existing:
                process.terminate()
        # Once, and with wait: a second call would not cancel, and a remaining thread fails at interpreter exit.
        executor.shutdown(wait=True, cancel_futures=True)


@contextmanager
def _unpack(source: Bundle | Path) -> Generator[Path]:
    with temporary_folder() as folder:
        yield source if isinstance(source, Path) else source.unpack(folder)


def _get_version() -> str:
    return __version__


def _start_worker() -> None:
    """Limit a worker process to one linear algebra thread, and end it when its parent has ended for any reason."""
    from threadpoolctl import threadpool_limits  # pyright: ignore[reportMissingTypeStubs]

    os.environ.update(dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1"))
    threadpool_limits(1)  # of the libraries that are loaded already
    parent = multiprocessing.parent_process()

    def follow() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=follow, daemon=True).start()


@contextmanager
def _block_interrupts() -> Generator[None]:
    """Block Ctrl-C in processes and threads started in the context: this process ends the sweep."""
    if not hasattr(signal, "pthread_sigmask"):  # not available on all systems
        yield
        return
    resource_tracker.ensure_running()  # starting it later would unblock the signal
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


KILLED_STATUS = Status(
    Cause.WORKER_LOST,
    "the process that ran this variant alone was killed, as the ones before it",
    "memory is the usual cause: save fewer fields (output.field_every), or run fewer at a time (--workers)",
)
_NO_WORKERS_STATUS = Status(Cause.WORKER_LOST, "the cluster has no workers left", "start some; --resume does the rest")
_CLUSTER_LOST_STATUS = Status(Cause.WORKER_LOST, "the connection to the scheduler was lost", "--resume does the rest")
_PATIENCE = 60.0  # time without a finished chunk after which flexcam checks the workers of a cluster, s
# Function that runs chunks and yields each with its rows as soon as it is finished.
ChunkRunner = Callable[[Evaluate, Iterable[Chunk]], Iterator[tuple[Chunk, list[Row]]]]


@contextmanager
def open_runner(workers: Workers, source: Bundle | Path) -> Generator[ChunkRunner]:
    """Yield a function that runs chunks on workers, which remain between its calls.

    A chunk whose worker was killed is repeated alone, and then its variants one by one: a variant that kills its worker
    again gets a row with that status.
    """
    start = partial(workers.open_pool, source)
    with ExitStack() as stack:
        pools: list[Pool] = []

        def run(evaluate: Evaluate, chunks: Iterable[Chunk]) -> Iterator[tuple[Chunk, list[Row]]]:
            waiting = deque(chunks)
            while waiting:
                suspects = list[Chunk]()
                if not pools:
                    pools.append(stack.enter_context(start()))
                for chunk, future in _submit_chunks(pools[0], evaluate, waiting):
                    if future.cancelled():
                        raise RunFailedError(_CLUSTER_LOST_STATUS)
                    if isinstance(future.exception(), pools[0].lost):
                        suspects.append(chunk)
                    else:
                        yield chunk, future.result()
                if suspects or waiting:  # the pool is broken
                    pools.clear()
                    stack.close()
                for chunk in suspects:
                    yield chunk, _repeat(start, evaluate, chunk.variants)

        yield run


def _submit_chunks(pool: Pool, evaluate: Evaluate, waiting: deque[Chunk]) -> Iterator[tuple[Chunk, Future[list[Row]]]]:
    """Yield chunks and their finished futures; chunks rejected by a broken pool remain in the queue."""
    running: dict[Future[list[Row]], Chunk] = {}
    broken = False
    while running or (waiting and not broken):
        while waiting and not broken and len(running) < pool.window:
            try:
                running[pool.submit(evaluate, waiting[0].variants)] = waiting[0]
                waiting.popleft()
            except pool.lost:
                broken = True
        done = wait(running, _PATIENCE, FIRST_COMPLETED).done
        if not done and pool.has_workers is not None and not pool.has_workers():
            raise RunFailedError(_NO_WORKERS_STATUS)
        for future in done:
            yield running.pop(future), future


def _repeat(start: Callable[[], AbstractContextManager[Pool]], evaluate: Evaluate, variants: Variants) -> list[Row]:
    """Return the rows of variants whose worker was killed, run together alone, and if it dies again, one by one."""
    with start() as pool:
        try:
            return pool.submit(evaluate, variants).result()
        except pool.lost:
            pass
    if len(variants) == 1:
        return [Row(KILLED_STATUS)]
    return [row for variant in variants for row in _repeat(start, evaluate, (variant,))]


_TIMEOUT = 5.0  # timeout of a scheduler, and then of its workers, s
_UNLIMITED = 1_000_000  # window of a cluster, whose scheduler holds all tasks
LOCAL = "local"  # address of a local Dask cluster


@dataclass(frozen=True)
class ClusterWorkers:
    """Workers of a Dask cluster."""

    address: str  #: address of the scheduler, such as ``tcp://10.0.0.1:8786``; ``local`` for workers on this machine
    count: int = 1  #: number of workers of a local cluster; ignored for others

    def __post_init__(self) -> None:
        if self.count < 1:
            raise refuse("--workers", self.count, "a whole number, at least 1")

    @contextmanager
    def open_pool(self, source: Bundle | Path) -> Generator[Pool]:
        """Yield the workers of the cluster."""
        require_packages("--scheduler", self.address, "cluster", "distributed")
        from distributed import Client, KilledWorker, LocalCluster
        from distributed.comm.core import CommClosedError

        cluster: Any = self.address
        quiet: dict[str, Any] = {"dashboard_address": None, "silence_logs": logging.CRITICAL}
        try:
            with _suppress_dask_log(), warnings.catch_warnings(), ExitStack() as stack:
                if self.address == LOCAL:
                    with _block_interrupts():
                        cluster = LocalCluster(n_workers=self.count, threads_per_worker=1, processes=True, **quiet)
                    stack.enter_context(cluster)
                else:
                    _check_address(self)
                client: Any = stack.enter_context(Client(cluster, timeout=_TIMEOUT))
                # large cases, different versions of other packages
                warnings.filterwarnings("ignore", module="distributed")
                _check_workers(client, self)
                # A task that loads the case instead of the case itself: Dask repeats it if a worker is lost.
                case = client.submit(copy, source, pure=False)
                submit = client.get_executor(pure=False).submit
                yield Pool(
                    lambda run, variants: submit(run, case, variants), _UNLIMITED, (KilledWorker,),
                    lambda: bool(client.scheduler_info()["workers"]),
                )  # fmt: skip
        except CommClosedError:  # an OSError, but none of a disk
            raise RunFailedError(_CLUSTER_LOST_STATUS) from None


Workers = SerialWorkers | ProcessWorkers | ClusterWorkers


@contextmanager
def _suppress_dask_log() -> Generator[None]:
    """Suppress the log of Dask: lost workers are reported by rows, a lost scheduler by a status."""
    names = [name for name in logging.root.manager.loggerDict if name.partition(".")[0] == "distributed"]
    levels = {name: logging.getLogger(name).level for name in names}
    for name in names:
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for name, level in levels.items():
            logging.getLogger(name).setLevel(level)


def _check_address(workers: ClusterWorkers) -> None:
    """Raise an error if no scheduler answers within the timeout; Dask's client may wait without limit."""
    import asyncio

    from distributed.core import rpc
    from distributed.security import Security

    async def greet() -> None:
        security: Any = Security()
        scheduler: Any = rpc(workers.address, connection_args=security.get_connection_args("client"))
        async with asyncio.timeout(_TIMEOUT), scheduler:
            await scheduler.identity()

    try:
        _ = urlsplit(workers.address).port  # Dask maps a port above 65535 to another one
        asyncio.run(greet())
    except Exception as fault:  # noqa: BLE001 - of many kinds, from sockets, Dask and what answers in its place
        cause: Any = fault
        while inner := cause.__cause__ or cause.__context__:  # Dask tries again until the timeout
            cause = inner
        reason = system_message(fault if isinstance(fault, ValueError) else cause) or "no scheduler answers"
        why, allowed = f"none answers there within {_TIMEOUT:g} s: {reason}", "the address of a Dask scheduler"
        remedy = "write tcp://HOST:PORT, check host, port and network, start a dask scheduler, or use --workers N"
        raise refuse("--scheduler", workers.address or "nothing", allowed, why, remedy) from None


def _check_workers(client: Any, workers: ClusterWorkers) -> None:  # noqa: ANN401 - distributed has no types
    """Raise an error for a cluster without workers, or with workers that have another version of flexcam."""
    why, allowed, remedy = "", f"workers with flexcam {__version__}", "install it there"
    try:
        client.wait_for_workers(1, timeout=_TIMEOUT)
        versions = {str(version) for version in client.run(_get_version).values()}
        why = "" if versions == {__version__} else f"they have flexcam {', '.join(sorted(versions))}"
    except TimeoutError:
        why, remedy = "the scheduler has no workers", f"start some: dask worker {workers.address}"
    except ModuleNotFoundError as fault:
        why = str(fault)
    if why:
        raise refuse("--scheduler", workers.address, allowed, why, remedy)


@contextmanager
def open_evaluators(
    file: CaseFile, fixed: Sequence[str], *functions: Callable[[Case], Row],
    plan: Plan | None = None, workers: int = 1, advance: ProgressCallback | None = None,
) -> Generator[list[Runs]]:  # fmt: skip
    """Yield, for each function, one that evaluates variants of a file, as it is now, on the same workers.

    The workers evaluate variants one by one, and end with the context. The progress counts those of the first function.
    """

    def run(variants: Variants, evaluate: Evaluate, shown: ProgressCallback | None) -> Iterator[Row]:
        finished, count = dict[int, Row](), 0
        for chunk, rows in track_progress(run_chunks(evaluate, divide_variants(variants, 1)), shown):
            finished[chunk.index] = rows[0]
            while count in finished:
                yield finished.pop(count)
                count += 1

    evaluations = [partial(evaluate_each, evaluate=function, fixed=tuple(fixed)) for function in functions]
    pool = SerialWorkers() if workers == 1 else ProcessWorkers(workers)
    with open_runner(pool, make_bundle(file, plan, fixed)) as run_chunks:
        yield [partial(run, evaluate=each, shown=None if i else advance) for i, each in enumerate(evaluations)]
