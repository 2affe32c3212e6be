"""What a cam drives: the nodes that move with its follower, its rocker, and the play before its valve."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from flexcam.train.model import CamContact, Lash, Model, Play, PublishedLoad, Rocker

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
