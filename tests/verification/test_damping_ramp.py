"""Oscillator against a seat whose damping grows over ten micrometres, which it crosses within a step.

The reference integrates the pieces between the kinks of the force with DOP853. Its Floquet multipliers and derivatives
are differences of these orbits.
"""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve

from flexcam import InputError, prepare, read_case, solve
from flexcam.analysis.stability import assess_stability
from flexcam.dynamics.contact_events import EventStepper
from flexcam.studies.gradients import compute_gradient
from flexcam.studies.sensitivity import get_numbers

STIFFNESS, DAMPING, DEPTH = 2000.0, 4.0, 1e-5  # of the seat
PERIOD = 2.0 * np.pi / 8.0
CASE = """
format = 1
title = "oscillator on a seat"
nodes = {{ a = [0, 0, 0] }}
supports = {{ a = ["ux", "uz"] }}
masses = {{ m = {{ at = "a", mass = 1.0 }} }}
springs = {{ s = {{ at = "a", direction = "uy", stiffness = 100, damping = {damping}, installed_force = 2 }} }}
loads = {{ f = {{ at = "a", direction = "uy", table = "cosine.csv" }} }}
contacts = {{ seat = {{ model = "seat", at = "a", direction = "uy", stiffness = 2000, damping = 4 }} }}
run = {{ speed = 8.0, revolutions = 1, steps_per_revolution = 3600, start = "{start}" }}
output = {{ probes = ["a"] }}
"""


def write_case(folder: Path, damping: float, start: str):
    angle = np.arange(0.0, 360.5, 0.5)
    rows = np.column_stack([angle, 5.0 * np.cos(np.radians(angle))])
    np.savetxt(folder / "cosine.csv", rows, delimiter=",", header="cam angle [deg],force [N]", comments="", fmt="%.17g")
    (folder / "case.toml").write_text(CASE.format(damping=damping, start=start))
    return read_case(folder / "case.toml")


def exact_motion(state, damping: float, preload: float = 2.0, stiffness: float = 100.0):
    """Return the state after a revolution and the maximum seat force, piece by piece between the kinks of the force."""
    time, largest, piece = 0.0, 0.0, "free" if state[0] > 0.0 else "full"

    def force(piece, x, v):
        growth = {"full": 1.0, "ramp": -x / DEPTH}.get(piece)
        return 0.0 if growth is None else -STIFFNESS * x - DAMPING * growth * v

    ends = {
        "free": [(lambda x, v: x, -1, "ramp")],
        "cut": [(lambda x, v: x, 1, "free")],
        "ramp": [
            (lambda x, v: x, 1, "free"),
            (lambda x, v: x + DEPTH, -1, "full"),
            (lambda x, v: STIFFNESS - DAMPING * v / DEPTH, -1, "cut"),
        ],
        "full": [(lambda x, v: x + DEPTH, 1, "ramp"), (lambda x, v: -STIFFNESS * x - DAMPING * v, -1, "cut")],
    }
    while time < PERIOD:
        events = []
        for value, direction, _ in ends[piece]:
            events.append(lambda t, y, value=value: value(*y))
            events[-1].terminal, events[-1].direction = True, direction

        def rates(t, y, piece=piece):
            pull = 5.0 * np.cos(8.0 * t) - preload - damping * y[1] - stiffness * y[0]
            return [y[1], pull + force(piece, *y)]

        found = solve_ivp(
            rates, (time, PERIOD), state, "DOP853", rtol=1e-11, atol=1e-14, events=events, dense_output=piece == "full"
        )
        if piece == "full":
            largest = max(largest, *(force(piece, *y) for y in found.sol(np.linspace(time, found.t[-1], 4001)).T))
        time, state = found.t[-1], found.y[:, -1]
        if found.status != 1:
            break
        piece = next(end[2] for end, times in zip(ends[piece], found.t_events, strict=True) if len(times))
    return state, largest


@pytest.mark.parametrize("damping", [0.4, 2.5])
def test_multiplier_of_impacts_shorter_than_a_step(tmp_path, damping):
    """The tolerance is a step's error: 0.6 % with 3600 steps, 0.06 % with 14 400."""
    stability = assess_stability(write_case(tmp_path, damping, "periodic"))
    floquet = stability.floquet
    orbit = fsolve(lambda y: exact_motion(y, damping)[0] - y, [0.0158, 0.072] if damping < 1.0 else [0.012, 0.05])
    step = 1e-6
    columns = [exact_motion(orbit + d, damping)[0] - exact_motion(orbit - d, damping)[0] for d in step * np.eye(2)]
    exact = np.linalg.eigvals(np.array(columns).T / (2.0 * step))
    worst = exact[np.argmax(np.abs(exact))]
    assert worst < -1.05
    assert complex(floquet.multipliers[0]) == pytest.approx(complex(worst), rel=0.01)
    assert stability.causes == ("chatter",)  # the motion leaves the orbit and repeats after two revolutions


@pytest.mark.parametrize("steps", [3600, 72_000])
def test_derivatives_of_impacts_shorter_than_a_step(tmp_path, steps):
    """Some of the shorter steps begin within the ramp."""
    write_case(tmp_path, 0.4, "rest")
    case = read_case(tmp_path / "case.toml", [f"run.steps_per_revolution={steps}"])
    name, keys = "contacts.seat.force.largest", ["springs.s.stiffness", "springs.s.installed_force"]
    found = compute_gradient(case, [name], get_numbers(case, keys)).derivatives

    def largest(preload=2.0, stiffness=100.0):
        return exact_motion([-preload / (stiffness + STIFFNESS), 0.0], 0.4, preload, stiffness)[1]

    exact = (largest(stiffness=100.01) - largest(stiffness=99.99)) / 0.02
    assert found[name, keys[0]] == pytest.approx(exact, rel=0.01)
    exact = (largest(preload=2.0002) - largest(preload=1.9998)) / 0.0004
    assert found[name, keys[1]] == pytest.approx(exact, rel=0.01)


def test_derivative_by_the_length_of_the_ramp_is_refused(tmp_path):
    case = write_case(tmp_path, 0.4, "rest")
    with pytest.raises(InputError, match=r"damping_depth.*--method differences"):
        compute_gradient(case, ["contacts.seat.force.largest"], get_numbers(case, ["contacts.seat.damping_depth"]))


def test_ramp_of_nanometres_does_not_stall_steps(tmp_path, monkeypatch):
    """The end of such a ramp is found only to rounding of the time: it must not be found again and again."""
    walk, counts = EventStepper._walk, []
    monkeypatch.setattr(EventStepper, "_walk", lambda *given: counts.append(len(found := walk(*given))) or found)
    write_case(tmp_path, 0.4, "rest")
    seat = ["contacts.seat.stiffness=1e7", "contacts.seat.damping=500", "contacts.seat.damping_depth=1e-9"]
    method = ["run.integrator.method=newmark", "run.steps_per_revolution=720", "run.revolutions=10"]
    ready = prepare(read_case(tmp_path / "case.toml", [*seat, *method]))
    assert solve(ready.problem, ready.scheme).status.ok
    assert 2 < max(counts) < 10
