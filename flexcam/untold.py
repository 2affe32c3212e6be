"""What a rigid train does not know or only presses through: shares of a closed seat, coils that touch.

May import what stands below `starting`.
"""

from __future__ import annotations

import math

import numpy as np

from flexcam.checks import FlexcamError
from flexcam.integrate import Problem, equilibrium, newmark, solve
from flexcam.system import ConstantSpeed
from flexcam.train import Model, build_system, shared_forces, touching_coils

_LARGEST = 3000
"""Unknowns up to which the flexible train is asked."""

_LIFTED = 1e-9
"""Part of its lift from which a cam counts as off its base circle."""


def shared(model: Model, speed: float) -> list[str]:
    """Return the cams that share a closed valve's springs with its seat, in words: rigid members cannot tell how."""
    return [
        f"Warning: contacts.{name}: no play parts the cam from a closed seat, and both share the {force:.4g} N of the "
        "springs by their stiffness: on the base circle the rigid train leaves all to the seat"
        + _left(model, name, speed)
        for name, force in shared_forces(model, speed).items()
    ]


def pressed_shut(model: Model, speed: float) -> list[str]:
    """Return the springs that a rigid train presses until their coils touch, in words as of a flexible one."""
    touching = touching_coils(model, speed).items()
    return [f"Warning: coils of {name!r} touch: {1e3 * beyond:.3g} mm beyond closed" for name, beyond in touching]


def _left(model: Model, contact: str, speed: float) -> str:
    """Return what the flexible train leaves to a cam on its base circle, in words; nothing where that is not known."""
    event = model.cams[model.driven[contact].cam].event
    low = _ANGLES[np.abs(event(_ANGLES, 0)) <= _LIFTED * event.height]
    if not len(low):
        return ""
    drive = ConstantSpeed(speed, float(low[0]))
    try:
        system = build_system(model, speed)
        if system.size > _LARGEST:
            return ""
        still = Problem(system, drive, 1e-6 / speed, 1, equilibrium(system, drive), engine="direct")
        force = float(solve(still, newmark()).channels[f"contacts.{contact}.force"][0])
    except FlexcamError:  # what a rigid train does not need may be missing
        return ""
    return f", the flexible one leaves {force:.4g} N to the cam"


_ANGLES = np.linspace(0.0, 2.0 * math.pi, 721)
"""Where a cam's base circle is sought, rad."""
