"""Topology of a train: nodes that move with a follower, rockers, and lash before the valve."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import lru_cache
from itertools import pairwise

from flexcam.valvetrain.model import Model
from flexcam.valvetrain.parts import Adjuster, CamPair, Lash, NodeLash, Rocker


@lru_cache(maxsize=64)
def moved_nodes(model: Model, contact: CamPair) -> tuple[int, ...]:
    """Return the nodes moved by a follower through members, links and lash."""
    found = dict[int, None]()
    if contact.follower in model.mesh.points:
        found |= dict.fromkeys(connected_nodes(model, model.mesh.node(contact.follower)))

    plays = [(play.ends[0], model.mesh.node(play.ends[1])) for play in model.lashes]
    while behind := [end for start, end in plays if end not in found and _is_driven(model, contact, start, found)]:
        found |= dict.fromkeys(connected_nodes(model, behind[0]))
    return tuple(found)


def _is_driven(model: Model, contact: CamPair, start: str, moved: Collection[int]) -> bool:
    """Return whether a node or point of a rocker moves with a follower and the nodes that it moves."""
    rocker = model.rocker_points.get(start)
    end = start if rocker is None else rocker.start
    return end == contact.follower or (end in model.mesh.points and model.mesh.node(end) in moved)


def lashes_before(model: Model, node: int, plays: Sequence[NodeLash]) -> list[NodeLash]:
    """Return the lash elements in series between nodes before a node moves."""
    found: list[NodeLash] = []
    left = list(plays)
    while before := [one for one in left if model.mesh.node(one.ends[1]) in connected_nodes(model, node)]:
        found.insert(0, before[0])
        left.remove(before[0])
        if before[0].ends[0] not in model.mesh.points:  # a rocker's point
            break
        node = model.mesh.node(before[0].ends[0])
    return found


@lru_cache(maxsize=4)
def _adjacency(model: Model) -> dict[int, list[int]]:
    """Return adjacency by members, superelements and links of both kinds."""
    points = model.mesh.points
    ends = [(one.at, one.to) for one in model.springs.values() if one.link and one.to is not None]
    links = [[model.mesh.node(a), model.mesh.node(b)] for a, b in ends if a in points and b in points]
    found: dict[int, list[int]] = {}
    groups = *model.mesh.bodies.values(), *model.mesh.links.values()
    bodies = [pair for nodes in groups for pair in pairwise(nodes.tolist())]
    for a, b in [*model.mesh.elements().tolist(), *links, *bodies]:
        found.setdefault(a, []).append(b)
        found.setdefault(b, []).append(a)
    return found


def connected_nodes(model: Model, node: int) -> list[int]:
    """Return the nodes connected to a node by members, superelements and links, nearest first, with the node itself."""
    joined, reached = _adjacency(model), {node: None}
    waiting = [node]
    for near in waiting:  # grows as it goes
        fresh = dict.fromkeys(one for one in joined.get(near, ()) if one not in reached)
        waiting += fresh
        reached |= fresh
    return waiting


def rocker_of(model: Model, contact: CamPair) -> Rocker | None:
    """Return the rocker driven by or identical to a follower, or None."""
    moved = moved_nodes(model, contact)
    return next((one for one in model.rockers.values() if _is_driven(model, contact, one.start, moved)), None)


def driving_contact(model: Model, point: str) -> str | None:
    """Return the contact of the cam that moves a point, through members, links, lash and a rocker; None without one."""
    for name, contact in model.cam_contacts.items():
        rocker = rocker_of(model, contact)
        own = {contact.follower, rocker.point if rocker else ""}
        if point in own or (point in model.mesh.points and model.mesh.node(point) in moved_nodes(model, contact)):
            return name
    return None


def is_in_train(model: Model, contact: CamPair, play: Lash | Adjuster) -> bool:
    """Return whether a lash or an adjuster is in the train of a contact, or carries the pivot of its finger."""
    if play.ends is not None:
        moved = moved_nodes(model, contact)
        return any(_is_driven(model, contact, end, moved) for end in play.ends[: 1 + isinstance(play, Adjuster)])
    return play.rocker is not None and model.rockers[play.rocker] is rocker_of(model, contact)
