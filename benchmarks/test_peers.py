"""The comparison itself: its own elements against flexcam's, every solver that is there, and what does not agree."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.peers import compare, with_flexcam, with_scipy
from benchmarks.peers.compare import PEERS, REFERENCE, TOLERANCE, Measured, Once
from benchmarks.peers.work import B1, Work


@pytest.mark.parametrize("spans", [1, 3])
def test_both_assemblies_give_the_same_motion(benchmark, spans):
    work = Work(spans=spans, revolutions=1, steps_per_revolution=720)
    found = benchmark(with_flexcam.run, work).displacement
    assert compare.difference(found, with_scipy.run(work).displacement) < TOLERANCE["B1"]


THERE = [peer for peer in PEERS if not compare.absent(peer.package)]
"""Solvers of the extra ``peers`` that are not installed are not asked for; ``make bench-peers`` names them."""


@pytest.mark.parametrize("peer", THERE, ids=lambda peer: peer.file)
def test_each_solver_runs_in_its_process(peer):
    one = compare.once(peer, "B1", 1)
    assert one.displacement.shape == (1, B1.steps + 1, 2)
    assert 0.0 < one.loop < one.whole < one.process


def test_another_shaft_is_not_compared():
    """A part in ten million of the stiffness is seen."""
    stiffer = with_flexcam.run(replace(B1, E=B1.E * (1.0 + 1e-7))).displacement
    runs = {peer: [Once(found, 1.0, 1.0, 1.0)] for peer, found in _both(stiffer).items()}
    with pytest.raises(SystemExit, match="flexcam by"):
        compare.check("B1", runs, {peer.file: Measured(peer.title) for peer in runs})


def test_no_number_does_not_agree():
    nothing = np.full((1, B1.steps + 1, 2), np.nan)
    runs = {peer: [Once(found, 1.0, 1.0, 1.0)] for peer, found in _both(nothing).items()}
    with pytest.raises(SystemExit, match="nan"):
        compare.check("B1", runs, {peer.file: Measured(peer.title) for peer in runs})


def _both(found):
    return {PEERS[0]: found, REFERENCE: with_scipy.run(B1).displacement}
