"""Step times of independent copies of a valve train: of a case, and of C1, the train of three masses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks.peers.train import C1
from benchmarks.peers.train_flexcam import train_problem
from benchmarks.processes import ROOT
from benchmarks.timing import repeated_cpu_time
from flexcam import prepare, read_case
from flexcam.core import FloatArray, Triplets
from flexcam.dynamics import AngleVector, Problem, SaveAt, System, collocation, newmark, solve

CASE = "direct-acting/bucket"
"""Case with cam contact, lash, seat and two springs per valve."""
COARSE = (
    "springs.outer.elements=2",
    "springs.inner.elements=2",
    "members.camshaft.elements=1",
    "members.valve.elements=1",
)
"""Overrides for few unknowns per train: sixteen trains do not exceed the number of modes of the kernel engine."""
METHODS = {"newmark": newmark(), "collocation": collocation()}
COUNTS = (1, 2, 4, 8, 16)
C1_COUNTS = (*COUNTS, 32)
"""Numbers of copies of C1."""
STEPS = 3600
"""Steps per revolution of both trains."""
REPEAT_SECONDS = 2.0
"""Total time of the repeats."""


def measure_step_times() -> list[dict[str, float]]:
    """Return the processor time per step of copies of C1, us, by number of valves and method."""
    return [
        {"valves": count} | {method: _us_per_step(train_problem(C1, STEPS, count), method) for method in METHODS}
        for count in C1_COUNTS
    ]


def _us_per_step(problem: Problem, method: str) -> float:
    def run() -> None:
        response = solve(problem, METHODS[method], save=SaveAt(field_every=problem.steps, channels=False))
        assert response.status.ok
        assert response.stats.engine == "kernel"

    run()
    return 1e6 * repeated_cpu_time(run, REPEAT_SECONDS) / problem.steps


def copy_case(count: int) -> Problem:
    """Return one revolution of equal trains of the case in one system."""
    ready = prepare(
        read_case(
            ROOT / f"cases/{CASE}.toml",
            ["run.revolutions=1", f"run.steps_per_revolution={STEPS}", "run.engine=kernel", *COARSE],
        )
    )
    train = ready.problem.system
    size = train.size

    def expand(vectors: FloatArray, copy: int) -> FloatArray:
        expanded = np.zeros((*vectors.shape[:-1], count * size))
        expanded[..., copy * size : (copy + 1) * size] = vectors
        return expanded

    def expand_angle_vector(vector: AngleVector, copy: int) -> AngleVector:
        return replace(vector, vectors=expand(vector.vectors, copy))

    def repeat(matrix: Triplets) -> Triplets:
        return Triplets.from_dense(np.kron(np.eye(count), matrix.dense()).tolist())

    copies = range(count)
    system = System(
        *(repeat(matrix) for matrix in (train.mass, train.damping, train.stiffness)),
        names=tuple(f"{copy}.{name}" for copy in copies for name in train.names),
        loads=tuple(replace(load, vector=expand(load.vector, copy)) for copy in copies for load in train.loads),
        local_forces=tuple(
            replace(
                force,
                sense=tuple(expand_angle_vector(vector, copy) for vector in force.sense),
                act=tuple(expand_angle_vector(vector, copy) for vector in force.act),
            )
            for copy in copies
            for force in train.local_forces
        ),
        probes=tuple(replace(probe, rows=expand(probe.rows, 0)) for probe in train.probes),
    )
    start = ready.problem.start
    if start is not None:
        inner = None if start.inner is None else np.tile(start.inner, count)
        displacement, velocity = (np.tile(part, count) for part in (start.displacement, start.velocity))
        start = replace(start, displacement=displacement, velocity=velocity, inner=inner)
    return replace(ready.problem, system=system, start=start, basis=None)
