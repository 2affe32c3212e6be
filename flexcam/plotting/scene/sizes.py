"""Default sizes of drawn parts that a case does not give, each with a note."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from flexcam.cams import FlatFollower, Follower, cam_profile
from flexcam.valvetrain import Cam, Model, Spring, valve_ratio

SHEAR_MODULUS = 79.3e9
"""Shear modulus of spring steel, Pa, used to find the number of coils from rate and wire."""

_COILS = 6.0
"""Number of coils of a spring without wire data."""


@dataclass(eq=False)
class Notes:
    """Notes on parts drawn with a default size."""

    _said: dict[str, list[str]] = field(default_factory=dict[str, list[str]])

    def record(self, what: str, name: str, size: float, why: str) -> float:
        """Return a size, m, and record a note: the kind of part, its name, and the reason."""
        self._said.setdefault(f"{what} {{}}: {1e3 * size:.3g} mm, {why}", []).append(name)
        return size

    @property
    def lines(self) -> tuple[str, ...]:
        """Sentences for the notes; parts of equal size share one."""
        return tuple(text.format(", ".join(dict.fromkeys(names))) for text, names in self._said.items())


def model_size(model: Model) -> float:
    """Return the diagonal of the bounding box of all nodes, m."""
    return model.mesh.extent or 0.1


def valve_lift(model: Model) -> float:
    """Return the maximum valve lift of the rigid train, m; a tenth of the model size without a driven valve."""
    lifts = [abs(cam.event.height * valve_ratio(model, name)) for name, cam in model.cams.items()]
    return max(lifts, default=0.0) or 0.1 * model_size(model)


def default_follower(name: str, cam: Cam, distance: float, notes: Notes) -> Follower:
    """Return the follower with which a cam is drawn."""
    if cam.follower is not None:
        return cam.follower
    base = distance if distance > 0.0 else 3.0 * cam.event.height
    return FlatFollower(notes.record("base circle of cam", name, base, "to its follower's node, under a flat face"))


def lobe_width(name: str, cam: Cam, follower: Follower, notes: Notes) -> float:
    """Return the width of a lobe, m."""
    if cam.width is not None:
        return cam.width
    return notes.record("width of cam", name, 0.7 * follower.base_radius, "0.7 of its base radius")


def face_radius(cam: Cam, follower: Follower, width: float) -> float:
    """Return the radius of a flat face that covers the whole contact with a margin of a tenth, m."""
    away = float(np.abs(cam_profile(cam.event, follower, turn=cam.turn).offset).max())
    return max(1.1 * math.hypot(away, 0.5 * width), 0.5 * follower.base_radius)


@dataclass(frozen=True)
class CoilSizes:
    """Sizes of a drawn spring: mean coil diameter, wire diameter and installed length, m, and number of coils."""

    diameter: float
    wire: float
    length: float
    coils: float


def coil_sizes(name: str, spring: Spring, diameter: float, travel: float, notes: Notes) -> CoilSizes:
    """Return the sizes of a drawn spring."""
    if spring.wire is not None:
        D, d = spring.wire.coil_diameter, spring.wire.diameter
        coils = SHEAR_MODULUS * d**4 / (8.0 * D**3 * spring.stiffness) if spring.stiffness > 0.0 else _COILS
    else:
        D, coils = notes.record("coil of spring", name, diameter, "wire from its rate, six coils of steel"), _COILS
        d = min((8.0 * D**3 * coils * spring.stiffness / SHEAR_MODULUS) ** 0.25, D / 5.0)
    d, coils = max(d, D / 40.0), min(max(coils, 2.0), 20.0)
    room = spring.clash_travel or 1.4 * travel
    return CoilSizes(
        D, d, notes.record("length of spring", name, (coils + 2.0) * d + room, "its coils and their travel"), coils
    )
