"""Topology of a train and its rigid motion.

Members, links, levers and closed contacts are rigid; other springs deform statically.
The motion is the limit of the flexible model for infinite stiffness of the train. All unknowns follow from the scalars
that contacts and levers sense, with minimum energy of the springs.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np

from flexcam.core import FloatArray, IntArray, Triplets
from flexcam.core.errors import refuse
from flexcam.fem.rigid_bodies import scalar_matrix
from flexcam.valvetrain.model import Model
from flexcam.valvetrain.parts import Adjuster, CamContact, CamPair, Lash, NodeLash, PublishedLoad, Rocker, Seat
from flexcam.valvetrain.rigid_train import RANK, Branch, Drive, LeverEnd, RigidTrain, Stop, find_closed_stops
from flexcam.valvetrain.structure import (
    Structure,
    build_structure,
    coupled_groups,
    lever_ends,
    spring_stretches,
    stop_row,
    strain_free_motions,
)


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


@lru_cache(maxsize=4)
def rigid_trains(structure: Structure) -> tuple[RigidTrain, ...]:
    """Return the parts that cams move or seats stop, without loads."""
    model, cam_contacts = structure.model, structure.model.cam_contacts
    drives = [
        Drive(
            name,
            one,
            model.cams[one.cam].lift,
            structure.row(one.follower, one.direction, f"contacts.{name}.follower"),
        )
        for name, one in cam_contacts.items()
    ]
    stops = [
        Stop(name, part, stop_row(structure, name, part), part.gap if isinstance(part, Lash) else 0.0)
        for name, part in model.contacts.items() if isinstance(part, Seat | Lash | Adjuster)
    ]  # fmt: skip
    levers = [
        LeverEnd(lever, end, *rows)
        for lever in model.levers.values() for end, rows in lever_ends(structure, lever).items()
    ]  # fmt: skip
    links = [one for one in spring_stretches(structure) if one.rigid]
    motions = strain_free_motions(structure, links)
    rows = [*(one.row for one in (*drives, *stops, *links)), *(one.path + one.moved for one in levers)]
    stiffness = soft_stiffness(structure)
    trains = (
        _train(dofs, motions[dofs], stiffness.part(dofs).dense(), drives, stops, levers)
        for dofs in coupled_groups(structure, rows)
    )
    return tuple(train for train in trains if train.drives or any(stop.is_seat for stop in train.stops))


def soft_stiffness(structure: Structure) -> Triplets:
    """Return the stiffness of the springs that are not rigid in the rigid model."""
    soft = (scalar_matrix(one.row, one.stiffness) for one in spring_stretches(structure) if not one.rigid)
    return Triplets.sum([Triplets.zeros(structure.dofs.size), *soft])


def load_trains(structure: Structure, load: FloatArray) -> tuple[RigidTrain, ...]:
    """Return the trains under a constant load, N, shape (n,), with the adjusters extended on the base circle."""
    driven = {drive.name for train in rigid_trains(structure) for drive in train.drives}
    for name, contact in structure.model.cam_contacts.items():
        if name not in driven:
            allowed, why = "a follower that moves along the lift without bending", "rigid members cannot yield"
            where, remedy = f"contacts.{name}.follower", "use fidelity.model = beams, or another support of its member"
            raise refuse(where, repr(contact.follower), allowed, why, remedy)
    return tuple(_extend_adjusters(replace(one, force=one.motions @ load[one.dofs])) for one in rigid_trains(structure))


def _train(
    dofs: IntArray, motions: FloatArray, stiffness: FloatArray, drives: Sequence[Drive], stops: Sequence[Stop],
    levers: Sequence[LeverEnd],
) -> RigidTrain:  # fmt: skip
    """Return the train of some coupled unknowns by their motions without strain, shape (k, r)."""
    left, sizes, _ = np.linalg.svd(motions, full_matrices=False)
    free = left[:, : int(np.count_nonzero(sizes > RANK))].T
    drives = [replace(one, row=free @ one.row[dofs]) for one in drives]
    stops = [replace(one, row=free @ one.row[dofs]) for one in stops]
    levers = [replace(one, path=free @ one.path[dofs], moved=free @ one.moved[dofs]) for one in levers]
    drives = [one for one in drives if np.abs(one.row).max(initial=0.0) > RANK]
    stops = [one for one in stops if np.abs(one.row).max(initial=0.0) > RANK]
    levers = [one for one in levers if np.abs(one.path).max(initial=0.0) > RANK]
    sensed = [*(one.row for one in (*drives, *stops)), *(row for one in levers for row in (one.path, one.moved))]
    basis = np.array(sensed).reshape(len(sensed), len(free))
    basis = (
        np.linalg.svd(basis, full_matrices=False)[2][: int(np.linalg.matrix_rank(basis, rtol=RANK))]
        if sensed
        else basis
    )
    shapes = _least_energy_motions(free @ stiffness @ free.T, basis)
    return RigidTrain(
        dofs, shapes @ free,
        tuple(replace(one, row=shapes @ one.row) for one in drives),
        tuple(replace(one, row=shapes @ one.row) for one in stops),
        tuple(replace(one, path=shapes @ one.path, moved=shapes @ one.moved) for one in levers),
        shapes @ free @ stiffness @ free.T @ shapes.T, np.zeros(len(shapes)),
    )  # fmt: skip


def _least_energy_motions(stiffness: FloatArray, rows: FloatArray) -> FloatArray:
    """Return the motions of minimum energy, then of minimum size, for a unit of each of some rows, shape (d, r)."""
    d, size = rows.shape
    scale = float(np.abs(stiffness).max(initial=0.0)) or 1.0
    matrix = np.block([[stiffness / scale, rows.T], [rows, np.zeros((d, d))]])
    return np.linalg.lstsq(matrix, np.eye(size + d)[:, size:], rcond=RANK)[0][:size].T.astype(np.float64)


def _extend_adjusters(train: RigidTrain) -> RigidTrain:
    """Return a train whose adjusters take up their clearance where the lifts are zero."""
    if not any(isinstance(stop.part, Adjuster) for stop in train.stops):
        return train
    still = np.zeros(len(train.drives))
    z = Branch(train, find_closed_stops(train, still)).positions(still[None])[0][0]
    stops = (replace(one, gap=float(one.row @ z)) if isinstance(one.part, Adjuster) else one for one in train.stops)
    return replace(train, stops=tuple(stops))


@dataclass(frozen=True, eq=False)
class FollowerTrain:
    """Parts that move with a follower along the lift as one rigid body."""

    motion: FloatArray  #: unit motion of all unknowns along the lift, shape (n,)
    #: `mass`, `stiffness`: kg and N/m of that motion, at the follower
    mass: float
    stiffness: float

    def moves(self, row: FloatArray) -> bool:
        """Return whether the train changes a scalar of the motion, shape (n,)."""
        return abs(float(self.motion @ row)) > RANK * float(np.abs(self.motion).max() * np.abs(row).max())


def follower_train(structure: Structure, contact: CamContact | PublishedLoad, where: str) -> FollowerTrain:
    """Return the rigid train of a follower as installed, with all lash closed."""
    row, motion = structure.row(contact.follower, contact.direction, where), np.zeros(structure.dofs.size)
    for train in rigid_trains(structure):
        if any(drive.contact is contact for drive in train.drives):
            motion[train.dofs] = train.unit_motion(contact) @ train.motions
            break
    else:  # a part that only bends
        motion = row
    mass, stiffness = structure.mass, structure.stiffness
    return FollowerTrain(motion, float(motion @ mass.times(motion)), float(motion @ stiffness.times(motion)))


def valve_ratio(model: Model, cam: str) -> float:
    """Return the valve motion per cam lift with all lash closed: of a seat, or of a rocker's point without one."""
    structure = build_structure(model)
    for name, contact in model.cam_contacts.items():
        if contact.cam == cam:
            ends = [
                (one.at, one.direction)
                for one in model.contacts.values()
                if isinstance(one, Seat) and driving_contact(model, one.at) == name
            ]
            rocker = rocker_of(model, contact)
            ends += [] if rocker is None else [(rocker.point, np.zeros(6))]
            motion = follower_train(structure, contact, f"contacts.{name}.follower").motion
            return abs(float(structure.row(*ends[0]) @ motion)) if ends else 1.0
    return 1.0


@lru_cache(maxsize=4)
def largest_lashes(model: Model) -> Mapping[str, float]:
    """Return the largest lash that the lift of each cam takes up, reduced to the follower, m."""
    structure, largest = build_structure(model), dict.fromkeys(model.cams, 0.0)
    for name, contact in model.cam_contacts.items():
        motion = follower_train(structure, contact, f"contacts.{name}.follower").motion
        for lash in model.contacts.values():
            if isinstance(lash, Lash) and not lash.turns and is_in_train(model, contact, lash):
                gap = _reduced_lash(structure, motion, lash)
                largest[contact.cam] = max(largest[contact.cam], gap)
    return largest


def _reduced_lash(structure: Structure, motion: FloatArray, lash: Lash) -> float:
    """Return a lash plus those before it, each divided by the motion of its driving side per lift, m."""
    model = structure.model
    if lash.ends is None or lash.direction is None:
        rocker = model.rockers[str(lash.rocker)]
        row, start = structure.reach(rocker), rocker.start
    else:
        row, start = structure.row(lash.ends[0], lash.direction), lash.ends[0]
        rocker = model.rocker_points.get(start)
        start = rocker.start if rocker else start
    before = lashes_before(model, model.mesh.node(start), model.lashes) if start in model.mesh.points else []
    pairs = [(row, lash.gap), *((structure.row(one.ends[0], one.direction), one.gap) for one in before)]
    return sum(gap / (abs(float(one @ motion)) or 1.0) for one, gap in pairs)
