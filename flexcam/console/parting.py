"""Table of where models of a train part."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rich.table import Table

from flexcam.console.words import fixed
from flexcam.linalg import FloatArray
from flexcam.parting import MODELS, Forces, Speed, parts_at
from flexcam.terminal import table
from flexcam.units import shaft_name

_PAIRS = (("rigid", "bilateral"), ("bilateral", "unilateral"))


def parting_table(found: Sequence[Speed], scale: float, tolerance: float) -> Table:
    """Return least and largest contact force on the main lift by model."""
    rows = [(f"{scale * one.rpm:.6g}", *(_told(one.forces[name]) for name in MODELS)) for one in found]
    head = (f"{shaft_name(scale)} rpm", *(f"{name}, N" for name in MODELS))
    return table(f"Contact force on the main lift; {_where(found, scale, tolerance)}", head, rows)


def _told(forces: Forces | None) -> str:
    return "did not finish" if forces is None else f"{fixed(forces.least, 0)} to {fixed(forces.largest, 0)}"


def _where(found: Sequence[Speed], scale: float, tolerance: float) -> str:
    words: list[str] = []
    for first, second in _PAIRS:
        rpm = parts_at(found, first, second, tolerance)
        there = "do not part" if rpm is None else f"part at {scale * rpm:.6g} {shaft_name(scale)} rpm"
        words.append(f"{first} and {second} {there}")
    return ", ".join(words) + f" ({tolerance:.0%})"


def parting_json(found: Sequence[Speed], scale: float, tolerance: float) -> dict[str, object]:
    """Return the same as ``--json`` prints it."""
    part: dict[str, object] = {}
    for first, second in _PAIRS:
        rpm = parts_at(found, first, second, tolerance)
        part[f"{first}_{second}_part_rpm"] = None if rpm is None else scale * rpm
    forces = {
        name: [None if (one := speed.forces[name]) is None else [one.least, one.largest] for speed in found]
        for name in MODELS
    }
    return {
        "shaft": shaft_name(scale),
        "rpm": [scale * one.rpm for one in found],
        "forces_n": forces,
        **part,
        "tolerance": tolerance,
    }


def force_bands(found: Sequence[Speed]) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Return least and largest forces by model for a picture."""
    nothing = Forces(float("nan"), float("nan"))
    each = {name: [speed.forces[name] or nothing for speed in found] for name in MODELS}
    return {
        name: (np.array([one.least for one in forces]), np.array([one.largest for one in forces]))
        for name, forces in each.items()
    }
