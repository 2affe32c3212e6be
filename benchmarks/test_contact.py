"""The time loop in contact: a revolution of the pushrod engine, cam, seat, lash and a spring of eight elements."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.measure.contact import ran, revolution
from benchmarks.paths import ALL


@pytest.mark.parametrize("path", ALL)
def test_revolution(benchmark, path):
    ready = revolution("pushrod-engine/intake")
    response = benchmark(ran, ready, path)
    assert response.status.ok
    assert response.stats.events > 0
    assert path in ("auto", response.stats.engine)
    assert np.ptp(response["valve"].displacement) > 0.009  # a lift of 6 mm by a rocker of 1.6, less lash and ramps


@pytest.mark.parametrize("name", ["pushrod-engine/intake", "direct-acting/bucket"])
def test_start(benchmark, name):
    """Equations and the balance that a run starts from, as for every speed of a sweep."""
    ready = benchmark(revolution, name)
    assert ready.problem.start is not None
    assert ready.problem.start.displacement.any()
