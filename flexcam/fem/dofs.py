"""Degrees of freedom: numbering of the free components of the nodes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from operator import add

import numpy as np

from flexcam.core import FloatArray, IntArray
from flexcam.fem.frames import COMPONENTS, ROTATIONS, component
from flexcam.fem.mesh import Mesh

_ROUNDING = 1e-10  # fraction of the largest motion of a mode below which a node is at rest


@dataclass(frozen=True, eq=False)
class DofMap:
    """Numbers of the free components, node after node, ux to rz."""

    numbers: IntArray  #: shape (nodes, 6); -1 if a support constrains the component
    names: tuple[str, ...]  #: a name per free component, such as ``"cam.uy"``

    @property
    def size(self) -> int:
        """Number of degrees of freedom."""
        return len(self.names)

    def vector(self, node: int, direction: FloatArray) -> FloatArray:
        """Return the row that extracts the motion of a node along a direction."""
        row = np.zeros(self.size)
        free = self.numbers[node] >= 0
        row[self.numbers[node][free]] = direction[free]
        return row

    def extend(self, names: Iterable[str]) -> DofMap:
        """Return the numbering with additional unknowns after those of the nodes, each a motion along one line."""
        return DofMap(self.numbers, (*self.names, *names))

    def release(self, node: int, components: IntArray, called: str) -> DofMap:
        """Return the numbering with constrained components of a node released."""
        free, names = self.numbers >= 0, list(self.names)
        free[node, components] = True
        numbers = np.full(free.shape, -1, dtype=np.intp)
        numbers[free] = np.arange(np.count_nonzero(free))
        for place in components.tolist():
            names.insert(int(numbers[node, place]), f"{called}.{COMPONENTS[place]}")
        return DofMap(numbers, tuple(names))

    def unit(self, name: str) -> FloatArray:
        """Return the row that extracts an unknown by its name, shape (size,)."""
        row = np.zeros(self.size)
        row[self.names.index(name)] = 1.0
        return row

    def nodal(self, unknowns: FloatArray) -> FloatArray:
        """Return unknowns expanded to all nodes, zero where constrained."""
        padded = np.concatenate([unknowns, np.zeros((*unknowns.shape[:-1], 1))], axis=-1)
        return padded[..., self.numbers]

    def nodal_modes(self, shapes: FloatArray, size: float) -> FloatArray:
        """Return modes expanded to all nodes, with zeros where the motion of a node is only rounding.

        A mode of a rocker and its springs leaves other nodes at rest. Rounding there would look like a mode of the
        members in a scaled drawing.
        """
        arms = np.array([size if name.rpartition(".")[2] in ROTATIONS else 1.0 for name in self.names])
        largest = np.abs(arms * shapes).max(axis=-1, initial=0.0, keepdims=True)
        return self.nodal(np.where(np.abs(arms * shapes) < _ROUNDING * largest, 0.0, shapes))

    def rigid_motion(self, mesh: Mesh, direction: FloatArray) -> FloatArray:
        """Return the free components of a unit rigid-body motion about the origin."""
        motion = np.tile(direction, (len(mesh.nodes), 1))
        motion[:, :3] += np.cross(direction[3:], mesh.nodes)
        row = np.zeros(self.size)
        free = self.numbers >= 0
        row[self.numbers[free]] = motion[free]
        return row


def dof_map(
    mesh: Mesh, supports: Iterable[tuple[str, Iterable[str]]], single: Iterable[tuple[int, FloatArray]] = ()
) -> DofMap:
    """Return the numbering of the free components of a mesh."""
    free = np.repeat(mesh.on_members()[:, None], 6, axis=1)
    for node, moved in single:
        free[node] |= moved != 0.0
    for point, components in supports:
        for name in components:
            free[mesh.select(point, f"supports.{point}"), component(name, f"supports.{point}")] = False
    numbers = np.full(free.shape, -1, dtype=np.intp)
    numbers[free] = np.arange(np.count_nonzero(free))
    nodes, components = (part.tolist() for part in np.nonzero(free))
    ends = [f".{name}" for name in COMPONENTS]
    return DofMap(
        numbers, tuple(map(add, map(_node_names(mesh).__getitem__, nodes), map(ends.__getitem__, components)))
    )


def _node_names(mesh: Mesh) -> list[str]:
    names = [f"node {n}" for n in range(len(mesh.nodes))]
    for point, index in reversed(list(mesh.points.items())):
        if len(index) == 1:
            names[index[0]] = point
    return names
