"""Exudyn with its solver as it comes: dense matrices, modified Newton."""

from __future__ import annotations

from benchmarks.peers.exudyn_model import at_all_speeds
from benchmarks.peers.work import Result, Work


def run(work: Work) -> Result:
    """Integrate at all speeds."""
    return at_all_speeds(work, lambda settings: None)
