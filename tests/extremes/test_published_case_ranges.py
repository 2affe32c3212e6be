"""The published model from 1 to 1e6 steps per revolution and from 1 to 50 000 rpm, compared with its exact response.

The lift is (1 - cos theta)/2, so that the loads consist of few harmonics; the response of each mode of K x = w^2 M x
from the installed state is known in closed form: q'' + w^2 q = a cos(n W t) + b sin(n W t).
"""

import re

import numpy as np
import pytest
from scipy.linalg import eigh

from flexcam import prepare, read_case
from flexcam.dynamics import SaveAt, solve
from tests.thinning import mostly_slow

FINE, FAST = "steps per revolution", "camshaft speed"
LOADED = 2.0 * np.pi * 67.1144  # rad/s: the one mode that moves the valve by more than a thousandth of its lift
HARMONICS = 4


def exact_displacement(ready, times):
    """Return the displacement of the valve by modal superposition in closed form."""
    system, speed = ready.problem.system, ready.case.speed
    squares, shapes = eigh(system.stiffness.dense(), system.mass.dense())
    turn = ready.problem.drive.at(2.0 * np.pi / speed * np.arange(64) / 64)
    waves = np.fft.rfft(system.load_histories(turn), axis=0) / 64
    assert np.abs(waves[HARMONICS:]).max() <= 1e-12 * np.abs(waves).max()
    modal = shapes.T @ system.load_vectors().T
    start = shapes.T @ system.mass.times(ready.problem.start.displacement)
    valve_row = next(probe for probe in system.probes if probe.name == "valve").rows @ shapes
    valve_motion = np.zeros(len(times))
    for i in np.flatnonzero(np.abs(modal).max(axis=1) > 1e-9 * np.abs(modal).max()).tolist():
        w = np.sqrt(squares[i])
        valve_motion += float(valve_row[0, i] * start[i]) * np.cos(w * times)
        for n in range(HARMONICS):
            wave = complex(modal[i] @ waves[n]) * (2.0 if n else 1.0)
            a, b, v = wave.real, -wave.imag, n * speed
            forced = a * (np.cos(v * times) - np.cos(w * times)) + b * (np.sin(v * times) - v / w * np.sin(w * times))
            valve_motion += float(valve_row[0, i]) * forced / (w**2 - v**2)
    return valve_motion


def deviation(case, *overrides):
    """Return the maximum relative deviation of the valve from the exact motion, omega dt and omega T."""
    ready = prepare(read_case(case, list(overrides)))
    response = solve(ready.problem, ready.scheme, save=SaveAt(field_every=10_000))
    assert response.status.ok
    theory = exact_displacement(ready, response.time)
    off = np.abs(response["valve"].displacement - theory).max()
    return float(off / np.abs(theory).max()), LOADED * ready.problem.step, float(LOADED * response.time[-1])


def expect_steps_accurate(expect, tayeb, steps, revolutions):
    off, x, angle = deviation(tayeb, f"run.steps_per_revolution={steps}", f"run.revolutions={revolutions}")
    # The phase of the loaded mode lags by x^2/12 of its angle w T, with an amplitude below twice that of the motion
    # (1.25 on a forced motion of 2.25 at 3000 rpm). Rounding of K: eps (w_max/w)^2 = 4e-9.
    expect.right(FINE, f"published case, {steps} steps per revolution, omega dt = {x:.2g} of the loaded mode",
                 what="valve off its exact motion by", reference=0.0, computed=off, absolute=True,
                 tolerance=x**2 / 12.0 * angle + 1e-7)  # fmt: skip


@pytest.mark.parametrize("steps", [100, 360, 3600, pytest.param(10_000, marks=pytest.mark.slow)])
def test_100_or_more_steps_match_exact_response(expect, tayeb, steps):
    expect_steps_accurate(expect, tayeb, steps, 2)


@pytest.mark.slow
def test_million_steps_match_exact_response(expect, tayeb):
    expect_steps_accurate(expect, tayeb, 1_000_000, 1)


@pytest.mark.parametrize("steps", [1, 3, 10, 30])
@pytest.mark.parametrize("asked", mostly_slow(["check", "run"]))
def test_too_few_steps_give_warning(expect, command, tayeb, asked, steps):
    code, output = command(asked, tayeb, "--set", f"run.steps_per_revolution={steps}")
    assert code == 0
    warning = re.search(r"Warning: with \S+ steps per revolution.*?take at least \d+", output, re.DOTALL)
    expect.warns(FINE, f"flexcam {asked}, published case, {steps} steps per revolution",
                 warning[0] if warning else output, r"steps per revolution", r"\d %", r"at least \d+")  # fmt: skip


@pytest.mark.parametrize("asked", ["check", "run"])
def test_100_steps_give_no_warning(command, tayeb, asked):
    """100 steps per revolution are accurate to 0.3 %."""
    code, output = command(asked, tayeb, "--set", "run.steps_per_revolution=100")
    assert code == 0
    assert "Warning" not in output


@pytest.mark.parametrize(("steps", "allowed"), [("0", "1 or more"), ("1000000000", "100000000")])
def test_invalid_number_of_steps_is_refused(expect, command, tayeb, steps, allowed):
    code, output = command("check", tayeb, "--set", f"run.steps_per_revolution={steps}")
    assert code == 2
    expect.refuses(FINE, f"{steps} steps per revolution", output, "steps_per_revolution", allowed)


@pytest.mark.parametrize("rpm", mostly_slow([1, 10, 100, 1000, 3000, 4000, 10_000, 50_000]))
def test_speeds_up_to_50000_rpm_match_exact_response(expect, tayeb, rpm):
    """With 3600 steps per revolution the loaded mode is unresolved below 300 rpm, where it is not excited either."""
    off, x, angle = deviation(tayeb, f"run.speed={rpm}rpm")
    # As above if the mode is resolved; otherwise its amplitude is (W/w)^2 of the motion. The amplitudes of higher modes
    # are below a hundredth of it at 50 000 rpm, and w dt is 6e-3 for the next mode.
    share = min(1.0, 2.0 * (rpm * np.pi / 30.0 / LOADED) ** 2)
    expect.right(FAST, f"published case, {rpm} rpm", what="valve off its exact motion by", reference=0.0, computed=off,
                 absolute=True, tolerance=min(x**2 / 12.0 * angle, 2.0) * share + 1e-5)  # fmt: skip


@pytest.mark.parametrize("speed", ["0 rpm", "-1 rpm"])
def test_zero_or_negative_speed_is_refused(expect, command, tayeb, speed):
    code, output = command("run", tayeb, "--set", f'run.speed="{speed}"')
    assert code == 2
    expect.refuses(FAST, speed, output, "run.speed", "above zero")
