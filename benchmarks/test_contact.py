"""Time integration in contact: pushrod engine with cam, seat, lash and a spring of eight elements."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.engines import ENGINES
from benchmarks.measure.contact import prepare_run, run


@pytest.mark.parametrize("engine", ENGINES)
def test_run(benchmark, engine):
    ready = prepare_run("pushrod-engine/intake", ("run.steps_per_revolution=900",))
    response = benchmark(run, ready, engine)
    assert response.status.ok
    assert response.stats.events > 0
    assert engine in ("auto", response.stats.engine)
    assert np.ptp(response["valve"].displacement) > 0.009  # a lift of 6 mm by a rocker of 1.6, less lash and ramps


@pytest.mark.parametrize("name", ["pushrod-engine/intake", "direct-acting/bucket"])
def test_preparation(benchmark, name):
    """Equations of motion and initial equilibrium, as for every speed of a sweep."""
    ready = benchmark(prepare_run, name)
    assert ready.problem.start is not None
    assert ready.problem.start.displacement.any()
