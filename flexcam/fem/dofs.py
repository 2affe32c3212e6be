"""Degrees of freedom: names, order and signs of the components of the nodes, and numbering of the free ones.

A node has six components in global axes: translations ``ux uy uz`` and rotations ``rx ry rz`` (right-hand rule). A beam
element has the six components of its first node, then those of its second, in local axes (x along the member). Axial
force is positive in tension.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexcam.core import FloatArray, IntArray
from flexcam.core.errors import finite_array, refuse, suggest_name
from flexcam.fem.mesh import Mesh

COMPONENTS = ("ux", "uy", "uz", "rx", "ry", "rz")
"""The six components of a node, in array order."""

ROTATIONS = COMPONENTS[3:]
"""Components that are rotations."""


def component(name: str, where: str = "component") -> int:
    """Return the index of a component among the six."""
    if name in COMPONENTS:
        return COMPONENTS.index(name)
    raise refuse(where, repr(name), ", ".join(COMPONENTS), remedy=suggest_name(name, COMPONENTS))


def direction(value: str | FloatArray | Sequence[float], where: str = "direction") -> FloatArray:
    """Return a direction as a row of the six components of a node.

    Its translations have the length one, and its rotations are arms in m, or of length one if it has no translations.
    """
    if isinstance(value, str):
        unit, name = np.zeros(6), value[1:] if value[:1] in ("+", "-") else value
        if name not in COMPONENTS:
            allowed = f"{', '.join(COMPONENTS)}, each also with a minus sign, or three or six numbers"
            raise refuse(where, repr(value), allowed, remedy=suggest_name(name, COMPONENTS))
        unit[COMPONENTS.index(name)] = -1.0 if value.startswith("-") else 1.0
        return unit
    entries = value if isinstance(value, np.ndarray | list | tuple) else [None]
    if any(isinstance(entry, bool) or not isinstance(entry, int | float) for entry in entries):
        raise refuse(where, value, _DIRECTIONS)
    six, vector = np.zeros(6), finite_array(where, value, (None,))
    if len(vector) not in (3, 6) or not vector.any():
        raise refuse(where, vector.tolist(), f"{_DIRECTIONS}, not all zero")
    six[: len(vector)] = vector
    return six / (np.linalg.norm(six[:3]) or np.linalg.norm(six[3:]))


_DIRECTIONS = "a component such as 'uy' or '-uy', or three or six numbers"


def rigid_motions(arms: FloatArray) -> FloatArray:
    """Return the components of points in six unit motions of a rigid body, shape (n, 6, 6), from their arms, m.

    A rigid body moves its points by ``u + theta x r``: H. Goldstein, Classical Mechanics, 3rd ed., sec. 4.8, for small
    rotations. The last axis has three translations, then three rotations.
    """
    motions = np.tile(np.eye(6), (len(arms), 1, 1))
    motions[:, :3, 3:] = np.swapaxes(np.cross(np.eye(3), arms[:, None]), 1, 2)
    return motions


_PARALLEL = 1e-6  # sine of the angle below which an orientation vector cannot define local y: six digits are lost there
_NEAR_VERTICAL = 0.02  # sine of the angle to global y below which the default orientation is global -x


def default_orientation(axis: FloatArray) -> FloatArray:
    """Return the default orientation vectors.

    The default is global y, so that a shaft along x has its local axes parallel to the global ones; for an element
    within about one degree of global y it is global -x, which is the same triad rotated by 90 degrees about z. A curved
    member that passes through global y, with a section that is not round, needs an explicit orientation.
    """
    vertical = np.hypot(axis[..., 0], axis[..., 2]) < _NEAR_VERTICAL
    return np.where(vertical[..., None], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0])


def triads(axes: FloatArray, orientations: FloatArray) -> FloatArray:
    """Return the local axes of elements as rows of rotation matrices.

    Local x runs along the element, local y lies in the plane of x and the orientation vector, on the side of the
    vector, and z = x cross y. With R the triad, ``u_local = R u_global``.
    """
    axial = np.sum(axes * orientations, axis=1, keepdims=True)
    transverse = orientations - axial * axes
    length = np.linalg.norm(transverse, axis=1)
    bad = np.flatnonzero(length <= _PARALLEL * np.linalg.norm(orientations, axis=1))
    if bad.size:
        raise refuse(
            f"orientation of element {bad[0]}", orientations[bad[0]].tolist(), "a vector that is not along the member",
            "the vector defines local y", "choose a vector across the member",
        )  # fmt: skip
    y = transverse / length[:, None]
    z = np.cross(axes, y).astype(float, copy=False)
    return np.stack([axes, y, z], axis=1) + 0.0  # + 0.0 changes -0.0 to 0.0


_ROUNDING = 1e-10  # fraction of the largest motion of a mode below which a node is at rest


@dataclass(frozen=True, eq=False)
class Ties:
    """Components of nodes that follow a leading node rigidly: ``u_c = T_cj u_j`` of the leading node."""

    leader: IntArray  #: leading node of each node, shape (nodes,); the node itself where none leads it
    matrices: FloatArray  #: T, shape (nodes, 6, 6), with zero rows for components that do not follow

    @property
    def tied(self) -> NDArray[np.bool_]:
        """Mask of the components that follow, shape (nodes, 6)."""
        return np.asarray(self.matrices.any(axis=-1))


def rigid_ties(mesh: Mesh, links: Mapping[str, Iterable[str]]) -> Ties | None:
    """Return the ties of rigid links, by name with the components that follow; None without links."""
    if not links:
        return None
    leader, matrices = np.arange(len(mesh.nodes)), np.zeros((len(mesh.nodes), 6, 6))
    for name, components in links.items():
        first, nodes = int(mesh.links[name][0]), mesh.links[name][1:]
        follow = [component(c) for c in components]
        leader[nodes] = first
        matrices[nodes[:, None], follow] = rigid_motions(mesh.nodes[nodes] - mesh.nodes[first])[:, follow]
    return Ties(leader, matrices)


@dataclass(frozen=True, eq=False)
class DofMap:
    """Numbers of the free components, node after node, ux to rz."""

    numbers: IntArray  #: shape (nodes, 6); -1 if a support constrains the component, or if it follows another node
    names: tuple[str, ...]  #: a name per free component, such as ``"cam.uy"``
    ties: Ties | None = None

    @property
    def size(self) -> int:
        """Number of degrees of freedom."""
        return len(self.names)

    def vector(self, node: int, direction: FloatArray) -> FloatArray:
        """Return the row that extracts the motion of a node along a direction."""
        return self.gather(np.array([node]), direction)

    def gather(self, nodes: IntArray, forces: FloatArray) -> FloatArray:
        """Return the forces on the unknowns, shape (size,), of forces and moments at nodes, shape (..., 6)."""
        result = np.zeros(self.size)
        for index, values in self.lead(nodes, forces):
            numbers = self.numbers[index].ravel()
            np.add.at(result, numbers[numbers >= 0], values.ravel()[numbers >= 0])
        return result

    def lead(self, nodes: IntArray, forces: FloatArray) -> list[tuple[IntArray, FloatArray]]:
        """Return nodes and forces that do the same work as forces at nodes, shape (...) and (..., 6).

        Forces on components without a number do no work at their own node; those that follow act on the leading node.
        """
        if self.ties is None:
            return [(nodes, forces)]
        on_leader = np.einsum("...c,...cj->...j", forces, self.ties.matrices[nodes])
        return [(nodes, forces), (self.ties.leader[nodes], on_leader)]

    def congruence(self, nodes: IntArray, matrices: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return the number of each row and the matrices, shape (e, r) and (e, r, r), in the unknowns of k nodes.

        Nodes have shape (e, k), matrices in global axes (e, 6 k, 6 k); -1 stands for a row without an unknown.
        """
        if self.ties is None or not self.ties.matrices[nodes].any():
            return self.numbers[nodes].reshape(len(nodes), -1), matrices
        size = matrices.shape[-1]
        T = np.zeros((len(nodes), size, 2 * size))
        T[:, np.arange(size), np.arange(size)] = 1.0
        for k in range(nodes.shape[1]):
            T[:, 6 * k : 6 * k + 6, size + 6 * k : size + 6 * k + 6] = self.ties.matrices[nodes[:, k]]
        all_nodes = np.concatenate([nodes, self.ties.leader[nodes]], axis=1)
        return self.numbers[all_nodes].reshape(len(nodes), -1), T.swapaxes(1, 2) @ matrices @ T

    @property
    def moving(self) -> NDArray[np.bool_]:
        """Mask of the components that can move, shape (nodes, 6)."""
        return self.numbers >= 0 if self.ties is None else (self.numbers >= 0) | self.ties.tied

    def extend(self, names: Iterable[str]) -> DofMap:
        """Return the numbering with additional unknowns after those of the nodes, each a motion along one line."""
        return replace(self, names=(*self.names, *names))

    def release(self, node: int, components: IntArray, called: str) -> DofMap:
        """Return the numbering with constrained components of a node released."""
        free, names = self.numbers >= 0, list(self.names)
        free[node, components] = True
        numbers = np.full(free.shape, -1, dtype=np.intp)
        numbers[free] = np.arange(np.count_nonzero(free))
        for place in components.tolist():
            names.insert(int(numbers[node, place]), f"{called}.{COMPONENTS[place]}")
        return replace(self, numbers=numbers, names=tuple(names))

    def unit(self, name: str) -> FloatArray:
        """Return the row that extracts an unknown by its name, shape (size,)."""
        row = np.zeros(self.size)
        row[self.names.index(name)] = 1.0
        return row

    def nodal(self, unknowns: FloatArray) -> FloatArray:
        """Return unknowns expanded to all nodes, zero where constrained."""
        padded = np.concatenate([unknowns, np.zeros((*unknowns.shape[:-1], 1))], axis=-1)
        values = padded[..., self.numbers]
        if self.ties is not None:
            nodes = np.flatnonzero(self.ties.tied.any(axis=1))
            leading = values[..., self.ties.leader[nodes], :]
            values[..., nodes, :] += np.einsum("ncj,...nj->...nc", self.ties.matrices[nodes], leading)
        return values

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
    mesh: Mesh, supports: Iterable[tuple[str, Iterable[str]]], single: Iterable[tuple[int, FloatArray]] = (),
    ties: Ties | None = None,
) -> DofMap:  # fmt: skip
    """Return the numbering of the free components of a mesh; leading nodes of ties have those that move others."""
    free = np.repeat(mesh.on_members()[:, None], 6, axis=1)
    for node, motion in single:
        free[node] |= motion != 0.0
    if ties is not None:
        np.logical_or.at(free, ties.leader, ties.matrices.any(axis=1))
        free &= ~ties.tied
    for point, components in supports:
        for name in components:
            free[mesh.select(point, f"supports.{point}"), component(name, f"supports.{point}")] = False
    numbers = np.full(free.shape, -1, dtype=np.intp)
    numbers[free] = np.arange(np.count_nonzero(free))
    labels = [f"node {n}" for n in range(len(mesh.nodes))]
    for point, index in reversed(list(mesh.points.items())):
        if len(index) == 1:
            labels[index[0]] = point
    pairs = zip(*(part.tolist() for part in np.nonzero(free)), strict=True)
    return DofMap(numbers, tuple(f"{labels[node]}.{COMPONENTS[i]}" for node, i in pairs), ties)
