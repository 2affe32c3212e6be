"""Explicit central difference method with diagonal or factorized mass and a step limited by the highest frequency.

Newmark's formulas with beta = 0 and gamma = 1/2: T. J. R. Hughes, The Finite Element Method (1987), sect. 9.1. Damping
is evaluated at the new instant, so the limit ``omega dt = 2`` holds at any damping ratio.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from flexcam.core import DENSE_LIMIT, FloatArray
from flexcam.core.errors import InputError, refuse
from flexcam.dynamics.generalized_alpha import family_matrix
from flexcam.dynamics.initial_acceleration import massless_contact_error
from flexcam.dynamics.integrator import At, ImplicitStage, Method, Stepper
from flexcam.dynamics.local_forces import LocalForces
from flexcam.dynamics.massless import MasslessMotions
from flexcam.dynamics.step_state import StepInputs, StepState
from flexcam.dynamics.system import System

_LIMIT = 2.0
"""Stability limit of angular frequency times step."""

_NAME = "central-difference"


@dataclass(frozen=True)
class CentralDifference(Method):
    """Explicit central difference; intended for lumped masses, whose operator is diagonal.

    Massless motions follow the static equilibrium of their springs. The stiffness of closed contacts is not included in
    the step limit: if a contact limits the step more than the structure, the run diverges and ends with a status with
    this reason.

    Examples
    --------
    >>> round(CentralDifference().stability_limit(), 9)
    2.0
    """

    def amplification(self, omega_dt: float, damping: float = 0.0) -> FloatArray:
        """Return the matrix that takes (d, dt v, dt^2 a) of one mode over a step, as `Method` says."""
        return family_matrix(0.0, 0.5, omega_dt, damping)

    def stepper(self, system: System, forces: LocalForces, step: float, at: At) -> Stepper:
        """Return the stepper of a system for steps of one length."""
        return _Stepper(system, forces, step)

    def refusal(self, system: System, step: float) -> InputError | None:
        """Return the refusal of contacts and dampers without mass, and of steps beyond the limit."""
        if error := massless_contact_error(system, _NAME):
            return error
        omega, names = highest_frequency(system)
        if step * omega <= _LIMIT:
            return None
        allowed = f"at most {_LIMIT / omega:.6g} s with {_NAME}"
        mode = f"the mode of {', '.join(names)} at {omega / (2.0 * np.pi):.5g} Hz"
        why, factor = f"with longer steps {mode} is unstable", math.ceil(100.0 * step * omega / _LIMIT) / 100.0
        remedy = f"use {factor:g} times as many steps, or an implicit method"
        return refuse("run.step", f"{step:.6g} s", allowed, why, remedy)


class _Stepper:
    """A stage without stiffness in its operator, followed by the massless motions."""

    def __init__(self, system: System, forces: LocalForces, step: float) -> None:
        self._massless, self._dt = MasslessMotions(system), step
        self._stage = ImplicitStage(system, forces, 0.0, 0.5 * step, step, inverse=self._massless.inverse)

    def advance(self, now: StepState, to: StepInputs) -> StepState:
        """Return the next instant, as `Stepper` says."""
        dt, light = self._dt, self._massless
        d = light.place(now.d + dt * now.v + 0.5 * dt**2 * now.a, to.load)
        new = self._stage.solve(d, now.v + 0.5 * dt * now.a, now, to)
        if not light.any:
            return new
        # Contacts do not act on massless motions: the forces there are loads, which follow a secant.
        v = light.place(new.v, (new.applied - now.applied) / dt)
        return replace(new, v=v, a=light.place(new.a, np.zeros(len(v))))


def highest_frequency(system: System) -> tuple[float, list[str]]:
    """Return the highest natural frequency of a system without its local forces, rad/s, and the unknowns in it."""
    light = MasslessMotions(system)
    if not len(light.kept):
        return 0.0, []
    solver = _highest_dense if len(light.kept) <= DENSE_LIMIT else _highest_sparse
    square, shape = solver(system, light)
    order: list[int] = np.argsort(-np.abs(shape)).tolist()
    return float(np.sqrt(max(square, 0.0))), [system.names[light.kept[i]] for i in order[:3]]


def _highest_dense(system: System, light: MasslessMotions) -> tuple[float, FloatArray]:
    forces = system.stiffness.multiply(light.expand(np.eye(len(light.kept))))
    values, vectors = np.linalg.eig(light.inverse(system.mass).solve(forces)[light.kept])
    squares, shapes = np.real(values), np.real(vectors)
    highest = int(np.argmax(squares))
    return float(squares[highest]), shapes[:, highest]


def _highest_sparse(system: System, light: MasslessMotions) -> tuple[float, FloatArray]:
    from scipy.sparse.linalg import LinearOperator, eigsh

    size, inverse = len(light.kept), light.inverse(system.mass)

    def pull(motion: FloatArray) -> FloatArray:
        return system.stiffness.multiply(light.expand(motion.reshape(size, -1)))[light.kept]

    def acceleration(force: FloatArray) -> FloatArray:
        forces = np.zeros((system.size, 1))
        forces[light.kept, 0] = force.ravel()
        return inverse.solve(forces)[light.kept]

    K, M_inverse = (LinearOperator((size, size), matvec=product, dtype=float) for product in (pull, acceleration))
    start = np.random.default_rng(0).standard_normal(size)
    mass = system.mass.part(light.kept).csr()
    values, vectors = eigsh(K, 1, M=mass, Minv=M_inverse, which="LM", v0=start, tol=1e-6)
    return float(values[0]), vectors[:, 0]


def central_difference() -> CentralDifference:
    """Return the explicit central difference."""
    return CentralDifference()
