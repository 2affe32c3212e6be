"""C1 by flexcam: the default method for contacts, and Newmark's method."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from benchmarks.peers.train import FloatArray, Setting, Train
from flexcam.core import Triplets
from flexcam.dynamics import (
    AngleFunction,
    AngleVector,
    ConstantSpeed,
    Load,
    LocalForce,
    Method,
    Probe,
    Problem,
    SaveAt,
    State,
    System,
    collocation,
    constant,
    hunt_crossley_contact,
    newmark,
    solve,
)

METHODS: dict[str, tuple[Method, tuple[int, ...]]] = {
    "flexcam, `collocation`": (collocation(), (900, 1800, 3600, 7200, 14400, 28800)),
    "flexcam, `newmark`": (newmark(), (1800, 3600, 7200, 14400, 28800, 57600)),
}
"""Methods with their numbers of steps per revolution."""
FINE_STEPS = 460_800
"""Steps of a reference solution."""


def settings(train: Train) -> Iterator[Setting]:
    """Yield both methods."""
    for title, (method, counts) in METHODS.items():
        for steps in counts:
            yield Setting(title, f"{steps} steps", partial(_prepare, train, method, steps))


def integrate(train: Train, method: Method, steps: int) -> FloatArray:
    """Return time, displacements and velocities at the output instants, shape (instants + 1, 7)."""
    return np.column_stack([train.times, _prepare(train, method, steps)()])


def train_problem(train: Train, steps: int, copies: int = 1) -> Problem:
    """Return one revolution of equal, independent trains in one system, for the kernel solver engine."""
    start = train.start
    return Problem(
        train_system(train, copies),
        ConstantSpeed(train.speed),
        step=train.period / steps,
        steps=steps,
        start=State(np.tile(start[:3], copies), np.tile(start[3:], copies)),
        engine="kernel",
    )


def train_system(train: Train, copies: int = 1) -> System:
    """Return the equations of equal trains, with a probe on the first one."""
    size = 3 * copies
    M, C, K = (Triplets.from_dense(np.kron(np.eye(copies), matrix).tolist()) for matrix in train.matrices())
    forces: list[LocalForce] = []
    for copy in range(copies):
        follower, rocker, valve = np.eye(size)[3 * copy : 3 * copy + 3]
        contacts: tuple[tuple[str, FloatArray, tuple[float, float], AngleFunction], ...] = (
            ("cam", -follower, train.cam, train.lift_at),
            ("tip", rocker - valve, train.tip, constant(-train.lash)),
            ("seat", -valve, train.seat, constant(0.0)),
        )
        for name, row, law, offset in contacts:
            sense, act = AngleVector.constant(row), AngleVector.constant(-row)
            forces.append(LocalForce(f"{copy}.{name}", (sense,), (act,), hunt_crossley_contact(*law), (offset,)))
    preload = Load("preload", np.tile(train.preload, copies), lambda motion: np.ones_like(motion.angle), steady=True)
    names = ("follower", "rocker", "valve")
    return System(
        M, C, K, tuple(f"{copy}.{name}" for copy in range(copies) for name in names), (preload,), tuple(forces),
        probes=(Probe("train", names, np.eye(size)[:3], (None,) * 3),),
    )  # fmt: skip


def _prepare(train: Train, method: Method, steps: int) -> partial[FloatArray]:
    return partial(_run, train_problem(train, steps), method, steps // train.instants)


def _run(problem: Problem, method: Method, every: int) -> FloatArray:
    response = solve(problem, method, save=SaveAt(field_every=problem.steps, channels=False))
    if not response.status.ok:
        raise RuntimeError(str(response.status))
    motion = response["train"]
    return np.hstack([motion.displacement[::every], motion.velocity[::every]])
