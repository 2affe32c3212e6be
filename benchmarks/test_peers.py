"""Comparison with other solvers: independent elements, all installed solvers, and rejection of different results."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.peers import comparison, shaft_flexcam, shaft_scipy, train_flexcam, train_scipy
from benchmarks.peers.comparison import PEERS, REFERENCE, TOLERANCE, TRAIN_PEERS, ShaftRow, ShaftRun, TrainRow
from benchmarks.peers.shaft import B1, Shaft
from benchmarks.peers.train import C1, equations
from flexcam.dynamics import newmark


@pytest.mark.parametrize("spans", [1, 3])
def test_independent_elements_give_same_motion(benchmark, spans):
    shaft = Shaft(spans=spans, revolutions=1, steps_per_revolution=720)
    found = benchmark(shaft_flexcam.run, shaft).displacement
    assert comparison.difference(found, shaft_scipy.run(shaft).displacement) < TOLERANCE["B1"]


INSTALLED = [peer for peer in PEERS if not comparison.missing_reason(peer.package)]
"""The other solvers of the extra ``peers`` are not tested; ``make bench-peers`` names them."""


@pytest.mark.parametrize("peer", INSTALLED, ids=lambda peer: peer.solver)
def test_solver_runs_in_process(peer):
    run = comparison.run_shaft(peer, "B1", 1)
    assert run.displacement.shape == (1, B1.steps + 1, 2)
    assert 0.0 < run.loop_seconds < run.total_seconds < run.process_seconds


def test_different_displacements_are_rejected():
    """A stiffness that differs by 1e-7 is detected."""
    stiffer = shaft_flexcam.run(replace(B1, E=B1.E * (1.0 + 1e-7))).displacement
    runs = _runs(stiffer)
    with pytest.raises(SystemExit, match="flexcam by"):
        comparison.check_displacements("B1", runs, {peer.solver: ShaftRow(peer.title) for peer in runs})


def test_nan_displacements_are_rejected():
    runs = _runs(np.full((1, B1.steps + 1, 2), np.nan))
    with pytest.raises(SystemExit, match="nan"):
        comparison.check_displacements("B1", runs, {peer.solver: ShaftRow(peer.title) for peer in runs})


def _runs(displacement):
    both = {PEERS[0]: displacement, REFERENCE: shaft_scipy.run(B1).displacement}
    return {peer: [ShaftRun(motion, 1.0, 1.0, 1.0)] for peer, motion in both.items()}


@pytest.fixture(scope="module")
def exact():
    return train_scipy.reference(C1, tolerance=1e-9)


@pytest.mark.parametrize(
    "peer", [peer for peer in TRAIN_PEERS if not comparison.missing_reason(peer.package)], ids=lambda peer: peer.solver
)
def test_train_solvers_agree_with_reference(peer, exact):
    found = comparison.run_train(peer, 0.0)
    errors = [comparison.force_error(motion, exact) for motion in found.motion]
    settings = [{"method": method, "error": error} for method, error in zip(found.methods, errors, strict=True)]
    comparison.check_forces([TrainRow(peer.title, settings=settings)])
    assert max(errors) < 0.2
    assert found.seconds.min() > 0.0
    assert found.first_seconds.min() > 0.0


def test_train_equations_agree_with_matrices():
    """The functions of the solvers have the lift and, with open contacts, the forces of `Train`."""
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


def test_inaccurate_forces_are_rejected(exact):
    """Newmark's method with few steps, and nan."""
    motion = train_flexcam.integrate(C1, newmark(), 1800)
    for error in (comparison.force_error(motion, exact), math.nan):
        row = TrainRow("flexcam", settings=[{"method": "coarse", "error": error}])
        with pytest.raises(SystemExit, match="coarse by"):
            comparison.check_forces([row])
