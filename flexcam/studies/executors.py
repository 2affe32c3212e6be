"""Distribution of chunks to workers, with recovery from killed workers."""

from __future__ import annotations

import logging
import multiprocessing
import os
import signal
import socket
import threading
import warnings
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from multiprocessing import resource_tracker
from pathlib import Path
from typing import Any, Protocol
from urllib.parse import urlsplit

from flexcam import __version__
from flexcam.core.errors import InputError, refuse, system_message
from flexcam.dynamics import Cause, RunFailedError, Status
from flexcam.io import temporary_folder
from flexcam.studies.evaluation import Chunk, Outcome, Row, evaluate_chunk
from flexcam.studies.plan import Bundle

Variants = Sequence[tuple[str, ...]]
_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True, eq=False)
class Pool:
    """Ready workers.

    Parameters
    ----------
    submit
        Function that submits variants; its future returns the outcomes.
    window
        Number of chunks submitted at a time; more would only wait.
    lost
        Exception of a future whose worker died.
    """

    submit: Callable[[Variants], Future[list[Outcome]]]
    window: int
    lost: tuple[type[BaseException], ...]


class Workers(Protocol):
    """Interface of workers."""

    def ready(self, bundle: Bundle, *, histories: bool) -> AbstractContextManager[Pool]:
        """Yield workers that have the case; they end with the context."""
        ...


@dataclass(frozen=True)
class SerialWorkers:
    """Serial execution in the calling process, for few variants and for debugging."""

    def ready(self, bundle: Bundle, *, histories: bool) -> AbstractContextManager[Pool]:
        """Yield a pool of this process."""
        return _serial_pool(bundle, histories)


@dataclass(frozen=True)
class ProcessWorkers:
    """Worker processes on this machine.

    Parameters
    ----------
    count
        Number of processes; each has one thread for linear algebra.
    """

    count: int

    def __post_init__(self) -> None:
        if self.count < 1:
            raise refuse("--workers", self.count, "a whole number from 1")

    def ready(self, bundle: Bundle, *, histories: bool) -> AbstractContextManager[Pool]:
        """Yield a pool of new processes, started on demand."""
        return _process_pool(bundle, self.count, histories)


@contextmanager
def _unpack_bundle(bundle: Bundle) -> Generator[Path]:
    with temporary_folder() as folder:
        yield bundle.unpack(folder)


@contextmanager
def _serial_pool(bundle: Bundle, histories: bool) -> Generator[Pool]:
    def submit(variants: Variants) -> Future[list[Outcome]]:
        future: Future[list[Outcome]] = Future()
        future.set_result(
            evaluate_chunk(case, variants, histories=histories, runs=bundle.runs, channels=bundle.channels)
        )
        return future

    with _unpack_bundle(bundle) as case:
        yield Pool(submit, 1, ())


@contextmanager
def _process_pool(bundle: Bundle, count: int, histories: bool) -> Generator[Pool]:
    with _unpack_bundle(bundle) as case, limit_threads(), restore_sigpipe():
        before = {process.pid for process in multiprocessing.active_children()}
        # spawn: workers do not inherit threads and locks of this process, on all systems
        executor = ProcessPoolExecutor(count, multiprocessing.get_context("spawn"), initializer=terminate_with_parent)

        def submit(variants: Variants) -> Future[list[Outcome]]:
            with block_interrupts():
                return executor.submit(
                    evaluate_chunk, case, variants, histories=histories, runs=bundle.runs, channels=bundle.channels
                )

        with block_interrupts():
            awake = executor.submit(_version)
        try:
            yield Pool(submit, count + 1, (BrokenProcessPool,))
            if awake.done() and awake.exception() is not None:
                raise RunFailedError(_NOT_STARTED_STATUS)
        finally:
            terminate_executor(executor, before)


_NOT_STARTED_STATUS = Status(
    Cause.WORKER_LOST,
    "no worker process could begin",
    'a script that sweeps needs its last part under: if __name__ == "__main__":',
)


def _version() -> str:
    return __version__


def terminate_executor(executor: Executor, before: set[int | None]) -> None:
    """Terminate the processes of an executor, also during a run."""
    for process in multiprocessing.active_children():
        if process.pid not in before:
            process.terminate()
    # Once, and with wait: a second call would not cancel, and a remaining thread fails at interpreter exit.
    executor.shutdown(wait=True, cancel_futures=True)


def terminate_with_parent() -> None:
    """Terminate a worker process when its parent has ended for any reason."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_exit_after, args=(parent.join,), daemon=True).start()


def _exit_after(joined: Callable[[], None]) -> None:
    joined()
    os._exit(1)


@contextmanager
def limit_threads() -> Generator[None]:
    """Limit processes started in the context to one linear algebra thread each."""
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name) if value is None else os.environ.__setitem__(name, value)


@contextmanager
def restore_sigpipe() -> Generator[None]:
    """Restore Python's handling of SIGPIPE, so that a broken pipe raises an exception instead of ending this process.

    Libraries such as Gmsh reset the signal to its default action.
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
def block_interrupts() -> Generator[None]:
    """Block Ctrl-C in processes and threads started in the context: this process decides how a sweep ends."""
    if not hasattr(signal, "pthread_sigmask"):  # not available on all systems
        yield
        return
    resource_tracker.ensure_running()  # starting it later would unblock the signal
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


Outcomes = list[Outcome]

_KILLED_STATUS = Status(
    Cause.WORKER_LOST,
    "the process that ran this variant alone was killed, as the ones before it",
    "memory is the usual cause: save fewer fields (output.field_every), or run fewer at a time (--workers)",
)
_CLUSTER_LOST_STATUS = Status(Cause.WORKER_LOST, "the connection to the scheduler was lost", "--resume does the rest")


def run_chunks(
    bundle: Bundle, chunks: Sequence[Chunk], workers: Workers, *, histories: bool = False
) -> Generator[tuple[Chunk, Outcomes]]:
    """Run chunks and yield each with its outcomes as they finish.

    A chunk whose worker was killed is repeated alone, and then its variants one by one: a variant that kills its worker
    again gets a row with that status.
    """
    waiting, suspects = deque(chunks), deque[Chunk]()
    while waiting:
        with workers.ready(bundle, histories=histories) as pool:
            for chunk, future in _submit_chunks(pool, waiting):
                if _is_worker_lost(pool, future):
                    suspects.append(chunk)
                else:
                    yield chunk, future.result()
        while suspects:
            chunk = suspects.popleft()
            yield chunk, _repeat_chunk(bundle, chunk, workers, histories)


def _submit_chunks(pool: Pool, waiting: deque[Chunk]) -> Iterator[tuple[Chunk, Future[Outcomes]]]:
    """Yield chunks and their finished futures; chunks rejected by a broken pool remain in the queue."""
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


def _is_worker_lost(pool: Pool, future: Future[Outcomes]) -> bool:
    if future.cancelled():
        raise RunFailedError(_CLUSTER_LOST_STATUS)
    fault = future.exception()
    return isinstance(fault, pool.lost)


def _repeat_chunk(bundle: Bundle, chunk: Chunk, workers: Workers, histories: bool) -> Outcomes:
    """Return the outcomes of a chunk whose worker was killed."""
    whole = _try_variants(bundle, chunk.variants, workers, histories)
    if whole is not None:
        return whole
    single = [_try_variants(bundle, (variant,), workers, histories) for variant in chunk.variants]
    return [outcome for one in single for outcome in one or [Outcome(Row(_KILLED_STATUS))]]


def _try_variants(
    bundle: Bundle, variants: Sequence[tuple[str, ...]], workers: Workers, histories: bool
) -> Outcomes | None:
    """Return the outcomes of variants run alone; None if their worker was killed again."""
    with workers.ready(bundle, histories=histories) as pool:
        try:
            return pool.submit(variants).result()
        except pool.lost:
            return None


_TIMEOUT = 5.0
"""Timeout of a scheduler, and then of its workers, s."""

LOCAL = "local"
"""Address of a local Dask cluster."""


@dataclass(frozen=True)
class ClusterWorkers:
    """Workers of a Dask cluster.

    Parameters
    ----------
    address
        Address of the scheduler, such as ``tcp://10.0.0.1:8786``; ``local`` for workers on this machine.
    count
        Number of workers of a local cluster; ignored for others.
    """

    address: str
    count: int = 1

    def __post_init__(self) -> None:
        if self.count < 1:
            raise refuse("--workers", self.count, "a whole number from 1", "somebody must run the variants")

    def ready(self, bundle: Bundle, *, histories: bool) -> AbstractContextManager[Pool]:
        """Yield the workers of the cluster."""
        return _cluster_pool(self, bundle, histories)


@contextmanager
def _cluster_pool(asked: ClusterWorkers, bundle: Bundle, histories: bool) -> Generator[Pool]:
    if find_spec("distributed") is None:
        why, remedy = "Dask is not installed", "pip install 'flexcam[cluster]'"
        raise refuse("--scheduler", asked.address, "processes of this machine (--workers)", why, remedy)
    from distributed import KilledWorker

    with _suppress_dask_log(), warnings.catch_warnings(), ExitStack() as stack:
        warnings.filterwarnings("ignore", module="distributed")  # large cases, different versions of other packages
        client = stack.enter_context(_client(asked))
        _check_workers(client, asked)
        # A task that loads the case instead of the case itself: Dask repeats it if a worker is lost.
        case = client.submit(_identity, bundle, key=f"flexcam-{bundle.digest}-{id(bundle)}")
        executor = client.get_executor(pure=False)

        def submit(variants: Variants) -> Future[list[Outcome]]:
            return executor.submit(
                evaluate_chunk, case, variants, histories=histories, runs=bundle.runs, channels=bundle.channels
            )

        yield Pool(submit, _LOG_LEVEL, (KilledWorker,))


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


_LOG_LEVEL = 1_000_000


@contextmanager
def _client(asked: ClusterWorkers) -> Generator[Any]:
    from distributed import Client, LocalCluster

    if asked.address == LOCAL:
        quiet: dict[str, Any] = {"dashboard_address": None, "silence_logs": logging.CRITICAL}
        with block_interrupts():
            local = LocalCluster(n_workers=asked.count, threads_per_worker=1, processes=True, **quiet)
        with local, Client(local, timeout=_TIMEOUT) as client:
            yield client
        return
    _check_address(asked)
    with Client(asked.address, timeout=_TIMEOUT) as client:
        yield client


def _check_address(asked: ClusterWorkers) -> None:
    """Raise an error if no scheduler answers within the timeout; Dask's client may wait without limit."""
    import asyncio

    from distributed.core import rpc
    from distributed.security import Security

    security: Any = Security()

    async def greeted() -> None:
        async with asyncio.timeout(_TIMEOUT):
            made: Any = rpc(asked.address, connection_args=security.get_connection_args("client"))
            async with made as scheduler:
                await scheduler.identity()

    try:
        _ = urlsplit(asked.address).port  # Dask maps a port above 65535 to another one
        asyncio.run(greeted())
    except OSError as fault:  # includes the timeout
        raise _no_scheduler_error(asked, *_describe_timeout(fault)) from None
    except (ValueError, TypeError) as fault:
        raise _no_scheduler_error(asked, str(fault), "write it as tcp://HOST:PORT") from None
    except (MemoryError, EOFError, RuntimeError, LookupError, AttributeError):
        raise _no_scheduler_error(asked, "something else does", "check the port") from None


def _describe_timeout(fault: BaseException) -> tuple[str, str]:
    """Return why the scheduler did not answer, which Dask retries until the timeout, and a remedy."""
    first = fault
    while (behind := first.__cause__ or first.__context__) is not None:
        first = behind
    if isinstance(first, ConnectionRefusedError):
        return "the connection is refused: no program listens on that port", "start one there: dask scheduler"
    if isinstance(first, socket.gaierror):
        return f"no machine is known by that name ({first.strerror})", "check the name, or give the number"
    if isinstance(first, OSError) and first.errno:
        return system_message(first), "check the address and the network"
    why = "it keeps silent: no scheduler, or a firewall or a machine that is off"
    return why, "check that a scheduler runs there and its port is open"


def _no_scheduler_error(asked: ClusterWorkers, why: str, remedy: str) -> InputError:
    told = f"none answers there within {_TIMEOUT:g} s: {why}"
    given = asked.address or "nothing"
    return refuse("--scheduler", given, "the address of a Dask scheduler", told, f"{remedy}; or use --workers N")


def _check_workers(client: Any, asked: ClusterWorkers) -> None:  # noqa: ANN401 - distributed has no types
    """Raise an error for a cluster without workers, or with workers that have another version of flexcam."""
    try:
        client.wait_for_workers(1, timeout=_TIMEOUT)
    except TimeoutError:
        why, remedy = "the scheduler has no workers", f"start some: dask worker {asked.address}"
        raise refuse("--scheduler", asked.address, "a cluster with workers", why, remedy) from None
    try:
        found = {str(version) for version in client.run(_version_cluster).values()}
    except ModuleNotFoundError as fault:
        raise _version_error(asked, str(fault)) from None
    if found != {__version__}:
        raise _version_error(asked, f"they have flexcam {', '.join(sorted(found))}")


def _version_error(asked: ClusterWorkers, why: str) -> InputError:
    return refuse("--scheduler", asked.address, f"workers with flexcam {__version__}", why, "install it there")


def _version_cluster() -> str:
    return __version__


def _identity(bundle: Bundle) -> Bundle:
    return bundle
