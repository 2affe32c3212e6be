"""The comparison itself: its own elements against flexcam's, every solver that is there, and what does not agree."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.peers import compare, train_flexcam, train_scipy, with_flexcam, with_scipy
from benchmarks.peers.compare import PEERS, REFERENCE, TOLERANCE, TRAIN_PEERS, Measured, MeasuredTrain, Once
from benchmarks.peers.train import C1, equations
from benchmarks.peers.work import B1, Work
from flexcam.dynamics import newmark


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


@pytest.fixture(scope="module")
def exact():
    return train_scipy.reference(C1, tolerance=1e-9)


@pytest.mark.parametrize(
    "peer", [one for one in TRAIN_PEERS if not compare.absent(one.package)], ids=lambda one: one.file
)
def test_each_solver_of_the_train_comes_close_to_the_reference(peer, exact):
    found = compare.train_once(peer, 0.0)
    errors = [compare.force_error(motion, exact) for motion in found.motion]
    settings = [{"method": method, "error": error} for method, error in zip(found.methods, errors, strict=True)]
    compare.check_forces([MeasuredTrain(peer.title, settings=settings)])
    assert max(errors) < 0.2
    assert found.seconds.min() > 0.0
    assert found.first_seconds.min() > 0.0


def test_the_train_is_written_alike_for_all_solvers():
    """Lift, its rate, and all forces but those of the contacts by the matrices."""
    laws, angles = equations(C1), np.linspace(0.0, 2.0 * math.pi, 201)
    lifts, rates = np.array([laws.cam_motion(angle / C1.speed) for angle in angles]).T
    np.testing.assert_allclose(lifts, C1.lift_at(angles), atol=1e-15)
    np.testing.assert_allclose(rates, C1.speed * C1.lift_at(angles, 1), atol=1e-12)
    h = 1e-5
    slopes = (C1.lift_at(angles + h, 1) - C1.lift_at(angles - h, 1)) / (2.0 * h)
    np.testing.assert_allclose(C1.lift_at(angles, 2), slopes, atol=1e-9)
    x, v = np.array([3e-4, 1e-4, 2e-4]), np.array([-0.3, 0.1, 0.2])  # all contacts open
    _, C, K = C1.matrices()
    np.testing.assert_allclose(laws.forces(0.0, *x, *v), C1.preload - K @ x - C @ v, rtol=1e-12)
    assert np.abs(laws.forces(0.0, *C1.start)).max() < 1e-10


def test_other_forces_are_not_compared(exact):
    """Newmark's method with few steps is not close enough, and no number is not either."""
    motion = train_flexcam.motion(C1, newmark(), 1800)
    for error in (compare.force_error(motion, exact), math.nan):
        row = MeasuredTrain("flexcam", settings=[{"method": "coarse", "error": error}])
        with pytest.raises(SystemExit, match="coarse by"):
            compare.check_forces([row])
