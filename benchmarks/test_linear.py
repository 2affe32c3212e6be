"""Linear time integration of B1 with all solver engines, which compute the same motion."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.engines import run_engine
from flexcam.dynamics import SaveAt
from flexcam.dynamics.problem import ENGINES

SAVED = {"probes": SaveAt(field_every=7200), "all": SaveAt(field_every=1)}


@pytest.mark.parametrize("saved", SAVED)
@pytest.mark.parametrize("engine", ENGINES)
def test_engines(benchmark, driven_shaft, engine, saved):
    response = benchmark(run_engine, driven_shaft, engine, SAVED[saved])
    assert response.status.ok
    assert engine in ("auto", response.stats.engine)
    direct = run_engine(driven_shaft, "direct")["middle"].displacement
    error = np.abs(response["middle"].displacement - direct).max(axis=0) / np.abs(direct).max(axis=0)
    assert error.max() < 1e-10  # rounding of the modal solution: 4e-11 here
