"""Exudyn by full Newton: a new factorization in every iteration, as for a mechanism whose matrices change."""

from __future__ import annotations

import exudyn as exu

from benchmarks.peers.exudyn_model import at_all_speeds
from benchmarks.peers.work import Result, Work


def run(work: Work) -> Result:
    """Integrate at all speeds."""
    return at_all_speeds(work, _full)


def _full(settings: exu.SimulationSettings) -> None:
    settings.timeIntegration.newton.useModifiedNewton = False
