"""Local forces inside a step: a small Newton iteration on the forces and the internal states behind them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from flexcam.integrate.iteration import LEAST_PART, MOST_ITERATIONS, ROUNDING, TOLERANCE, WHOLE_STEPS
from flexcam.integrate.local import LocalForces
from flexcam.linalg import FloatArray
from flexcam.system import Reaction


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

    @cached_property
    def sizes(self) -> tuple[FloatArray, FloatArray]:
        """By how much forces change the scalars and their rates at most, shape (c, c) each."""
        return np.abs(self.gap_by_force), np.abs(self.rate_by_force)

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
    """
    c, part, last, usual = len(guess), 1.0, np.inf, _largest(guess)
    x = base = np.concatenate([guess, inner.state])
    change = missing = np.zeros(len(x))
    for iteration in range(1, MOST_ITERATIONS + 1):
        f, z = x[:c], x[c:]
        gap, rate = within.at(f)
        answer = forces.respond(gap, rate, z, angle)
        travel = 0.5 * step * (inner.rate + answer.state_rate)
        missing = np.concatenate([f - answer.force, z - inner.state - travel])
        moved = _largest(np.abs(inner.state) + np.abs(travel))
        late = usual if iteration > WHOLE_STEPS else 0.0
        if not np.isfinite(missing).all() or _settled(missing, within, answer, f, step, late, moved):
            # a force that is not finite is reported by `solve`
            return Settled(answer.force, gap, rate, Inner(z, answer.state_rate), iteration)
        off = _largest(missing[:c] - answer.by_state @ missing[c:] if len(z) else missing)
        if iteration > WHOLE_STEPS and off > last and part > LEAST_PART:
            part *= 0.5
        else:
            try:
                change = np.linalg.solve(_tangent(within, answer, step), missing)
            except np.linalg.LinAlgError:
                break
            base, last, part = x, off, 1.0
        x = base - part * change
    scale = np.abs(missing[:c])
    raise NoConvergenceError([name for name, one in zip(forces.names, scale, strict=True) if one > 0.1 * scale.max()])


def _tangent(within: Compliance, answer: Reaction, step: float) -> FloatArray:
    """Return the derivative of what is missing by forces and states."""
    c, s, half = len(answer.force), len(answer.state_rate), 0.5 * step
    tangent = np.eye(c + s)
    tangent[:c, :c] -= answer.by_gap @ within.gap_by_force + answer.by_rate @ within.rate_by_force
    if s:
        by_force = answer.state_rate_by_gap @ within.gap_by_force + answer.state_rate_by_rate @ within.rate_by_force
        tangent[:c, c:], tangent[c:, :c] = -answer.by_state, -half * by_force
        tangent[c:, c:] -= half * answer.state_rate_by_state
    return tangent


def _settled(
    missing: FloatArray, within: Compliance, answer: Reaction, f: FloatArray, step: float, usual: float, moved: float
) -> bool:
    """Tell whether forces and states miss no more than their tolerance, or than moves nothing but by rounding."""
    c = len(f)
    (on_gap, on_rate), forces = within.sizes, np.abs(missing[:c])
    gap, rate = np.abs(within.gap) + on_gap @ np.abs(f), np.abs(within.rate) + on_rate @ np.abs(f)
    rounding = _largest(np.abs(answer.by_gap) @ gap + np.abs(answer.by_rate) @ rate)
    if _largest(forces) > TOLERANCE * max(_largest(answer.force), usual) + ROUNDING * rounding and not (
        (on_gap @ forces <= ROUNDING * gap).all() and (on_rate @ forces <= ROUNDING * rate).all()
    ):
        return False
    if len(missing) == c:
        return True
    flow = np.abs(answer.state_rate_by_gap) @ gap + np.abs(answer.state_rate_by_rate) @ rate
    return _largest(missing[c:]) <= TOLERANCE * moved + ROUNDING * 0.5 * step * _largest(flow)


def _largest(values: FloatArray) -> float:
    return float(np.abs(values).max(initial=0.0))
