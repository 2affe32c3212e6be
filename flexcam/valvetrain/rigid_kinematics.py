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
    nodes = dict[int, None]()
    if contact.follower in model.mesh.points:
        nodes |= dict.fromkeys(connected_nodes(model, model.mesh.node(contact.follower)))

    lashes = [(lash.ends[0], model.mesh.node(lash.ends[1])) for lash in model.lashes]
    while driven := [end for start, end in lashes if end not in nodes and _is_driven(model, contact, start, nodes)]:
        nodes |= dict.fromkeys(connected_nodes(model, driven[0]))
    return tuple(nodes)


def _is_driven(model: Model, contact: CamPair, start: str, nodes: Collection[int]) -> bool:
    """Return whether a node or point of a rocker moves with a follower and the nodes that it moves."""
    rocker = model.rocker_points.get(start)
    end = start if rocker is None else rocker.start
    return end == contact.follower or (end in model.mesh.points and model.mesh.node(end) in nodes)


def lashes_before(model: Model, node: int, lashes: Sequence[NodeLash]) -> list[NodeLash]:
    """Return the lash elements in series between nodes before a node moves."""
    series: list[NodeLash] = []
    remaining = list(lashes)
    while preceding := [lash for lash in remaining if model.mesh.node(lash.ends[1]) in connected_nodes(model, node)]:
        series.insert(0, preceding[0])
        remaining.remove(preceding[0])
        if preceding[0].ends[0] not in model.mesh.points:  # a rocker's point
            break
        node = model.mesh.node(preceding[0].ends[0])
    return series


@lru_cache(maxsize=4)
def _adjacency(model: Model) -> dict[int, list[int]]:
    """Return adjacency by members, superelements and links of both kinds."""
    points = model.mesh.points
    ends = [(spring.at, spring.to) for spring in model.springs.values() if spring.link and spring.to is not None]
    links = [[model.mesh.node(a), model.mesh.node(b)] for a, b in ends if a in points and b in points]
    neighbours: dict[int, list[int]] = {}
    groups = *model.mesh.bodies.values(), *model.mesh.links.values()
    bodies = [pair for nodes in groups for pair in pairwise(nodes.tolist())]
    for a, b in [*model.mesh.elements().tolist(), *links, *bodies]:
        neighbours.setdefault(a, []).append(b)
        neighbours.setdefault(b, []).append(a)
    return neighbours


def connected_nodes(model: Model, node: int) -> list[int]:
    """Return the nodes connected to a node by members, superelements and links, nearest first, with the node itself."""
    neighbours, visited = _adjacency(model), {node: None}
    nodes = [node]
    for current in nodes:  # grows as it goes
        added = dict.fromkeys(neighbour for neighbour in neighbours.get(current, ()) if neighbour not in visited)
        nodes += added
        visited |= added
    return nodes


def rocker_of(model: Model, contact: CamPair) -> Rocker | None:
    """Return the rocker driven by or identical to a follower, or None."""
    nodes = moved_nodes(model, contact)
    return next((rocker for rocker in model.rockers.values() if _is_driven(model, contact, rocker.start, nodes)), None)


def driving_contact(model: Model, point: str) -> str | None:
    """Return the contact of the cam that moves a point, through members, links, lash and a rocker; None without one."""
    for name, contact in model.cam_contacts.items():
        rocker = rocker_of(model, contact)
        points = {contact.follower, rocker.point if rocker else ""}
        if point in points or (point in model.mesh.points and model.mesh.node(point) in moved_nodes(model, contact)):
            return name
    return None


def is_in_train(model: Model, contact: CamPair, lash: Lash | Adjuster) -> bool:
    """Return whether a lash or an adjuster is in the train of a contact, or carries the pivot of its finger."""
    if lash.ends is not None:
        nodes = moved_nodes(model, contact)
        return any(_is_driven(model, contact, end, nodes) for end in lash.ends[: 1 + isinstance(lash, Adjuster)])
    return lash.rocker is not None and model.rockers[lash.rocker] is rocker_of(model, contact)


@lru_cache(maxsize=4)
def rigid_trains(structure: Structure) -> tuple[RigidTrain, ...]:
    """Return the parts that cams move or seats stop, without loads."""
    model, drives = structure.model, list[Drive]()
    for name, contact in model.cam_contacts.items():
        row = structure.row(contact.follower, contact.direction, f"contacts.{name}.follower")
        drives.append(Drive(name, contact, model.cams[contact.cam].lift, row))
    stops = [
        Stop(name, part, stop_row(structure, name, part), part.gap if isinstance(part, Lash) else 0.0)
        for name, part in model.contacts.items() if isinstance(part, Seat | Lash | Adjuster)
    ]  # fmt: skip
    levers = [
        LeverEnd(lever, end, *rows)
        for lever in model.levers.values() for end, rows in lever_ends(structure, lever).items()
    ]  # fmt: skip
    links = [spring for spring in spring_stretches(structure) if spring.rigid]
    motions = strain_free_motions(structure, links)
    rows = [*(item.row for item in (*drives, *stops, *links)), *(end.path + end.moved for end in levers)]
    stiffness = soft_stiffness(structure)
    groups = coupled_groups(structure, rows)
    trains = (_train(dofs, motions[dofs], stiffness.part(dofs).dense(), drives, stops, levers) for dofs in groups)
    return tuple(train for train in trains if train.drives or any(stop.is_seat for stop in train.stops))


def soft_stiffness(structure: Structure) -> Triplets:
    """Return the stiffness of the springs that are not rigid in the rigid model."""
    soft = (scalar_matrix(spring.row, spring.stiffness) for spring in spring_stretches(structure) if not spring.rigid)
    return Triplets.sum([Triplets.zeros(structure.dofs.size), *soft])


def load_trains(structure: Structure, load: FloatArray) -> tuple[RigidTrain, ...]:
    """Return the trains under a constant load, N, shape (n,), with the adjusters extended on the base circle."""
    names = {drive.name for train in rigid_trains(structure) for drive in train.drives}
    for name, contact in structure.model.cam_contacts.items():
        if name not in names:
            allowed, why = "a follower that moves along the lift without bending", "rigid members cannot yield"
            where, remedy = f"contacts.{name}.follower", "use fidelity.model = beams, or another support of its member"
            raise refuse(where, repr(contact.follower), allowed, why, remedy)
    return tuple(_extend_adjusters(replace(t, force=t.motions @ load[t.dofs])) for t in rigid_trains(structure))


def _train(
    dofs: IntArray, motions: FloatArray, stiffness: FloatArray, drives: Sequence[Drive], stops: Sequence[Stop],
    levers: Sequence[LeverEnd],
) -> RigidTrain:  # fmt: skip
    """Return the train of some coupled unknowns by their motions without strain, shape (k, r)."""
    vectors, values, _ = np.linalg.svd(motions, full_matrices=False)
    free = vectors[:, : int(np.count_nonzero(values > RANK))].T

    def moves(row: FloatArray) -> bool:
        return float(np.abs(free @ row[dofs]).max(initial=0.0)) > RANK

    drives, stops = [drive for drive in drives if moves(drive.row)], [stop for stop in stops if moves(stop.row)]
    levers = [lever for lever in levers if moves(lever.path)]
    rows = [*(item.row for item in (*drives, *stops)), *(row for end in levers for row in (end.path, end.moved))]
    sensed = np.array([free @ row[dofs] for row in rows]).reshape(len(rows), len(free))
    _, values, vectors = np.linalg.svd(sensed, full_matrices=False)
    basis = vectors[: int(np.count_nonzero(values > RANK * values.max(initial=0.0)))]
    shapes = _least_energy_motions(free @ stiffness @ free.T, basis) @ free
    return RigidTrain(
        dofs, shapes,
        tuple(replace(drive, row=shapes @ drive.row[dofs]) for drive in drives),
        tuple(replace(stop, row=shapes @ stop.row[dofs]) for stop in stops),
        tuple(replace(end, path=shapes @ end.path[dofs], moved=shapes @ end.moved[dofs]) for end in levers),
        shapes @ stiffness @ shapes.T, np.zeros(len(shapes)),
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
    lifts = np.zeros(len(train.drives))
    z = Branch(train, find_closed_stops(train, lifts)).positions(lifts[None])[0][0]
    stops = (replace(s, gap=float(s.row @ z)) if isinstance(s.part, Adjuster) else s for s in train.stops)
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
            seats = (seat for seat in model.contacts.values() if isinstance(seat, Seat))
            ends = [(seat.at, seat.direction) for seat in seats if driving_contact(model, seat.at) == name]
            if rocker := rocker_of(model, contact):
                ends.append((rocker.point, np.zeros(6)))
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
    preceding = lashes_before(model, model.mesh.node(start), model.lashes) if start in model.mesh.points else []
    pairs = [(row, lash.gap), *((structure.row(prior.ends[0], prior.direction), prior.gap) for prior in preceding)]
    return sum(gap / (abs(float(row @ motion)) or 1.0) for row, gap in pairs)
