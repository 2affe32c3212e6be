"""Copies of one valve train that share nothing: of a case, and of the train of three masses of `benchmarks.peers`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks.peers.train import C1, least_time
from benchmarks.peers.train_flexcam import problem
from benchmarks.processes import ROOT
from flexcam import prepare, read_case
from flexcam.core import FloatArray, Triplets
from flexcam.dynamics import AngleVector, Problem, SaveAt, System, collocation, newmark, solve

CASE = "direct-acting/bucket"
"""Cam contact, lash, seat and two springs of two coils per valve."""
COARSE = (
    "springs.outer.elements=2",
    "springs.inner.elements=2",
    "members.camshaft.elements=1",
    "members.valve.elements=1",
)
"""Few unknowns per train, so that sixteen have no more modes than the kernel solver engine takes."""
METHODS = {"newmark": newmark(), "collocation": collocation()}
COUNTS = (1, 2, 4, 8, 16)
SMALL_COUNTS = (*COUNTS, 32)
"""Of the train of three masses."""
STEPS = 3600
"""Per revolution, of both trains."""
ENOUGH_SECONDS = 2.0
"""Of repeats."""


def times_by_valves() -> list[dict[str, float]]:
    """Return the processor time of a step of the trains of three masses, us, by number of valves and method."""
    return [
        {"valves": count} | {method: _us_per_step(small_copies(count), method) for method in METHODS}
        for count in SMALL_COUNTS
    ]


def _us_per_step(train: Problem, method: str) -> float:
    def run() -> None:
        response = solve(train, METHODS[method], save=SaveAt(field_every=train.steps, channels=False))
        assert response.status.ok
        assert response.stats.engine == "kernel"

    run()
    return 1e6 * least_time(run, ENOUGH_SECONDS) / train.steps


def small_copies(count: int, steps: int = STEPS) -> Problem:
    """Return a revolution of some equal trains of three masses in one system."""
    return problem(C1, steps, count)


def copies(count: int) -> Problem:
    """Return a revolution of some equal trains in one system."""
    ready = prepare(
        read_case(
            ROOT / f"cases/{CASE}.toml",
            ["run.revolutions=1", f"run.steps_per_revolution={STEPS}", "run.engine=kernel", *COARSE],
        )
    )
    one = ready.problem.system
    size = one.size

    def placed(vectors: FloatArray, copy: int) -> FloatArray:
        whole = np.zeros((*vectors.shape[:-1], count * size))
        whole[..., copy * size : (copy + 1) * size] = vectors
        return whole

    def moved(vector: AngleVector, copy: int) -> AngleVector:
        return replace(vector, vectors=placed(vector.vectors, copy))

    def repeated(matrix: Triplets) -> Triplets:
        return Triplets.from_dense(np.kron(np.eye(count), matrix.dense()).tolist())

    each = range(count)
    system = System(
        *(repeated(matrix) for matrix in (one.mass, one.damping, one.stiffness)),
        names=tuple(f"{copy}.{name}" for copy in each for name in one.names),
        loads=tuple(replace(load, vector=placed(load.vector, copy)) for copy in each for load in one.loads),
        local_forces=tuple(
            replace(
                force,
                sense=tuple(moved(vector, copy) for vector in force.sense),
                act=tuple(moved(vector, copy) for vector in force.act),
            )
            for copy in each
            for force in one.local_forces
        ),
        probes=tuple(replace(probe, rows=placed(probe.rows, 0)) for probe in one.probes),
    )
    start = ready.problem.start
    if start is not None:
        inner = None if start.inner is None else np.tile(start.inner, count)
        displacement, velocity = (np.tile(part, count) for part in (start.displacement, start.velocity))
        start = replace(start, displacement=displacement, velocity=velocity, inner=inner)
    return replace(ready.problem, system=system, start=start, basis=None)
