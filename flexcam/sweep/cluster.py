"""Dask's workers, of a cluster or of this machine by the same code; owns `distributed` (extra ``cluster``)."""

from __future__ import annotations

import logging
import socket
import warnings
from collections.abc import Generator
from concurrent.futures import Future
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any
from urllib.parse import urlsplit

from flexcam import __version__
from flexcam.checks import InputError, refuse, said
from flexcam.sweep.bundle import Bundle
from flexcam.sweep.chunks import Outcome, evaluated
from flexcam.sweep.workers import Pool, Variants, undisturbed

_PATIENCE = 5.0
"""Seconds that a scheduler, and then its workers, have to answer."""

LOCAL = "local"
"""Address that asks for workers of Dask on this machine."""


@dataclass(frozen=True)
class Cluster:
    """Workers of a Dask cluster.

    Parameters
    ----------
    address
        Of its scheduler, such as ``tcp://10.0.0.1:8786``; ``local`` for workers of this machine.
    count
        Workers of a local one; a cluster has those it has.
    """

    address: str
    count: int = 1

    def __post_init__(self) -> None:
        if self.count < 1:
            raise refuse("--workers", self.count, "a whole number from 1", "somebody must run the variants")

    def ready(self, bundle: Bundle, *, histories: bool) -> AbstractContextManager[Pool]:
        """Return the workers of the cluster."""
        return _cluster(self, bundle, histories)


@contextmanager
def _cluster(asked: Cluster, bundle: Bundle, histories: bool) -> Generator[Pool]:
    if find_spec("distributed") is None:
        why, remedy = "Dask is not installed", "pip install 'flexcam[cluster]'"
        raise refuse("--scheduler", asked.address, "processes of this machine (--workers)", why, remedy)
    from distributed import KilledWorker

    with _quiet(), warnings.catch_warnings(), ExitStack() as stack:
        warnings.filterwarnings("ignore", module="distributed")  # large cases, other versions of other packages
        client = stack.enter_context(_client(asked))
        _answers(client, asked)
        # A task that gives the case, and not the case itself: Dask makes it again where a worker is lost.
        case = client.submit(_same, bundle, key=f"flexcam-{bundle.digest}-{id(bundle)}")
        executor = client.get_executor(pure=False)

        def submit(variants: Variants) -> Future[list[Outcome]]:
            return executor.submit(
                evaluated, case, variants, histories=histories, runs=bundle.runs, channels=bundle.channels
            )

        yield Pool(submit, _EVERYTHING, (KilledWorker,))


@contextmanager
def _quiet() -> Generator[None]:
    """Keep Dask's own log out of what a user reads: a lost worker is told by its rows, a lost scheduler by a status."""
    names = [name for name in logging.root.manager.loggerDict if name.partition(".")[0] == "distributed"]
    levels = {name: logging.getLogger(name).level for name in names}
    for name in names:
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for name, level in levels.items():
            logging.getLogger(name).setLevel(level)


_EVERYTHING = 1_000_000


@contextmanager
def _client(asked: Cluster) -> Generator[Any]:
    from distributed import Client, LocalCluster

    if asked.address == LOCAL:
        quiet: dict[str, Any] = {"dashboard_address": None, "silence_logs": logging.CRITICAL}
        with undisturbed():
            local = LocalCluster(n_workers=asked.count, threads_per_worker=1, processes=True, **quiet)
        with local, Client(local, timeout=_PATIENCE) as client:
            yield client
        return
    _greet(asked)
    with Client(asked.address, timeout=_PATIENCE) as client:
        yield client


def _greet(asked: Cluster) -> None:
    """Refuse an address where no scheduler answers in time; Dask's own client may wait for ever."""
    import asyncio

    from distributed.core import rpc
    from distributed.security import Security

    security: Any = Security()

    async def greeted() -> None:
        async with asyncio.timeout(_PATIENCE):
            made: Any = rpc(asked.address, connection_args=security.get_connection_args("client"))
            async with made as scheduler:
                await scheduler.identity()

    try:
        _ = urlsplit(asked.address).port  # Dask takes one beyond 65535 for another
        asyncio.run(greeted())
    except OSError as fault:  # also of the time that is over
        raise _nobody(asked, *_silence(fault)) from None
    except (ValueError, TypeError) as fault:
        raise _nobody(asked, str(fault), "write it as tcp://HOST:PORT") from None
    except (MemoryError, EOFError, RuntimeError, LookupError, AttributeError):
        raise _nobody(asked, "something else does", "check the port") from None


def _silence(fault: BaseException) -> tuple[str, str]:
    """Return why nobody answered, which Dask tries again until the time is over, and what to do."""
    first = fault
    while (behind := first.__cause__ or first.__context__) is not None:
        first = behind
    if isinstance(first, ConnectionRefusedError):
        return "the connection is refused: no program listens on that port", "start one there: dask scheduler"
    if isinstance(first, socket.gaierror):
        return f"no machine is known by that name ({first.strerror})", "check the name, or give the number"
    if isinstance(first, OSError) and first.errno:
        return said(first), "check the address and the network"
    why = "it keeps silent: no scheduler, or a firewall or a machine that is off"
    return why, "check that a scheduler runs there and its port is open"


def _nobody(asked: Cluster, why: str, remedy: str) -> InputError:
    told = f"none answers there within {_PATIENCE:g} s: {why}"
    given = asked.address or "nothing"
    return refuse("--scheduler", given, "the address of a Dask scheduler", told, f"{remedy}; or use --workers N")


def _answers(client: Any, asked: Cluster) -> None:  # noqa: ANN401 - distributed has no types
    """Refuse a cluster without workers, or with workers that would compute something else."""
    try:
        client.wait_for_workers(1, timeout=_PATIENCE)
    except TimeoutError:
        why, remedy = "the scheduler has no workers", f"start some: dask worker {asked.address}"
        raise refuse("--scheduler", asked.address, "a cluster with workers", why, remedy) from None
    try:
        found = {str(version) for version in client.run(_version).values()}
    except ModuleNotFoundError as fault:
        raise _other(asked, str(fault)) from None
    if found != {__version__}:
        raise _other(asked, f"they have flexcam {', '.join(sorted(found))}")


def _other(asked: Cluster, why: str) -> InputError:
    return refuse("--scheduler", asked.address, f"workers with flexcam {__version__}", why, "install it there")


def _version() -> str:
    return __version__


def _same(bundle: Bundle) -> Bundle:
    return bundle
