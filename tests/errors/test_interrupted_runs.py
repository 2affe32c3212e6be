"""Runs that end early, by each engine: the status names parts of the system, and the saved response is finite."""

from dataclasses import replace

import numpy as np
import pytest

from flexcam.core import Triplets
from flexcam.dynamics import (
    AngleVector,
    Cause,
    ConstantSpeed,
    Load,
    LocalForce,
    Probe,
    Problem,
    SaveAt,
    System,
    constant,
    elastic_stop,
    hunt_crossley_contact,
    newmark,
    solve,
    spring_damper,
)
from flexcam.dynamics.force_laws import BILATERAL

NAMES = ("cam.uy", "tappet.uy", "valve")
ENGINES = ["direct", "modal", "kernel"]


def sine(motion):
    return np.sin(motion.angle)


def exponential(motion):
    return np.exp(np.minimum(40.0 * motion.angle, 700.0))


def chain(history=sine, law=None, at=1, stiff=1e4):
    K = stiff * np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 2.0]])
    matrices = (Triplets.from_dense(one) for one in (np.diag([1.0, 0.5, 0.2]), 1e-4 * K, K))
    row = np.eye(3)[at]
    local = () if law is None else (
        LocalForce("seat", (AngleVector.constant(row),), (AngleVector.constant(-row),), law, (constant(0.0),)),
    )  # fmt: skip
    probes = (Probe("all", NAMES, np.eye(3), (None,) * 3),)
    return System(*matrices, NAMES, (Load("push", row, history),), local, probes)


def problem_of(system, path, steps=2000):
    return Problem(system, ConstantSpeed(10.0), 1e-3, steps, engine=path)


def assert_response_is_finite(run):
    for values in (*run.channels.values(), run.probes.displacement, run.fields.acceleration):
        assert np.isfinite(values).all()


@pytest.mark.parametrize("path", ENGINES)
def test_exponential_load_gives_status_not_finite(path):
    run = solve(problem_of(chain(exponential), path), newmark(), save=SaveAt(field_every=10))
    general = solve(problem_of(chain(exponential), "direct"), newmark(), save=SaveAt(field_every=10))
    assert run.stats.engine == path
    assert run.status.cause is Cause.NOT_FINITE
    assert run.status.text.split()[0] in NAMES
    assert "is not finite at t = " in run.status.text
    assert run.status.remedy
    assert_response_is_finite(run)
    # Modal amplitudes differ from displacements: they exceed the limit at different steps.
    assert abs(len(run.time) - len(general.time)) <= 30
    assert np.abs(run.probes.displacement).max() > 1e80


@pytest.mark.parametrize(
    ("path", "law"),
    [
        ("direct", spring_damper(-3e5)),
        pytest.param("direct", hunt_crossley_contact(1e4, 0.1), marks=pytest.mark.slow),
        ("kernel", spring_damper(-3e5)),
        ("kernel", hunt_crossley_contact(1e4, 0.1)),
    ],
)
def test_divergence_with_local_force_gives_status(path, law):
    """A negative spring, and an exponential load on a contact: the status has a cause and a name."""
    system = chain(sine if law.kind == BILATERAL else exponential, law)
    run = solve(problem_of(system, path, 4000), newmark())
    assert run.status.cause in (Cause.NOT_FINITE, Cause.NO_CONVERGENCE)
    assert any(name in run.status.text for name in (*NAMES, "seat"))
    assert_response_is_finite(run)


def test_engines_agree_on_step_with_singular_operator():
    """A negative spring makes the operator of the step zero: both engines halve the step, with one result."""
    step, mass = 1e-3, 0.5
    system = chain(law=None)
    one = replace(
        system, mass=Triplets.from_dense(np.diag([1.0, mass, 0.2])), damping=Triplets.zeros(3),
        stiffness=Triplets.from_dense(np.diag([1e4, 1e4, 1e4])),
    )  # fmt: skip
    operator = mass + 0.25 * step**2 * 1e4
    row = np.eye(3)[1]
    force = LocalForce("seat", (AngleVector.constant(row),), (AngleVector.constant(-row),),
                       spring_damper(-operator / (0.25 * step**2)), (constant(0.0),))  # fmt: skip
    system = replace(one, local_forces=(force,))
    general, run = (solve(problem_of(system, path, 5), newmark()) for path in ("direct", "kernel"))
    assert general.status.cause is run.status.cause
    np.testing.assert_allclose(run.probes.displacement, general.probes.displacement, rtol=1e-9)


@pytest.mark.parametrize("path", ENGINES)
@pytest.mark.parametrize("after", [0, 2])
def test_stop_callback_interrupts_run(path, after):
    calls = iter(range(10_000))
    law = elastic_stop(1e4) if path == "kernel" else None
    run = solve(problem_of(chain(law=law), path), newmark(), save=SaveAt(20, 4),
                stop=lambda: next(calls) >= after * (80 if path == "direct" else 1))  # fmt: skip
    assert run.status.cause is Cause.INTERRUPTED
    assert len(run.time) == after * 80
    assert run.stats.steps == max(after * 80 - 1, 0)
    assert_response_is_finite(run)


class InterruptSink:
    """Sink that raises KeyboardInterrupt at its third block."""

    def __init__(self):
        self.blocks, self.ended = 0, None

    def write(self, block):
        self.blocks += 1
        if self.blocks == 3:
            raise KeyboardInterrupt

    def close(self, status, stats):
        self.ended = status


@pytest.mark.parametrize("path", ENGINES)
def test_keyboard_interrupt_returns_finished_steps(path):
    sink = InterruptSink()
    run = solve(problem_of(chain(), path), newmark(), save=SaveAt(20, 4), sinks=[sink])
    assert run.status.cause is Cause.INTERRUPTED
    assert sink.ended is run.status
    assert len(run.time) >= 160


@pytest.mark.parametrize("path", ENGINES)
def test_solve_does_not_modify_system(path, readonly):
    system = chain()
    loads = tuple(replace(load, vector=readonly(load.vector)) for load in system.loads)
    probes = tuple(replace(probe, rows=readonly(probe.rows)) for probe in system.probes)
    problem = problem_of(replace(system, loads=loads, probes=probes), path, 50)
    before = [matrix.values.copy() for matrix in (system.mass, system.damping, system.stiffness)]
    solve(problem, newmark())
    for matrix, values in zip((system.mass, system.damping, system.stiffness), before, strict=True):
        np.testing.assert_array_equal(matrix.values, values)
