"""Velocities and accelerations of massless degrees of freedom, with every engine and scheme.

Two masses on springs k to ground and to a massless joint between them under the force f: both masses move by q with
``q'' + k q = f/2``, and the joint by ``q + f/(2 k)``. With the average acceleration method alone the velocity of the
joint would keep an alternating error of the start, and its acceleration an increasing one.
"""

import functools

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from flexcam.core import Triplets
from flexcam.dynamics import ConstantSpeed, Load, Probe, Problem, System, generalized_alpha, hht, newmark, solve
from tests.thinning import mostly_slow

PUSH, STIFF, SPEED, STEP, STEPS = 100.0, 1e4, 30.0, 1e-4, 4000
METHODS = {
    "average acceleration": newmark(),
    "linear acceleration": newmark(beta=1 / 6),
    "hht": hht(),
    "generalized-alpha": generalized_alpha(),
}
ENGINES = ["direct", "modal", "kernel"]


def sine(angle):
    return np.sin(angle)


def ramp_from_kink(angle):
    """Return zero up to the middle of a step, then a ramp."""
    return np.maximum(angle - KINK, 0.0)


KINK = 1000.5 * STEP * SPEED


def joint_system(history, *, damper=0.0, joints=1):
    """Return masses, a joint with a damper to ground, and optionally an undamped joint after the second mass."""
    n = 2 + joints
    K, C = np.zeros((n, n)), np.zeros((n, n))
    for row in ([1, 0, 0], [1, -1, 0], [0, 1, -1], [0, 0, 1]):
        K[:3, :3] += STIFF * np.outer(row, row)
    C[1, 1] = damper
    if joints == 2:
        K[2:, 2:] += STIFF * np.array([[1.0, -1.0], [-1.0, 2.0]])
    masses = np.diag([1.0, 0.0, 1.0, 0.0][:n])
    names, push = ("a", "joint", "b", "other")[:n], PUSH * np.eye(n)[1]
    load = Load("push", push, lambda motion: history(motion.angle))
    probe = Probe("all", names, np.eye(n), (None,) * n)
    return System(*(Triplets.from_dense(m) for m in (masses, C, K)), names, (load,), probes=(probe,))


def run_system(made, method, engine):
    response = solve(Problem(made, ConstantSpeed(SPEED), STEP, STEPS, engine=engine), METHODS[method])
    assert response.status.ok
    assert response.stats.engine == engine
    return response.time, response["all"]


def exact_under_sine(t):
    """Return displacement, velocity and acceleration of the joint, from rest."""
    s, w, size = np.sqrt(STIFF), SPEED, 0.5 * PUSH / (STIFF - SPEED**2)
    q = size * np.array([np.sin(w * t) - w / s * np.sin(s * t), w * (np.cos(w * t) - np.cos(s * t)),
                         w * (s * np.sin(s * t) - w * np.sin(w * t))])  # fmt: skip
    return q + 0.5 * PUSH / STIFF * np.array([np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)])


def exact_under_ramp(t):
    s, w = np.sqrt(STIFF), SPEED
    tau = np.maximum(t - KINK / w, 0.0)
    rate, on = 0.5 * PUSH * w / STIFF, tau > 0.0
    return rate * np.array([2.0 * tau - np.sin(s * tau) / s, on * (2.0 - np.cos(s * tau)), s * np.sin(s * tau)])


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("method", mostly_slow(METHODS, 2))
@pytest.mark.parametrize(
    ("history", "exact", "broken"),
    [(sine, exact_under_sine, 0), (ramp_from_kink, exact_under_ramp, 1000)],
    ids=["start", "kink"],
)
def test_joint_rates_are_exact_after_start_and_kink(history, exact, broken, method, engine):
    """The run starts at rest though the load begins at once; the kink is within a step."""
    time, joint = run_system(joint_system(history), method, engine)
    wanted = exact(time)
    later = np.abs(np.arange(len(time)) - broken - 1.5) > 2.0
    # Periods are (s h)^2/12 = 1e-5 long, over 40 rad; the part alpha of the old forces delays by a part of a step.
    for found, right, allowed in zip(
        (joint.displacement, joint.velocity, joint.acceleration), wanted, (1e-3, 1e-3, 2e-2), strict=True
    ):
        missed = np.abs(found[:, 1] - right)[later]
        assert missed.max() <= allowed * np.abs(right).max()


@functools.cache
def exact_damped_joint(damper):
    """Return the motion of the damped joint by scipy: velocity by equilibrium, acceleration as its rate."""
    K, push = joint_system(sine).stiffness.dense(), PUSH * np.eye(3)[1]

    def rates(t, state):
        force = push * np.sin(SPEED * t) - K @ state[:3]
        return np.array([state[3], force[1] / damper, state[4], force[0], force[2]])

    t = STEP * np.arange(STEPS + 1)
    found = solve_ivp(rates, (0.0, t[-1]), np.zeros(5), method="Radau", t_eval=t, rtol=1e-10, atol=1e-14).y
    x, (va, vb) = found[:3], found[3:]
    v = (PUSH * np.sin(SPEED * t) - K[1] @ x) / damper
    a = (PUSH * SPEED * np.cos(SPEED * t) - K[1] @ np.array([va, v, vb])) / damper
    return x[1], v, a


@pytest.mark.parametrize("engine", [pytest.param("direct", marks=pytest.mark.slow), "kernel"])
def test_damped_joint_does_not_oscillate(engine):
    """The damper reduces the velocity error of the start to zero; the acceleration has no such error."""
    damper = 2.0  # the joint follows in c/(2 k) = 1e-4 s, a step
    _, joint = run_system(joint_system(sine, damper=damper), "average acceleration", engine)
    for found, right, allowed in zip(
        (joint.displacement, joint.velocity, joint.acceleration),
        exact_damped_joint(damper),
        (1e-3, 1e-3, 2e-2),
        strict=True,
    ):
        assert np.abs(found[20:, 1] - right[20:]).max() <= allowed * np.abs(right).max()


def test_stiffness_damping_on_modal_engine():
    """Rayleigh damping does not couple the natural modes, so that they are integrated separately."""
    made = joint_system(sine)
    made = System(made.mass, made.stiffness.scale(1e-5), made.stiffness, made.names, made.loads, probes=made.probes)
    (_, one), (_, other) = (run_system(made, "average acceleration", engine) for engine in ("modal", "direct"))
    size = np.abs(other.acceleration).max()
    np.testing.assert_allclose(one.acceleration, other.acceleration, rtol=0.0, atol=1e-8 * size)
    assert (
        np.abs(np.diff(one.acceleration[200:, 1], 2)).max() <= 1e-3 * size
    )  # (s h)^2 = 1e-4 of it; an oscillating error would be four times as large


@pytest.mark.parametrize(
    "method",
    [
        "average acceleration",
        pytest.param("hht", marks=pytest.mark.slow),
        pytest.param("generalized-alpha", marks=pytest.mark.slow),
    ],
)
def test_engines_agree_for_damped_and_undamped_joints(method):
    """The massless motions are combined so that the damper acts on one of them."""
    made = joint_system(sine, damper=2.0, joints=2)
    (_, one), (_, other) = (run_system(made, method, engine) for engine in ("direct", "kernel"))
    for found, right in zip(
        (one.displacement, one.velocity, one.acceleration), (other.displacement, other.velocity, other.acceleration),
        strict=True,
    ):  # fmt: skip
        np.testing.assert_allclose(found, right, rtol=0.0, atol=1e-8 * np.abs(right).max())  # second differences
