"""What of a train nothing can move, in words."""

from __future__ import annotations

import numpy as np

from flexcam.fem import COMPONENTS
from flexcam.integrate import Reach, Still
from flexcam.linalg import FloatArray, IntArray
from flexcam.train.structure import Structure

_ALONG = 1e-6
"""Part by which a component may be off a member's axis, or off its cross section, to count as along or across."""


def left_out(structure: Structure, found: Reach) -> list[str]:
    """Return what of a structure nothing can move."""
    said = [f"{_place(structure, still.unknowns)}: {_reason(still)}" for still in found.still]
    return [f"{one} ({said.count(one)} times)" if said.count(one) > 1 else one for one in dict.fromkeys(said)]


def _reason(still: Still) -> str:
    if still.loaded:
        return "what loads it is constant and in balance"
    return "free and unloaded" if still.free else "nothing loads it"


def _place(structure: Structure, unknowns: IntArray) -> str:
    """Return members, motion and components of some unknowns, or their names where no member has them."""
    places = np.argwhere(structure.dofs.numbers >= 0)
    nodes, components = places[unknowns[unknowns < len(places)]].T
    touched: IntArray = np.flatnonzero(np.isin(structure.beams.nodes, nodes).any(axis=1))
    if len(nodes) < len(unknowns) or not len(touched):
        which: list[int] = unknowns.tolist()
        return ", ".join(structure.dofs.names[i] for i in which)
    ranges = structure.model.mesh.element_ranges()
    members = [name for name, part in ranges.items() if ((touched >= part.start) & (touched < part.stop)).any()]
    shown: list[int] = np.unique(components).tolist()
    motion = _motion(structure.beams.triads[touched, 0], shown)
    return f"{' and '.join(members)}: {motion} ({', '.join(COMPONENTS[c] for c in shown)})"


def _motion(axes: FloatArray, components: list[int]) -> str:
    """Return what some components are for members along some axes, shape (e, 3): along them, about them, or bending."""
    along = np.abs(axes).argmax(axis=1)
    if (along != along[0]).any() or np.abs(np.abs(axes[:, along[0]]) - 1.0).max() > _ALONG:
        return "motion"
    return " and ".join(dict.fromkeys(_kind(int(along[0]), c) for c in components))


def _kind(axis: int, component: int) -> str:
    """Return what a component, ux to rz, is for a member along an axis, x, y or z by number."""
    turns, direction = divmod(component, 3)
    if direction == axis:
        return "torsion" if turns else "axial motion"
    across = 3 - axis - direction if turns else direction
    return f"bending in {'xyz'[axis]}-{'xyz'[across]}"
