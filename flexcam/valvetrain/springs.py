"""Contribution of valve springs to the equations of motion: tables, coils that close, pulsating stiffness, channels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flexcam.core import FloatArray
from flexcam.dynamics import (
    Channel,
    ForceLaw,
    Load,
    LocalForce,
    Observation,
    constant,
    elastic_stop,
)
from flexcam.dynamics.force_laws import PULSATING
from flexcam.valvetrain.coupling import Coupling, constant_history, opposed_force
from flexcam.valvetrain.parts import Pulsation, Spring
from flexcam.valvetrain.spring_properties import (
    closed_forces,
    is_bent,
    solid_forces,
    spring_curve,
    stress_factor,
    table_law,
)
from flexcam.valvetrain.structure import Structure, spring_parts


def couple_springs(structure: Structure) -> Coupling:
    """Return the nonlinear forces of the parts of springs, and the channels of all springs.

    ``surge`` is the largest deviation of a coil from its static position, ``clearance`` the travel left until all coils
    touch, counted by the most compressed part of those that close last.
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
            where, balance = f"springs.{name}.closed", constant_history(1.0)
            loads.append(Load(where, rows.T @ np.array(closed), balance, installed=True, steady=True))
        channels += _channels(f"springs.{name}", spring, rows, scalars)
    return Coupling(tuple(loads), tuple(forces), tuple(channels))


def _part_forces(where: str, spring: Spring, rows: FloatArray) -> dict[str, LocalForce]:
    """Return the nonlinear forces of the parts of a spring by kind."""
    found: dict[str, LocalForce] = {}
    if spring.pulsation is not None:
        law = pulsating_spring(spring.parts[0].stiffness, spring.pulsation)
        found["pulsation"] = opposed_force(f"{where}.pulsation", rows, law)
    if is_bent(spring.table):
        found["table"] = opposed_force(f"{where}.table", rows, table_law(spring))
    if spring.clash_travel is not None:
        rooms = tuple(constant(-(part.travel or 0.0)) for part in spring.parts)
        clash = opposed_force(f"{where}.clash", rows, elastic_stop(spring.clash_stiffness))
        found["clash"] = replace(clash, offset=rooms)
    return found


def pulsating_spring(stiffness: float, pulsation: Pulsation) -> ForceLaw:
    """Return the law of the fluctuating part of a pulsating stiffness."""
    return ForceLaw(PULSATING, (stiffness,), (lambda angle, order: pulsation.part(angle),))


def has_channels(spring: Spring) -> bool:
    """Return whether the force of a spring is an output: not of a bearing or a substitute for a stiff part."""
    return spring.installed_force is not None or spring.elements > 1 or spring.wire is not None


def force_unit(spring: Spring) -> str:
    """Return the unit of the force of a spring."""
    return "N m" if spring.turns else "N"


def _channels(where: str, spring: Spring, rows: FloatArray, scalars: dict[str, list[int]]) -> list[Channel]:
    """Return the channels of a spring; `scalars` are the positions of its nonlinear forces by kind."""
    clash, table = scalars.get("clash", []), scalars.get("table", [])
    installed = (spring.installed_force or 0.0) - np.array(closed_forces(spring))
    stiffness = np.array([part.stiffness for part in spring.parts])
    stress_factors = np.array([stress_factor(part) for part in spring.parts])
    curve = spring_curve(spring) if spring.coils else None

    def forces(seen: Observation) -> FloatArray:
        """Return the force in the wire of every part, N, shape (m, parts), compression positive."""
        pulsating = 1.0 if spring.pulsation is None else 1.0 + spring.pulsation.part(seen.motion.angle)[:, None]
        linear = installed + stiffness * pulsating * seen.moved.extract(rows)
        return linear + seen.forces[:, table] if table else linear

    def end(seen: Observation) -> FloatArray:
        wire = forces(seen)[:, -1]
        return wire + seen.forces[:, clash[-1]] if clash else wire

    def surge(seen: Observation) -> FloatArray:
        stretch = seen.moved.extract(rows)
        travel = stretch.sum(axis=1, keepdims=True)
        still = travel * spring.compliances / spring.compliances.sum()
        if curve is not None:
            still = curve.compression(travel[:, 0])
        return np.abs(np.cumsum(stretch - still, axis=1)).max(axis=1)

    def clearance(seen: Observation) -> FloatArray:
        stretch = seen.moved.extract(rows)
        travel = len(rows) * stretch.max(axis=1) if curve is None else curve.travel_of(stretch)
        return (spring.clash_travel or 0.0) - travel

    def touching(seen: Observation) -> FloatArray:
        return np.maximum(seen.forces[:, clash] - solid, 0.0).sum(axis=1)

    found: list[Channel] = []
    if has_channels(spring):
        found.append(Channel(f"{where}.force", force_unit(spring), end))
        if spring.elements > 1:
            found.append(Channel(f"{where}.surge", "rad" if spring.turns else "m", surge))
        if spring.wire is not None:
            stress = Channel(f"{where}.stress", "Pa", lambda seen: (stress_factors * np.abs(forces(seen))).max(axis=1))
            found.append(stress)
        if clash:
            found.append(Channel(f"{where}.clearance", "m", clearance))
    if clash:
        solid = solid_forces(spring, curve)
        found.append(Channel(f"{where}.clash", "N", touching))
    return found
