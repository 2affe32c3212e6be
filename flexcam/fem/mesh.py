"""Mesh of members: nodes, members as chains of nodes, and named points."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from flexcam.core import FloatArray, IntArray, component_members, connected_components
from flexcam.core.errors import Fault, InputError, finite_array, refuse, suggest_name

Bools = np.ndarray[tuple[int], np.dtype[np.bool_]]


_GROUPS = ("lines", "points", "bodies", "links", "couplings")
_COINCIDENCE_TOLERANCE = 1e-9  # distance, relative to the mesh size, below which nodes count as coincident (rounding)


def _frozen_index(values: ArrayLike) -> IntArray:
    array = np.array(values)
    index = array.astype(np.intp)
    if array.size and not (array == index).all():
        raise refuse("node numbers", array.tolist(), "whole numbers")
    index.setflags(write=False)
    return index


@dataclass(frozen=True, eq=False)
class Mesh:
    """Nodes, members and named points; every array is copied and read-only.

    Parameters
    ----------
    nodes
        Coordinates, m, shape (n, 3), global axes.
    lines
        Member name to its node numbers in order along the member, shape (m + 1,) for m elements.
    points
        Point name to node numbers, shape (k,); a name of one node also names it in messages.
    bodies
        Name of a body between nodes, such as a superelement, to their numbers, shape (k,).
    links
        Name of a rigid link to its nodes, shape (k,): the leading one first, then those that follow it, which may lie
        at the same place.
    couplings
        Name of a spring or contact to its nodes, shape (k,), which may lie at the same place.
    joints
        Names of the links that do not pass all rotations.

    Raises
    ------
    InputError
        If a number is out of range, an element has no length, a member has no element, or two nodes coincide.

    Examples
    --------
    >>> mesh = Mesh([[0, 0, 0], [1, 0, 0]], {"bar": [0, 1]}, {"tip": [1]})
    >>> mesh.node("tip"), mesh.node_name(1), mesh.node_name(0)
    (1, 'tip', 'node 0')
    """

    nodes: FloatArray
    lines: Mapping[str, IntArray]
    points: Mapping[str, IntArray]
    bodies: Mapping[str, IntArray] = field(default_factory=dict[str, IntArray])
    links: Mapping[str, IntArray] = field(default_factory=dict[str, IntArray])
    couplings: Mapping[str, IntArray] = field(default_factory=dict[str, IntArray])
    joints: frozenset[str] = frozenset()

    def __reduce__(self) -> tuple[type[Mesh], tuple[object, ...]]:
        """Return the constructor and its arguments, for pickle and copy."""
        return type(self), (self.nodes, *(dict(getattr(self, groups)) for groups in _GROUPS), self.joints)

    def __post_init__(self) -> None:
        object.__setattr__(self, "nodes", finite_array("nodes", self.nodes, (None, 3)))
        for groups in _GROUPS:
            frozen = {name: _frozen_index(index) for name, index in getattr(self, groups).items()}
            object.__setattr__(self, groups, MappingProxyType(frozen))
        if faults := [*_range_faults(self)]:
            raise InputError(faults)
        places = number_places(self.nodes)
        if faults := [*_length_faults(self, places), *_duplicate_faults(self, places)]:
            raise InputError(faults)

    def node(self, name: str, where: str = "point") -> int:
        """Return the node number of a point name with a single node.

        Parameters
        ----------
        name
            Name of the point.
        where
            Location in the input, for the message.

        Returns
        -------
        int
            Row of `nodes`.

        Raises
        ------
        InputError
            If there is no such point, or it names several nodes.
        """
        index = self.select(name, where)
        if len(index) != 1:
            raise refuse(where, repr(name), "a point with one node", f"the name has {len(index)} nodes")
        return int(index[0])

    def select(self, name: str, where: str = "point") -> IntArray:
        """Return the node numbers of a named point.

        Parameters
        ----------
        name
            Name of the point.
        where
            Location in the input, for the message.

        Returns
        -------
        ndarray
            Rows of `nodes`, shape (k,).

        Raises
        ------
        InputError
            If there is no such point.
        """
        if name in self.points:
            return self.points[name]
        known = ", ".join(self.points) or "(the mesh names no points)"
        raise refuse(where, repr(name), f"a point of the mesh: {known}", remedy=suggest_name(name, self.points))

    def node_name(self, node: int) -> str:
        """Return the name of a node: that of its point, or its number.

        Parameters
        ----------
        node
            Row of `nodes`.

        Returns
        -------
        str
            Such as ``cam`` or ``node 7``.
        """
        for name, index in self.points.items():
            if len(index) == 1 and index[0] == node:
                return name
        return f"node {node}"

    @property
    def extent(self) -> float:
        """Diagonal of the bounding box of all nodes, m."""
        return float(np.linalg.norm(np.ptp(self.nodes, axis=0)))

    def elements(self) -> IntArray:
        """Return both node numbers of every element, shape (e, 2), member after member."""
        pairs = [np.column_stack([line[:-1], line[1:]]) for line in self.lines.values()]
        return np.concatenate(pairs) if pairs else np.zeros((0, 2), np.intp)

    def element_ranges(self) -> dict[str, slice]:
        """Return the range of each member's elements in `elements`."""
        ends = np.cumsum([0, *(len(line) - 1 for line in self.lines.values())]).tolist()
        return {name: slice(a, b) for name, a, b in zip(self.lines, ends[:-1], ends[1:], strict=True)}

    def on_members(self) -> Bools:
        """Return a mask of the nodes on members, shape (nodes,)."""
        used = np.zeros(len(self.nodes), dtype=bool)
        used[self.elements().ravel()] = True
        return used

    @cached_property
    def parts(self) -> list[IntArray]:
        """Node numbers of each connected part, ascending; members and bodies connect at shared nodes."""
        return self._connect(self.bodies)

    @cached_property
    def _linked_parts(self) -> tuple[list[IntArray], list[IntArray]]:
        """Node numbers of the parts that links connect too: all of them, and those with all rotations."""
        rigid = {name: nodes for name, nodes in self.links.items() if name not in self.joints}
        return self._connect({**self.bodies, **self.links}), self._connect({**self.bodies, **rigid})

    def _connect(self, bodies: Mapping[str, IntArray]) -> list[IntArray]:
        pairs = [np.column_stack([nodes[:-1], nodes[1:]]) for nodes in bodies.values()]
        ends = np.concatenate([self.elements(), *pairs])
        labels = connected_components(len(self.nodes), ends[:, 0], ends[:, 1])
        joined = np.unique(ends)
        return [joined[group] for group in component_members(labels[joined])]

    def connected_nodes(self, node: int, *, turning: bool = False) -> IntArray:
        """Return the nodes connected to a node by members, bodies and links, including the node itself.

        Parameters
        ----------
        node
            Row of `nodes`.
        turning
            Only those that turn with the node: joints separate them.

        Returns
        -------
        ndarray
            Rows of `nodes`, ascending, shape (k,).
        """
        parts = self._linked_parts[turning]
        return next((part for part in parts if (part == node).any()), np.array([node], dtype=np.intp))


def refine(mesh: Mesh, divisions: Mapping[str, int]) -> Mesh:
    """Return the mesh with every element of the given members divided into equal parts."""
    nodes = [mesh.nodes]
    lines: dict[str, IntArray] = {}
    count = len(mesh.nodes)
    for name, line in mesh.lines.items():
        parts = divisions.get(name, 1)
        share = np.arange(1, parts) / parts
        start, end = mesh.nodes[line[:-1], None], mesh.nodes[line[1:], None]
        nodes.append((start + share[:, None] * (end - start)).reshape(-1, 3))
        inner = count + np.arange((len(line) - 1) * (parts - 1)).reshape(len(line) - 1, parts - 1)
        lines[name] = np.append(np.column_stack([line[:-1], inner]).ravel(), line[-1])
        count += inner.size
    return replace(mesh, nodes=np.concatenate(nodes), lines=lines)


_MAX_FAULTS = 20  # maximum number of faults of one kind to report: in a mesh with thousands they have one cause


def _range_faults(mesh: Mesh) -> Iterator[Fault]:
    last = len(mesh.nodes) - 1
    for name, index in [*mesh.lines.items(), *mesh.points.items()]:
        if index.size and not 0 <= index.min() <= index.max() <= last:
            yield Fault(f"mesh group {name!r}", f"node {index.max()}", f"nodes 0 to {last}", "", "")
    for name, line in mesh.lines.items():
        if len(line) < 2:
            why = "a member has at least one element"
            yield Fault(f"member {name!r}", f"{len(line)} nodes", "two or more", why, "")


def number_places(nodes: FloatArray) -> IntArray:
    """Return the number of the place of each node, shape (n,); nodes that differ by rounding have the same place."""
    if not len(nodes):
        return np.zeros(0, dtype=np.intp)
    labels, tolerance = np.zeros(nodes.shape, dtype=np.intp), _COINCIDENCE_TOLERANCE * np.ptp(nodes, axis=0).max()
    for coordinates, label in zip(nodes.T, labels.T, strict=True):
        order = np.argsort(coordinates)
        label[order[1:]] = np.cumsum(np.diff(coordinates[order]) > tolerance)
    return np.unique(labels, axis=0, return_inverse=True)[1].ravel()


def coincident_nodes(places: IntArray, groups: Iterable[IntArray]) -> list[tuple[int, int]]:
    """Return pairs of nodes at the same place that no group of nodes joins: the first node there and another one."""
    chains = [index[np.argsort(places[index], kind="stable")] for index in groups]
    pairs = np.concatenate([np.zeros((0, 2), dtype=np.intp), *(np.column_stack([c[:-1], c[1:]]) for c in chains)])
    pairs = pairs[places[pairs[:, 0]] == places[pairs[:, 1]]]
    labels, first = connected_components(len(places), *pairs.T), np.unique(places, return_index=True)[1][places]
    return [(int(first[i]), i) for i in np.flatnonzero(labels != labels[first]).tolist()]


def _length_faults(mesh: Mesh, places: IntArray) -> Iterator[Fault]:
    ends, why = mesh.elements(), "an element needs a length"
    for element in np.flatnonzero(places[ends[:, 0]] == places[ends[:, 1]])[:_MAX_FAULTS].tolist():
        given = f"nodes {ends[element, 0]} and {ends[element, 1]} at the same place"
        yield Fault(f"element {element}", given, "two nodes apart", why, "merge the nodes or move one")


def _duplicate_faults(mesh: Mesh, places: IntArray) -> Iterator[Fault]:
    """Yield the faults of coincident nodes, which usually are a missing joint."""
    for first, other in coincident_nodes(places, [*mesh.links.values(), *mesh.couplings.values()])[:_MAX_FAULTS]:
        where, given = f"nodes {mesh.node_name(first)!r} and {mesh.node_name(other)!r}", mesh.nodes[other].tolist()
        why, remedy = "members meet only at a shared node", "list the node in the member, or move it"
        yield Fault(where, str(given), "one node at one place", why, remedy)


def chain(
    start: FloatArray | Sequence[float], end: FloatArray | Sequence[float], elements: int, name: str = "shaft"
) -> Mesh:
    """Return a straight member of equal elements with ends named ``start`` and ``end``."""
    if elements < 1:
        raise refuse("elements", elements, "a whole number, at least 1")
    line = np.arange(elements + 1)
    nodes = np.linspace(np.asarray(start, float), np.asarray(end, float), elements + 1)
    points = {"start": line[:1], "end": line[-1:], "inner": line[1:-1]}
    return Mesh(nodes, {name: line}, {key: index for key, index in points.items() if len(index)})
