"""Local forces inside a step: a small Newton iteration on the forces and the internal states behind them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexcam.integrate.local import LocalForces
from flexcam.linalg import FloatArray
from flexcam.system import Reaction

_TOLERANCE = 1e-12
"""Of the force: three digits above rounding, so that Newton's last quadratic step reaches it."""

_ROUNDING = 16.0 * np.finfo(float).eps
"""Of the terms a stiff law multiplies: the sensed scalars themselves carry a few eps."""

_MOST_ITERATIONS = 60
_WHOLE_STEPS = 20


class NoConvergenceError(ArithmeticError):
    """Newton's iteration on the local forces did not settle.

    Parameters
    ----------
    forces
        Names of those that did not.
    """

    def __init__(self, forces: list[str]) -> None:
        super().__init__(", ".join(forces))
        self.forces = forces


@dataclass(frozen=True, eq=False)
class Compliance:
    """How the sensed scalars answer to the local forces within a step, and the scalars without them.

    Parameters
    ----------
    gap, rate
        gamma and gamma' if the new local forces were zero, shape (c,).
    gap_by_force, rate_by_force
        Their change per unit of each force, shape (c, c).
    """

    gap: FloatArray
    rate: FloatArray
    gap_by_force: FloatArray
    rate_by_force: FloatArray

    def at(self, force: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the sensed scalars and their rates under forces, shape (c,) each."""
        return self.gap + self.gap_by_force @ force, self.rate + self.rate_by_force @ force


@dataclass(frozen=True, eq=False)
class Inner:
    """Internal states of the local laws and their rates at an instant, shape (s,) each."""

    state: FloatArray
    rate: FloatArray


@dataclass(frozen=True, eq=False)
class Settled:
    """Local forces that agree with the motion they cause.

    Parameters
    ----------
    force, gap, rate
        Forces, what they sense and its rate, shape (c,).
    inner
        Internal states.
    iterations
        That it took.
    """

    force: FloatArray
    gap: FloatArray
    rate: FloatArray
    inner: Inner
    iterations: int


def settle(
    forces: LocalForces, within: Compliance, guess: FloatArray, inner: Inner, step: float, angle: float
) -> Settled:
    """Return the local forces that agree with the motion they cause.

    Internal states advance by the trapezoidal rule within the same iteration.

    Parameters
    ----------
    forces
        The local forces.
    within
        Response of the sensed scalars within this step.
    guess
        Forces to start from, shape (c,).
    inner
        Internal states at the step's beginning.
    step
        s; zero to find the forces of an instant.
    angle
        Cam angle at the step's end, rad.

    Returns
    -------
    Settled
        The forces and what belongs to them.

    Raises
    ------
    NoConvergenceError
        If the forces do not settle.
    """
    f, z = guess, inner.state
    missing = np.zeros(len(f) + len(z))
    for iteration in range(1, _MOST_ITERATIONS + 1):
        gap, rate = within.at(f)
        answer = forces.respond(gap, rate, z, angle)
        travel = 0.5 * step * (inner.rate + answer.state_rate)
        missing = np.concatenate([f - answer.force, z - inner.state - travel])
        moved = float((np.abs(inner.state) + np.abs(travel)).max(initial=0.0))
        if not np.isfinite(missing).all() or _settled(missing, within, answer, f, moved):
            # a force that is not finite is reported by `solve`
            return Settled(answer.force, gap, rate, Inner(z, answer.state_rate), iteration)
        try:
            change = np.linalg.solve(_tangent(within, answer, step), missing)
        except np.linalg.LinAlgError:
            break
        part = _shortened(iteration)
        f, z = f - part * change[: len(f)], z - part * change[len(f) :]
    scale = np.abs(missing[: len(f)])
    raise NoConvergenceError([name for name, one in zip(forces.names, scale, strict=True) if one > 0.1 * scale.max()])


def _tangent(within: Compliance, answer: Reaction, step: float) -> FloatArray:
    """Return the derivative of what is missing by forces and states."""
    tangent = np.eye(len(answer.force)) - answer.by_gap @ within.gap_by_force - answer.by_rate @ within.rate_by_force
    if not len(answer.state_rate):
        return tangent
    half = 0.5 * step
    by_force = answer.state_rate_by_gap @ within.gap_by_force + answer.state_rate_by_rate @ within.rate_by_force
    own = np.eye(len(answer.state_rate)) - half * answer.state_rate_by_state
    return np.block([[tangent, -answer.by_state], [-half * by_force, own]])


def _settled(missing: FloatArray, within: Compliance, answer: Reaction, f: FloatArray, moved: float) -> bool:
    size = _TOLERANCE * np.abs(answer.force).max(initial=0.0) + _ROUNDING * _sensed_size(within, answer, f)
    forces, states = np.abs(missing[: len(f)]), np.abs(missing[len(f) :])
    return bool(forces.max(initial=0.0) <= size and states.max(initial=0.0) <= _TOLERANCE * moved)


def _shortened(iteration: int) -> float:
    """Return the part of Newton's step that is taken: the whole, until contacts that open and close do not settle."""
    return 1.0 if iteration <= _WHOLE_STEPS else 0.5


def _sensed_size(within: Compliance, reaction: Reaction, f: FloatArray) -> float:
    """Return the size of the terms that the laws' stiffnesses multiply, as forces."""
    gap = np.abs(reaction.by_gap) @ (np.abs(within.gap) + np.abs(within.gap_by_force) @ np.abs(f))
    rate = np.abs(reaction.by_rate) @ (np.abs(within.rate) + np.abs(within.rate_by_force) @ np.abs(f))
    return float((gap + rate).max(initial=0.0))
