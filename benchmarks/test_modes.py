"""The lowest modes of shafts, dense and sparse."""

from __future__ import annotations

import pytest

from benchmarks.peers.with_flexcam import shaft
from benchmarks.peers.work import Work
from flexcam.dynamics import modes


@pytest.mark.parametrize("spans", [1, 17, 172])
def test_twenty_modes(benchmark, spans):
    system = shaft(Work(spans=spans))
    found = benchmark(modes, system.mass, system.stiffness, 20)
    assert len(found.omegas) == 20
