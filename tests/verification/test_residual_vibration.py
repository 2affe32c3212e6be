"""Residual vibration of an undamped oscillator after a rise, y'' + w^2 y = w^2 s: closed forms and runs.

lambda = T_rise/T_n. Amplitude over lift: SHM |cos pi l|/|4 l^2 - 1|, parabolic 4 sin^2(pi l/2)/(pi l)^2, cycloidal |sin
pi l|/(pi l |1 - l^2|): e.g. M. P. Koster, Vibrations of Cam Mechanisms (1974), ch. 3. The limits at l = 1 (cycloidal
1/2) and l = 1/2 (SHM pi/4) are used. The oscillator is a System of one unknown; the same values follow from the
published beam model, whose pushrod is far stiffer than its spring.
"""

import math

import numpy as np
import pytest

from flexcam.cams import LAWS, LiftEvent
from flexcam.dynamics import ConstantSpeed, Problem, installed_state, modes, newmark, solve
from flexcam.valvetrain import build_structure, build_system
from tests.thinning import mostly_slow

SOURCE = "Residual vibration after a rise, closed form"
CLOSED_FORMS = {
    "shm": lambda x: math.pi / 4 if x == 0.5 else abs(math.cos(math.pi * x)) / abs(4 * x**2 - 1),
    "parabolic": lambda x: 4 * math.sin(math.pi * x / 2) ** 2 / (math.pi * x) ** 2,
    "cycloidal": lambda x: 0.5 if x == 1 else abs(math.sin(math.pi * x)) / (math.pi * x * abs(1 - x**2)),
}
DIGITS = {
    1.0: {"shm": 0.333333, "parabolic": 0.405285, "cycloidal": 0.5},
    1.5: {"shm": 0.0, "parabolic": 0.090063, "cycloidal": 0.169765},
    2.0: {"shm": 0.066667, "parabolic": 0.0, "cycloidal": 0.0},
}
RISE = 1.0
LAW_NAMES = ("cycloidal", "parabolic", "shm")
"""Laws with a closed form."""

EVENTS = {law: LiftEvent(LAWS[law], 1.0, rise=RISE, dwell=3.0, fall=1.0) for law in LAW_NAMES}
LAMBDAS = (0.5, 1.0, 1.5, 2.0, 3.3)


@pytest.mark.parametrize("ratio", sorted(DIGITS))
@pytest.mark.parametrize("law", LAW_NAMES)
def test_formula_matches_digits(law, ratio):
    assert CLOSED_FORMS[law](ratio) == pytest.approx(DIGITS[ratio][law], abs=5.1e-7)


def residual_amplitude(problem, probe, scale, lift):
    """Return the amplitude of y - h in the dwell from y and y' at one instant."""
    response = solve(problem, newmark())
    at = -1
    y, v = response[probe].displacement[at], response[probe].velocity[at]
    return np.hypot(y / lift - 1, v / lift / scale)


def oscillator_amplitude(system_of, law, ratio, per_rise):
    """Return the residual amplitude for a rise in 1 s at 1 rad/s; the run ends 0.3 s into the dwell."""
    w = 2 * math.pi * ratio
    event = EVENTS[law]
    system = system_of([[1.0]], [[0.0]], [[w**2]], [([w**2], lambda motion: event(motion.angle))])
    return residual_amplitude(
        Problem(system, ConstantSpeed(1.0), RISE / per_rise, round(1.3 * per_rise)), "all", w, 1.0
    )


@pytest.mark.parametrize("ratio", LAMBDAS)
@pytest.mark.parametrize("law", LAW_NAMES)
def test_oscillator_matches_closed_form(record, system_of, law, ratio):
    record(
        source=SOURCE, case=f"one unknown, {law}", quantity=f"residual amplitude / lift, lambda = {ratio:g}", unit="1",
        reference=CLOSED_FORMS[law](ratio), computed=oscillator_amplitude(system_of, law, ratio, 2000), absolute=True,
        tolerance=2 * math.pi * ratio * (2 * math.pi * ratio / 2000) ** 2 / 12 + 1e-6,
        reason="period error (w dt)^2/12 over the rise as phase, times an amplitude below 1",
    )  # fmt: skip


@pytest.mark.parametrize("law", LAW_NAMES)
def test_oscillator_converges_with_second_order(record, system_of, fitted_order, law):
    counts = np.array([50, 100, 200, 400])
    errors = [abs(oscillator_amplitude(system_of, law, 1.2, n) - CLOSED_FORMS[law](1.2)) for n in counts]
    record(
        source=SOURCE, case=f"one unknown, {law}", quantity="order in the time step, lambda = 1.2", unit="1",
        reference=2.0, computed=fitted_order(1 / counts, errors), tolerance=0.1, absolute=True,
        reason="average acceleration; every joint of the law lies on a step",
    )  # fmt: skip


@pytest.mark.parametrize("law", LAW_NAMES)
def test_convergence_order_of_relative_motion(record, system_of, fitted_order, law):
    """For a prescribed base, u = y - s under -s'' of the law; y'' = u'' + s'' has second order as u'' has."""
    w, event = 2 * math.pi * 1.2, EVENTS[law]

    def amplitude(n):
        load = ([-1.0], lambda motion: event(motion.angle, 2) * motion.speed**2)
        problem = Problem(system_of([[1.0]], [[0.0]], [[w**2]], [load]), ConstantSpeed(1.0), RISE / n, round(1.3 * n))
        end = solve(problem, newmark())["all"]
        return math.hypot(end.displacement[-1], end.velocity[-1] / w)

    smooth = law == "cycloidal"  # a jump of the load at a step is averaged over it: first order
    counts = np.array([50, 100, 200, 400])
    errors = [abs(amplitude(n) - CLOSED_FORMS[law](1.2)) for n in counts]
    record(
        source=SOURCE, case=f"prescribed base, {law}", quantity="order in the time step, lambda = 1.2", unit="1",
        reference=2.0 if smooth else 1.0, computed=fitted_order(1 / counts, errors), tolerance=0.15, absolute=True,
        reason="order 2 for a continuous s''; 1 where s'' jumps within the run",
    )  # fmt: skip


@pytest.mark.parametrize("ratio", mostly_slow([1.0, 1.5, 2.0]))
@pytest.mark.parametrize("law", LAW_NAMES)
def test_beam_model_matches_closed_form(record, published, law, ratio):
    """Model 3 of Tayeb and Sliman is slow enough to be a single oscillator: rise 90 deg, then a dwell."""
    event = LiftEvent(LAWS[law], lift=0.006, rise=math.pi / 2, dwell=math.pi, fall=math.pi / 2)
    model = published(3, event=event, cam_torque=False)
    structure = build_structure(model)
    found = modes(structure.mass, structure.stiffness)
    w = found.omegas[np.argmax(np.abs(structure.row("valve", np.zeros(6)) @ found.shapes) * (found.omegas < 1e3))]
    speed = (math.pi / 2) / (ratio * 2 * math.pi / w)
    system = build_system(model, speed)
    drive = ConstantSpeed(speed)
    problem = Problem(system, drive, (math.pi / 2) / speed / 2000, 2600, installed_state(system, drive))
    record(
        source=SOURCE,
        case=f"published beam model 3, {law}",
        quantity=f"residual amplitude / lift, lambda = {ratio:g}",
        unit="1",
        reference=CLOSED_FORMS[law](ratio),
        computed=residual_amplitude(problem, "valve", w, 0.0096),
        tolerance=0.005,
        absolute=True,
        reason="spring 40 kN/m x 2.56 beside 26 MN/m of the pushrod: the valve is 0.4 % softer than K_KE",
    )
