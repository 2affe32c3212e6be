"""What follows a motion while no play is open: pushed parts, rockers' points, springs."""

from __future__ import annotations

import math

import numpy as np

from flexcam.linalg import FloatArray
from flexcam.train.model import Lever, Rocker, path_name, tip_name
from flexcam.train.springs import inner_name, spring_ends
from flexcam.train.structure import Structure


def completed(structure: Structure, motion: FloatArray) -> FloatArray:
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


def shifted(structure: Structure, end: str, direction: FloatArray) -> FloatArray:
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
            moved += driven * shifted(structure, play.ends[1], play.direction)
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
                    moved += other * shifted(structure, end, direction)
    return moved


def _shares(structure: Structure, rocker: Rocker) -> dict[str, float]:
    """Return what the unknowns of a rocker move per motion of its driven end, as installed, no play being open."""
    own = {rocker.point: rocker.ratio}
    if isinstance(rocker, Lever):
        name = structure.name_of(rocker)
        own |= {path_name(name): 1.0 / math.cos(rocker.angles[0]), tip_name(name): rocker.ratio}
    return {name: share for name, share in own.items() if name in structure.dofs.names}
