"""Time per step over the number of valves: independent copies of one train."""

from __future__ import annotations

import pytest

from benchmarks.train_copies import COUNTS, METHODS, copy_case
from flexcam.dynamics import SaveAt, solve


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("count", COUNTS)
def test_revolution(benchmark, count, method):
    problem = copy_case(count)
    save = SaveAt(field_every=problem.steps, channels=False)
    response = benchmark(solve, problem, METHODS[method], save=save)
    assert response.status.ok
    assert response.stats.engine == "kernel"
