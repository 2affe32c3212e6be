"""Floquet multipliers against Mathieu's equation, a parametrically excited damped oscillator, and plain systems.

x'' + (a - 2 q cos 2t) x = 0: M. Abramowitz and I. A. Stegun, Handbook of Mathematical Functions (1964), ch. 20: near
a = 1 the unstable tongue lies between a = 1 - q - q^2/8 + q^3/64 and a = 1 + q - q^2/8 - q^3/64 (eq. 20.2.25). The
characteristic exponent is also computed here with solve_ivp at 1e-12.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from flexcam.integrate import Problem
from flexcam.integrate.floquet import floquet
from flexcam.linalg import Triplets
from flexcam.system import AngleVector, ConstantSpeed, LocalForce, Reaction, System, constant

SOURCE = "Mathieu's equation"


@dataclass(frozen=True)
class Pulsating:
    q: float

    def respond(self, gap, rate, angle):
        k = -2.0 * self.q * math.cos(2.0 * angle)
        return Reaction(k * gap, np.array([[k]]), np.zeros((1, 1)))


def mathieu(a, q, damping=0.0):
    one = Triplets.from_dense([[1.0]])
    row = np.array([1.0])
    force = LocalForce(
        "pulse", (AngleVector.constant(row),), (AngleVector.constant(-row),), Pulsating(q), (constant(0.0),)
    )
    return System(one, one.scaled(damping), one.scaled(a), ("x",), (), (force,))


def multipliers(a, q, damping=0.0, steps=2000):
    """Over pi, the period of the coefficient."""
    return floquet(Problem(mathieu(a, q, damping), ConstantSpeed(1.0), math.pi / steps, steps)).multipliers


def exact(a, q, damping=0.0):
    def f(t, y):
        return [y[1], -(a - 2 * q * math.cos(2 * t)) * y[0] - damping * y[1]]

    ends = [solve_ivp(f, (0, math.pi), start, rtol=1e-12, atol=1e-13).y[:, -1] for start in ([1.0, 0.0], [0.0, 1.0])]
    return sorted(np.linalg.eigvals(np.array(ends).T), key=abs, reverse=True)


@pytest.mark.parametrize(("a", "q", "damping"), [(1.0, 0.1, 0.0), (1.0, 0.1, 0.02), (4.0, 1.0, 0.0), (2.5, 0.3, 0.1)])
def test_multipliers(record, a, q, damping):
    found, reference = multipliers(a, q, damping), exact(a, q, damping)
    record(source=SOURCE, case=f"a = {a:g}, q = {q:g}, damping {damping:g}", quantity="largest multiplier", unit="1",
           reference=abs(reference[0]), computed=float(abs(found[0])), tolerance=1e-5,
           reason="average acceleration at 2000 steps")  # fmt: skip


def test_unstable_tongue_at_one():
    q = 0.1
    low, high = 1 - q - q**2 / 8 + q**3 / 64, 1 + q - q**2 / 8 - q**3 / 64
    for a, stable in ((low - 2e-4, True), (low + 2e-4, False), (1.0, False), (high - 2e-4, False), (high + 2e-4, True)):
        assert bool(abs(multipliers(a, q)[0]) <= 1.0 + 1e-6) is stable


def test_without_pulsation_all_lie_on_the_circle():
    np.testing.assert_allclose(np.abs(multipliers(1.3, 0.0)), 1.0, atol=1e-9)


def test_the_product_is_what_damping_leaves():
    """Liouville: the determinant is exp(-c T)."""
    found = multipliers(1.7, 0.4, damping=0.2)
    assert abs(np.prod(found)) == pytest.approx(math.exp(-0.2 * math.pi), rel=1e-6)


class Spring:
    """f = 3 gamma, whatever the angle."""

    def respond(self, gap, rate, angle):
        return Reaction(3.0 * gap, np.array([[3.0]]), np.zeros((1, 1)))


def test_a_local_spring_adds_its_stiffness(record):
    """1 + 3: the disturbance turns by 2 rad per second. A tangent of the wrong sign would make it grow."""
    one, row = Triplets.from_dense([[1.0]]), np.array([1.0])
    force = LocalForce(
        "spring", (AngleVector.constant(row),), (AngleVector.constant(-row),), Spring(), (constant(0.0),)
    )
    system = System(one, Triplets.zeros(1), one, ("x",), (), (force,))
    found = floquet(Problem(system, ConstantSpeed(1.0), 0.001, 500)).multipliers
    case = "mass between a spring of 1 and a local one of 3, over 0.5 s"
    record(source=SOURCE, case=case, quantity="turn", unit="rad", reference=1.0, computed=abs(np.angle(found[0])),
           tolerance=1e-6, reason="period error (w dt)^2/12")  # fmt: skip
    assert abs(found[0]) == pytest.approx(1.0, abs=1e-9)
