"""Contribution of a part of the train to the equations of motion, and what most contributions consist of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from flexcam.core import FloatArray
from flexcam.dynamics import (
    AngleFunction,
    AngleVector,
    CamMotion,
    Channel,
    Constant,
    ForceLaw,
    Load,
    LocalForce,
    Observable,
    Phaser,
    ShiftedFunction,
    constant,
)


@dataclass(frozen=True, eq=False)
class Coupling:
    """Loads, local forces and channels of one contact; indices refer to these tuples."""

    loads: tuple[Load, ...]
    forces: tuple[LocalForce, ...]
    channels: tuple[Channel, ...]


_zero = constant(0.0)


def opposed_force(name: str, rows: FloatArray, law: ForceLaw, offsets: tuple[AngleFunction, ...] = ()) -> LocalForce:
    """Return a local force that acts against the rows it senses, A = -G, none of which changes with the cam angle."""
    sense = tuple(AngleVector.constant(row) for row in rows)
    act = tuple(AngleVector.constant(-row) for row in rows)
    return LocalForce(name, sense, act, law, offsets or (_zero,) * len(rows))


def conservative_force(
    name: str, sense: AngleVector, law: ForceLaw, offset: AngleFunction = _zero, restitution: float | None = None
) -> LocalForce:
    """Return a local force of one scalar that acts against the motion that presses its bodies together."""
    act = AngleVector(-sense.vectors, sense.functions)
    return LocalForce(name, (sense,), (act,), law, (offset,), restitution)


def installed_load(name: str, vector: FloatArray, size: float = 1.0) -> Load:
    """Return a constant load that acts before the cam turns."""
    return Load(name, vector, constant_history(size), installed=True, steady=True)


def constant_history(value: float) -> Callable[[CamMotion], FloatArray]:
    """Return a constant load history."""
    return lambda motion: np.full_like(motion.angle, value)


def shift_coupling(coupling: Coupling, phaser: Phaser | None) -> Coupling:
    """Return the coupling of a cam, which depends on the angle of its shaft, over the angle of the drive."""
    if phaser is None:
        return coupling

    def functions(unshifted: tuple[AngleFunction, ...]) -> tuple[AngleFunction, ...]:
        return tuple(func if isinstance(func, Constant) else ShiftedFunction(func, phaser) for func in unshifted)

    def vectors(unshifted: tuple[AngleVector, ...]) -> tuple[AngleVector, ...]:
        return tuple(AngleVector(vector.vectors, functions(vector.functions)) for vector in unshifted)

    def law(unshifted: ForceLaw) -> ForceLaw:
        return replace(unshifted, functions=functions(unshifted.functions))

    def history(load: Load) -> Callable[[CamMotion], FloatArray]:
        return lambda motion: load.history(phaser.motion(motion))

    def value(channel: Channel) -> Observable:
        return lambda obs: channel.value(replace(obs, motion=phaser.motion(obs.motion), cam=phaser.cache(obs.cam)))

    return Coupling(
        tuple(replace(load, history=history(load)) for load in coupling.loads),
        tuple(
            replace(
                force, sense=vectors(force.sense), act=vectors(force.act), offset=functions(force.offset),
                law=law(force.law) if isinstance(force.law, ForceLaw) else force.law,
            )
            for force in coupling.forces
        ),
        tuple(replace(channel, value=value(channel)) for channel in coupling.channels),
    )  # fmt: skip
