"""Local forces inside a step: a small Newton iteration on the few scalars they sense.

With the constant operator S of the step, the new acceleration is ``a = a_free + S^-1 w sum A f``, so the sensed scalars
are affine in f and Newton's matrix is c x c, c being the number of local scalars; nothing is factorized again.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from flexcam.linalg import FloatArray
from flexcam.system import AngleVector, CamMotion, LocalForce, Reaction, System

_TOLERANCE = 1e-12
"""Of the force: three digits above rounding, so that Newton's last quadratic step reaches it."""

_ROUNDING = 16.0 * np.finfo(float).eps
"""Of the terms a stiff law multiplies: the sensed scalars themselves carry a few eps."""

_MOST_ITERATIONS = 80
_WHOLE_STEPS = 20


class NoConvergenceError(ArithmeticError):
    """Newton's iteration on the local forces did not settle."""


@dataclass(frozen=True, eq=False)
class _Stack:
    """All vectors of one side (sensing or acting) under each other, and which scalar each belongs to."""

    vectors: FloatArray
    terms: tuple[AngleVector, ...]
    owner: FloatArray

    @classmethod
    def of(cls, terms: tuple[AngleVector, ...], size: int) -> _Stack:
        vectors = np.concatenate([t.vectors for t in terms]) if terms else np.zeros((0, size))
        owner = np.zeros((len(terms), len(vectors)))
        first = 0
        for i, term in enumerate(terms):
            owner[i, first : first + len(term.vectors)] = 1.0
            first += len(term.vectors)
        return cls(vectors, terms, owner)

    def weights(self, angle: FloatArray, order: int = 0) -> FloatArray:
        """Return the weights of all vectors, shape (times, scalars, vectors)."""
        if not self.terms:
            return np.zeros((*angle.shape, 0, 0))
        side_by_side = np.concatenate([t.weights(angle, order) for t in self.terms], axis=-1)
        return self.owner * side_by_side[..., None, :]


@dataclass(frozen=True, eq=False)
class Schedule:
    """Everything about the local forces that follows from the cam motion alone, for a block of steps.

    Parameters
    ----------
    sense, sense_rate
        Weights of the sensing vectors and their time derivatives, shape (times, c, k).
    act
        Weights of the acting vectors, shape (times, c, m).
    offset, offset_rate
        Prescribed part of the sensed scalars and its time derivative, shape (times, c).
    angle
        rad, shape (times,).
    """

    sense: FloatArray
    sense_rate: FloatArray
    act: FloatArray
    offset: FloatArray
    offset_rate: FloatArray
    angle: FloatArray


class LocalForces:
    """The local forces of a system, stacked.

    Parameters
    ----------
    system
        The system.
    """

    def __init__(self, system: System) -> None:
        forces = system.local_forces
        self.laws = [(f.law, slice_) for f, slice_ in zip(forces, _slices(forces), strict=True)]
        self.sense = _Stack.of(tuple(t for f in forces for t in f.sense), system.size)
        self.act = _Stack.of(tuple(t for f in forces for t in f.act), system.size)
        self._offsets = tuple(g for f in forces for g in f.offset)
        self.count = len(self._offsets)
        self.start_states = [f.law.start_state for f in forces]

    def schedule(self, motion: CamMotion) -> Schedule:
        """Return the parts that follow from the cam motion at some instants."""
        angle, speed = motion.angle, motion.speed
        offset = [np.stack([g(angle, order) for g in self._offsets], -1) if self.count else np.zeros((len(angle), 0))
                  for order in (0, 1)]  # fmt: skip
        return Schedule(
            self.sense.weights(angle), self.sense.weights(angle, 1) * speed[:, None, None],
            self.act.weights(angle), offset[0], offset[1] * speed[:, None], angle,
        )  # fmt: skip

    def respond(
        self, gap: FloatArray, rate: FloatArray, states: list[FloatArray], angle: float
    ) -> tuple[Reaction, list[FloatArray]]:
        """Return the reaction of all laws side by side, and the rates of their states."""
        force = np.zeros(self.count)
        by_gap, by_rate = np.zeros((self.count, self.count)), np.zeros((self.count, self.count))
        state_rates: list[FloatArray] = []
        for (law, part), state in zip(self.laws, states, strict=True):
            reaction = law.respond(gap[part], rate[part], state, angle)
            force[part], by_gap[part, part], by_rate[part, part] = reaction.force, reaction.by_gap, reaction.by_rate
            state_rates.append(reaction.state_rate)
        return Reaction(force, by_gap, by_rate, np.zeros(0)), state_rates


def _slices(forces: tuple[LocalForce, ...]) -> list[slice]:
    ends = np.cumsum([0, *(len(f.offset) for f in forces)]).tolist()
    return [slice(a, b) for a, b in pairwise(ends)]


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


def settle(
    forces: LocalForces, within: Compliance, guess: FloatArray, states: list[FloatArray], state_rates: list[FloatArray],
    step: float, angle: float,
) -> tuple[FloatArray, list[FloatArray], list[FloatArray], int]:  # fmt: skip
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
    states, state_rates
        Internal states and their rates at the step's beginning, one array per law.
    step
        s; zero to find the forces of an instant.
    angle
        Cam angle at the step's end, rad.

    Returns
    -------
    tuple
        Forces (c,), new states, new state rates, iterations.

    Raises
    ------
    NoConvergenceError
        If the forces do not settle.
    """
    f, new_states, rates = guess, states, state_rates
    for iteration in range(1, _MOST_ITERATIONS + 1):
        gap, rate = within.gap + within.gap_by_force @ f, within.rate + within.rate_by_force @ f
        new_states = [z + 0.5 * step * (r0 + r1) for z, r0, r1 in zip(states, state_rates, rates, strict=True)]
        reaction, new_rates = forces.respond(gap, rate, new_states, angle)
        moved = max((float(np.abs(a - b).max(initial=0.0)) for a, b in zip(new_rates, rates, strict=True)), default=0.0)
        still = moved * step <= _TOLERANCE * max((float(np.abs(z).max(initial=0.0)) for z in new_states), default=0.0)
        residual = f - reaction.force
        rates = new_rates
        settled = np.abs(residual).max(initial=0.0) <= _TOLERANCE * np.abs(reaction.force).max(
            initial=0.0
        ) + _ROUNDING * _sensed_size(within, reaction, f)
        if (still and settled) or not np.isfinite(residual).all():  # a non-finite force is reported by `solve`
            return reaction.force, new_states, new_rates, iteration
        tangent = np.eye(len(f)) - reaction.by_gap @ within.gap_by_force - reaction.by_rate @ within.rate_by_force
        try:
            f = f - _shortened(iteration) * np.linalg.solve(tangent, residual)
        except np.linalg.LinAlgError:
            raise NoConvergenceError from None
    raise NoConvergenceError


def _shortened(iteration: int) -> float:
    """Return the part of Newton's step that is taken: the whole, until contacts that open and close do not settle."""
    return 1.0 if iteration <= _WHOLE_STEPS else 0.5


def _sensed_size(within: Compliance, reaction: Reaction, f: FloatArray) -> float:
    """Return the size of the terms that the laws' stiffnesses multiply, as forces."""
    gap = np.abs(reaction.by_gap) @ (np.abs(within.gap) + np.abs(within.gap_by_force) @ np.abs(f))
    rate = np.abs(reaction.by_rate) @ (np.abs(within.rate) + np.abs(within.rate_by_force) @ np.abs(f))
    return float((gap + rate).max(initial=0.0))
