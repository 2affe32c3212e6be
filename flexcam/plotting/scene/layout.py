"""Positions of parts outside of the mesh: cams, followers, rockers, valves, coil springs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from flexcam.core import FloatArray
from flexcam.plotting.scene import sizes
from flexcam.plotting.scene.levers import LeverFrame, lever_frame
from flexcam.plotting.scene.lobes import CamFrame, cam_frame
from flexcam.plotting.scene.sizes import CoilSizes, Notes
from flexcam.plotting.scene.solids import perpendicular_axes
from flexcam.plotting.scene.springs import CoilPlacement
from flexcam.plotting.scene.trains import closing_spring, find_seat, is_coil, unit_vector
from flexcam.plotting.scene.valves import STEM, ValvePlacement
from flexcam.valvetrain import Lash, Model, Rocker, Spring, Structure
from flexcam.valvetrain.structure import spring_parts
from flexcam.valvetrain.train_topology import Driven, moved_nodes, rocker_of


@dataclass(frozen=True, eq=False)
class CamPlacement:
    """Cam and follower with their positions.

    Parameters
    ----------
    frame
        Plane of the cam.
    node
        Index of its node.
    contact
        Contact with the follower.
    lift
        Unit vector of the lift, shape (3,).
    ahead
        Distance along the lift from the cam centre to the follower node, m; zero for a finger follower.
    face
        Radius of a flat face, m.
    """

    frame: CamFrame
    node: int
    contact: Driven
    lift: FloatArray
    ahead: float
    face: float


@dataclass(frozen=True, eq=False)
class Layout:
    """Positions and sizes of parts.

    Parameters
    ----------
    cams, levers, valves, springs
        Parts; levers by the name of their rocker.
    head
        Diameter of valve heads, m.
    thick
        Thickness of rockers, m.
    notes
        Sentences about sizes that the case does not give.
    """

    cams: tuple[CamPlacement, ...]
    levers: dict[str, LeverFrame]
    valves: tuple[ValvePlacement, ...]
    springs: tuple[CoilPlacement, ...]
    head: float
    thick: float
    notes: tuple[str, ...]


def build_layout(structure: Structure) -> Layout:
    """Return the layout of a model."""
    model, notes = structure.model, Notes()
    head = 4.0 * sizes.valve_lift(model)  # makes the curtain area equal to the port area
    cams = tuple(_cams(model, notes))
    levers = {name: _lever(model, one, cams) for name, one in model.rockers.items()}
    valves = tuple(_valves(model, levers))
    for one in valves:
        notes.record("valve head at", one.point, head, "four lifts across")
        if one.stem:
            notes.record("valve stem at", one.point, STEM * head, "a sixth of its head across and three heads long")
    reach = min((arm for one in model.rockers.values() for arm in one.arms), default=0.0)
    thick = 0.42 * reach
    for name in levers:
        notes.record("rocker", name, thick, "thick: 0.42 of the shortest arm")
    springs = tuple(_springs(structure, cams, levers, head, notes))
    return Layout(cams, levers, valves, springs, head, thick, notes.lines)


def _cams(model: Model, notes: Notes) -> Iterator[CamPlacement]:
    for contact in model.cam_contacts.values():
        cam, lift = model.cams[contact.cam], unit_vector(contact.direction)
        node, points = model.mesh.node(cam.at), model.mesh.points
        centre, ahead = model.mesh.nodes[node], 0.0
        if contact.follower in points:
            ahead = float((model.mesh.nodes[model.mesh.node(contact.follower)] - centre) @ lift)
        follower = sizes.default_follower(contact.cam, cam, ahead, notes)
        width = sizes.lobe_width(contact.cam, cam, follower, notes)
        frame = cam_frame(cam, follower, centre, lift, contact.shaft_axis, width)
        face = 0.0
        if np.isinf(follower.roller_radius):
            face = sizes.face_radius(cam, follower, width)
            notes.record("face of follower", contact.follower, face, "radius on which the whole contact lies")
        yield CamPlacement(frame, node, contact, lift, ahead, face)


def _lever(model: Model, rocker: Rocker, cams: tuple[CamPlacement, ...]) -> LeverFrame:
    own = next((one for one in cams if rocker_of(model, one.contact) is rocker), None)
    lift = unit_vector(rocker.direction)
    if rocker.finger and own is not None:
        tip = own.frame.contact_end(0.0)
        end = own.frame.centre + np.array([tip.real, tip.imag]) @ own.frame.plane
        return lever_frame(rocker, end, own.frame.plane, -own.frame.side)
    right = np.cross(own.frame.axis, lift) if own is not None else perpendicular_axes(lift)[0]
    if float(np.linalg.norm(right)) < 0.5:  # driven along the shaft
        right = perpendicular_axes(lift)[0]
    return lever_frame(
        rocker, model.mesh.nodes[model.mesh.node(rocker.start)], np.array([unit_vector(right), lift]), -1
    )


def _valves(model: Model, levers: dict[str, LeverFrame]) -> Iterator[ValvePlacement]:
    """Yield the valves: at the points of rockers, at seats, and at the stiffest spring of other trains."""
    for name, frame in levers.items():
        point, play = frame.rocker.point, model.lash_of(name)
        gap = play.gap if isinstance(play, Lash) else 0.0
        tip = frame.space(frame.ends(0.0)[1]) + gap * frame.opening_direction
        yield ValvePlacement(point, tip, frame.opening_direction, True, find_seat(model, point) is not None)
    for contact in model.cam_contacts.values():
        if rocker_of(model, contact) is not None:
            continue
        nodes = set(moved_nodes(model, contact))
        seated = [p for p in model.mesh.points if (s := find_seat(model, p)) and model.mesh.node(s.at) in nodes]
        for point in seated:
            seat = find_seat(model, point)
            if seat is not None:
                on_member = bool(model.mesh.on_members()[model.mesh.node(point)])
                yield _valve_at(model, point, unit_vector(seat.direction), stem=not on_member, seat=True)
        spring = closing_spring(model, nodes)
        if not seated and spring is not None:
            yield _valve_at(model, spring.at, unit_vector(contact.direction), stem=True, seat=False)


def _valve_at(model: Model, point: str, away: FloatArray, *, stem: bool, seat: bool) -> ValvePlacement:
    return ValvePlacement(point, model.mesh.nodes[model.mesh.node(point)], away, stem, seat)


def _springs(
    structure: Structure, cams: tuple[CamPlacement, ...], levers: dict[str, LeverFrame], head: float, notes: Notes
) -> Iterator[CoilPlacement]:
    model = structure.model
    travel = sizes.valve_lift(model)
    for name, spring in model.springs.items():
        if not is_coil(model, spring):
            continue
        parts = spring_parts(structure, name, spring)
        borders = np.array([parts[0][0], *(high for _, high in parts)])
        across_face = next((1.7 * one.face for one in cams if one.contact.follower == spring.at and one.face), 0.0)
        if spring.to is not None and spring.to in model.mesh.points and spring.at in model.mesh.points:
            yield _spring_between_nodes(model, name, spring, borders, head, notes)
        else:
            start, away = _moving_end(model, spring, levers, head)
            coil = sizes.coil_sizes(name, spring, across_face or 0.75 * head, travel, notes)
            yield CoilPlacement(start + coil.length * away, -away, coil, borders, -1.0, True, not across_face)


def _moving_end(
    model: Model, spring: Spring, levers: dict[str, LeverFrame], head: float
) -> tuple[FloatArray, FloatArray]:
    """Return the moving end of a spring to ground, and the direction from there to its fixed end."""
    if spring.at in model.mesh.points:
        return model.mesh.nodes[model.mesh.node(spring.at)], unit_vector(spring.direction)
    frame = next(one for one in levers.values() if spring.at in (one.rocker.point, one.rocker.start))
    same = float(spring.direction @ frame.rocker.direction) >= 0.0
    if spring.at == frame.rocker.point:
        away = frame.opening_direction if same else -frame.opening_direction
        return frame.space(frame.ends(0.0)[1]) + 0.2 * head * away, away
    away = frame.plane[1] if same else -frame.plane[1]
    return frame.space(frame.ends(0.0)[0]), away


def _spring_between_nodes(
    model: Model, name: str, spring: Spring, borders: FloatArray, head: float, notes: Notes
) -> CoilPlacement:
    """Return the position of a spring between two nodes, starting at its end `to`."""
    start, end = (model.mesh.nodes[model.mesh.node(str(one))] for one in (spring.to, spring.at))
    span = end - start
    length = float(np.linalg.norm(span))
    coil = sizes.coil_sizes(name, spring, min(0.5 * head, 0.4 * length), 0.0, notes)
    fits = min(1.0, 0.7 * length / ((coil.coils + 2.0) * coil.wire))
    made = CoilSizes(coil.diameter, fits * coil.wire, length, coil.coils)
    return CoilPlacement(
        start, span / length, made, borders, float(np.sign(spring.direction[:3] @ span)) or 1.0, False, False
    )
