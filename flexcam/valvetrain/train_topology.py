"""Topology of a train: nodes moving with a follower, rockers, and lash before the valve."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np

from flexcam.core import FloatArray
from flexcam.valvetrain.model import Model
from flexcam.valvetrain.parts import CamPair, Lash, Lever, NodeLash, Rocker, path_name, tip_name
from flexcam.valvetrain.structure import Structure, find_node, inner_name, spring_ends, spring_row


@lru_cache(maxsize=64)
def moved_nodes(model: Model, contact: CamPair) -> tuple[int, ...]:
    """Return the nodes moved by a follower through members, links and lash."""
    joined, found = _adjacency(model), dict[int, None]()
    if contact.follower in model.mesh.points:
        found |= dict.fromkeys(_nodes_by_distance(joined, model.mesh.node(contact.follower)))

    plays = [(play.ends[0], model.mesh.node(play.ends[1])) for play in model.lashes]
    while behind := [end for start, end in plays if end not in found and _is_driven(model, contact, start, found)]:
        found |= dict.fromkeys(_nodes_by_distance(joined, behind[0]))
    return tuple(found)


def _is_driven(model: Model, contact: CamPair, start: str, moved: Collection[int]) -> bool:
    """Return whether a node or point of a rocker moves with a follower and the nodes that it moves."""
    rocker = model.rocker_at(start)
    end = start if rocker is None else rocker.start
    return end == contact.follower or (end in model.mesh.points and model.mesh.node(end) in moved)


def lashes_before(model: Model, node: int, plays: Sequence[NodeLash]) -> list[NodeLash]:
    """Return the lash elements in series between nodes before a node moves."""
    found: list[NodeLash] = []
    left = list(plays)
    while before := [one for one in left if model.mesh.node(one.ends[1]) in model.connected_nodes(node)]:
        found.insert(0, before[0])
        left.remove(before[0])
        if before[0].ends[0] not in model.mesh.points:  # a rocker's point
            break
        node = model.mesh.node(before[0].ends[0])
    return found


def _adjacency(model: Model) -> dict[int, list[int]]:
    """Return adjacency by members, superelements and links."""
    points = model.mesh.points
    ends = [(one.at, one.to) for one in model.springs.values() if one.link and one.to is not None]
    links = [[model.mesh.node(a), model.mesh.node(b)] for a, b in ends if a in points and b in points]
    found: dict[int, list[int]] = {}
    bodies = [pair for nodes in model.mesh.bodies.values() for pair in pairwise(nodes.tolist())]
    for a, b in [*model.mesh.elements().tolist(), *links, *bodies]:
        found.setdefault(a, []).append(b)
        found.setdefault(b, []).append(a)
    return found


def _nodes_by_distance(joined: Mapping[int, Sequence[int]], start: int) -> list[int]:
    """Return the nodes connected to a node, nearest first."""
    reached = {start: None}
    waiting = [start]
    for node in waiting:  # grows as it goes
        fresh = [one for one in joined.get(node, ()) if one not in reached]
        waiting += dict.fromkeys(fresh)
        reached |= dict.fromkeys(fresh)
    return list(reached)


def rocker_of(model: Model, contact: CamPair) -> Rocker | None:
    """Return the rocker driven by or identical to a follower, or None."""
    return _rocker_at(model, contact, moved_nodes(model, contact))


def _rocker_at(model: Model, contact: CamPair, moved: Collection[int]) -> Rocker | None:
    """Return the rocker that starts at a follower or at a node that it moves, or None."""
    return next((one for one in model.rockers.values() if _is_driven(model, contact, one.start, moved)), None)


def driving_contact(model: Model, point: str) -> str | None:
    """Return the contact of the cam that moves a point, through members, links, lash and a rocker; None without one."""
    for name, contact in model.cam_contacts.items():
        rocker = rocker_of(model, contact)
        own = {contact.follower, rocker.point if rocker else ""}
        if point in own or (point in model.mesh.points and model.mesh.node(point) in moved_nodes(model, contact)):
            return name
    return None


@lru_cache(maxsize=4)
def largest_lashes(model: Model) -> Mapping[str, float]:
    """Return the largest lash that the lift of each cam takes up, reduced to the follower, m."""
    moved = [(contact, moved_nodes(model, contact)) for contact in model.cam_contacts.values()]
    largest = dict.fromkeys(model.cams, 0.0)
    for play in model.contacts.values():
        if isinstance(play, Lash):
            gap = _accumulated_lash(model, play)
            cams = {contact.cam for contact, nodes in moved if _is_in_train(model, contact, nodes, play)}
            largest |= {cam: max(largest[cam], gap) for cam in cams or model.cams}
    return largest


def _accumulated_lash(model: Model, play: Lash) -> float:
    """Return a lash plus those before it, reduced to the follower, m."""
    start = play.ends[0] if play.ends else ""
    rocker = model.rockers[play.rocker] if play.rocker else model.rocker_at(start)
    start = rocker.start if rocker else start
    before = lashes_before(model, model.mesh.node(start), model.lashes) if start in model.mesh.points else []
    return play.gap / (rocker.ratio if rocker else 1.0) + sum(one.gap for one in before)


def _is_in_train(model: Model, contact: CamPair, moved: Collection[int], play: Lash) -> bool:
    """Return whether a lash is in the train of a contact that moves some nodes."""
    if play.ends is not None:
        return _is_driven(model, contact, play.ends[0], moved)
    return play.rocker is not None and model.rockers[play.rocker] is _rocker_at(model, contact, moved)


def complete_motion(structure: Structure, motion: FloatArray) -> FloatArray:
    """Return a motion of nodes with dependent points and springs, lash closed and springs in proportion."""
    moved = motion.copy()
    for _ in [None, *structure.model.lashes]:  # each pass adds at least one lash element in any order
        further = _follow_links(structure, _transmit_through_lash(structure, moved))
        if np.array_equal(further, moved):
            break
        moved = further
    for rocker in structure.model.rockers.values():
        driven = float(structure.row(rocker.start, rocker.direction) @ moved)
        for name, share in _shares(structure, rocker).items():
            moved += structure.dofs.unit(name) * share * driven
    return with_springs(structure, _follow_links(structure, _transmit_through_lash(structure, moved)))


def with_springs(structure: Structure, motion: FloatArray) -> FloatArray:
    """Return a motion with springs whose parts deform by their compliances."""
    moved = motion.copy()
    for name, spring in structure.model.springs.items():
        ends = [float(row @ motion) for row in spring_ends(structure, name, spring)]
        borders: list[float] = (np.cumsum(spring.compliances) / spring.compliances.sum()).tolist()
        for i, part in enumerate(borders[:-1], start=1):
            own = structure.dofs.unit(inner_name(name, i))
            moved += own * ((1.0 - part) * ends[1] + part * ends[0] - float(own @ motion))
    return moved


def rigid_shift(structure: Structure, end: str, direction: FloatArray) -> FloatArray:
    """Return the rigid translation of all nodes connected to a node, for a unit displacement along a direction.

    If supports guide at an angle to the direction, the unit is the component along it.
    """
    motion = np.zeros(structure.dofs.size)
    numbers = structure.dofs.numbers[structure.model.mesh.connected_nodes(structure.model.mesh.node(end))]
    motion[numbers[numbers >= 0]] = np.broadcast_to(direction, numbers.shape)[numbers >= 0]
    along = float(structure.row(end, direction) @ motion)
    return motion / along if along else motion


def _transmit_through_lash(structure: Structure, motion: FloatArray) -> FloatArray:
    """Return a motion transmitted through lash between nodes, all closed."""
    moved = motion.copy()
    for play in structure.model.lashes:
        driven, pushed = (float(structure.row(end, play.direction) @ moved) for end in play.ends)
        if driven != 0.0 and pushed == 0.0:
            moved += driven * rigid_shift(structure, play.ends[1], play.direction)
    return moved


def _follow_links(structure: Structure, motion: FloatArray) -> FloatArray:
    """Return a motion with points that follow through link springs."""
    moved = motion.copy()
    links = [(one.direction, (one.at, one.to)) for one in structure.model.springs.values() if one.link and one.to]
    for _ in links:  # each pass adds at least one link
        for direction, ends in links:
            drawn = [float(structure.row(end, direction) @ moved) for end in ends]
            for still, (other, end) in enumerate(zip(reversed(drawn), ends, strict=True)):
                if drawn[still] == 0.0 and other != 0.0 and structure.is_node(end):
                    moved += other * rigid_shift(structure, end, direction)
    return moved


def _shares(structure: Structure, rocker: Rocker) -> dict[str, float]:
    """Return the motion of the unknowns of a rocker per motion of its driven end, as installed with lash closed."""
    own = {rocker.point: rocker.ratio}
    if isinstance(rocker, Lever):
        name = structure.name_of(rocker)
        own |= {path_name(name): 1.0 / math.cos(rocker.angles[0]), tip_name(name): rocker.ratio}
    return {name: share for name, share in own.items() if name in structure.dofs.names}


_MOTION_TOLERANCE = 1e-9  # fraction of a motion that counts as zero


def follower_motion(structure: Structure, contact: CamPair, node: int) -> FloatArray:
    """Return the unit rigid motion along the lift of all nodes connected to a follower by members.

    In the plane of the cam the motion satisfies the supports: a finger rotates about its pivot, each point by ``phi x
    (x - x_pivot)`` (J. L. Meriam and L. G. Kraige, Engineering Mechanics: Dynamics, ch. 5). If the supports allow
    several motions, the one of minimum spring energy is used, as in equilibrium (C. L. Dym and I. H. Shames, Solid
    Mechanics: A Variational Approach (1973), ch. 3), without parts after a lash: a finger on a stiff spring under its
    pivot rotates about the pivot, and the spring deflects under its force. Motions without spring energy are zero. A
    part constrained along the lift itself, which bends, moves in its free components.
    """
    numbers = structure.dofs.numbers[structure.model.mesh.connected_nodes(node)]
    fields, free = _fields(structure, contact, node), numbers >= 0
    motions = np.zeros((len(fields), structure.dofs.size))
    motions[:, numbers[free]] = fields[:, free]
    asked, ways = _support_combination(fields[:, ~free])
    if asked is None:
        return motions[0]
    begun, beside = motions[0] + asked @ motions[1:], ways @ motions[1:]
    if not len(beside):
        return begun
    rows = _deformation_rows(structure)
    bent = np.array([rows @ complete_motion(structure, one) for one in (begun, *beside)]).T
    return begun + _least_squares(bent[:, 1:], -bent[:, 0]) @ beside


def _fields(structure: Structure, contact: CamPair, node: int) -> FloatArray:
    """Return motions of the nodes connected to a node, shape (k, m, 6): along the lift, across it, and rotation.

    The rotation is about the node, scaled by the length of the part; a single node does not rotate.
    """
    mesh, axis = structure.model.mesh, np.asarray(contact.shaft_axis)
    away = mesh.nodes[mesh.connected_nodes(node)] - mesh.nodes[node]
    turned = np.concatenate([np.cross(axis, away), np.broadcast_to(axis, away.shape)], axis=1, dtype=np.float64)
    length = float(np.linalg.norm(away, axis=1).max())
    shifts = [np.broadcast_to(one, turned.shape) for one in (contact.direction, contact.across)]
    return np.array([*shifts, *([turned / length] if length > 0.0 else [])])


def _support_combination(held: FloatArray) -> tuple[FloatArray | None, FloatArray]:
    """Return the combination of other motions required by supports for the first, and the free combinations.

    Combinations have the shape (k, h); None if the supports prevent the motion.
    """
    straight, others = held[0], held[1:]
    _, sizes, ways = np.linalg.svd(others.T, full_matrices=True)
    asked = _least_squares(others.T, -straight)
    still = np.abs(straight + asked @ others).max(initial=0.0) <= _MOTION_TOLERANCE
    return asked if still else None, ways[int(np.count_nonzero(sizes > _MOTION_TOLERANCE)) :]


def _least_squares(matrix: FloatArray, wanted: FloatArray) -> FloatArray:
    """Return the minimum-norm least-squares coefficients of columns; rounding is not a column."""
    return np.linalg.lstsq(matrix, wanted, rcond=_MOTION_TOLERANCE)[0].astype(np.float64, copy=False)


def _deformation_rows(structure: Structure) -> FloatArray:
    """Return rows of the deformation of springs, and of lash to fixed parts, times the square root of stiffness."""
    model = structure.model
    rows = [np.sqrt(one.stiffness) * spring_row(structure, name, one) for name, one in model.springs.items()]
    for play in model.lashes:
        first, second = (structure.row(end, play.direction) for end in play.ends)
        if not (first.any() and second.any()):
            rows.append(np.sqrt(play.part.stiffness) * (first - second))
    return np.array(rows).reshape(-1, structure.dofs.size)


@dataclass(frozen=True, eq=False)
class FollowerTrain:
    """Parts moving with a follower as one rigid body along the lift."""

    motion: FloatArray  #: unit motion of its unknowns along the lift, shape (n,)
    #: `mass`, `stiffness`: kg and N/m of that motion, at the follower
    mass: float
    stiffness: float


def follower_train(structure: Structure, contact: CamPair, where: str) -> FollowerTrain:
    """Return the rigid body of a follower and its attached parts: it translates, or rotates about a pivot.

    Without a pivot, the motion has minimum spring energy.
    """
    if structure.is_node(contact.follower):
        node = find_node(structure.model, contact.follower, where)
        motion = follower_motion(structure, contact, node)
    else:
        motion = structure.row(contact.follower, contact.direction, where)
    motion = complete_motion(structure, motion)
    mass, stiffness = structure.mass, structure.stiffness
    return FollowerTrain(motion, float(motion @ mass.times(motion)), float(motion @ stiffness.times(motion)))
