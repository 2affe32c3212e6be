"""Lowest modes of shafts with dense and sparse matrices."""

from __future__ import annotations

import pytest

from benchmarks.peers.shaft import Shaft
from benchmarks.peers.shaft_flexcam import shaft_system
from flexcam.dynamics import modes


@pytest.mark.parametrize("spans", [1, 17, 172])
def test_twenty_modes(benchmark, spans):
    system = shaft_system(Shaft(spans=spans))
    found = benchmark(modes, system.mass, system.stiffness, 20)
    assert len(found.omegas) == 20
