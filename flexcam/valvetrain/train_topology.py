"""What a cam drives: the nodes that move with its follower, its rocker, and the play before its valve."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from flexcam.core import FloatArray
from flexcam.valvetrain.model import Model
from flexcam.valvetrain.parts import Adjuster, CamContact, Lash, Lever, Play, PublishedLoad, Rocker, path_name, tip_name
from flexcam.valvetrain.structure import Structure, inner_name, spring_ends, spring_row

Driven = PublishedLoad | CamContact


def moved_nodes(model: Model, contact: Driven) -> list[int]:
    """Return the nodes that a follower moves through members, links and plays."""
    if contact.follower not in model.mesh.points:
        return []
    joined = _joined(model)
    found = dict.fromkeys(_outward(joined, model.mesh.node(contact.follower)))
    plays = [(model.mesh.node(play.ends[0]), model.mesh.node(play.ends[1])) for play in model.plays]
    while behind := [end for start, end in plays if start in found and end not in found]:
        found |= dict.fromkeys(_outward(joined, behind[0]))
    return list(found)


def plays_before(model: Model, node: int, plays: Sequence[Play]) -> list[Play]:
    """Return the plays between nodes that are taken up one after the other before a node moves."""
    found: list[Play] = []
    left = list(plays)
    while before := [one for one in left if model.mesh.node(one.ends[1]) in model.connected(node)]:
        found.insert(0, before[0])
        left.remove(before[0])
        node = model.mesh.node(before[0].ends[0])
    return found


def _joined(model: Model) -> dict[int, list[int]]:
    """Return by node the nodes that members and links join to it."""
    points = model.mesh.points
    ends = [(one.at, one.to) for one in model.springs.values() if one.link and one.to is not None]
    links = [[model.mesh.node(a), model.mesh.node(b)] for a, b in ends if a in points and b in points]
    found: dict[int, list[int]] = {}
    for a, b in [*model.mesh.elements().tolist(), *links]:
        found.setdefault(a, []).append(b)
        found.setdefault(b, []).append(a)
    return found


def _outward(joined: Mapping[int, Sequence[int]], start: int) -> list[int]:
    """Return the nodes that are joined to a node in any number of steps, nearest first."""
    reached = {start: None}
    waiting = [start]
    for node in waiting:  # grows as it goes
        fresh = [one for one in joined.get(node, ()) if one not in reached]
        waiting += dict.fromkeys(fresh)
        reached |= dict.fromkeys(fresh)
    return list(reached)


def rocker_of(model: Model, contact: Driven) -> Rocker | None:
    """Return the rocker that a follower drives or is, or None."""
    nodes, points = set(moved_nodes(model, contact)), model.mesh.points
    own = (
        one
        for one in model.rockers.values()
        if one.start == contact.follower or (one.start in points and model.mesh.node(one.start) in nodes)
    )
    return next(own, None)


def play_of(model: Model, cam: str) -> float:
    """Return the largest play that a cam's lift takes up, as its follower sees it."""
    gaps = [0.0]
    for play in model.contacts.values():
        if isinstance(play, Lash):
            cams = {contact.cam for contact in model.driven.values() if _within(model, contact, play)}
            if not cams or cam in cams:
                gaps.append(_taken_up(model, play))
    return max(gaps)


def _taken_up(model: Model, play: Lash) -> float:
    """Return a play with those before it, as the follower sees them, m."""
    rocker = model.rockers[play.rocker] if play.rocker else None
    start = rocker.start if rocker else play.ends[0] if play.ends else ""
    before = plays_before(model, model.mesh.node(start), model.plays) if start in model.mesh.points else []
    return play.gap / (rocker.ratio if rocker else 1.0) + sum(one.gap for one in before)


def _within(model: Model, contact: Driven, play: Lash) -> bool:
    """Tell whether a play is in the train of a contact."""
    if play.ends is not None:
        return model.mesh.node(play.ends[0]) in moved_nodes(model, contact)
    return play.rocker is not None and model.rockers[play.rocker] is rocker_of(model, contact)


def complete_motion(structure: Structure, motion: FloatArray) -> FloatArray:
    """Return a motion of nodes with points and springs following: no play is open, springs stretch evenly."""
    moved = motion
    for _ in [None, *structure.model.plays]:  # each pass goes on by one play at least, whatever their order
        moved = _linked(structure, _pushed_on(structure, moved))
    for rocker in structure.model.rockers.values():
        driven = float(structure.row(rocker.start, rocker.direction) @ moved)
        for name, share in _shares(structure, rocker).items():
            moved += structure.dofs.unit(name) * share * driven
    return with_springs(structure, _linked(structure, moved))


def with_springs(structure: Structure, motion: FloatArray) -> FloatArray:
    """Return a motion with the inner parts of springs evenly between their ends."""
    moved = motion.copy()
    for name, spring in structure.model.springs.items():
        ends = [float(row @ motion) for row in spring_ends(structure, name, spring)]
        for i in range(1, spring.elements):
            own, part = structure.dofs.unit(inner_name(name, i)), i / spring.elements
            moved += own * ((1.0 - part) * ends[1] + part * ends[0] - float(own @ motion))
    return moved


def rigid_shift(structure: Structure, end: str, direction: FloatArray) -> FloatArray:
    """Return the motion of everything that members connect to a node, by which this goes a unit along a direction.

    What supports guide at an angle to the direction goes farther: the unit is its part along it.
    """
    motion = np.zeros(structure.dofs.size)
    numbers = structure.dofs.numbers[structure.model.mesh.connected(structure.model.mesh.node(end))]
    motion[numbers[numbers >= 0]] = np.broadcast_to(direction, numbers.shape)[numbers >= 0]
    along = float(structure.row(end, direction) @ motion)
    return motion / along if along else motion


def _pushed_on(structure: Structure, motion: FloatArray) -> FloatArray:
    """Return a motion with what plays between nodes push along, no play being open."""
    moved = motion.copy()
    for play in structure.model.plays:
        driven, pushed = (float(structure.row(end, play.direction) @ moved) for end in play.ends)
        if driven != 0.0 and pushed == 0.0:
            moved += driven * rigid_shift(structure, play.ends[1], play.direction)
    return moved


def _linked(structure: Structure, motion: FloatArray) -> FloatArray:
    """Return a motion with the points that follow through springs that stand for parts of the train."""
    moved = motion.copy()
    links = [(one.direction, (one.at, one.to)) for one in structure.model.springs.values() if one.link and one.to]
    for _ in links:  # each pass goes on by one link at least
        for direction, ends in links:
            drawn = [float(structure.row(end, direction) @ moved) for end in ends]
            for still, (other, end) in enumerate(zip(reversed(drawn), ends, strict=True)):
                if drawn[still] == 0.0 and other != 0.0 and structure.is_node(end):
                    moved += other * rigid_shift(structure, end, direction)
    return moved


def _shares(structure: Structure, rocker: Rocker) -> dict[str, float]:
    """Return what the unknowns of a rocker move per motion of its driven end, as installed, no play being open."""
    own = {rocker.point: rocker.ratio}
    if isinstance(rocker, Lever):
        name = structure.name_of(rocker)
        own |= {path_name(name): 1.0 / math.cos(rocker.angles[0]), tip_name(name): rocker.ratio}
    return {name: share for name, share in own.items() if name in structure.dofs.names}


_SLIGHT = 1e-9
"""Part of a motion that counts as none."""


def follower_motion(structure: Structure, contact: CamContact | PublishedLoad, node: int) -> FloatArray:
    """Return the unit motion along the lift of everything that members connect to a follower's node.

    In the plane of the cam it moves across the lift and turns as its supports ask: a finger about its pivot, each point
    by ``phi x (x - x_pivot)`` (J. L. Meriam and L. G. Kraige, Engineering Mechanics: Dynamics, ch. 5). Where supports
    leave several ways, springs are bent with the least energy, as in balance (C. L. Dym and I. H. Shames, Solid
    Mechanics: A Variational Approach (1973), ch. 3), but for what is behind a play: a finger on a stiff spring under
    its pivot turns about that, and the spring yields by its force over its stiffness. What costs none does not move.
    What supports hold along the lift itself, so that it bends, goes along it in what they leave free.
    """
    numbers = structure.dofs.numbers[structure.model.mesh.connected(node)]
    fields, free = _fields(structure, contact, node), numbers >= 0
    motions = np.zeros((len(fields), structure.dofs.size))
    motions[:, numbers[free]] = fields[:, free]
    asked, ways = _supported(fields[:, ~free])
    if asked is None:
        return motions[0]
    begun, beside = motions[0] + asked @ motions[1:], ways @ motions[1:]
    if not len(beside):
        return begun
    rows = _bent(structure)
    bent = np.array([rows @ complete_motion(structure, one) for one in (begun, *beside)]).T
    return begun + _least(bent[:, 1:], -bent[:, 0]) @ beside


def _fields(structure: Structure, contact: CamContact | PublishedLoad, node: int) -> FloatArray:
    """Return motions of what is joined to a node, shape (k, m, 6): along the lift, across it, turning about the node.

    The last is by the length of it all; a single node does not turn.
    """
    mesh, axis = structure.model.mesh, np.asarray(contact.shaft_axis)
    away = mesh.nodes[mesh.connected(node)] - mesh.nodes[node]
    across = np.concatenate([np.cross(contact.direction[:3], axis), np.zeros(3)], dtype=np.float64)
    turned = np.concatenate([np.cross(axis, away), np.broadcast_to(axis, away.shape)], axis=1, dtype=np.float64)
    length = float(np.linalg.norm(away, axis=1).max())
    shifts = [np.broadcast_to(one, turned.shape) for one in (contact.direction, across)]
    return np.array([*shifts, *([turned / length] if length > 0.0 else [])])


def _supported(held: FloatArray) -> tuple[FloatArray | None, FloatArray]:
    """Return what of other motions supports ask beside the first, and the ways of these that they leave free.

    All are given where supports hold them, shape (k, h); None where they cannot hold still.
    """
    straight, others = held[0], held[1:]
    _, sizes, ways = np.linalg.svd(others.T, full_matrices=True)
    asked = _least(others.T, -straight)
    still = np.abs(straight + asked @ others).max(initial=0.0) <= _SLIGHT
    return asked if still else None, ways[int(np.count_nonzero(sizes > _SLIGHT)) :]


def _least(matrix: FloatArray, wanted: FloatArray) -> FloatArray:
    """Return the smallest amounts of columns that come nearest to what is wanted; rounding is no column."""
    return np.linalg.lstsq(matrix, wanted, rcond=_SLIGHT)[0].astype(np.float64, copy=False)


def _bent(structure: Structure) -> FloatArray:
    """Return the rows of what springs, and plays on what is held, are bent by, by the root of their stiffness."""
    model = structure.model
    rows = [np.sqrt(one.stiffness) * spring_row(structure, name, one) for name, one in model.springs.items()]
    for one in model.contacts.values():
        if isinstance(one, Lash | Adjuster) and one.ends is not None and one.direction is not None:
            ends = [structure.row(end, one.direction) for end in one.ends]
            rows += [np.sqrt(one.stiffness) * (ends[0] - ends[1])] * (not all(end.any() for end in ends))
    return np.array(rows).reshape(-1, structure.dofs.size)
