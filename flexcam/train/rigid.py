"""The same mechanism with rigid members: no unknowns, a train goes where the lift of its cam sends it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from flexcam.linalg import FloatArray, Triplets
from flexcam.motion import Event
from flexcam.system import (
    AngleFunction,
    AngleVector,
    Carried,
    Channel,
    Evaluated,
    Following,
    Load,
    Probe,
    System,
    constant,
    derivative,
    load_sum,
    total,
)  # fmt: skip
from flexcam.train.assembled import build_structure
from flexcam.train.build import probe_of
from flexcam.train.cam_functions import lightened, rub
from flexcam.train.lever import refuse_far_turns
from flexcam.train.model import CamContact, Model
from flexcam.train.paths import Coordinate
from flexcam.train.rigid_friction import rigid_friction
from flexcam.train.rigid_train import RigidTrain, rigid_train
from flexcam.train.structure import Structure

ANY_SPEED = 1.0
"""rad/s: the motion of a rigid train over the cam angle is that of every speed, so it is built once for all."""


@lru_cache(maxsize=2)
def build_rigid(model: Model, speed: float) -> System:
    """Return the same mechanism with rigid members: no unknowns, the follower's train follows the lift."""
    structure = build_structure(model)
    refuse_far_turns(structure)
    trains = {
        name: rigid_train(structure, contact, f"contacts.{name}.follower", speed)
        for name, contact in model.driven.items()
    }
    loads: list[Load] = []
    channels: list[Channel] = []
    for name, train in trains.items():
        own = _felt(structure, name, train, len(loads))
        loads += own[0]
        channels += own[1]
    nothing = Triplets.zeros(0)
    probes = tuple(_rigid_probe(structure, probe_of(structure, point), trains) for point in model.probes)
    shown = _carried(model, structure, trains)
    return System(nothing, nothing, nothing, (), tuple(loads), (), probes, tuple(channels), carried=shown)


def _felt(structure: Structure, name: str, train: RigidTrain, at: int) -> tuple[list[Load], list[Channel]]:
    """Return forces of a contact as histories from some position on, and what they make of its channels."""
    where, contact = f"contacts.{name}", structure.model.driven[name]
    cam = structure.model.cams[contact.cam]
    needed, arm = train.contact_force(cam.event), derivative(cam.event)
    torque = load_sum(at, factor=arm)
    if not (isinstance(contact, CamContact) and contact.friction):
        loads = [Load(where, np.zeros(0), needed)]
        return loads, [Channel(f"{where}.force", "N", load_sum(at)), Channel(f"{where}.torque", "N m", torque)]
    rubs = rigid_friction(structure, name, contact, train.motions[0])
    loads = [
        Load(where, np.zeros(0), rubs.force(needed)),
        Load(f"{where}.friction", np.zeros(0), rubs.friction(needed)),
    ]
    return loads, [
        Channel(f"{where}.force", "N", load_sum(at)),
        Channel(f"{where}.torque", "N m", total(torque, load_sum(at + 1, factor=rub(cam)))),
        Channel(f"{where}.friction", "N", load_sum(at + 1, factor=lightened(cam))),
    ]


def _carried(model: Model, structure: Structure, trains: Mapping[str, RigidTrain]) -> Carried:
    """Return the motion of all components, as the results show it."""
    vectors, functions = [np.zeros((1, structure.dofs.size))], [constant(0.0)]
    for name, train in trains.items():
        event = model.cams[model.driven[name].cam].event
        vectors.append(train.motions)
        functions += [_Along(1.0, coordinate, event) for coordinate in train.coordinates]
    return Carried(structure.dofs.names, AngleVector(np.concatenate(vectors), tuple(functions)))


def _rigid_probe(structure: Structure, probe: Probe, trains: dict[str, RigidTrain]) -> Probe:
    """Return the probe as the rigid trains move it."""
    model = structure.model
    moving: list[list[AngleFunction]] = [[] for _ in probe.components]
    for name, train in trains.items():
        event = model.cams[model.driven[name].cam].event
        for component, shares in zip(moving, probe.rows @ train.motions.T, strict=True):
            component += [
                _Along(float(share), one, event)
                for share, one in zip(shares, train.coordinates, strict=True)
                if share != 0.0
            ]
    offsets = tuple(_Sum(tuple(component)) if component else None for component in moving)
    return Probe(probe.name, probe.components, np.zeros((len(probe.components), 0)), offsets)


@dataclass(frozen=True, eq=False)
class _Along(Following):
    """A share of a coordinate over the cam angle."""

    share: float
    coordinate: Coordinate
    event: Event

    def of(self, cam: Evaluated, order: int) -> FloatArray:
        key = id(self.coordinate), id(self.event)  # trains of several cams may share a coordinate
        h, h1, h2 = cam.once(key, lambda: self.coordinate(cam(self.event, 0)))
        if order == 0:
            return self.share * h
        slope = cam(self.event, 1)
        return self.share * (h1 * slope if order == 1 else h1 * cam(self.event, 2) + h2 * slope**2)


@dataclass(frozen=True, eq=False)
class _Sum(Following):
    """A sum of motions."""

    parts: tuple[AngleFunction, ...]

    def of(self, cam: Evaluated, order: int) -> FloatArray:
        return np.sum([cam(part, order) for part in self.parts], axis=0)
