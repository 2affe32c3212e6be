"""Solids of the parts at an instant: lobes, followers, rockers, valves, coil springs, supports."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from flexcam.cams import CamProfile, SwingFlatFollower, SwingRollerFollower
from flexcam.core import ComplexArray, FloatArray
from flexcam.fem.dofs import COMPONENTS
from flexcam.plotting.scene import solids
from flexcam.plotting.scene.motion import SceneState, rotation_matrices
from flexcam.plotting.scene.solids import Solid
from flexcam.valvetrain import Lever, Model, Rocker, Spring
from flexcam.valvetrain.parts import CamPair


def in_space(point: complex, plane: FloatArray) -> FloatArray:
    """Return a vector of a plane in space, shape (3,); the rows of the plane are its axes."""
    return np.array([point.real, point.imag]) @ plane


@dataclass(frozen=True, eq=False)
class CamPlacement:
    """Cam and follower with their positions; they are drawn in a plane in space."""

    profile: CamProfile  # cam profile in its own coordinates
    centre: FloatArray  # centre of the cam at rest, m, shape (3,)
    lift: FloatArray  # unit vector along which the follower initially moves, shape (3,)
    axis: FloatArray  # unit vector of rotation, shape (3,)
    width: float
    node: int  # index of its node
    contact: CamPair  # contact with the follower
    ahead: float  # distance along the lift from the cam centre to the follower node, m; zero for a finger follower
    face: float  # radius of a flat face, m

    @property
    def plane(self) -> FloatArray:
        """Unit vectors in space of the drawing axes, shape (2, 3); the second is the lift."""
        return np.array([self.profile.turn * np.cross(self.lift, self.axis), self.lift])

    @property
    def side(self) -> int:
        """1 if the pivot of a swinging follower lies along the first axis from its contact end, else -1."""
        follower = self.profile.follower
        return follower.side if isinstance(follower, SwingRollerFollower | SwingFlatFollower) else 1

    def contact_end(self, lift: float) -> complex:
        """Return the contact end of the follower (a roller's centre) at a lift, in the plane, m."""
        touch = self.profile.follower.contact(np.array([lift]), np.zeros(1), np.zeros(1), self.profile.turn)
        return complex(touch.trace[0]) * self._upright_rotation

    @property
    def _upright_rotation(self) -> complex:
        """Rotation of the drawing after which the initial follower motion is along the imaginary axis."""
        zero = np.zeros(1)
        return 1j / complex(self.profile.follower.contact(zero, zero, zero, self.profile.turn).motion[0])

    def contour(self, angle: float) -> ComplexArray:
        """Return the profile at a cam angle, rad, in the rotated drawing, m, shape (n,), counterclockwise."""
        outline = self.profile.points @ np.array([1.0, 1j])
        points = outline * np.exp(1j * self.profile.turn * angle) * self._upright_rotation
        area = float(np.sum((np.conj(points) * np.roll(points, -1)).imag))
        return points if area > 0.0 else points[::-1]


def lobe_solid(frame: CamPlacement, angle: float, moved: FloatArray) -> Solid:
    """Return the solid of a lobe."""
    plane = frame.plane @ rotation_matrices(moved[None, 3:])[0]
    return solids.prism("lobe", solids.plane_points(frame.contour(angle)), plane, frame.centre + moved[:3], frame.width)


def follower_solids(place: CamPlacement, instant: SceneState) -> list[Solid]:
    """Return the solids of a follower: a flat face or a roller, and its connection to the moving node.

    A flat face is a disc on the cam, with a neck to the node if that is farther away.
    """
    displacement = instant.at(place.contact.follower, place.lift)
    if math.isfinite(place.profile.follower.roller_radius):
        return _roller(place, displacement, instant)
    base, radius = place.profile.follower.base_radius, place.face
    face = place.centre + base * place.lift + displacement
    thick = 0.3 * radius
    profile = [(0.0, 0.96 * radius), (0.04 * radius, radius), (thick, radius)]
    parts = [solids.revolve("follower", face, place.lift, profile)]
    if place.ahead - base > thick:
        bottom, top = face + thick * place.lift, face + (place.ahead - base) * place.lift
        parts.append(solids.cylinder("follower", bottom, top, 0.3 * radius))
    return parts


def _roller(place: CamPlacement, displacement: np.ndarray, instant: SceneState) -> list[Solid]:
    finger = not instant.structure.is_node(place.contact.follower)
    swings = finger or place.side != 1
    centre = place.contact_end(float(displacement @ place.lift) if swings else 0.0)
    middle = place.centre + in_space(centre, place.plane) + (0.0 if swings else 1.0) * displacement
    half, radius = 0.55 * place.width * place.axis, place.profile.follower.roller_radius
    parts = [solids.cylinder("roller", middle - half, middle + half, radius)]
    if not finger and place.ahead - place.contact_end(0.0).imag > 1.2 * radius:
        node = middle + (place.ahead - centre.imag) * place.lift
        parts.append(solids.cylinder("follower", middle, node, 0.4 * radius))
    return parts


@dataclass(frozen=True, eq=False)
class LeverFrame:
    """Plane of a rocker in space."""

    rocker: Rocker
    pivot: FloatArray  # pivot, m, shape (3,)
    plane: FloatArray  # unit vectors perpendicular to and along the motion of the driven end, shape (2, 3)
    side: int = -1  # side of the pivot with the driven end along the first axis of the plane, 1 or -1

    def ends(self, path: float) -> tuple[complex, complex]:
        """Return both ends relative to the pivot, in the plane, m, for a displacement of the driven end (m)."""
        rocker, far = self.rocker, self.side if self.rocker.finger else -self.side
        if isinstance(rocker, Lever):
            angles = rocker.angles[0] + path / rocker.arms[0], rocker.angles[1] + path / rocker.arms[0]
        else:  # constant ratio: the sine of the rotation is proportional to the displacement
            share = max(-0.9, min(0.9, path / rocker.arms[0]))
            angles = math.asin(share), math.asin(share)
        driven = rocker.arms[0] * complex(self.side * math.cos(angles[0]), math.sin(angles[0]))
        up = 1.0 if rocker.finger else -1.0
        return driven, rocker.arms[1] * complex(far * math.cos(angles[1]), up * math.sin(angles[1]))

    def space(self, point: complex) -> FloatArray:
        """Return a point of the plane in space, m, shape (3,)."""
        return self.pivot + in_space(point, self.plane)

    @property
    def opening_direction(self) -> FloatArray:
        """Unit vector of the output motion during lift, shape (3,)."""
        return self.plane[1] if self.rocker.finger else -self.plane[1]


def lever_solids(frame: LeverFrame, instant: SceneState, thick: float) -> list[Solid]:
    """Return the solids of a rocker and its pivot.

    The lower side of a rocker touches its pushrod and its valve; a finger touches its valve.
    """
    path, thin = float(instant.structure.path(frame.rocker) @ instant.unknowns), 0.5 * thick
    driven, point = frame.ends(path)
    if frame.rocker.finger:
        middle = 0j
        joints = [(middle, 0.7 * thick), (driven, 0.7 * thick), (point - 1j * thin, thin)]
    else:
        middle = 1j * thin
        joints = [(driven + middle, thin), (middle, 0.85 * thick), (point + middle, thin)]
    links = [solids.capsule(a, b, (r, s)) for (a, r), (b, s) in pairwise(joints)]
    parts = [solids.prism("rocker", outline, frame.plane, frame.pivot, thick) for outline in links]
    reach, centre = 0.9 * thick * np.cross(frame.plane[0], frame.plane[1]), frame.space(middle)
    parts.append(solids.cylinder("pivot", centre - reach, centre + reach, 0.45 * thick))
    if frame.rocker.finger:
        up = thick * frame.plane[1]
        parts.append(solids.cylinder("pivot", centre + 0.3 * up, centre + 3.0 * up, 0.6 * thick))
    return parts


STEM = 1.0 / 6.0  # ratio of stem diameter to head diameter
VALVE_LENGTH = 3.0  # ratio of valve length to head diameter
_HALF = 0.5 * STEM
# Axial positions from the valve end and radii there, relative to the head diameter
_HEAD_PROFILE = [(-0.45, _HALF), (-0.2, 1.3 * _HALF), (-0.1, 2.1 * _HALF), (-0.04, 0.47), (0.0, 0.5), (0.03, 0.5)]


@dataclass(frozen=True, eq=False)
class ValvePlacement:
    """Position of a valve."""

    point: str  # name of the point with which it moves
    # installed position, m, shape (3,): end of the stem, or centre of the head if the stem is a member of the model
    tip: FloatArray
    away: FloatArray  # unit vector of the opening direction, shape (3,)
    stem: bool  # whether the stem is drawn
    seat: bool  # whether the model has a seat for the valve


def valve_solids(place: ValvePlacement, instant: SceneState, head: float) -> list[Solid]:
    """Return the solids of a valve, and of its seat if the model has one."""
    length, away = (VALVE_LENGTH * head if place.stem else 0.0), place.away
    tip, stem = place.tip + instant.at(place.point, away), 0.5 * STEM * head
    profile = [(length + x * head, radius * head) for x, radius in _HEAD_PROFILE]
    parts = [solids.revolve("valve", tip, away, [*([(0.0, stem)] if place.stem else []), *profile])]
    if place.seat:
        closed = place.tip + (length - 0.08 * head) * away
        parts.append(solids.ring("seat", closed, away, (0.47 * head, 0.62 * head), 0.14 * head))
    return parts


@dataclass(frozen=True)
class CoilSizes:
    """Sizes of a drawn spring: mean coil diameter, wire diameter and installed length, m, and number of coils."""

    diameter: float
    wire: float
    length: float
    coils: float


_PER_COIL = 20
_WIRE = 10
_END_COILS = 1.0  # number of closed coils at each end


def coil_solid(sizes: CoilSizes, start: FloatArray, axis: FloatArray, moved: FloatArray) -> Solid:
    """Return the solid of a coil spring."""
    length = sizes.length
    turns = sizes.coils + 2.0 * _END_COILS
    angle = np.linspace(0.0, 2.0 * math.pi * turns, round(_PER_COIL * turns) + 1)
    inner = max(length - (1.0 + 2.0 * _END_COILS) * sizes.wire, 0.0)  # evenly spaced active coils
    half, lower = 0.5 * sizes.wire, 0.5 * sizes.wire + _END_COILS * sizes.wire
    ends = [0.0, _END_COILS, turns - _END_COILS, turns]
    place = np.interp(angle / (2.0 * math.pi), ends, [half, lower, lower + inner, length - half])
    closed = (0.5 + _END_COILS) * sizes.wire  # end coils move with the ends
    along = place + np.interp(place, np.linspace(closed, max(length - closed, closed), len(moved)), moved)
    first, second = solids.perpendicular_axes(axis)
    out = np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * second
    centres = start + along[:, None] * axis + 0.5 * sizes.diameter * out
    tangent = np.gradient(centres, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    up = np.cross(tangent, out)
    wire = solids.circle(0.5 * sizes.wire, _WIRE)
    return solids.loft("spring", centres[:, None] + wire[:, :1] * out[:, None] + wire[:, 1:] * up[:, None])


@dataclass(frozen=True, eq=False)
class CoilPlacement:
    """Position of a coil spring."""

    name: str  # name of the spring
    start: FloatArray  # installed position of its fixed end (that at `to`), m, shape (3,)
    axis: FloatArray  # unit vector from there to its moving end, shape (3,)
    sizes: CoilSizes  # sizes of the coil
    # rows over the degrees of freedom for the displacements of the boundaries of its parts along the spring direction,
    # from the fixed end to the moving end, shape (parts + 1, n)
    borders: FloatArray
    sense: float  # 1 if the direction of the spring is along `axis`, else -1
    ground: bool  # whether it stands on a washer at ground, and whether it has a retainer
    retainer: bool


def spring_solids(place: CoilPlacement, instant: SceneState) -> list[Solid]:
    """Return the solids of a spring."""
    displacements = place.sense * (place.borders @ instant.unknowns)
    size, axis = place.sizes, place.axis
    parts = [coil_solid(size, place.start, axis, displacements)]
    inner, outer, thick = 0.5 * (size.diameter - 1.6 * size.wire), 0.5 * size.diameter + size.wire, 0.7 * size.wire
    if place.retainer:
        top = place.start + (size.length + displacements[-1] + 0.5 * thick) * axis
        parts.append(solids.ring("retainer", top, axis, (0.25 * inner, outer), thick))
    if place.ground:
        parts.append(solids.ring("ground", place.start - 0.5 * thick * axis, axis, (0.6 * inner, 1.1 * outer), thick))
    return parts


def shaft_names(model: Model) -> list[str]:
    """Return the names of the members with cams."""
    cams = {model.mesh.node(cam.at) for cam in model.cams.values()}
    return [name for name, line in model.mesh.lines.items() if cams.intersection(line.tolist())]


def is_bearing(model: Model, spring: Spring) -> bool:
    """Return whether a spring is drawn as a bearing: from a node of a camshaft to ground."""
    if spring.to is not None or spring.at not in model.mesh.points:
        return False
    node = model.mesh.node(spring.at)
    return any(node in model.mesh.lines[name] for name in shaft_names(model))


# Outline of a drive wheel of 20 teeth and of radius 1, in the complex plane
_WHEEL = np.tile([1.0, 1.0, 0.9, 0.9], 20) * np.exp(2j * math.pi * np.arange(80) / 80)


def support_solids(model: Model, cams: Sequence[CamPlacement], instant: SceneState) -> Iterator[Solid]:
    """Yield the symbols of supports."""
    elastic = [spring for spring in model.springs.values() if is_bearing(model, spring)]
    bearings = {model.mesh.node(bearing.at) for bearing in (*elastic, *model.bearings.values())}
    shafts, fixed_dofs = shaft_names(model), np.zeros((len(model.mesh.nodes), 6), dtype=bool)
    for point, names in model.supports.items():
        fixed_dofs[model.mesh.points[point]] |= np.isin(COMPONENTS, list(names))
    faces = {model.mesh.node(c.contact.follower) for c in cams if c.ahead}
    for name, line in model.mesh.lines.items():
        radius = model.members[name].section.at(0.5).radius
        for place, node in enumerate(line.tolist()):
            before, after = max(place - 1, 0), min(place + 1, len(line) - 1)
            axis = solids.unit_vector(model.mesh.nodes[line[after]] - model.mesh.nodes[line[before]])
            position, fixed, plane = model.mesh.nodes[node], fixed_dofs[node], np.array(solids.perpendicular_axes(axis))
            driven = name in shafts and float(np.abs(fixed[3:] * axis).max()) > 0.5
            if driven:
                sense = float(np.sign(cams[0].axis @ axis)) if cams else 1.0
                teeth = solids.plane_points(_WHEEL * np.exp(1j * sense * instant.angle))
                yield replace(solids.prism("drive", 2.4 * radius * teeth, plane, position, 0.84 * radius), name=name)
            across = np.abs(plane)[:, ~fixed[:3]]  # free translations perpendicular to the axis
            if fixed.all():
                corners = 2.0 * radius * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
                yield replace(solids.prism("ground", corners, plane, position, 0.8 * radius), name=name)
            elif (node in bearings or not (across > 0.3).any()) and node not in faces and not driven:
                yield replace(
                    solids.ring("bearing", position, axis, (1.02 * radius, 1.6 * radius), 1.1 * radius), name=name
                )
