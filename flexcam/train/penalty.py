"""Laws of contacts: a force from how deep and how fast two bodies are pressed into each other."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import overload

import numpy as np

from flexcam.linalg import FloatArray
from flexcam.system import (
    ONE,
    AngleFunction,
    Changing,
    Formula,
    Formulated,
    Kind,
    LocalLaw,
    Reaction,
    Stored,
    Storing,
)
from flexcam.system.pointwise import dissipating, hunt_crossley, line_load, sliding, stop

STRAIGHT = 10.0
"""Largest relative radius by the depth of a line contact: where cam and roller nest, its logarithm says nothing."""

_MOST_ITERATIONS, _SETTLED, _LEAST = 60, 1e-7, 1e-300  # as in `pointwise`
_REVOLUTION = np.linspace(0.0, 2.0 * math.pi, 721)
"""Cam angles at which the sharpest curvature is sought: where it is missed, a slight part of an energy is."""

_WITH_FRICTION = 2
"""Scalars of a contact with friction: depth and path."""


@lru_cache
def _nothing(count: int) -> Reaction:
    return Reaction(np.zeros(count), np.zeros((count, count)), np.zeros((count, count)))


def _one(force: float, by_gap: float, by_rate: float) -> Reaction:
    return Reaction(np.array([force]), np.array([[by_gap]]), np.array([[by_rate]]))


def _linear_stop(stiffness: float, gap: FloatArray, state: FloatArray) -> Stored:
    """Return the energy of springs that only push, and its derivative, per instant."""
    pressed = np.maximum(gap, 0.0)
    energy = 0.5 * stiffness * np.einsum("...i,...i->...", pressed, pressed)
    return Stored(energy, stiffness * pressed, np.zeros_like(state))


class Stateless:
    """A law without internal state.

    Examples
    --------
    >>> Stateless().start_state
    array([], dtype=float64)
    """

    @property
    def start_state(self) -> FloatArray:
        """Nothing."""
        return np.zeros(0)


@dataclass(frozen=True)
class Bilateral(Stateless):
    """Force k gamma + c gamma', pushing and pulling.

    Parameters
    ----------
    stiffness, damping
        N/m and N s/m.

    Examples
    --------
    >>> Bilateral(2.0).respond(np.array([-3.0]), np.zeros(1), np.zeros(0), 0.0).force
    array([-6.])
    """

    stiffness: float
    damping: float = 0.0

    def respond(self, gap: FloatArray, rate: FloatArray, state: FloatArray, angle: float) -> Reaction:
        """Return force and tangent."""
        force = self.stiffness * float(gap[0]) + self.damping * float(rate[0])
        return _one(force, self.stiffness, self.damping)

    def formulas(self, count: int) -> tuple[Formula, ...]:
        """Return the law as data."""
        return (Formula(Kind.BILATERAL, (self.stiffness, self.damping)),) * count

    def stored(self, gap: FloatArray, state: FloatArray, angle: FloatArray) -> Stored:
        """Return the energy stored and its derivative, per instant."""
        return Stored(0.5 * self.stiffness * np.sum(gap**2, axis=-1), self.stiffness * gap, np.zeros_like(state))


@dataclass(frozen=True)
class Stop(Stateless):
    """Force k gamma + c gamma' while pressed together (gamma > 0), never pulling; any number of places side by side.

    The damping takes hold over the first micrometres of depth, as in the impact functions of multibody codes: a damper
    that acts at once would step at touchdown, and a step of the force has no balance within a time step.

    Parameters
    ----------
    stiffness, damping
        N/m and N s/m of each.
    hold
        Depth at which the damping is whole, m.

    Examples
    --------
    >>> Stop(2.0).respond(np.array([-3.0, 1.0]), np.zeros(2), np.zeros(0), 0.0).force
    array([0., 2.])
    """

    stiffness: float
    damping: float = 0.0
    hold: float = 1e-5

    def respond(self, gap: FloatArray, rate: FloatArray, state: FloatArray, angle: float) -> Reaction:
        """Return force and tangent; a damper that would pull lets go."""
        if gap.max() <= 0.0:
            return _nothing(len(gap))
        if len(gap) == 1:
            return _one(*stop(float(gap[0]), float(rate[0]), self.stiffness, self.damping, self.hold))
        part = np.clip(gap / self.hold, 0.0, 1.0)
        force = self.stiffness * gap + self.damping * part * rate
        pressed = (gap > 0.0) & (force > 0.0)
        by_gap = self.stiffness + np.where(part < 1.0, self.damping * rate / self.hold, 0.0)
        return Reaction(
            np.where(pressed, force, 0.0), np.diag(np.where(pressed, by_gap, 0.0)),
            np.diag(np.where(pressed, self.damping * part, 0.0)),
        )  # fmt: skip

    def formulas(self, count: int) -> tuple[Formula, ...]:
        """Return the law as data."""
        return (Formula(Kind.STOP, (self.stiffness, self.damping, self.hold)),) * count

    def stored(self, gap: FloatArray, state: FloatArray, angle: FloatArray) -> Stored:
        """Return the energy stored and its derivative, per instant."""
        return _linear_stop(self.stiffness, gap, state)


@dataclass(frozen=True)
class HuntCrossley(Stateless):
    """Force k gamma (1 + chi gamma') while pressed together, never pulling.

    K. H. Hunt and F. R. E. Crossley, Coefficient of restitution interpreted as damping in vibroimpact, Journal of
    Applied Mechanics 42 (1975): the damping grows with the depth, so that neither impact nor parting begins with a
    step.

    Parameters
    ----------
    stiffness
        N/m.
    dissipation
        chi, s/m.

    Examples
    --------
    >>> HuntCrossley(2.0, 0.5).respond(np.array([1.0]), np.array([1.0]), np.zeros(0), 0.0).force
    array([3.])
    """

    stiffness: float
    dissipation: float

    def respond(self, gap: FloatArray, rate: FloatArray, state: FloatArray, angle: float) -> Reaction:
        """Return force and tangent."""
        return _one(*hunt_crossley(float(gap[0]), float(rate[0]), self.stiffness, self.dissipation))

    def formulas(self, count: int) -> tuple[Formula, ...]:
        """Return the law as data."""
        return (Formula(Kind.HUNT_CROSSLEY, (self.stiffness, self.dissipation)),) * count

    def stored(self, gap: FloatArray, state: FloatArray, angle: FloatArray) -> Stored:
        """Return the energy stored and its derivative, per instant."""
        return _linear_stop(self.stiffness, gap, state)


@dataclass(frozen=True, eq=False)
class HertzLine(Stateless):
    """Line contact of cam and follower, the cam's radius of curvature changing with its angle.

    A cylinder of radius R pressed by p per length approaches its middle by ``(1 - nu^2) p/(pi E) (2 ln(4 R/a) - 1)``
    and sinks into a flat body of depth d by ``(1 - nu^2) p/(pi E) (2 ln(2 d/a) - nu/(1 - nu))``, with the half width
    ``a^2 = 4 p R/(pi E*)`` of the relative radius: K. L. Johnson, Contact Mechanics (1985), eqs. 4.43, 5.57 and 5.58.
    In the sum the radius cancels: with ``q = (1 - nu^2) p/(pi E)`` the approach is ``q (2 ln(d/q) - 1 - nu/(1 - nu))``,
    and of two cylinders, each with the first, ``q (2 ln(2 (R1 + R2)/q) - 2)``: only the distance of their axes is left.
    So the cam's curvature tells in the pressure, but in the stiffness by a logarithm at most, for which the base circle
    stands.

    Parameters
    ----------
    width
        Length of the line, m.
    modulus, poisson
        E and nu of both bodies.
    radius
        Relative radius of curvature over the cam angle, m, above zero; `STRAIGHT` depths at most.
    depth
        Depth of the flat body, or twice the distance of the axes of two cylinders on the base circle, m.
    dissipation
        chi of Hunt and Crossley, s/m.
    rolls
        Whether both bodies are cylinders.
    """

    width: float
    modulus: float
    poisson: float
    radius: AngleFunction
    depth: float
    dissipation: float = 0.0
    rolls: bool = False

    @property
    def plane_strain(self) -> float:
        """E/(1 - nu^2) of one body, Pa."""
        return self.modulus / (1.0 - self.poisson**2)

    def respond(self, gap: FloatArray, rate: FloatArray, state: FloatArray, angle: float) -> Reaction:
        """Return force and tangent."""
        depth = float(gap[0])
        if depth <= 0.0:
            return _nothing(1)
        load, slope = self._load(depth, self._most(float(self.radius(np.array([angle]), 0)[0])))
        return _one(*dissipating(self.width * load, self.width * slope, float(rate[0]), 1.0, self.dissipation))

    def formulas(self, count: int, cosine: AngleFunction = ONE) -> tuple[Formula, ...]:
        """Return the law as data, along a lift inclined to the normal."""
        shape = (self.width, self._one, self._rest, self.depth, self.dissipation, self._most(1.0))
        return (Formula(Kind.LINE, shape, (self.radius, cosine)),) * count

    def line_load(self, approach: FloatArray, radius: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the load per length at approaches, N/m, and its slope, N/m^2.

        Parameters
        ----------
        approach
            m, above zero, shape (m,).
        radius
            Relative radius of curvature, m, shape (m,).

        Returns
        -------
        tuple
            Shape (m,) each, by Newton's iteration; straight on from where the contact is half the radius wide.
        """
        most, rest = self._most(radius), self._rest
        largest = self._one * most
        terms = 2.0 * np.log(self.depth / largest) - rest
        end, give = largest * terms, self._one * (terms - 2.0)
        below = np.minimum(approach, end)
        q = np.maximum(largest * below / end, _LEAST)
        for _ in range(_MOST_ITERATIONS):
            terms = 2.0 * np.log(self.depth / q) - rest
            new = q + (below - q * terms) / (terms - 2.0)
            new = np.where(new > 0.0, new, 0.5 * q)
            done = bool((np.abs(new - q) <= _SETTLED * new).all())
            q = new
            if done:
                break
        slopes = 1.0 / (self._one * (2.0 * np.log(self.depth / q) - rest - 2.0))
        straight = approach >= end
        return np.where(straight, most + (approach - end) / give, q / self._one), np.where(straight, 1.0 / give, slopes)

    def stored(self, gap: FloatArray, state: FloatArray, angle: FloatArray) -> Stored:
        """Return the energy stored (the integral of the load over the approach, by parts) and its derivative."""
        depth = gap[..., 0]
        energy, load = np.zeros_like(depth), np.zeros_like(depth)
        at = np.flatnonzero(depth > 0.0)
        if len(at):
            energy[at], load[at] = self._stored(depth[at], self.radius(angle[at], 0))
        return Stored(energy, self.width * load[..., None], np.zeros_like(state))

    def changing(self, gap: FloatArray, state: FloatArray, angle: FloatArray) -> FloatArray:
        """Return the energy where the law may be straight: below, the radius tells nothing."""
        depth = gap[..., 0]
        energy, at = np.zeros_like(depth), np.flatnonzero(depth > self._round)
        if len(at):
            energy[at] = self._stored(depth[at], self.radius(angle[at], 0))[0]
        return energy

    @cached_property
    def _round(self) -> float:
        """Depth up to which the law is nowhere straight, m."""
        q = self._one * self._most(float(self.radius(_REVOLUTION, 0).min()))
        return max(q * (2.0 * math.log(self.depth / q) - self._rest), 0.0)

    def _stored(self, depth: FloatArray, radius: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return energy, J, and load per length, N/m, at depths above zero and relative radii, shape (m,) each."""
        most = self._most(radius)
        load, slope = self.line_load(depth, radius)
        straight = np.where(load > most, 0.5 * (load + most) * (load - most) / slope, 0.0)
        # The approach is q times terms that fall by 2 ln q: its integral over q is q^2 (terms + 1)/2.
        p = np.minimum(load, most)
        q = self._one * p
        terms = 2.0 * np.log(self.depth / q) - self._rest
        return self.width * (p * q * terms - 0.5 * p * q * (terms + 1.0) + straight), load

    @property
    def _one(self) -> float:
        """Q per load, 1/Pa."""
        return 1.0 / (math.pi * self.plane_strain)

    @property
    def _rest(self) -> float:
        """What the logarithm is lessened by."""
        return 2.0 if self.rolls else 1.0 + self.poisson / (1.0 - self.poisson)

    @overload
    def _most(self, radius: float) -> float: ...
    @overload
    def _most(self, radius: FloatArray) -> FloatArray: ...
    def _most(self, radius: float | FloatArray) -> float | FloatArray:
        """Return the load per length from which on the law is straight."""
        return radius * math.pi * self.plane_strain / 128.0

    def _load(self, approach: float, most: float) -> tuple[float, float]:
        """Return load per length and slope at one approach."""
        return line_load(approach, most, self._one, self._rest, self.depth)

    def pressure(self, force: FloatArray, radius: FloatArray) -> FloatArray:
        """Return the largest Hertz pressure, sqrt(p E*/(pi R)), Pa, of forces, N, and relative radii, m, shape (n,)."""
        p = np.maximum(force, 0.0) / self.width
        return np.sqrt(p * 0.5 * self.plane_strain / (math.pi * radius))


@dataclass(frozen=True, eq=False)
class Inclined(Stateless):
    """A law of the depth along the normal, asked for by the depth along the lift.

    The normal is inclined by the pressure angle: the depth along it is the cosine's share, and so is the force along
    the lift of that along the normal. On a swinging flat face it is the contact's distance from the pivot by the arm.

    Parameters
    ----------
    normal
        Law along the normal.
    cosine
        Of the pressure angle, over the cam angle.
    """

    normal: HertzLine
    cosine: AngleFunction

    def respond(self, gap: FloatArray, rate: FloatArray, state: FloatArray, angle: float) -> Reaction:
        """Return force and tangent."""
        share = float(self.cosine(np.array([angle]), 0)[0])
        answer = self.normal.respond(gap * share, rate * share, state, angle)
        return Reaction(answer.force * share, answer.by_gap * share**2, answer.by_rate * share**2)

    def formulas(self, count: int) -> tuple[Formula, ...]:
        """Return the law as data."""
        return self.normal.formulas(count, self.cosine)

    def stored(self, gap: FloatArray, state: FloatArray, angle: FloatArray) -> Stored:
        """Return the energy stored and its derivative, per instant."""
        share = self.cosine(angle, 0)[..., None]
        kept = self.normal.stored(gap * share, state, angle)
        return Stored(kept.energy, kept.by_gap * share, np.zeros_like(state))


@dataclass(frozen=True, eq=False)
class Sliding(Stateless):
    """A contact with Coulomb's friction: depth and sliding, normal force and friction mu N tanh(v/v0).

    Parameters
    ----------
    normal
        Law of the depth.
    coefficient
        mu.
    speed
        v0, m/s: the friction turns over within a few of it.

    Examples
    --------
    >>> law = Sliding(HuntCrossley(1000.0, 0.0), 0.1, 1e-3)
    >>> law.respond(np.array([0.01, 0.0]), np.array([0.0, 1.0]), np.zeros(0), 0.0).force
    array([10.,  1.])
    """

    normal: LocalLaw
    coefficient: float
    speed: float

    def respond(self, gap: FloatArray, rate: FloatArray, state: FloatArray, angle: float) -> Reaction:
        """Return both forces and their tangent."""
        pressed = self.normal.respond(gap[:1], rate[:1], state, angle)
        turned, turning = sliding(float(rate[1]), self.speed)
        share = self.coefficient * turned
        N = float(pressed.force[0])
        by_gap, by_rate = np.zeros((2, 2)), np.zeros((2, 2))
        by_gap[:, 0] = float(pressed.by_gap[0, 0]) * np.array([1.0, share])
        by_rate[:, 0] = float(pressed.by_rate[0, 0]) * np.array([1.0, share])
        by_rate[1, 1] = self.coefficient * N * turning
        return Reaction(np.array([N, share * N]), by_gap, by_rate)

    def formulas(self, count: int) -> tuple[Formula, ...] | None:
        """Return the law as data."""
        if count != _WITH_FRICTION or not isinstance(self.normal, Formulated):
            return None
        normal = self.normal.formulas(1)
        return normal and (replace(normal[0], scalars=count, friction=(self.coefficient, self.speed)),)

    def stored(self, gap: FloatArray, state: FloatArray, angle: FloatArray) -> Stored:
        """Return the energy stored in the depth; friction stores none."""
        if not isinstance(self.normal, Storing):
            return Stored(np.zeros(len(gap)), np.zeros_like(gap), np.zeros_like(state))
        kept = self.normal.stored(gap[..., :1], state, angle)
        return Stored(kept.energy, np.concatenate([kept.by_gap, np.zeros_like(kept.by_gap)], axis=-1), kept.by_state)

    def changing(self, gap: FloatArray, state: FloatArray, angle: FloatArray) -> FloatArray:
        """Return the part of the energy that changes with the cam angle."""
        if isinstance(self.normal, Changing):
            return self.normal.changing(gap[..., :1], state, angle)
        return self.stored(gap, state, angle).energy
