"""The published model from 1 to 1e6 steps per revolution and from 1 to 50 000 rpm, against its exact response.

The cam's lift is (1 - cos theta)/2, so that the loads are few harmonics; every mode of K x = w^2 M x answers them from
the installed state in closed form: q'' + w^2 q = a cos(n W t) + b sin(n W t).
"""

from __future__ import annotations

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


def exact(ready, times):
    """Return the valve's displacement, by modal superposition in closed form."""
    system, speed = ready.problem.system, ready.case.speed
    squares, shapes = eigh(system.stiffness.dense(), system.mass.dense())
    turn = ready.problem.drive.at(2.0 * np.pi / speed * np.arange(64) / 64)
    waves = np.fft.rfft(system.load_histories(turn), axis=0) / 64
    assert np.abs(waves[HARMONICS:]).max() <= 1e-12 * np.abs(waves).max()
    modal = shapes.T @ system.load_vectors().T
    start = shapes.T @ system.mass.times(ready.problem.start.displacement)
    seen = next(probe for probe in system.probes if probe.name == "valve").rows @ shapes
    moved = np.zeros(len(times))
    for i in np.flatnonzero(np.abs(modal).max(axis=1) > 1e-9 * np.abs(modal).max()).tolist():
        w = np.sqrt(squares[i])
        moved += float(seen[0, i] * start[i]) * np.cos(w * times)
        for n in range(HARMONICS):
            wave = complex(modal[i] @ waves[n]) * (2.0 if n else 1.0)
            a, b, v = wave.real, -wave.imag, n * speed
            forced = a * (np.cos(v * times) - np.cos(w * times)) + b * (np.sin(v * times) - v / w * np.sin(w * times))
            moved += float(seen[0, i]) * forced / (w**2 - v**2)
    return moved


def deviation(case, *overrides):
    """Return the largest deviation of the valve from its exact motion, as a part of that, and omega dt."""
    ready = prepare(read_case(case, list(overrides)))
    response = solve(ready.problem, ready.scheme, save=SaveAt(field_every=10_000))
    assert response.status.ok
    theory = exact(ready, response.time)
    off = np.abs(response["valve"].displacement - theory).max()
    return float(off / np.abs(theory).max()), LOADED * ready.problem.step, float(LOADED * response.time[-1])


def check_steps(expect, tayeb, steps, revolutions):
    off, x, angle = deviation(tayeb, f"run.steps_per_revolution={steps}", f"run.revolutions={revolutions}")
    # The loaded mode falls behind by x^2/12 of the angle it swings through, w T, with an amplitude below twice the
    # motion's (one of 1.25 on a forced motion of 2.25 at 3000 rpm). Rounding of K: eps (w_max/w)^2 = 4e-9.
    expect.right(FINE, f"published case, {steps} steps per revolution, omega dt = {x:.2g} of the loaded mode",
                 what="valve off its exact motion by", reference=0.0, computed=off, absolute=True,
                 tolerance=x**2 / 12.0 * angle + 1e-7)  # fmt: skip


@pytest.mark.parametrize("steps", [100, 360, 3600, 10_000])
def test_enough_steps_are_right(expect, tayeb, steps):
    check_steps(expect, tayeb, steps, 2)


@pytest.mark.slow
def test_a_million_steps_per_revolution(expect, tayeb):
    check_steps(expect, tayeb, 1_000_000, 1)


@pytest.mark.parametrize("steps", [1, 3, 10, 30])
@pytest.mark.parametrize("asked", mostly_slow(["check", "run"]))
def test_too_few_steps_are_told(expect, command, tayeb, asked, steps):
    code, said = command(asked, tayeb, "--set", f"run.steps_per_revolution={steps}")
    assert code == 0
    told = re.search(r"Warning: with \S+ steps per revolution.*?take at least \d+", said, re.DOTALL)
    expect.warns(FINE, f"flexcam {asked}, published case, {steps} steps per revolution", told[0] if told else said,
                 r"steps per revolution", r"\d %", r"at least \d+")  # fmt: skip


@pytest.mark.parametrize("asked", ["check", "run"])
def test_enough_steps_are_not_warned_of(command, tayeb, asked):
    """100 steps per revolution are right within 0.3 %."""
    code, said = command(asked, tayeb, "--set", "run.steps_per_revolution=100")
    assert code == 0
    assert "Warning" not in said


@pytest.mark.parametrize(("steps", "allowed"), [("0", "1 or more"), ("1000000000", "100000000")])
def test_impossible_steps_are_refused(expect, command, tayeb, steps, allowed):
    code, said = command("check", tayeb, "--set", f"run.steps_per_revolution={steps}")
    assert code == 2
    expect.refuses(FINE, f"{steps} steps per revolution", said, "steps_per_revolution", allowed)


@pytest.mark.parametrize("rpm", mostly_slow([1, 10, 100, 1000, 3000, 4000, 10_000, 50_000]))
def test_every_speed_is_right(expect, tayeb, rpm):
    """3600 steps per revolution; where the loaded mode is not resolved (below 300 rpm) it is not excited either."""
    off, x, angle = deviation(tayeb, f"run.speed={rpm}rpm")
    # As above while the mode is resolved; below, its amplitude is the part (W/w)^2 of the motion. Modes above the
    # loaded one swing with less than a hundredth of it at 50 000 rpm, and w dt is 6e-3 for the next.
    share = min(1.0, 2.0 * (rpm * np.pi / 30.0 / LOADED) ** 2)
    expect.right(FAST, f"published case, {rpm} rpm", what="valve off its exact motion by", reference=0.0, computed=off,
                 absolute=True, tolerance=min(x**2 / 12.0 * angle, 2.0) * share + 1e-5)  # fmt: skip


@pytest.mark.parametrize("speed", ["0 rpm", "-1 rpm"])
def test_a_cam_that_does_not_turn_forward_is_refused(expect, command, tayeb, speed):
    code, said = command("run", tayeb, "--set", f'run.speed="{speed}"')
    assert code == 2
    expect.refuses(FAST, speed, said, "run.speed", "above zero")
