"""What a cam drives: the nodes that move with its follower, its rocker, and the play before its valve."""

from __future__ import annotations

from flexcam.train.model import CamContact, Lash, Model, PublishedLoad, Rocker

Driven = PublishedLoad | CamContact


def moved_nodes(model: Model, contact: Driven) -> set[int]:
    """Return the nodes that a follower moves through members, links and plays.

    Parameters
    ----------
    model, contact
        The model and the contact of a cam.

    Returns
    -------
    set
        Node numbers; none where a finger is the follower.
    """
    if contact.follower not in model.mesh.points:
        return set()
    found = set(model.connected(model.mesh.node(contact.follower)).tolist())
    for _ in model.plays:  # each pass goes on by one play at least
        for play in model.plays:
            if model.mesh.node(play.ends[0]) in found:
                found.update(model.connected(model.mesh.node(play.ends[1])).tolist())
    return found


def rocker_of(model: Model, contact: Driven) -> Rocker | None:
    """Return the rocker that a follower drives or is, or None.

    Parameters
    ----------
    model, contact
        The model and the contact of a cam.

    Returns
    -------
    Rocker or None
        The first one.
    """
    nodes, points = moved_nodes(model, contact), model.mesh.points
    own = (
        one
        for one in model.rockers.values()
        if one.start == contact.follower or (one.start in points and model.mesh.node(one.start) in nodes)
    )
    return next(own, None)


def play_of(model: Model, cam: str) -> float:
    """Return the largest play that a cam's lift takes up, as its follower sees it.

    Parameters
    ----------
    model
        The model.
    cam
        Name of the cam.

    Returns
    -------
    float
        m; a play that is in no train counts in each.
    """
    gaps = [0.0]
    for play in model.contacts.values():
        if isinstance(play, Lash):
            cams = {contact.cam for contact in model.driven.values() if _within(model, contact, play)}
            if not cams or cam in cams:
                gaps.append(play.gap / (model.rockers[play.rocker].ratio if play.rocker else 1.0))
    return max(gaps)


def _within(model: Model, contact: Driven, play: Lash) -> bool:
    """Tell whether a play is in the train of a contact."""
    if play.ends is not None:
        return model.mesh.node(play.ends[0]) in moved_nodes(model, contact)
    return play.rocker is not None and model.rockers[play.rocker] is rocker_of(model, contact)
