"""Periodic initial state, `start = "periodic"`, against closed forms and long transients.

The steady motion of a damped linear train under a periodic cam force is the sum of its responses to the harmonics, (K -
w^2 n^2 M + i w n C)^-1 f_n. Newmark's own steady motion differs from it by (w n dt)^2/12 of each. J. P. Den Hartog,
Mechanical Vibrations, 4th ed. (1956), secs. 2.8-2.9, 4.1.
"""

from __future__ import annotations

import math
import sys
from dataclasses import replace

import numpy as np
import pytest

from flexcam import prepare, read_case, run
from flexcam.core import Triplets
from flexcam.dynamics import ConstantSpeed, Load, Probe, Problem, State, System, newmark, solve, solve_periodic
from flexcam.dynamics.periodic import period_map

SOURCE = "Periodic start"
PERIODIC_MODULE = sys.modules["flexcam.dynamics.periodic"]  # the package exports the function of that name
LINEAR_CASE = "cases/tayeb/model-1-cycloidal.toml"


def harmonic_solution(system, speed, count=4096, most=400):
    """Return the exact steady displacement and velocity at angle zero, by the harmonics of the loads."""
    angles = 2.0 * math.pi * np.arange(count) / count
    motion = ConstantSpeed(speed).at(angles / speed)
    loads = np.fft.rfft(system.load_histories(motion) @ system.load_vectors(), axis=0) / count
    M, C, K = (one.dense() for one in (system.mass, system.damping, system.stiffness))
    d, v = np.zeros(system.size), np.zeros(system.size)
    for n in range(most):
        w = n * speed
        answer = np.linalg.solve(K - w**2 * M + 1j * w * C, loads[n]) * (1.0 if n == 0 else 2.0)
        d, v = d + answer.real, v + (1j * w * answer).real
    return d, v


def test_oscillator_under_harmonic_force(record):
    """Damped oscillator at 0.9 of resonance, in closed form; a transient would last 200 revolutions."""
    M, C, K = (Triplets.from_dense([[one]]) for one in (1.0, 0.01, 1.0))
    push = Load("push", np.ones(1), lambda motion: np.cos(motion.angle))
    system = System(M, C, K, ("x",), (push,), (), (Probe("x", ("x",), np.eye(1), (None,)),))
    w, steps = 0.9, 4000
    problem = Problem(system, ConstantSpeed(w), 2.0 * math.pi / w / steps, steps, State.rest(1))
    found = solve_periodic(problem, newmark())
    exact = 1.0 / (1.0 - w**2 + 0.01j * w)
    size = abs(exact)
    for name, reference, computed in (
        ("displacement", exact.real, found.displacement[0]), ("velocity", (1j * w * exact).real, found.velocity[0]),
    ):  # fmt: skip
        record(source=SOURCE, case="damped oscillator at 0.9 of resonance", quantity=f"start {name}", unit="1",
               reference=reference, computed=computed, tolerance=3e-6 * size, absolute=True,
               reason="Newmark's frequency is (w dt)^2/24 low, enlarged by the nearness to resonance")  # fmt: skip
    assert found.periodicity <= 1e-9
    again = solve(Problem(system, ConstantSpeed(w), problem.step, steps, found), newmark())
    assert again.stats.periodicity == found.periodicity
    assert again["x"].displacement[-1] == pytest.approx(found.displacement[0], abs=1e-8 * size)


DAMPED_RUN = ("run.damping={ alpha = '20 1/s', beta = '20 us' }", "run.steps_per_revolution=1800", "run.revolutions=1")


def test_published_model_matches_harmonic_solution(record):
    """The state of the damped model 1 equals the sum over harmonics, in the energy norm; the valve motion repeats."""
    ready = prepare(read_case(LINEAR_CASE, [*DAMPED_RUN, "run.start=periodic"]))
    system, start = ready.problem.system, ready.problem.start
    assert not system.local_forces
    d, v = harmonic_solution(system, ready.case.speed)
    M, K = system.mass.dense(), system.stiffness.dense()

    def size(x, y):
        return math.sqrt(x @ K @ x + y @ M @ y)

    missed = size(start.displacement - d, start.velocity - v) / size(d, v)
    record(source=SOURCE, case="published model 1, cycloidal", quantity="start state by harmonics, energy norm",
           unit="1", reference=0.0, computed=missed, tolerance=2e-3, absolute=True,
           reason="time steps of 0.2 deg at the harmonics next to the first mode")  # fmt: skip
    response = solve(ready.problem, ready.scheme)
    assert 0.0 <= response.stats.periodicity <= 1e-9
    valve = response["valve"]
    assert np.ptp(valve.displacement) > 1e-3
    for series in (valve.displacement, valve.velocity, valve.acceleration):
        assert abs(series[-1] - series[0]) < 1e-7 * np.abs(series).max()


def test_long_transient_converges_to_periodic_state(record):
    """The reference is a run of twenty-five revolutions of a well damped train from rest."""
    damped = ("run.damping={ alpha = '200 1/s', beta = '40 us' }", "run.steps_per_revolution=600")
    transient = run(read_case(LINEAR_CASE, [*damped, "run.revolutions=25", "run.start=rest"]))
    steady = run(read_case(LINEAR_CASE, [*damped, "run.revolutions=1", "run.start=periodic"]))
    last, first = transient["valve"].displacement[-601:], steady["valve"].displacement
    record(source=SOURCE, case="published model 1, heavily damped", quantity="distance from the 25th revolution",
           unit="m", reference=0.0, computed=np.abs(last - first).max(), tolerance=1e-8 * np.abs(first).max(),
           absolute=True, reason="what is left of the transient")  # fmt: skip


CONTACT_CASE = """
format = 1
[nodes]
drive = [0.0, 0.0, 0.0]
cam = [0.02, 0.0, 0.0]
tappet = [0.02, 0.03, 0.0]
top = [0.02, 0.08, 0.0]
[materials.steel]
E = "207 GPa"
nu = 0.3
density = "7800 kg/m^3"
[sections]
thick = { shape = "circle", diameter = "20 mm" }
[members]
camshaft = { nodes = ["drive", "cam"], material = "steel", section = "thick" }
pushrod = { nodes = ["tappet", "top"], material = "steel", section = "thick" }
[supports]
drive = ["ux", "uy", "uz", "rx", "ry", "rz"]
tappet = ["ux", "uz", "ry", "rx", "rz"]
top = ["ux", "uz", "ry", "rx", "rz"]
[masses]
follower = { at = "tappet", mass = "0.4 kg" }
[springs]
valve = { at = "tappet", direction = "uy", stiffness = "20 kN/m", installed_force = "300 N", damping = "20 N s/m" }
[cams.intake]
at = "cam"
law = "4-5-6-7"
lift = "10 mm"
rise = "90 deg"
return = "90 deg"
phase = "60 deg"
[contacts]
intake = { cam = "intake", follower = "tappet", model = "unilateral", stiffness = "20 MN/m", dissipation = "2 s/m" }
[run]
speed = "1850 rpm"
revolutions = 1
steps_per_revolution = 600
damping = { beta = "5 us" }
[output]
probes = ["tappet"]
"""


@pytest.mark.parametrize(("speed", "flies"), [(600, False), (1850, True)])
def test_periodic_state_with_contact(record, tmp_path, speed, flies):
    """The reference is the sixth revolution of a transient, for a closed contact and with a flight after the nose."""
    path = tmp_path / "contact.toml"
    path.write_text(CONTACT_CASE, encoding="utf-8")
    more = f"run.speed={speed} rpm"
    steady = run(read_case(path, [more, "run.start=periodic"]))
    force = steady.channels["contacts.intake.force"]
    assert (force.min() == 0.0) == flies
    lift = steady["tappet.uy"].displacement
    record(source=SOURCE, case=f"contact, {speed} rpm", quantity="follower after a revolution", unit="m",
           reference=0.0, computed=abs(lift[-1] - lift[0]), tolerance=1e-8, absolute=True,
           reason="what the search leaves: 1e-9 of the motion, a little more where contacts part")  # fmt: skip
    assert 0.0 <= steady.stats.periodicity < 1e-6
    transient = run(read_case(path, [more, "run.start=equilibrium", "run.revolutions=6"]))
    last = transient["tappet.uy"].displacement[-601:]
    record(source=SOURCE, case=f"contact, {speed} rpm", quantity="distance from the sixth revolution", unit="m",
           reference=0.0, computed=np.abs(last - lift).max(), tolerance=1e-7, absolute=True,
           reason="what is left of the transient, 1e-5 of the lift")  # fmt: skip


def test_periodic_state_at_fluctuating_speed(record):
    """With integer orders the state repeats with the camshaft."""
    swing = "run.fluctuation={ orders = [2], amplitudes = [0.02] }"
    response = run(read_case(LINEAR_CASE, [*DAMPED_RUN, swing, "run.start=periodic"]))
    record(source=SOURCE, case="published model 1, swinging speed", quantity="periodicity", unit="1", reference=0.0,
           computed=response.stats.periodicity, tolerance=1e-9, absolute=True, reason="as asked for")  # fmt: skip
    valve = response["valve"].displacement
    assert abs(valve[-1] - valve[0]) < 1e-7 * np.abs(valve).max()


def test_rigid_model_is_periodic():
    """The rigid model follows its lift and is periodic from the start."""
    response = run(read_case(LINEAR_CASE, [*DAMPED_RUN, "run.start=periodic"]), rigid=True)
    assert response.status.ok
    valve = response["valve"].displacement
    np.testing.assert_allclose(valve[-1], valve[0], atol=1e-12)
    assert 0.0 <= response.stats.periodicity <= 1e-9


@pytest.mark.parametrize(("case", "damped", "most"), [
    (LINEAR_CASE, DAMPED_RUN, 2), (LINEAR_CASE, ("run.revolutions=1",), 2),
    ("cases/direct-acting/finger.toml", ("run.steps_per_revolution=360", "run.revolutions=1"), 8),
    pytest.param("cases/direct-acting/bucket.toml", ("run.revolutions=1",), 20, marks=pytest.mark.slow),
])  # fmt: skip
def test_number_of_revolutions_of_search(monkeypatch, case, damped, most):
    """A linear train is periodic after the second revolution; with contacts the search uses no derivative."""
    taken: list[bool] = []

    def counted(*arguments, derived):
        taken.append(derived)
        return period_map(*arguments, derived=derived)

    monkeypatch.setattr(PERIODIC_MODULE, "period_map", counted)
    ready = prepare(read_case(case, [*damped, "run.start=periodic"]))
    assert len(taken) <= most
    assert any(taken) == (case == LINEAR_CASE)
    assert ready.problem.start.periodicity <= 1e-9


def test_anderson_and_newton_agree(monkeypatch):
    """Systems above the size limit use Anderson's method."""
    found = [prepare(read_case(LINEAR_CASE, [*DAMPED_RUN, "run.start=periodic"])).problem.start]
    monkeypatch.setattr(PERIODIC_MODULE, "MAX_UNKNOWNS", 0)
    found.append(prepare(read_case(LINEAR_CASE, [*DAMPED_RUN, "run.start=periodic"])).problem.start)
    newton, anderson = (one.displacement for one in found)
    np.testing.assert_allclose(newton, anderson, atol=1e-7 * np.abs(newton).max())


@pytest.mark.slow
def test_residual_is_equal_on_direct_and_kernel_engine():
    """A tolerance of one ends the search after the first revolution."""
    words = ("run.steps_per_revolution=360", "run.revolutions=1")
    problem = prepare(read_case("cases/direct-acting/finger.toml", words)).problem
    direct, kernel = (
        solve_periodic(replace(problem, engine=engine), newmark(), tolerance=1.0).periodicity
        for engine in ("direct", "kernel")
    )
    assert direct > 1e-3
    assert kernel == pytest.approx(direct, rel=1e-6)  # touchdowns leave a part of the Newton tolerance
