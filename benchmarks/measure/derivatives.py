"""Errors and times of exact derivatives and central differences, against closed forms."""

from __future__ import annotations

import cmath
import math
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.special import gamma

from benchmarks.timing import minimum_time
from flexcam.case.reader import CaseFile
from flexcam.studies.quantities import create_evaluator
from flexcam.studies.sensitivity import Sensitivity, sensitivities

MASS, STIFFNESS, GRAVITY, SPEED, TURNS = 2.0, 800.0, 9.81, 20.0, 3  # an oscillator at 20 rad/s for three periods
HEIGHT, RESTITUTION, FALL = 0.5, 0.8, 0.7  # a ball that falls on a floor and bounces, over 0.7 s
MATHIEU_STEPS, REPEATS = 3600, 5

OSCILLATOR = f"""
format = 1
nodes = {{ mass = [0, 0, 0] }}
supports = {{ mass = ["uy", "uz"] }}
masses.body = {{ at = "mass", mass = {MASS} }}
springs.one = {{ at = "mass", direction = "ux", stiffness = {STIFFNESS} }}
output.probes = ["mass"]
[run]
speed = "{SPEED} rad/s"
revolutions = {TURNS}
"""

BALL = f"""
format = 1
nodes = {{ ground = [0, -1, 0], body = [0, 0, 0] }}
supports = {{ body = ["ux", "uz"] }}
masses.body = {{ at = "body", mass = {MASS} }}
contacts.floor = {{ at = "body", model = "seat", direction = "uy", stiffness = 1e9, restitution = {RESTITUTION} }}
output.probes = ["body"]
[run]
speed = "{2.0 * math.pi / FALL} rad/s"
revolutions = 1
gravity = [0, {-GRAVITY}, 0]
start = {{ displacement = {{ "body.uy" = {HEIGHT} }}, velocity = {{ "body.uy" = -1e-6 }} }}
"""

FALLING = f"gravity = [{GRAVITY}, 0, 0]\n"
AT_ZERO = 'start = { displacement = { "mass.ux" = 0 } }\n'
MOVING = 'start = { velocity = { "mass.ux" = 1.0 } }\n'
MATHIEU = (Path(__file__).parents[2] / "cases/checks/mathieu.toml").read_text(encoding="utf-8")


def frequency(k: complex) -> complex:
    """Return the natural frequency, Hz."""
    return cmath.sqrt(k / MASS) / (2.0 * math.pi)


def deflection(k: complex) -> complex:
    """Return the static deflection under gravity."""
    return MASS * GRAVITY / k


def step_response_rms(k: complex) -> complex:
    """Return the rms of x = (m g/k)(1 - cos wt) over the last period of the shaft."""
    w = cmath.sqrt(k / MASS)
    begin, end = (2.0 * math.pi / SPEED * revolutions for revolutions in (TURNS - 1, TURNS))

    def integral(t: float) -> complex:
        return 1.5 * t - 2.0 * cmath.sin(w * t) / w + cmath.sin(2.0 * w * t) / (4.0 * w)

    return deflection(k) * cmath.sqrt((integral(end) - integral(begin)) / (end - begin))


def sine_norm(k: complex) -> complex:
    """Return the norm of order 8 of x = sin(wt)/w over a period of the shaft, to first order about w = 20 rad/s."""
    w, mean = cmath.sqrt(k / MASS), float(gamma(4.5) / (math.sqrt(math.pi) * gamma(5.0)))
    return (mean * SPEED / w) ** 0.125 / w


def bounce_rms(e: complex) -> complex:
    """Return the rms height of a ball that falls on a floor and bounces with the coefficient of restitution e."""
    impact = math.sqrt(2.0 * HEIGHT / GRAVITY)
    rest, v = FALL - impact, e * GRAVITY * impact
    before = HEIGHT**2 * impact - HEIGHT * GRAVITY * impact**3 / 3.0 + GRAVITY**2 * impact**5 / 20.0
    after = v * v * rest**3 / 3.0 - v * GRAVITY * rest**4 / 4.0 + GRAVITY**2 * rest**5 / 20.0
    return cmath.sqrt((before + after) / FALL)


def mathieu_multiplier(amplitude: complex) -> complex:
    """Return the largest Floquet multiplier of x'' + (1 - amplitude cos 2t) x = 0 over 2 pi."""

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        return np.array([y[1], -(1.0 - amplitude * np.cos(2.0 * t)) * y[0]])

    starts = np.eye(2, dtype=complex)
    ends = [solve_ivp(rates, (0.0, 2.0 * math.pi), y, "DOP853", rtol=1e-13, atol=1e-30).y[:, -1] for y in starts]
    (a, c), (b, d) = ends
    half = 0.5 * (a + d)
    return complex(half + cmath.sqrt(half * half - (a * d - b * c)))


class Check(NamedTuple):
    """A derivative with a closed form."""

    what: str
    text: str  #: of the case
    scalar: str
    key: str  #: of the parameter
    exact: Callable[[complex], complex]
    tolerance: float  #: relative, of the exact derivative
    fixed: tuple[str, ...] = ()  #: overrides


STIFF = "springs.one.stiffness"
CHECKS = (
    Check("natural frequency with respect to stiffness", OSCILLATOR, "frequency.1", STIFF, frequency, 1e-10),
    Check("static deflection with respect to stiffness", OSCILLATOR + FALLING, "static.probes.mass.ux.displacement",
          STIFF, deflection, 1e-7),
    Check("rms of a step response with respect to stiffness", OSCILLATOR + FALLING + AT_ZERO,
          "probes.mass.ux.displacement.rms", STIFF, step_response_rms, 1e-5),
    Check("8-norm of a sine with respect to stiffness", OSCILLATOR + MOVING, "probes.mass.ux.displacement.pnorm_8",
          STIFF, sine_norm, 1e-5),
    Check("rms of a bounce with respect to restitution", BALL, "probes.body.uy.displacement.rms",
          "contacts.floor.restitution", bounce_rms, 1e-6),
    Check("Floquet multiplier of Mathieu's equation with respect to amplitude", MATHIEU, "multiplier.1",
          "springs.mean.pulsation.amplitude", mathieu_multiplier, 1e-5,
          (f"run.steps_per_revolution={MATHIEU_STEPS}",)),
)  # fmt: skip


def measure_table() -> list[dict[str, object]]:
    """Return a row per check."""
    return [measure(check) for check in CHECKS]


def measure(check: Check) -> dict[str, object]:
    """Return a row: the closed form, and the relative errors and times of both methods."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "case.toml"
        path.write_text(check.text, encoding="utf-8")
        file = CaseFile.open(path)
        found = {method: _derivative(file, check, method) for method in ("exact", "differences")}
        number = found["exact"][0].by.value
        step = 1e-20 * number
        reference = check.exact(number + 1j * step).imag / step
    return {
        "what": check.what, "scalar": check.scalar, "closed_form": reference,
        **{f"{name}_error": abs(result.derivative / reference - 1.0) for name, (result, _) in found.items()},
        **{f"{name}_ms": 1e3 * seconds for name, (_, seconds) in found.items()},
    }  # fmt: skip


def _derivative(file: CaseFile, check: Check, method: str) -> tuple[Sensitivity, float]:
    """Return the derivative by a method, and its time in s."""
    found = list[Sensitivity]()

    def derive() -> None:
        with create_evaluator(file, check.fixed, (check.scalar,)) as runs:
            found[:] = sensitivities(file, check.fixed, (check.scalar,), (check.key,), runs, method=method)

    seconds = minimum_time(derive, REPEATS)
    return found[0], seconds
