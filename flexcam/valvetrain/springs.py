"""Valve springs: static curve, wire stress, natural frequencies, and their part in the equations of motion."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from flexcam.cams import Event, harmonics
from flexcam.core import FloatArray
from flexcam.dynamics import Channel, ForceLaw, Load, LocalForce, Observation, constant, elastic_stop
from flexcam.dynamics.force_laws import force_table
from flexcam.dynamics.law_data import force_table_law
from flexcam.valvetrain.coupling import Coupling, installed_load, opposed_force
from flexcam.valvetrain.parts import Spring, SpringPart, Wire
from flexcam.valvetrain.structure import Structure, spring_parts


def table_law(spring: Spring) -> ForceLaw:
    """Return the law of one part of a spring with a table, beyond its stiffness and installed force."""
    travel, force = np.array(spring.table).T
    excess = force - (spring.installed_force or 0.0) - spring.stiffness * travel
    return force_table_law((travel / spring.elements).tolist(), excess.tolist())


def closed_forces(spring: Spring) -> list[float]:
    """Return the force of the touching coils of every part as installed, N."""
    return [spring.clash_stiffness * max(-(part.travel or 0.0), 0.0) for part in spring.parts]


def wire_stress(spring: Spring, travel: FloatArray) -> FloatArray:
    """Return the largest stress of the wire at rest, Pa, shape (m,), at travels from the installed length, m."""
    compressions, stress = spring_curve(spring).compression(travel), np.zeros(len(travel))
    for i, (part, closed) in enumerate(zip(spring.parts, closed_forces(spring), strict=True)):
        force = np.interp(compressions[:, i], *_part_curve(spring, replace(part, travel=None))) - closed
        stress = np.maximum(stress, part.stress_factor * np.abs(force))
    return stress


@dataclass(frozen=True, eq=False)
class SpringCurve:
    """Static force of a spring over its travel from the installed length, linear between its corners.

    The first and the last row are far beyond the others and continue the curve.
    """

    travel: FloatArray  #: m, shape (c,)
    force: FloatArray  #: N, shape (c,)
    parts: FloatArray  #: compression of each part, m, shape (c, parts)

    @property
    def stiffness(self) -> FloatArray:
        """Stiffness between the corners, N/m, shape (c - 1,)."""
        return np.diff(self.force) / np.diff(self.travel)

    @property
    def closing_last(self) -> list[int]:
        """Numbers of the parts that close last, as the spring becomes solid."""
        change = self.parts[-2] - self.parts[-3]
        return np.flatnonzero(change > _CLOSED * change.max()).tolist()

    def row_at(self, travel: float) -> int:
        """Return the corner from which the curve is straight at a travel; at a corner, that corner."""
        return int(np.clip(np.searchsorted(self.travel, travel, side="right") - 1, 0, len(self.travel) - 2))

    def stiffness_at(self, travel: float) -> float:
        """Return the stiffness at a travel, N/m; at a corner that beyond it."""
        return float(self.stiffness[self.row_at(travel)])

    def compression(self, travel: FloatArray) -> FloatArray:
        """Return the compression of each part at given travels, m, shape (m, parts)."""
        return np.array([np.interp(travel, self.travel, part) for part in self.parts.T], dtype=np.float64).T

    def travel_of(self, compression: FloatArray) -> FloatArray:
        """Return the travel at which, at rest, one of the parts that close last is compressed as given, shape (m,).

        Parts that closed before are stiff: the vibration of closed coils does not affect the remaining travel.
        """
        parts = [(compression[:, i], self.parts[:, i]) for i in self.closing_last]
        return np.array([np.interp(x, curve, self.travel) for x, curve in parts], dtype=np.float64).max(axis=0)


_CLOSED = 0.1  # compression of a closed part per that of the softest open one, above which it counts as open
_FAR = 1.0  # distance of the end rows of a curve from the others, m


def spring_curve(spring: Spring) -> SpringCurve:
    """Return the static curve of a spring: all parts in series carry the same force."""
    rows = [_part_curve(spring, part) for part in spring.parts]
    lowest, highest = max(float(force[0]) for _, force in rows), min(float(force[-1]) for _, force in rows)
    corners = np.unique(np.concatenate([force[1:-1] for _, force in rows]))
    distinct = np.diff(corners, prepend=-np.inf) > _SAME * np.abs(corners).max()
    force = np.concatenate([[lowest], corners[distinct], [highest]])
    parts = np.column_stack([np.interp(force, forces, travel) for travel, forces in rows])
    return SpringCurve(parts.sum(axis=1), force, parts)


_SAME = 1e-9  # relative difference of forces below which they are the same


def _part_curve(spring: Spring, part: SpringPart) -> tuple[FloatArray, FloatArray]:
    """Return travel and force of one part at its corners, with a far row at either end."""
    corners = [x / spring.elements for x, _ in spring.table] or [0.0]
    if part.travel is not None:
        corners = sorted({*corners, part.travel})
    travel = np.array([corners[0] - _FAR, *corners, corners[-1] + _FAR])
    force = (spring.installed_force or 0.0) + part.stiffness * travel
    if spring.table:
        constants = np.array(table_law(spring).constants)
        force += [force_table(x, constants, 0)[0] for x in travel.tolist()]
    if part.travel is not None:
        force += spring.clash_stiffness * (np.maximum(travel - part.travel, 0.0) - max(-part.travel, 0.0))
    return travel, force


@dataclass(frozen=True)
class Coils:
    """Neighbouring active coils of a spring, of equal pitch."""

    turns: float  #: number of coils
    ends: tuple[float, float]  #: diameter of the mean circle at both ends, m; it tapers evenly between them
    pitch: float  #: rise per coil of the free spring, m

    def gap(self, wire: float) -> float:
        """Return the compression per coil at which it touches the next, m, by the diameter d of the wire.

        Where the coil tapers by r per turn, two touching coils differ in height by ``sqrt(d^2 - r^2)``.
        """
        taper = 0.5 * abs(self.ends[1] - self.ends[0]) / self.turns
        return self.pitch - math.sqrt(max(wire**2 - taper**2, 0.0))

    def parts(self, wire: float, shear_modulus: float, count: int) -> list[tuple[SpringPart, float]]:
        """Return parts of equal numbers of turns, without mass, and the length of the wire of each, m.

        The stiffness is ``G d^4/(8 n D^3)`` with the mean cube of the diameter.
        """
        bounds, turns = np.linspace(*self.ends, count + 1).tolist(), self.turns / count
        parts: list[tuple[SpringPart, float]] = []
        for d1, d2 in pairwise(bounds):
            mean, cube = 0.5 * (d1 + d2), 0.25 * (d1 + d2) * (d1**2 + d2**2)
            stiffness = shear_modulus * wire**4 / (8.0 * cube * turns)
            part = SpringPart(
                stiffness, travel=turns * self.gap(wire), wire=Wire(wire, mean), length=turns * self.pitch
            )
            parts.append((part, turns * math.hypot(math.pi * mean, self.pitch)))
        return parts


def coil_spring(
    spring: Spring, coils: Sequence[Coils], wire: float, shear_modulus: float, density: float | None
) -> Spring:
    """Return a free spring with coils, each divided into the parts of the given one, by the diameter of the wire.

    Its mass is that of the wire, or the given one, divided by the length of the wire.
    """
    pairs = [pair for coil in coils for pair in coil.parts(wire, shear_modulus, spring.elements)]
    stiffness, length = 1.0 / sum(1.0 / part.stiffness for part, _ in pairs), sum(length for _, length in pairs)
    per_length = spring.mass / length if density is None else density * math.pi * wire**2 / 4.0
    parts = tuple(
        replace(part, damping=spring.damping * part.stiffness / stiffness, mass=per_length * arc) for part, arc in pairs
    )
    diameter = sum(0.5 * sum(coil.ends) * coil.turns for coil in coils) / sum(coil.turns for coil in coils)
    return replace(
        spring, stiffness=stiffness, mass=per_length * length, elements=len(parts), coils=parts,
        wire=Wire(wire, diameter),
    )  # fmt: skip


def install_spring(spring: Spring, force: float | None, compression: float | None) -> Spring:
    """Return a spring whose table or parts count from the free length with travels from the installed length.

    Its installed position follows from the force or the compression; without both it is installed as free.
    """
    curve = spring_curve(replace(spring, installed_force=None, clash_travel=None))
    if force is None:
        start = compression or 0.0
        force = float(np.interp(start, curve.travel, curve.force))
    else:
        start = float(np.interp(force, curve.force, curve.travel))
    if spring.table:
        table = tuple((travel - start, load) for travel, load in spring.table)
        return replace(spring, table=table, stiffness=curve.stiffness_at(start), installed_force=force)
    shifts = curve.compression(np.array([start]))[0].tolist()
    coils = tuple(
        replace(part, travel=(part.travel or 0.0) - shift, length=part.length - shift)
        for part, shift in zip(spring.coils, shifts, strict=True)
    )
    return replace(spring, coils=coils, installed_force=force, clash_travel=float(curve.travel[-2]) - start)


def condense_spring(spring: Spring) -> Spring:
    """Return a spring in one part: unequal parts become the table of their static curve up to coil bind.

    Its mass is that of a uniform spring with the same inertia at the moving end, its wire that with the largest stress.
    """
    if not spring.coils:
        return replace(spring, elements=1)
    curve = spring_curve(spring)
    end = np.cumsum(spring.compliances) / spring.compliances.sum()
    begin = end - spring.compliances / spring.compliances.sum()
    masses = np.array([part.mass for part in spring.parts])
    reduced = float(masses @ (begin**2 + begin * end + end**2)) / 3.0  # at the moving end: a third of a uniform spring
    return replace(
        spring, elements=1, coils=(), stiffness=curve.stiffness_at(0.0), mass=3.0 * reduced,
        wire=max(spring.parts, key=lambda part: part.stress_factor).wire,
        table=tuple(zip(curve.travel[:-1].tolist(), curve.force[:-1].tolist(), strict=True)),
        clash_stiffness=float(curve.stiffness[-1] - curve.stiffness[-2]),
    )  # fmt: skip


_POISSON = 0.3  # Poisson's ratio of the wire, for Young's modulus from the shear modulus


def radial_stiffness(spring: Spring, turns: float) -> float:
    """Return the contact force of all coils of a nest per radial displacement of its wire, N/m.

    The coils remain circles and their ends may turn: as the radius R decreases by x, the spring winds up by
    ``2 pi n x/R`` against its torsional stiffness ``E d^4/(64 D n)`` (A. M. Wahl, Mechanical Springs, 1963). This
    gives a line load of ``E I x/R^4`` along the wire, and for all n coils ``4 pi^2 (1 + nu) n^2`` times the axial
    stiffness.

    Parameters
    ----------
    spring
        Spring whose axial stiffness is that of n coils of one diameter D = 2 R.
    turns
        n.
    """
    return 4.0 * math.pi**2 * (1.0 + _POISSON) * turns**2 * spring.stiffness


def share_ends(one: Spring, other: Spring) -> bool:
    """Return whether two springs act between the same points along the same direction."""
    return (one.at, one.to) == (other.at, other.to) and np.array_equal(one.direction, other.direction)


def nest_interference(inner: Spring, outer: Spring) -> float:
    """Return the largest radial interference by the diameters of two springs with wires at equal heights, m."""
    heights: list[float] = sorted({*inner.heights.tolist(), *outer.heights.tolist()})
    overlaps: list[float] = []
    for pair in pairwise(heights):
        inside, outside = (
            spring.parts[int(np.searchsorted(spring.heights, sum(pair) / 2.0)) - 1].wire for spring in (inner, outer)
        )
        if inside is not None and outside is not None:
            radii = inside.coil_diameter + inside.diameter, outside.coil_diameter - outside.diameter
            overlaps.append(0.5 * (radii[0] - radii[1]))
    return max(overlaps, default=-math.inf)


_FINE = 64  # minimum number of parts for natural frequencies, with which the first one is 1e-4 too high


def spring_frequencies(spring: Spring, travel: float) -> FloatArray:
    """Return the lowest three natural frequencies of a spring with fixed ends at a travel, Hz; none without mass."""
    if spring.mass == 0.0:
        return np.zeros(0)
    curve = spring_curve(spring)
    row = curve.row_at(travel)
    stiffness = (curve.force[row + 1] - curve.force[row]) / (curve.parts[row + 1] - curve.parts[row])
    n = math.ceil(_FINE / len(stiffness))
    k, m = np.repeat(n * stiffness, n), np.repeat([part.mass / n for part in spring.parts], n)
    K = np.diag(k[:-1] + k[1:]) - np.diag(k[1:-1], 1) - np.diag(k[1:-1], -1)
    M = (2.0 * np.diag(m[:-1] + m[1:]) + np.diag(m[1:-1], 1) + np.diag(m[1:-1], -1)) / 6.0
    L = np.linalg.cholesky(M)
    squares = np.linalg.eigvalsh(np.linalg.solve(L, np.linalg.solve(L, K).T))
    return np.sqrt(squares[:3]) / (2.0 * math.pi)


# parts per half wave, and minimum number of parts, as a valve that hits its seat excites surge at any speed
_PER_HALF_WAVE = 4
_MAX_PARTS = 16  # default maximum number of parts; for longer waves the case must specify the number
_FORCE_FRACTION = 0.01  # fraction of the spring force by the lift below which waves of higher harmonics are neglected

_HARMONICS = 256


def surge_frequency(spring: Spring) -> float:
    """Return the first natural frequency of a spring with mass fixed at both ends, Hz."""
    return 0.5 * math.sqrt(spring.stiffness / spring.mass)


def count_spring_parts(spring: Spring, lifts: Iterable[Event], speed: float) -> int:
    """Return the default number of parts of a spring for given lifts at a camshaft speed."""
    if not (spring.mass > 0.0 and spring.stiffness > 0.0):
        return 1
    surge, orders, waves = 2.0 * math.pi * surge_frequency(spring) / speed, np.arange(_HARMONICS + 1), [1.0]
    for lift in lifts:
        amplitude = math.pi / surge * orders * np.abs(harmonics(lift, _HARMONICS))  # W T = pi W / (2 pi f1)
        tail = np.cumsum(amplitude[::-1])[::-1]
        highest = int(np.count_nonzero(tail > _FORCE_FRACTION * lift.height)) - 1  # relevant harmonic
        waves.append(highest / surge)
    return min(math.ceil(_PER_HALF_WAVE * max(waves)), _MAX_PARTS)


def is_bent(table: Sequence[tuple[float, float]]) -> bool:
    """Return whether the rows of travel and force do not lie on a straight line."""
    slopes = [(f1 - f0) / (x1 - x0) for (x0, f0), (x1, f1) in pairwise(table)]
    return max(slopes, default=0.0) > (1.0 + _SAME) * min(slopes, default=0.0)


def couple_springs(structure: Structure) -> Coupling:
    """Return the nonlinear forces of the parts of springs, and the channels of all springs.

    ``surge`` is the largest deviation of a coil from its static position, ``clearance`` the travel left until all coils
    touch, counted by the most compressed part of those that close last, ``clash`` the sum of their contact forces.
    """
    loads: list[Load] = []
    forces: list[LocalForce] = []
    channels: list[Channel] = []
    count = 0
    for name, spring in structure.model.springs.items():
        if not has_channels(spring) and spring.pulsation is None and spring.clash_travel is None:
            continue
        rows = np.array([high - low for low, high in spring_parts(structure, name, spring)])
        scalars: dict[str, list[int]] = {}
        for kind, force in _part_forces(f"springs.{name}", spring, rows).items():
            forces.append(force)
            scalars[kind] = list(range(count, count + len(rows)))
            count += len(rows)
        if any(closed := closed_forces(spring)):  # the installed force includes what these coils carry
            loads.append(installed_load(f"springs.{name}.closed", rows.T @ np.array(closed)))
        channels += _channels(f"springs.{name}", spring, rows, scalars)
    return Coupling(tuple(loads), tuple(forces), tuple(channels))


def _part_forces(where: str, spring: Spring, rows: FloatArray) -> dict[str, LocalForce]:
    forces: dict[str, LocalForce] = {}
    if spring.pulsation is not None:
        law = spring.pulsation.law(spring.parts[0].stiffness)
        forces["pulsation"] = opposed_force(f"{where}.pulsation", rows, law)
    if is_bent(spring.table):
        forces["table"] = opposed_force(f"{where}.table", rows, table_law(spring))
    if spring.clash_travel is not None:
        offsets = tuple(constant(-(part.travel or 0.0)) for part in spring.parts)
        forces["clash"] = opposed_force(f"{where}.clash", rows, elastic_stop(spring.clash_stiffness), offsets)
    return forces


def has_channels(spring: Spring) -> bool:
    """Return whether the force of a spring is an output: not of a bearing or a substitute for a stiff part."""
    return spring.installed_force is not None or spring.elements > 1 or spring.wire is not None


def _channels(where: str, spring: Spring, rows: FloatArray, scalars: dict[str, list[int]]) -> list[Channel]:
    """Return the channels of a spring; `scalars` are the positions of its nonlinear forces by kind."""
    clash, table = scalars.get("clash", []), scalars.get("table", [])
    installed = (spring.installed_force or 0.0) - np.array(closed_forces(spring))
    stiffness = np.array([part.stiffness for part in spring.parts])
    stress_factors = np.array([part.stress_factor for part in spring.parts])
    curve = spring_curve(spring) if spring.coils else None

    def forces(obs: Observation) -> FloatArray:
        """Return the force in the wire of every part, N, shape (m, parts), compression positive."""
        pulsating = 1.0 if spring.pulsation is None else 1.0 + spring.pulsation.part(obs.motion.angle)[:, None]
        linear = installed + stiffness * pulsating * obs.moved.extract(rows)
        return linear + obs.forces[:, table] if table else linear

    def end(obs: Observation) -> FloatArray:
        wire = forces(obs)[:, -1]
        return wire + obs.forces[:, clash[-1]] if clash else wire

    def surge(obs: Observation) -> FloatArray:
        stretch = obs.moved.extract(rows)
        travel = stretch.sum(axis=1, keepdims=True)
        equal = travel * spring.compliances / spring.compliances.sum()
        static = equal if curve is None else curve.compression(travel[:, 0])
        return np.abs(np.cumsum(stretch - static, axis=1)).max(axis=1)

    def clearance(obs: Observation) -> FloatArray:
        stretch = obs.moved.extract(rows)
        travel = len(rows) * stretch.max(axis=1) if curve is None else curve.travel_of(stretch)
        return (spring.clash_travel or 0.0) - travel

    def stress(obs: Observation) -> FloatArray:
        return (stress_factors * np.abs(forces(obs))).max(axis=1)

    def touching(obs: Observation) -> FloatArray:
        return obs.forces[:, bound].sum(axis=1)

    channels: list[Channel] = []
    if has_channels(spring):
        channels.append(Channel(f"{where}.force", "N m" if spring.turns else "N", end))
        if spring.elements > 1:
            channels.append(Channel(f"{where}.surge", "rad" if spring.turns else "m", surge))
        if spring.wire is not None:
            channels.append(Channel(f"{where}.stress", "Pa", stress))
        if clash:
            channels.append(Channel(f"{where}.clearance", "m", clearance))
    if clash:
        bound = clash if curve is None else [clash[i] for i in curve.closing_last]
        channels.append(Channel(f"{where}.clash", "N", touching))
    return channels
