"""The linear time loop on B1, by every path it has; all give the same motion."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.paths import solved
from flexcam.dynamics import SaveAt
from flexcam.dynamics.problem import ENGINES

SAVED = {"probes": SaveAt(field_every=7200), "all": SaveAt(field_every=1)}


@pytest.mark.parametrize("saved", SAVED)
@pytest.mark.parametrize("path", ENGINES)
def test_paths(benchmark, driven_shaft, path, saved):
    response = benchmark(solved, driven_shaft, path, SAVED[saved])
    assert response.status.ok
    assert path in ("auto", response.stats.engine)
    general = solved(driven_shaft, "direct")["middle"].displacement
    off = np.abs(response["middle"].displacement - general).max(axis=0) / np.abs(general).max(axis=0)
    assert off.max() < 1e-10  # modes differ from a direct solution by rounding: 4e-11 here
