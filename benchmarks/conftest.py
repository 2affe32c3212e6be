"""Cases of the benchmarks."""

from __future__ import annotations

import math

import pytest

from benchmarks.peers.with_flexcam import shaft
from benchmarks.peers.work import B1
from flexcam.dynamics import ConstantSpeed, Problem

collect_ignore_glob = ["peers/*", "measure/*"]  # no tests, and not every solver is installed


@pytest.fixture
def driven_shaft() -> Problem:
    """Return B1: a steel shaft of ten elements, a rotating force and torque at its middle, 7200 steps."""
    speed = B1.frequencies[0]
    return Problem(shaft(B1), ConstantSpeed(2.0 * math.pi * speed), step=B1.step(speed), steps=B1.steps)
