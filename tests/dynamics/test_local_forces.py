"""Local forces: equivalence to a spring in K, and order 2 with internal states and with rotating vectors.

The reference is DOP853 at 1e-12.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from flexcam.dynamics import (
    AngleVector,
    ConstantSpeed,
    LocalForce,
    constant,
    equilibrium,
    newmark,
)
from tests.integrators import WITH_CONTACTS
from tests.thinning import mostly_slow

STEPS = np.array([300, 600])
ROW, SPRING, DAMPER = np.array([1.0, -1.0]), 400.0, 6.0
K = np.array([[30.0, -12.0], [-12.0, 20.0]])
C = np.array([[0.4, -0.1], [-0.1, 0.3]])


@pytest.fixture(scope="module", params=sorted(WITH_CONTACTS))
def scheme(request):
    return WITH_CONTACTS[request.param]


@pytest.mark.parametrize(("k", "c"), mostly_slow([(SPRING, 0.0), (0.0, DAMPER), (SPRING, DAMPER), (1e5, 0.0)], 2))
def test_local_spring_equals_matrix_spring(pair, run, laws, local_force, scheme, k, c):
    outer = np.outer(ROW, ROW)
    inside = run(pair(K + k * outer, C + c * outer), scheme, 200)
    outside = run(pair(local=[local_force("spring", ROW, laws["linear"](k, c))]), scheme, 200)
    # Rounding grows as (w dt)^2 eps per step on both sides, 1e-12 at 1e5 N/m: the unknown is the acceleration.
    for field in ("displacement", "velocity", "acceleration"):
        one, other = getattr(inside, field), getattr(outside, field)
        assert np.abs(one - other).max() <= 1e-10 * np.abs(one).max()


def test_law_of_two_scalars(pair, run, laws):
    """A law that senses and acts on both unknowns, with coupling entries, equals a contribution to K."""
    vectors = tuple(AngleVector.constant(row) for row in np.eye(2))
    back = tuple(AngleVector.constant(-row) for row in np.eye(2))
    force = LocalForce("both", vectors, back, laws["linear"](50.0, 1.0), (constant(0.0), constant(0.0)))
    inside = run(pair(K + 50.0 * np.eye(2), C + np.eye(2)), newmark(), 100)
    outside = run(pair(local=[force]), newmark(), 100)
    np.testing.assert_allclose(outside.displacement, inside.displacement, atol=1e-10)


def test_two_local_forces(pair, run, laws, local_force):
    parts = [
        local_force("a", ROW, laws["linear"](SPRING)),
        local_force("b", np.array([0.0, 1.0]), laws["linear"](70.0, 2.0)),
    ]
    inside = run(pair(K + SPRING * np.outer(ROW, ROW) + np.diag([0, 70.0]), C + np.diag([0, 2.0])), newmark(), 100)
    np.testing.assert_allclose(run(pair(local=parts), newmark(), 100).displacement, inside.displacement, atol=1e-10)


def fit_orders(fitted_order, run, system, scheme, d, v):
    ends = [run(system, scheme, n) for n in STEPS]
    return (
        fitted_order(1 / STEPS, [np.linalg.norm(e.displacement[-1] - d) for e in ends]),
        fitted_order(1 / STEPS, [np.linalg.norm(e.velocity[-1] - v) for e in ends]),
    )


def reference_end_state(system, gap_force):
    """Return the end state of M u'' + C u' + K u = p cos(angle) + gap_force(t, u, v) by DOP853 at 1e-12."""
    M, C, K = (m.dense() for m in (system.mass, system.damping, system.stiffness))
    p = system.loads[0].vector

    def rate(t, x):
        u, v = x[:2], x[2:]
        return np.concatenate([v, np.linalg.solve(M, p * np.cos(3.0 * t) + gap_force(t, u, v) - C @ v - K @ u)])

    start = [0.2, -0.1, -0.5, 0.8]
    end = solve_ivp(rate, (0, 2.0), start, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    return end[:2], end[2:]


@pytest.mark.parametrize(
    "scheme",
    [
        pytest.param(method, id=name, marks=[pytest.mark.slow] * (name != "Newmark"))
        for name, method in sorted(WITH_CONTACTS.items())
    ],
)
def test_order_with_nonlinear_law(pair, run, laws, local_force, fitted_order, scheme):
    system = pair(local=[local_force("cubic", ROW, laws["cubic"](20.0, 300.0))])
    d, v = reference_end_state(system, lambda t, u, v: -ROW * (20.0 * (ROW @ u) + 300.0 * (ROW @ u) ** 3))
    assert fit_orders(fitted_order, run, system, scheme, d, v) == pytest.approx((2.0, 2.0), abs=0.1)


def rotating_vector(order_sign=1.0):
    """Return g(angle) = cos e0 + sin e1, with its derivatives by the angle."""
    return AngleVector(
        order_sign * np.eye(2), (lambda a, n: np.cos(a + n * np.pi / 2), lambda a, n: np.sin(a + n * np.pi / 2))
    )


@pytest.mark.parametrize(
    "scheme",
    [
        pytest.param(method, id=name, marks=[pytest.mark.slow] * (name not in ("Newmark", "HHT -0.1")))
        for name, method in sorted(WITH_CONTACTS.items())
    ],
)
def test_order_with_rotating_vectors(pair, run, laws, fitted_order, scheme):
    """Spring and damper along a direction rotating with the cam, plus a prescribed part: gamma' has g' u and g0'."""
    offset = lambda a, n: 0.1 * np.sin(2 * a + n * np.pi / 2) * 2.0**n  # noqa: E731
    force = LocalForce(
        "turning", (rotating_vector(),), (rotating_vector(-1.0),), laws["linear"](SPRING, DAMPER), (offset,)
    )
    system = pair(local=[force])

    def reaction(t, u, v):
        a = 3.0 * t
        g, slope = np.array([np.cos(a), np.sin(a)]), 3.0 * np.array([-np.sin(a), np.cos(a)])
        gap, rate = g @ u + 0.1 * np.sin(2 * a), g @ v + slope @ u + 0.6 * np.cos(2 * a)
        return -g * (SPRING * gap + DAMPER * rate)

    d, v = reference_end_state(system, reaction)
    assert fit_orders(fitted_order, run, system, scheme, d, v) == pytest.approx((2.0, 2.0), abs=0.1)


def test_equilibrium_with_local_forces(pair, laws, local_force):
    """Static equilibrium at an angle: K u + k row row.u = p cos(angle)."""
    system = pair(local=[local_force("spring", ROW, laws["linear"](SPRING))])
    found = equilibrium(system, ConstantSpeed(3.0), time=0.2).displacement
    expected = np.linalg.solve(K + SPRING * np.outer(ROW, ROW), system.loads[0].vector * np.cos(0.6))
    np.testing.assert_allclose(found, expected, rtol=1e-11)
