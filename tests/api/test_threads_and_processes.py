"""Runs in threads and processes give the same results as single runs."""

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
"""Runs with each engine, with and without contacts."""


def run_bytes(case):
    """Return the motion and the channels of a run as bytes."""
    response = flexcam.run(case)
    assert response.status.ok
    arrays = [response.probes.displacement, response.fields.acceleration, *response.channels.values()]
    return b"".join(np.ascontiguousarray(one).tobytes() for one in arrays)


@pytest.fixture(scope="module", autouse=True)
def _single_blas_thread():
    """Limit BLAS to one thread: the number of threads changes the last bits of a product."""
    with threadpool_limits(1, user_api="blas"), pytest.MonkeyPatch.context() as patch:
        patch.setenv("OPENBLAS_NUM_THREADS", "1")  # for spawned processes
        yield


@pytest.fixture(scope="module")
def cases():
    return [flexcam.read_case(path, overrides) for path, overrides in RUNS]


@pytest.fixture(scope="module")
def single_results(cases):
    return [run_bytes(case) for case in cases]


@pytest.mark.slow
def test_runs_in_threads_equal_single_runs(cases, single_results, tried):
    """Each case runs twice, in eight threads."""
    with ThreadPoolExecutor(8) as threads:
        assert list(threads.map(run_bytes, [*cases, *cases])) == single_results * 2
    tried("together", "eight threads of runs in one process", 2 * len(cases), "bit by bit the results of one thread")


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_runs_in_processes_equal_single_runs(method, cases, single_results, tried):
    """The cases are pickled, and the kernel is compiled or loaded in the parent process before the fork."""
    with ProcessPoolExecutor(2, multiprocessing.get_context(method)) as processes:
        assert list(processes.map(run_bytes, cases)) == single_results
    tried("together", f"worker processes, {method}", len(cases), "bit by bit the results of this process")


def test_overlapping_runs_restore_blas_threads(monkeypatch):
    """The first run limits the number of threads and the last one restores it, in any order."""
    monkeypatch.delenv("OPENBLAS_NUM_THREADS")
    with threadpool_limits(2, user_api="blas"):
        direct = [flexcam.read_case(LINEAR, ("run.engine=direct", f"run.revolutions={x}")) for x in (0.05, 0.1, 0.2)]
        with ThreadPoolExecutor(3) as threads:
            list(threads.map(run_bytes, direct))
        assert {one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"} == {2}
