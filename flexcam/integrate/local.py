"""The local forces of a system side by side: what they sense, how they act, what they answer.

With the constant operator S of a step, the new acceleration is ``a = a_free + S^-1 w sum A f``, so the sensed scalars
are affine in f, and only a small system is left to iterate on (`settle`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flexcam.integrate.schedule import Schedule, Weights
from flexcam.integrate.stores import Stores
from flexcam.linalg import FloatArray, IntArray
from flexcam.system import (
    ONE,
    AngleFunction,
    AngleVector,
    CamMotion,
    Constant,
    Evaluated,
    Reaction,
    Smooth,
    Storing,
    System,
)

_NO_STATE = np.zeros(0)


@dataclass(frozen=True, eq=False)
class _Stack:
    """All vectors of one side (sensing or acting) under each other, and which scalar each belongs to."""

    vectors: FloatArray
    owner: FloatArray
    still: FloatArray
    moving: tuple[tuple[int, AngleFunction], ...]
    """Weights that are constant, and the functions that are the others."""
    rows: FloatArray
    """What is constant of every scalar, then the vectors whose weights are functions, shape (c + moving, n)."""
    places: tuple[tuple[int, int], ...]
    """Of these vectors: to which scalar each belongs, and its place among all vectors."""

    @classmethod
    def of(cls, terms: tuple[AngleVector, ...], size: int) -> _Stack:
        vectors = np.concatenate([t.vectors for t in terms]) if terms else np.zeros((0, size))
        owner = np.zeros((len(terms), len(vectors)))
        first = 0
        for i, term in enumerate(terms):
            owner[i, first : first + len(term.vectors)] = 1.0
            first += len(term.vectors)
        functions = [function for t in terms for function in t.functions or (ONE,) * len(t.vectors)]
        told = np.flatnonzero(vectors.any(axis=1))  # what is left of others is zero: nothing there moves
        vectors, owner, functions = vectors[told], owner[:, told], [functions[i] for i in told.tolist()]
        still, moving = _sorted(functions)
        places = tuple((int(owner[:, i].argmax()), i) for i, _ in moving)
        rows = np.concatenate([(owner * still) @ vectors, vectors[[i for _, i in places]]])
        return cls(vectors, owner, still, moving, rows, places)

    def weights(self, cam: Evaluated, order: int = 0, speed: FloatArray | None = None) -> Weights:
        """Return the weights of all vectors; their derivatives by the angle times a speed, shape (m,), by time."""
        return _weights(self.still, self.moving, cam, order, speed)


def _sorted(functions: Sequence[AngleFunction]) -> tuple[FloatArray, tuple[tuple[int, AngleFunction], ...]]:
    """Return the values of the functions that are constant, zero for others, and the others with their places."""
    still = np.array([one.value if isinstance(one, Constant) else 0.0 for one in functions], dtype=float)
    return still, tuple((i, one) for i, one in enumerate(functions) if not isinstance(one, Constant))


def _weights(
    still: FloatArray, moving: tuple[tuple[int, AngleFunction], ...], cam: Evaluated, order: int,
    speed: FloatArray | None = None,
) -> Weights:  # fmt: skip
    """Return functions side by side, or their derivatives."""
    found = [(i, cam(function, order)) for i, function in moving]
    if speed is not None:
        found = [(i, values * speed) for i, values in found]
    return Weights(still if order == 0 else np.zeros_like(still), found, len(cam.angle))


class LocalForces:
    """The local forces of a system, stacked.

    Parameters
    ----------
    system
        The system.
    """

    def __init__(self, system: System) -> None:
        forces = system.local_forces
        self.names = [f.name for f in forces for _ in f.sense]
        self.sense = _Stack.of(tuple(t for f in forces for t in f.sense), system.size)
        self.act = _Stack.of(tuple(t for f in forces for t in f.act), system.size)
        self._offsets = _sorted([g for f in forces for g in f.offset])
        self.count = len(self._offsets[0])
        self.start_state = np.concatenate([f.law.start_state for f in forces]) if forces else np.zeros(0)
        scalars, states = _slices([len(f.sense) for f in forces]), _slices([len(f.law.start_state) for f in forces])
        self.laws = [(f.law, *places) for f, *places in zip(forces, scalars, states, strict=True)]
        switches = [(scalars[i].start + one, f.restitution) for i, f in enumerate(forces) for one in f.switching]
        kept = [(law, part, inner) for law, part, inner in self.laws if isinstance(law, Storing)]
        self.stores, self.storing = Stores(kept), np.zeros(self.count)
        for _, part, _ in kept:
            self.storing[part] = 1.0
        self.opposed = self._opposed()
        self.smooth = [
            (law, part) for law, part, _ in self.laws if isinstance(law, Smooth) and bool(self.opposed[part].all())
        ]
        self._last = Evaluated(np.full(1, -np.inf))
        self.switching: IntArray = np.array([one for one, _ in switches], dtype=np.intp)
        self.restitution: FloatArray = np.array([np.nan if e is None else e for _, e in switches], dtype=float)

    def _opposed(self) -> NDArray[np.bool_]:
        """Tell which forces act straight against what they sense, while the cam does nothing about it, shape (c,)."""
        c = self.count
        found = (self.sense.rows[:c] == -self.act.rows[:c]).all(axis=1) & (self.storing > 0.0)
        for scalar, _ in (*self.sense.places, *self.act.places, *self._offsets[1]):
            found[scalar] = False
        return found

    def schedule(self, motion: CamMotion) -> Schedule:
        """Return what follows from the cam motion at some instants."""
        cam, speed = motion.cam, motion.speed
        # What lies within a block only looks at it more closely.
        if motion.known is None and len(cam.angle) and not cam.angle[0] < self._last.angle[-1]:
            self._last = cam
        return Schedule(
            self.sense.weights(cam), self.sense.weights(cam, 1, speed), self.act.weights(cam),
            _weights(*self._offsets, cam, 0), _weights(*self._offsets, cam, 1, speed),
            motion.angle, self.sense.owner, self.act.owner, cam,
        )  # fmt: skip

    def recalled(self, motion: CamMotion, at: IntArray) -> CamMotion:
        """Return a motion of the cam with what is known of the last block's instants, if these are at some places."""
        angle, last = motion.angle, self._last.angle
        if len(at) != len(last) or not np.array_equal(angle[at], last):
            return motion
        return replace(motion, known=Evaluated(angle, self._last, at) if len(at) < len(angle) else self._last)

    def sensed(self, d: FloatArray, v: FloatArray, schedule: Schedule) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return gamma, gamma', and the part of gamma' that the cam alone causes."""
        rows, c = self.sense.rows, self.count
        on_d, on_v = (rows @ d.T).T, (rows @ v.T).T  # a scalar's history lies together: most is done scalar by scalar
        gap, rate, carried = on_d[:, :c], on_v[:, :c], np.zeros((len(d), c), order="F")
        schedule.offsets.add(gap)
        schedule.offset_rates.add(carried)
        places = np.array([i for _, i in self.sense.places], dtype=np.intp)
        weights, turning = schedule.sensed.columns(places), schedule.sensed_rates.columns(places)
        for j, (scalar, _) in enumerate(self.sense.places):
            gap[:, scalar] += weights[:, j] * on_d[:, c + j]
            carried[:, scalar] += turning[:, j] * on_d[:, c + j]
            rate[:, scalar] += weights[:, j] * on_v[:, c + j]
        rate += carried
        return gap, rate, carried

    def respond(self, gap: FloatArray, rate: FloatArray, state: FloatArray, angle: float) -> Reaction:
        """Return the reaction of all laws side by side to gamma and gamma', shape (c,), and all states, shape (s,)."""
        c = self.count
        force, by_gap, by_rate = np.zeros(c), np.zeros((c, c)), np.zeros((c, c))
        answers: list[tuple[Reaction, slice, slice]] = []
        for law, part, inner in self.laws:
            one = law.respond(gap[part], rate[part], state[inner], angle)
            force[part] = one.force
            if part.stop - part.start == 1:
                by_gap[part.start, part.start], by_rate[part.start, part.start] = one.by_gap[0, 0], one.by_rate[0, 0]
            else:
                by_gap[part, part], by_rate[part, part] = one.by_gap, one.by_rate
            if inner.start < inner.stop:
                answers.append((one, part, inner))
        if not answers:
            return Reaction(force, by_gap, by_rate, _NO_STATE)
        return Reaction(force, by_gap, by_rate, *_inner(answers, c, len(state)))

    def pressed(self, gap: FloatArray) -> NDArray[np.bool_]:
        """Return on which side of zero the switching scalars are."""
        return gap[self.switching] > 0.0


def _inner(answers: list[tuple[Reaction, slice, slice]], c: int, s: int) -> tuple[FloatArray, ...]:
    """Return the rates of all states, and the derivatives that states take part in."""
    rate, by_state, of_gap, of_rate, of_state = (
        np.zeros(shape) for shape in ((s,), (c, s), (s, c), (s, c), (s, s))
    )  # fmt: skip
    for one, part, inner in answers:
        rate[inner] = one.state_rate
        for whole, places, given in (
            (by_state, (part, inner), one.by_state),
            (of_gap, (inner, part), one.state_rate_by_gap),
            (of_rate, (inner, part), one.state_rate_by_rate),
            (of_state, (inner, inner), one.state_rate_by_state),
        ):
            whole[places] = given if given.size else 0.0
    return rate, by_state, of_gap, of_rate, of_state


def _slices(sizes: list[int]) -> list[slice]:
    return [slice(a, b) for a, b in pairwise(np.cumsum([0, *sizes]).tolist())]
