"""`solve` with one unknown and with none: saved instants, sinks, and unchanged arguments."""

from __future__ import annotations

import importlib

import numpy as np
import pytest

from flexcam.core import Triplets
from flexcam.core.errors import InputError
from flexcam.dynamics import (
    Channel,
    ConstantSpeed,
    Load,
    Probe,
    Problem,
    SaveAt,
    State,
    System,
    installed_state,
    load_sum,
    newmark,
    solve,
)

W = 7.0


@pytest.fixture
def oscillator(system_of):
    return system_of([[1.0]], [[0.0]], [[W**2]])


def run_free_vibration(oscillator, steps=400, **options):
    return solve(Problem(oscillator, ConstantSpeed(1.0), 1e-3, steps, State([1.0], [0.0])), newmark(), **options)


def test_free_vibration(oscillator):
    response = run_free_vibration(oscillator)
    # Period error (w dt)^2/12 = 4e-6 over 2.8 rad.
    np.testing.assert_allclose(response["all"].displacement, np.cos(W * response.time), atol=1.2e-5)
    assert response.status.ok
    assert response.stats.steps == 400
    assert response.stats.unknowns == 1


@pytest.mark.parametrize("save", [SaveAt(7, 3), SaveAt(1000, 1)])
def test_save_options_do_not_change_run(oscillator, save):
    one, other = run_free_vibration(oscillator), run_free_vibration(oscillator, save=save)
    np.testing.assert_array_equal(one["all"].displacement, other["all"].displacement)
    np.testing.assert_array_equal(one.time, other.time)
    at = np.union1d(np.arange(0, 401, save.field_every), [400])
    np.testing.assert_array_equal(other.field_time, one.time[at])
    np.testing.assert_array_equal(other.fields.displacement[:, 0], one["all"].displacement[at])
    np.testing.assert_array_equal(other.fields.acceleration[:, 0], one["all"].acceleration[at])


def test_second_run_continues_first(oscillator):
    whole, first = run_free_vibration(oscillator), run_free_vibration(oscillator, 150)
    start = State(first["all"].displacement[-1:], first["all"].velocity[-1:], first.time[-1])
    second = solve(Problem(oscillator, ConstantSpeed(1.0), 1e-3, 250, start), newmark())
    np.testing.assert_allclose(second["all"].displacement, whole["all"].displacement[150:], atol=1e-13)
    np.testing.assert_allclose(second.time, whole.time[150:], rtol=1e-14)


class RecordingSink:
    """Sink that records block lengths and the end."""

    def __init__(self):
        self.lengths, self.ends = [], []

    def write(self, block):
        self.lengths.append(len(block.time))

    def close(self, status, stats):
        self.ends.append((status, stats))


def test_sinks_receive_every_step_and_end(oscillator):
    sink = RecordingSink()
    response = run_free_vibration(oscillator, sinks=[sink], save=SaveAt(10, 4))
    assert sink.lengths == [40] * 10 + [1]
    assert sink.ends == [(response.status, response.stats)]


def test_arguments_are_unchanged(oscillator, readonly):
    start = readonly([1.0])
    for matrix in (oscillator.mass, oscillator.damping, oscillator.stiffness):
        matrix.values.setflags(write=False)
    solve(Problem(oscillator, ConstantSpeed(1.0), 1e-3, 5, State(start, readonly([0.0]))), newmark())
    np.testing.assert_array_equal(start, [1.0])


def test_system_without_unknowns():
    """The probe of a rigid model follows its function of the angle, with the rates of a rotating cam."""
    nothing, speed = Triplets.zeros(0), 3.0
    lift = lambda a, n: np.sin(2 * a + n * np.pi / 2) * 2.0**n  # noqa: E731
    system = System(
        nothing,
        nothing,
        nothing,
        (),
        (Load("spring", np.zeros(0), lambda m: 5.0 * lift(m.angle, 0)),),
        probes=(
            Probe("valve", ("lift",), np.zeros((1, 0)), (lift,)),
            Probe("still", ("a", "b"), np.zeros((2, 0)), (None, lift)),
        ),
        channels=(
            Channel("force", "N", load_sum(0)),
            Channel("torque", "N m", load_sum(0, factor=lambda a, n: lift(a, n + 1))),
        ),
    )
    response = solve(Problem(system, ConstantSpeed(speed), 0.01, 100), newmark())
    angle = speed * response.time
    np.testing.assert_allclose(response.angle, angle)
    np.testing.assert_allclose(response["valve"].displacement, np.sin(2 * angle), atol=1e-15)
    np.testing.assert_allclose(response["valve"].velocity, 2 * speed * np.cos(2 * angle), atol=1e-14)
    np.testing.assert_allclose(response["valve"].acceleration, -4 * speed**2 * np.sin(2 * angle), atol=1e-13)
    assert not response["still.a"].displacement.any()
    np.testing.assert_array_equal(response["still"].displacement[:, 1], response["still.b"].displacement)
    np.testing.assert_allclose(response.channels["torque"], 10 * np.sin(2 * angle) * np.cos(2 * angle), atol=1e-13)
    assert response.fields.displacement.shape == (len(response.field_time), 0)


def test_probe_adds_prescribed_part(system_of):
    system = system_of([[1.0]], [[0.0]], [[W**2]])
    probe = Probe("sum", ("x",), np.array([[2.0]]), (lambda a, n: a if n == 0 else np.full_like(a, n == 1),))
    system = System(system.mass, system.damping, system.stiffness, system.names, probes=(*system.probes, probe))
    response = solve(Problem(system, ConstantSpeed(4.0), 1e-3, 50, State([1.0], [0.0])), newmark())
    x = response["all"]
    np.testing.assert_allclose(response["sum"].displacement, 2 * x.displacement + response.angle, rtol=1e-14)
    np.testing.assert_allclose(response["sum"].velocity, 2 * x.velocity + 4.0, rtol=1e-14)
    np.testing.assert_allclose(response["sum"].acceleration, 2 * x.acceleration, rtol=1e-14)


def test_massless_unknown_follows_statically(system_of):
    """Mass - spring - massless joint - spring - ground: the joint divides the elongation by the stiffnesses."""
    K = np.array([[3.0, -3.0], [-3.0, 3.0 + 6.0]])
    system = system_of([[1.0, 0.0], [0.0, 0.0]], np.zeros((2, 2)), K)
    response = solve(Problem(system, ConstantSpeed(1.0), 1e-3, 500, State([1.0, 0.0], [0.0, 0.0])), newmark())
    d = response["all"].displacement
    np.testing.assert_allclose(d[:, 1], d[:, 0] / 3, atol=1e-9)
    np.testing.assert_allclose(d[:, 0], np.cos(np.sqrt(2.0) * response.time), atol=1e-6)


def test_installed_state_uses_installed_loads_only(system_of):
    system = system_of([[1.0]], [[0.0]], [[4.0]])
    steady = lambda m: np.ones_like(m.angle)  # noqa: E731
    loads = (Load("preload", np.array([8.0]), steady, installed=True), Load("other", np.array([1.0]), steady))
    system = System(system.mass, system.damping, system.stiffness, system.names, loads)
    np.testing.assert_allclose(installed_state(system, ConstantSpeed(1.0)).displacement, [2.0])


def test_unknown_channel_raises_error(oscillator):
    with pytest.raises(InputError, match=r"'energy\.kinetik'.*Did you mean 'energy\.kinetic"):
        run_free_vibration(oscillator, 10).channels["energy.kinetik"]


@pytest.mark.parametrize("wrong", ["al", "all.x1", ""])
def test_unknown_probe_raises_error(oscillator, wrong):
    with pytest.raises(InputError):
        run_free_vibration(oscillator, 2)[wrong]


@pytest.mark.parametrize(
    ("step", "steps", "start"),
    [(0.0, 1, None), (-1.0, 1, None), (np.nan, 1, None), (1.0, 0, None), (1.0, 1, State([0.0, 0.0], [0.0, 0.0]))],
)
def test_invalid_problem_raises_error(oscillator, step, steps, start):
    with pytest.raises(InputError):
        Problem(oscillator, ConstantSpeed(1.0), step, steps, start)


def test_start_velocity_of_wrong_size_raises_error(oscillator):
    with pytest.raises(InputError):
        Problem(oscillator, ConstantSpeed(1.0), 1.0, 1, State([0.0], [0.0, 0.0]))


def test_small_systems_use_one_blas_thread(monkeypatch):
    """The setting of the host process is restored after the run."""
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    control = importlib.import_module("threadpoolctl")

    def threads():
        return {one["num_threads"] for one in control.threadpool_info() if one["user_api"] == "blas"}

    one = Triplets.from_dense([[1.0]])
    seen: list[set[int]] = []
    with control.threadpool_limits(2, user_api="blas"):
        solve(
            Problem(System(one, one, one, ("x",)), ConstantSpeed(1.0), 0.1, 2, engine="direct"), newmark(),
            stop=lambda: bool(seen.append(threads())),
        )  # fmt: skip
        assert threads() == {2}
    assert all(found == {1} for found in seen)
    assert seen
