"""Published model 3 with all unknowns, with the active ones, and as reduced models."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flexcam import prepare, read_case
from flexcam.dynamics import solve

CASE = Path(__file__).parents[1] / "cases" / "tayeb" / "model-3-shm.toml"
MODELS = {
    "all 47 unknowns": (["fidelity.prune=false"], 47), "24 that move": ([], 24),
    "3 modes": (["fidelity.modes=3"], None), "one mass": (["fidelity.model=sdof"], 1),
}  # fmt: skip


@pytest.mark.parametrize("model", MODELS)
def test_models(benchmark, model):
    overrides, unknowns = MODELS[model]
    ready = prepare(read_case(CASE, overrides))
    response = benchmark(solve, ready.problem, ready.scheme, save=ready.save)
    assert response.status.ok
    assert unknowns in (None, response.stats.unknowns)


@pytest.mark.parametrize("method", ["newmark", "hht", "bathe"])
def test_methods(benchmark, method):
    ready = prepare(read_case(CASE, [f'run.integrator.method="{method}"']))
    response = benchmark(solve, ready.problem, ready.scheme, save=ready.save)
    assert np.isfinite(response["valve"].displacement).all()
