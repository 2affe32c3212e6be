"""Time of a step over the number of valves: copies of one train that share nothing."""

from __future__ import annotations

import pytest

from benchmarks.valves import COUNTS, METHODS, copies
from flexcam.dynamics import SaveAt, solve


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("count", COUNTS)
def test_revolution(benchmark, count, method):
    problem = copies(count)
    save = SaveAt(field_every=problem.steps, channels=False)
    response = benchmark(solve, problem, METHODS[method], save=save)
    assert response.status.ok
    assert response.stats.engine == "kernel"
