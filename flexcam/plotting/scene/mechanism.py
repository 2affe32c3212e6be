"""Drawable mechanism: positions and default sizes of its parts, and all its solids at an instant."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from flexcam.cams import FlatFollower, cam_profile
from flexcam.core import FloatArray
from flexcam.plotting.scene import parts
from flexcam.plotting.scene.motion import SceneState, centre_line, model_size, sweep_outline
from flexcam.plotting.scene.parts import STEM, CamPlacement, CoilPlacement, CoilSizes, LeverFrame, ValvePlacement
from flexcam.plotting.scene.solids import Solid, ball, cylinder, loft, member_outlines, perpendicular_axes, unit_vector
from flexcam.valvetrain import Lash, Model, Rocker, Seat, Spring, Structure, valve_ratio
from flexcam.valvetrain.rigid_kinematics import moved_nodes, rocker_of
from flexcam.valvetrain.structure import spring_parts

SHEAR_MODULUS = 79.3e9  # shear modulus of spring steel, Pa, used to find the number of coils from rate and wire
_COILS = 6.0  # number of coils of a spring without wire data
_PROFILE_POINTS = 360


Notes = dict[str, list[str]]  # names of the parts drawn with a default size, by the sentence about them


def _record(notes: Notes, what: str, name: str, size: float, why: str) -> float:
    """Return a size, m, and record a note: the kind of part, its name, and the reason."""
    notes.setdefault(f"{what} {{}}: {1e3 * size:.3g} mm, {why}", []).append(name)
    return size


def valve_lift(model: Model) -> float:
    """Return the maximum valve lift of the rigid train, m; a tenth of the model size without a driven valve."""
    lifts = [abs(cam.event.height * valve_ratio(model, name)) for name, cam in model.cams.items()]
    return max(lifts, default=0.0) or 0.1 * model_size(model)


def coil_sizes(
    name: str, spring: Spring, diameter: float, travel: float, notes: Notes, length: float | None = None
) -> CoilSizes:
    """Return the sizes of a drawn spring; `length`, m, is that to the seat of a spring around it."""
    if spring.wire is not None:
        D, d = spring.wire.coil_diameter, spring.wire.diameter
        coils = SHEAR_MODULUS * d**4 / (8.0 * D**3 * spring.stiffness) if spring.stiffness > 0.0 else _COILS
    else:
        why = "wire diameter from its stiffness, assuming six steel coils"
        D, coils = _record(notes, "coil diameter of spring", name, diameter, why), _COILS
        d = min((8.0 * D**3 * coils * spring.stiffness / SHEAR_MODULUS) ** 0.25, D / 5.0)
    d, coils = max(d, D / 40.0), min(max(coils, 2.0), 20.0)
    if length is not None:
        return CoilSizes(D, d, length, coils)
    installed = (coils + 2.0) * d + (spring.clash_travel or 1.4 * travel)
    return CoilSizes(D, d, _record(notes, "length of spring", name, installed, "solid length plus travel"), coils)


def _cams(model: Model, notes: Notes) -> Iterator[CamPlacement]:
    for contact in model.cam_contacts.values():
        cam, lift = model.cams[contact.cam], unit_vector(contact.direction)
        node, points = model.mesh.node(cam.at), model.mesh.points
        centre, ahead = model.mesh.nodes[node], 0.0
        if contact.follower in points:
            ahead = float((model.mesh.nodes[model.mesh.node(contact.follower)] - centre) @ lift)
        follower, width, face = cam.follower, cam.width, 0.0
        if follower is None:
            base = ahead if ahead > 0.0 else 3.0 * cam.event.height
            why = "to its follower's node, under a flat face"
            follower = FlatFollower(_record(notes, "base circle of cam", contact.cam, base, why))
        if width is None:
            why = "0.7 of its base radius"
            width = _record(notes, "width of cam", contact.cam, 0.7 * follower.base_radius, why)
        profile = cam_profile(cam.event, follower, count=_PROFILE_POINTS, turn=cam.turn)
        if np.isinf(follower.roller_radius):  # the face covers the whole contact with a margin of a tenth
            away = float(np.abs(cam_profile(cam.event, follower, turn=cam.turn).offset).max())
            face = max(1.1 * math.hypot(away, 0.5 * width), 0.5 * follower.base_radius)
            _record(notes, "face radius of follower", contact.follower, face, "which covers the whole contact")
        yield CamPlacement(profile, centre, lift, contact.shaft_axis, width, node, contact, ahead, face)


def _lever(model: Model, rocker: Rocker, cams: tuple[CamPlacement, ...]) -> LeverFrame:
    cam = next((cam for cam in cams if rocker_of(model, cam.contact) is rocker), None)
    lift = unit_vector(rocker.direction)
    if rocker.finger and cam is not None:
        end = cam.centre + parts.in_space(cam.contact_end(0.0), cam.plane)
        plane, side = cam.plane, -cam.side
    else:
        right = np.cross(cam.axis, lift) if cam is not None else np.zeros(3)
        if float(np.linalg.norm(right)) < 0.5:  # driven along the shaft, or by no cam
            right = perpendicular_axes(lift)[0]
        end, plane, side = model.mesh.nodes[model.mesh.node(rocker.start)], np.array([unit_vector(right), lift]), -1
    driven = LeverFrame(rocker, np.zeros(3), plane, side).ends(0.0)[0]
    return LeverFrame(rocker, end - parts.in_space(driven, plane), plane, side)


def _valves(model: Model, levers: dict[str, LeverFrame]) -> Iterator[ValvePlacement]:
    seats = {seat.at: seat for seat in model.contacts.values() if isinstance(seat, Seat)}
    for name, frame in levers.items():
        point, lash = frame.rocker.point, model.rocker_lashes.get(name)
        gap = lash.gap if isinstance(lash, Lash) else 0.0
        tip = frame.space(frame.ends(0.0)[1]) + gap * frame.opening_direction
        yield ValvePlacement(point, tip, frame.opening_direction, True, point in seats)
    for contact in model.cam_contacts.values():
        if rocker_of(model, contact) is not None:
            continue
        nodes = set(moved_nodes(model, contact))
        for point in filter(seats.__contains__, model.mesh.points):
            if (node := model.mesh.node(point)) in nodes:
                stem, away = not model.mesh.on_members()[node], unit_vector(seats[point].direction)
                yield ValvePlacement(point, model.mesh.nodes[node], away, stem, True)


def _springs(
    structure: Structure, cams: tuple[CamPlacement, ...], levers: dict[str, LeverFrame], head: float, notes: Notes
) -> Iterator[CoilPlacement]:
    """Yield the springs, the outer ones first: those inside have the same seat."""
    model, outer = structure.model, list[CoilPlacement]()
    travel = valve_lift(model)
    coils = [(n, s) for n, s in model.springs.items() if s.direction[:3].any() and not parts.is_bearing(model, s)]
    for name, spring in sorted(coils, key=_coil_order):
        pieces = spring_parts(structure, name, spring)
        borders = np.array([pieces[0][0], *(high for _, high in pieces)])
        across_face = next((1.7 * cam.face for cam in cams if cam.contact.follower == spring.at and cam.face), 0.0)
        if spring.to is not None and spring.to in model.mesh.points and spring.at in model.mesh.points:
            yield _spring_between_nodes(model, name, spring, borders, head, notes)
        else:
            start, away = _moving_end(model, spring, levers, head)
            around = [coil for coil in outer if _is_inside(start, away, coil)]
            room = 0.7 * min((coil.sizes.diameter - coil.sizes.wire for coil in around), default=math.inf)
            length = float((around[0].start - start) @ away) if around else None
            sizes = coil_sizes(name, spring, min(across_face or 0.75 * head, room), travel, notes, length)
            ends = not around, not (around or across_face)
            outer.append(CoilPlacement(name, start + sizes.length * away, -away, sizes, borders, -1.0, *ends))
            yield outer[-1]


def _coil_order(item: tuple[str, Spring]) -> tuple[bool, float]:
    """Return a sort key: springs of given size, the widest first, then the others, the stiffest first."""
    wire = item[1].wire
    return wire is None, -(item[1].stiffness if wire is None else wire.coil_diameter)


def _is_inside(start: FloatArray, away: FloatArray, outer: CoilPlacement) -> bool:
    """Return whether a spring whose moving end is at `start` lies around the line of another and overlaps it."""
    span = outer.start - start
    along = float(span @ away)
    coaxial = float(outer.axis @ away) < -0.999 and float(np.linalg.norm(span - along * away)) < outer.sizes.wire
    return coaxial and outer.sizes.length / 3.0 < along < 3.0 * outer.sizes.length


def _moving_end(
    model: Model, spring: Spring, levers: dict[str, LeverFrame], head: float
) -> tuple[FloatArray, FloatArray]:
    """Return the moving end of a spring to ground, and the direction from there to its fixed end."""
    if spring.at in model.mesh.points:
        return model.mesh.nodes[model.mesh.node(spring.at)], unit_vector(spring.direction)
    frame = next(frame for frame in levers.values() if spring.at in (frame.rocker.point, frame.rocker.start))
    same = float(spring.direction @ frame.rocker.direction) >= 0.0
    if spring.at == frame.rocker.point:
        away = frame.opening_direction if same else -frame.opening_direction
        return frame.space(frame.ends(0.0)[1]) + 0.2 * head * away, away
    away = frame.plane[1] if same else -frame.plane[1]
    return frame.space(frame.ends(0.0)[0]), away


def _spring_between_nodes(
    model: Model, name: str, spring: Spring, borders: FloatArray, head: float, notes: Notes
) -> CoilPlacement:
    start, end = (model.mesh.nodes[model.mesh.node(str(point))] for point in (spring.to, spring.at))
    span = end - start
    length = float(np.linalg.norm(span))
    sizes = coil_sizes(name, spring, min(0.5 * head, 0.4 * length), 0.0, notes)
    fits = min(1.0, 0.7 * length / ((sizes.coils + 2.0) * sizes.wire))
    fitted = CoilSizes(sizes.diameter, fits * sizes.wire, length, sizes.coils)
    sense = float(np.sign(spring.direction[:3] @ span)) or 1.0
    return CoilPlacement(name, start, span / length, fitted, borders, sense, ground=False, retainer=False)


@dataclass(frozen=True, eq=False)
class Mechanism:
    """Drawable model: positions and sizes of its parts."""

    structure: Structure  # structure of the model
    cams: tuple[CamPlacement, ...]
    levers: dict[str, LeverFrame]  # by the name of the rocker
    valves: tuple[ValvePlacement, ...]
    springs: tuple[CoilPlacement, ...]
    head: float  # diameter of valve heads, m
    thick: float  # thickness of rockers, m
    notes: tuple[str, ...]  # sentences about sizes that the case does not give

    @property
    def upwards(self) -> FloatArray:
        """Unit vector that points up in figures, shape (3,): along the lift, toward increasing coordinates."""
        lift = self.cams[0].lift if self.cams else np.array([0.0, 1.0, 0.0])
        return lift * (np.sign(lift[np.argmax(np.abs(lift))]) or 1.0)

    @property
    def view(self) -> FloatArray:
        """Directions to the right, up and to the observer of a picture of lobes and train, shape (3, 3)."""
        up = self.upwards
        axis = self.cams[0].axis if self.cams else perpendicular_axes(up)[1]
        ahead = unit_vector(0.85 * axis + 0.55 * np.cross(up, axis) + 0.3 * up)
        right = unit_vector(np.cross(up, ahead))
        return np.array([right, np.cross(ahead, right), ahead])

    def solids(self, instant: SceneState) -> list[Solid]:
        """Return all parts at an instant."""
        named = [
            *(pair for cam in self.cams for pair in self._cam(cam, instant)),
            *((name, parts.lever_solids(lever, instant, self.thick)) for name, lever in self.levers.items()),
            *((valve.point, parts.valve_solids(valve, instant, self.head)) for valve in self.valves),
            *((spring.name, parts.spring_solids(spring, instant)) for spring in self.springs),
        ]
        return [
            *self._members(instant),
            *(replace(solid, name=name) for name, solids in named for solid in solids),
            *parts.support_solids(self.structure.model, self.cams, instant),
            *self._links(instant),
            *self._balls(instant),
        ]

    def _links(self, instant: SceneState) -> Iterator[Solid]:
        """Yield a rod from the leading node of a rigid link to each node apart that follows it."""
        mesh, thick = self.structure.model.mesh, 0.015 * model_size(self.structure.model)
        for name, nodes in mesh.links.items():
            first, *others = mesh.nodes[nodes] + instant.nodal[nodes, :3]
            for point in others:
                if np.linalg.norm(point - first) > thick:
                    yield replace(cylinder("rocker", first, point, thick), name=name)

    def _members(self, instant: SceneState) -> Iterator[Solid]:
        model, first = self.structure.model, 0
        shafts = parts.shaft_names(model)
        for name, elements in model.mesh.element_ranges().items():
            line = centre_line(self.structure.beams, elements, model.mesh.nodes, instant.nodal)
            outlines = member_outlines(model.members[name].section, line.part / line.part[-1])
            rings = [sweep_outline(outline, line) for outline in outlines]
            count, values = len(model.mesh.lines[name]), None
            if instant.values is not None:
                values = np.interp(line.part, np.arange(count), instant.values[first : first + count])
            if hollow := len(rings) > 1:  # the hole is connected in the reverse direction
                rings[0] = np.concatenate([rings[0], rings[1][::-1]])
                values = None if values is None else np.concatenate([values, values[::-1]])
            kind = "shaft" if name in shafts else "member"
            yield replace(loft(kind, rings[0], cyclic=hollow, values=values), name=name)
            first += count

    def _cam(self, place: CamPlacement, instant: SceneState) -> Iterator[tuple[str, list[Solid]]]:
        """Yield names and solids of the lobe, with the stub shaft of a cam without a member, and of the follower."""
        displacement = instant.nodal[place.node]
        angle = self.structure.model.cams[place.contact.cam].angle(np.array([instant.angle]))
        solids = [parts.lobe_solid(place, float(angle[0]), displacement)]
        if not self.structure.model.mesh.on_members()[place.node]:
            middle, reach = place.centre + displacement[:3], 1.1 * place.width * place.axis
            solids.append(cylinder("shaft", middle - reach, middle + reach, 0.4 * place.profile.follower.base_radius))
        yield place.contact.cam, solids
        yield place.contact.follower, parts.follower_solids(place, instant)

    def _balls(self, instant: SceneState) -> Iterator[Solid]:
        """Yield the masses at nodes without other parts; the rods of links stand for the body that leads them."""
        model = self.structure.model
        points = {valve.point for valve in self.valves} | {cam.contact.follower for cam in self.cams}
        for mass in model.masses.values():
            if mass.at in points or mass.at not in model.mesh.points:
                continue
            node = model.mesh.node(mass.at)
            if not model.mesh.on_members()[node] and all(node != nodes[0] for nodes in model.mesh.links.values()):
                radius = (0.75 * mass.body.mass / (math.pi * 7800.0)) ** (1.0 / 3.0)  # of a steel ball
                centre = model.mesh.nodes[node] + instant.nodal[node, :3]
                yield replace(ball("mass", centre, min(radius, 0.1 * model_size(model))), name=mass.at)


def build_mechanism(structure: Structure) -> Mechanism:
    """Create the drawable model of a structure."""
    model, notes = structure.model, Notes()
    head = 4.0 * valve_lift(model)  # makes the curtain area equal to the port area
    cams = tuple(_cams(model, notes))
    levers = {name: _lever(model, rocker, cams) for name, rocker in model.rockers.items()}
    valves = tuple(_valves(model, levers))
    for valve in valves:
        _record(notes, "diameter of the valve head at", valve.point, head, "four times the valve lift")
        if valve.stem:
            why = "a sixth of the head diameter; stem length three head diameters"
            _record(notes, "diameter of the valve stem at", valve.point, STEM * head, why)
    thick = 0.42 * min((arm for rocker in model.rockers.values() for arm in rocker.arms), default=0.0)
    for name in levers:
        _record(notes, "thickness of rocker", name, thick, "0.42 of the shortest arm")
    springs = tuple(_springs(structure, cams, levers, head, notes))
    sentences = tuple(text.format(", ".join(dict.fromkeys(names))) for text, names in notes.items())
    return Mechanism(structure, cams, levers, valves, springs, head, thick, sentences)
