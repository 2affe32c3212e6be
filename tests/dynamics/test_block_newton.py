"""Local forces of several trains: Newton's method by blocks matches a single matrix."""

from __future__ import annotations

import numpy as np
import pytest

import flexcam.dynamics.kernel_step as kernel_step
from flexcam.core import Triplets
from flexcam.dynamics import (
    AngleVector,
    ConstantSpeed,
    LocalForce,
    Probe,
    Problem,
    SaveAt,
    System,
    collocation,
    hunt_crossley_contact,
    newmark,
    solve,
)
from flexcam.dynamics.kernel_step import list_runs

TRAINS, PARTS = 5, 3


def trains(shaft: float) -> System:
    """Return chains of masses with springs and dampers, driven by cams at different angles.

    Each cam is on its own mass; springs of the given stiffness couple the cam masses, or not if it is zero.
    """
    size = TRAINS * (PARTS + 1)
    M, K, C = np.eye(size), np.zeros((size, size)), np.zeros((size, size))
    forces = list[LocalForce]()
    for train in range(TRAINS):
        cam, first = train * (PARTS + 1), train * (PARTS + 1) + 1
        K[cam, cam] += 1e6
        for i in range(first, first + PARTS - 1):
            K[i : i + 2, i : i + 2] += 4e5 * np.array([[1.0, -1.0], [-1.0, 1.0]])
            C[i : i + 2, i : i + 2] += 20.0 * np.array([[1.0, -1.0], [-1.0, 1.0]])
        K[first + PARTS - 1, first + PARTS - 1] += 2e4 * (1.0 + 0.1 * train)
        if train:
            other = cam - PARTS - 1
            K[cam, cam] += shaft
            K[other, other] += shaft
            K[cam, other] -= shaft
            K[other, cam] -= shaft
        row = np.zeros((1, size))
        row[0, cam], row[0, first] = 1.0, -1.0
        turned = 2.0 * np.pi * train / TRAINS

        def lift(angle, order, turned=turned):
            return 2e-3 * np.cos(angle - turned + 0.5 * np.pi * order)

        forces.append(
            LocalForce(
                f"cam {train}", (AngleVector.constant(row[0]),), (AngleVector.constant(-row[0]),),
                hunt_crossley_contact(5e6, 0.1), (lift,),
            )
        )  # fmt: skip
    names = tuple(f"u{i}" for i in range(size))
    probe = Probe("all", names, np.eye(size), (None,) * size)
    matrices = (Triplets.from_dense(one) for one in (M, C, K))
    return System(*matrices, names, (), tuple(forces), (probe,))


def run_trains(shaft, method, engine="kernel"):
    problem = Problem(trains(shaft), ConstantSpeed(100.0), 1e-5, 1200, engine=engine)
    response = solve(problem, method, save=SaveAt(energies=False))
    assert response.status.ok
    return response["all"].acceleration, response.stats.iterations


@pytest.mark.parametrize("method", [newmark(), collocation()])
@pytest.mark.parametrize("shaft", [0.0, 1e6, 5e8])
def test_blocks_and_single_matrix_give_same_forces(method, shaft, monkeypatch):
    blocks = list[int]()
    divide = kernel_step.divide_laws

    def count_blocks(laws, coupling):
        found = divide(laws, coupling)
        blocks.append(len(found[1]) - 1)
        return found

    monkeypatch.setattr(kernel_step, "divide_laws", count_blocks)
    divided, iterations = run_trains(shaft, method)
    monkeypatch.setattr(kernel_step, "_STRONG", -1.0)
    together, usual = run_trains(shaft, method)
    assert blocks == [TRAINS, 1]
    np.testing.assert_allclose(divided, together, rtol=0.0, atol=1e-8 * np.abs(together).max())
    assert iterations < 1.5 * usual


@pytest.mark.parametrize("shaft", [1e6, 5e8])
def test_blocks_include_forces_of_other_blocks(shaft):
    """The direct engine uses the complete compliance; at 5e8 N/m trains move each other by 1 % within a step."""
    divided, _ = run_trains(shaft, newmark())
    complete, _ = run_trains(shaft, newmark(), "direct")
    np.testing.assert_allclose(divided, complete, rtol=0.0, atol=1e-7 * np.abs(complete).max())


def test_modes_of_train_are_contiguous():
    """Without a common shaft, the vectors of a train use one run of its own modes and one of its cam's."""
    from flexcam.dynamics.local_forces import LocalForces
    from flexcam.dynamics.modal_coordinates import find_modal_coordinates, modal_problem

    problem = Problem(trains(0.0), ConstantSpeed(100.0), 1e-5, 10)
    natural = find_modal_coordinates(problem.system)
    assert natural is not None
    runs = list_runs(LocalForces(modal_problem(problem, natural).system).sense.vectors)
    assert (np.diff(runs[: TRAINS + 1]) <= 4).all()
    assert int(np.diff(runs[TRAINS + 1 :].reshape(-1, 2)).sum()) == TRAINS * (PARTS + 1)


def test_list_runs_of_rows():
    rows = np.array([[0.0, 2.0, 3.0], [0.0, 0.0, 0.0], [1.0, 0.0, 4.0]])
    assert list_runs(rows).tolist() == [4, 6, 6, 10, 1, 3, 0, 1, 2, 3]
