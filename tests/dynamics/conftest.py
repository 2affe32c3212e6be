"""Two damped masses with initial velocities under a suddenly applied load, with the exact solution."""

import numpy as np
import pytest
from scipy.linalg import expm

from flexcam.dynamics import ConstantSpeed, Problem, Reaction, State, solve

M = np.array([[2.0, 0.3], [0.3, 1.0]])
C = np.array([[0.4, -0.1], [-0.1, 0.3]])
K = np.array([[30.0, -12.0], [-12.0, 20.0]])
PUSH, SPEED = np.array([5.0, -3.0]), 3.0
START, SPEED0 = np.array([0.2, -0.1]), np.array([-0.5, 0.8])
END = 2.0


@pytest.fixture(autouse=True)
def _selection(shipped_selection):
    """Use the direct engine for short runs, which half of these tests examine."""


@pytest.fixture(scope="session")
def pair(system_of):
    """Return a function that builds the two-mass system, with another stiffness or damping or with local forces."""

    def make(stiffness=K, damping=C, local=()):
        return system_of(M, damping, stiffness, [(PUSH, lambda motion: np.cos(motion.angle))], local)

    return make


@pytest.fixture(scope="session")
def run():
    """Return a function that runs the system over 2 s in a number of steps and returns the probe."""

    def run_steps(system, scheme, steps):
        problem = Problem(system, ConstantSpeed(SPEED), END / steps, steps, State(START, SPEED0))
        response = solve(problem, scheme)
        assert response.status.ok, str(response.status)
        return response["all"]

    return run_steps


@pytest.fixture(scope="session")
def exact_end():
    """Return the exact displacement and velocity by the matrix exponential of the linear system and its load.

    `extra` holds the coupling of internal states z: rows of the acceleration by z, z' by u, z' by z.
    """

    def at_end(stiffness=K, damping=C, extra=None):
        inner = 0 if extra is None else len(extra[2])
        n = 4 + inner + 2
        A, inverse = np.zeros((n, n)), np.linalg.inv(M)
        A[:2, 2:4] = np.eye(2)
        A[2:4, :2], A[2:4, 2:4], A[2:4, -2] = -inverse @ stiffness, -inverse @ damping, inverse @ PUSH
        if extra is not None:
            A[2:4, 4 : 4 + inner], A[4 : 4 + inner, :2], A[4 : 4 + inner, 4 : 4 + inner] = (
                inverse @ extra[0],
                extra[1],
                extra[2],
            )
        A[-2:, -2:] = SPEED * np.array([[0, -1], [1, 0]])
        x = np.concatenate([START, SPEED0, np.zeros(inner), [1.0, 0.0]])
        end = expm(END * A) @ x
        return end[:2], end[2:4]

    return at_end


class LinearLaw:
    """Linear law f = k gamma + c gamma'."""

    def __init__(self, k, c=0.0):
        self.k, self.c = k, c

    def respond(self, gap, rate, angle):
        one = np.eye(len(gap))
        return Reaction(self.k * gap + self.c * rate, self.k * one, self.c * one)


class CubicLaw:
    """Cubic law f = k gamma + k3 gamma^3."""

    def __init__(self, k, k3):
        self.k, self.k3 = k, k3

    def respond(self, gap, rate, angle):
        slope = np.diag(self.k + 3 * self.k3 * gap**2)
        return Reaction(self.k * gap + self.k3 * gap**3, slope, 0 * slope)


@pytest.fixture(scope="session")
def laws():
    """Return the two test laws by name."""
    return {"linear": LinearLaw, "cubic": CubicLaw}
