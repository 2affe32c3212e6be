"""Runs in threads and processes give the numbers of a run alone."""

from __future__ import annotations

import multiprocessing
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import flexcam

ROOT = Path(__file__).parents[2]
BUCKET = ROOT / "cases/direct-acting/bucket.toml"
LINEAR = ROOT / "tests/data/inline.toml"

RUNS = [
    (LINEAR, ("run.engine=modal",)),
    (LINEAR, ("run.engine=direct", "run.steps_per_revolution=360")),
    (LINEAR, ("fidelity.model=rigid",)),
    (BUCKET, ("run.engine=kernel", "run.revolutions=0.2")),
    (BUCKET, ("run.engine=direct", "run.revolutions=0.02")),
    (BUCKET, ("run.engine=kernel", "run.revolutions=0.1", "run.crank_speed=3000rpm")),
    (BUCKET, ("fidelity.model=sdof", "run.revolutions=0.2")),
    (BUCKET, ("run.engine=kernel", "run.integrator.method=collocation", "run.revolutions=0.1")),
]
"""Every engine, and contacts."""


def numbers(case):
    """Return the motion and the channels of a run as bytes."""
    response = flexcam.run(case)
    assert response.status.ok
    arrays = [response.probes.displacement, response.fields.acceleration, *response.channels.values()]
    return b"".join(np.ascontiguousarray(one).tobytes() for one in arrays)


@pytest.fixture(scope="module", autouse=True)
def _one_thread_of_the_linear_algebra():
    """Its number of threads changes the last bits of a product."""
    with threadpool_limits(1, user_api="blas"), pytest.MonkeyPatch.context() as patch:
        patch.setenv("OPENBLAS_NUM_THREADS", "1")  # of spawned processes
        yield


@pytest.fixture(scope="module")
def cases():
    return [flexcam.read_case(path, overrides) for path, overrides in RUNS]


@pytest.fixture(scope="module")
def alone(cases):
    return [numbers(case) for case in cases]


@pytest.mark.slow
def test_eight_threads(cases, alone, tried):
    """Every case twice, eight at a time."""
    with ThreadPoolExecutor(8) as threads:
        assert list(threads.map(numbers, [*cases, *cases])) == alone * 2
    tried("together", "eight threads of runs in one process", 2 * len(cases), "bit by bit the results of one thread")


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_processes(method, cases, alone, tried):
    """The cases are sent, and the kernel is compiled or loaded in the parent before the fork."""
    with ProcessPoolExecutor(2, multiprocessing.get_context(method)) as processes:
        assert list(processes.map(numbers, cases)) == alone
    tried("together", f"worker processes, {method}", len(cases), "bit by bit the results of this process")


def test_runs_that_overlap_restore_the_threads_of_the_linear_algebra(monkeypatch):
    """The first run limits them and the last one restores them, in any order."""
    monkeypatch.delenv("OPENBLAS_NUM_THREADS")
    with threadpool_limits(2, user_api="blas"):
        direct = [flexcam.read_case(LINEAR, ("run.engine=direct", f"run.revolutions={x}")) for x in (0.05, 0.1, 0.2)]
        with ThreadPoolExecutor(3) as threads:
            list(threads.map(numbers, direct))
        assert {one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"} == {2}
