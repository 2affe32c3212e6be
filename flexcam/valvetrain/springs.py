"""Valve springs: coil clash, wire stress and pulsating stiffness."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from flexcam.cams import Event, harmonics
from flexcam.core import FloatArray
from flexcam.dynamics import (
    Channel,
    ForceLaw,
    LocalForce,
    Observable,
    Observation,
    constant,
    elastic_stop,
    force_sum,
    observable_sum,
)
from flexcam.dynamics.force_laws import PULSATING
from flexcam.valvetrain.contacts import Coupling, opposed_force
from flexcam.valvetrain.parts import Pulsation, Spring
from flexcam.valvetrain.structure import Structure, spring_parts


def couple_coils(structure: Structure) -> Coupling:
    """Return the contacts between neighbouring parts of springs, and the channels of all springs.

    ``surge`` is the largest deviation of a coil from uniform deformation, ``clearance`` the travel left until all coils
    touch, counted by the most compressed part.
    """
    forces: list[LocalForce] = []
    channels: list[Channel] = []
    count = 0
    for name, spring in structure.model.springs.items():
        if not _has_channels(spring) and spring.pulsation is None and spring.clash_travel is None:
            continue
        rows = np.array([high - low for low, high in spring_parts(structure, name, spring)])
        if spring.pulsation is not None:
            law = pulsating_spring(spring.stiffness * spring.elements, spring.pulsation)
            forces.append(opposed_force(f"springs.{name}.pulsation", rows, law))
            count += len(rows)
        clash = None if spring.clash_travel is None else force_sum(count + len(rows) - 1)
        channels += _channels(f"springs.{name}", spring, rows, clash)
        if spring.clash_travel is None:
            continue
        room = constant(-spring.clash_travel / spring.elements)
        forces.append(opposed_force(f"springs.{name}.clash", rows, elastic_stop(spring.clash_stiffness), room))
        channels.append(Channel(f"springs.{name}.clash", "N", force_sum(*range(count, count + len(rows)))))
        count += len(rows)
    return Coupling((), tuple(forces), tuple(channels))


def pulsating_spring(stiffness: float, pulsation: Pulsation) -> ForceLaw:
    """Return the law of the fluctuating part of a pulsating stiffness."""
    return ForceLaw(PULSATING, (stiffness,), (lambda angle, order: pulsation.part(angle),))


def _has_channels(spring: Spring) -> bool:
    """Return whether the force of a spring is an output: not of a bearing or a substitute for a stiff part."""
    return spring.installed_force is not None or spring.elements > 1 or spring.wire is not None


def _channels(where: str, spring: Spring, rows: FloatArray, clash: Observable | None) -> list[Channel]:
    """Return the channels of a spring; `clash` is the force of the touching coils at its moving end."""
    if not _has_channels(spring):
        return []
    installed, stiffness = spring.installed_force or 0.0, spring.stiffness * spring.elements

    def forces(seen: Observation) -> FloatArray:
        """Return the force in every part, N, shape (m, parts), compression positive."""
        pulsating = 1.0 if spring.pulsation is None else 1.0 + spring.pulsation.part(seen.motion.angle)[:, None]
        return installed + stiffness * pulsating * seen.moved.extract(rows)

    def end(seen: Observation) -> FloatArray:
        return forces(seen)[:, -1]

    def surge(seen: Observation) -> FloatArray:
        stretch = seen.moved.extract(rows)
        return np.abs(np.cumsum(stretch - stretch.mean(axis=1, keepdims=True), axis=1)).max(axis=1)

    force = end if clash is None else observable_sum(end, clash)
    found = [Channel(f"{where}.force", "N m" if spring.turns else "N", force)]
    if spring.elements > 1:
        found.append(Channel(f"{where}.surge", "rad" if spring.turns else "m", surge))
    if (wire := spring.wire) is not None:
        factor = wire.wahl * 8.0 * wire.coil_diameter / (math.pi * wire.diameter**3)
        stress = Channel(f"{where}.stress", "Pa", lambda seen: factor * np.abs(forces(seen)).max(axis=1))
        found.append(stress)
    if (travel := spring.clash_travel) is not None:
        left = Channel(
            f"{where}.clearance", "m", lambda seen: travel - len(rows) * seen.moved.extract(rows).max(axis=1)
        )
        found.append(left)
    return found


_PER_HALF_WAVE = 4
"""Parts per half wave, and minimum number of parts, as a valve that hits its seat excites surge at any speed."""

_MOST = 16  # default maximum number of parts; for longer waves the case must specify the number
_FORCE_FRACTION = 0.01  # fraction of the spring force by the lift below which waves of higher harmonics are neglected

_HARMONICS = 256


def surge_frequency(spring: Spring) -> float:
    """Return the first natural frequency of a spring with mass fixed at both ends, Hz."""
    return 0.5 * math.sqrt(spring.stiffness / spring.mass)


def count_spring_parts(spring: Spring, lifts: Iterable[Event], speed: float) -> int:
    """Return the default number of parts of a spring for given lifts at a camshaft speed."""
    if not (spring.mass > 0.0 and spring.stiffness > 0.0):
        return 1
    surge = 2.0 * math.pi * surge_frequency(spring) / speed
    waves = max((_last_harmonic(lift, surge) / surge for lift in lifts), default=0.0)
    return min(math.ceil(_PER_HALF_WAVE * max(waves, 1.0)), _MOST)


def _last_harmonic(lift: Event, surge: float) -> int:
    """Return the last relevant harmonic of a lift for a spring with surge at a camshaft order."""
    orders = np.arange(_HARMONICS + 1)
    sent = math.pi / surge * orders * np.abs(harmonics(lift, _HARMONICS))  # W T = pi W / (2 pi f1)
    beyond = np.cumsum(sent[::-1])[::-1]
    return int(np.count_nonzero(beyond > _FORCE_FRACTION * lift.height)) - 1
