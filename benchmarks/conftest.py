"""Fixtures of the benchmarks."""

from __future__ import annotations

import math

import pytest

from benchmarks.peers.shaft import B1
from benchmarks.peers.shaft_flexcam import shaft_system
from flexcam.dynamics import ConstantSpeed, Problem

collect_ignore_glob = ["peers/*", "measure/*"]  # no tests; some solvers may not be installed


@pytest.fixture
def driven_shaft() -> Problem:
    """Return B1: a steel shaft of ten elements, a rotating force and torque at its middle, 7200 steps."""
    speed = B1.frequencies[0]
    return Problem(shaft_system(B1), ConstantSpeed(2.0 * math.pi * speed), step=B1.step(speed), steps=B1.steps)
