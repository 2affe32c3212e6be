"""Contact of cam and follower: directions in the plane of the cam, penetration, friction, and Hertz's line contact."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from flexcam.cams import CamProfile, FlatFollower, SwingFlatFollower, SwingRollerFollower, undercut
from flexcam.cams.lift_event import describe_height
from flexcam.cams.lift_table import MAX_LIFT
from flexcam.core import FloatArray
from flexcam.core.errors import InputError, refuse
from flexcam.dynamics import (
    ONE,
    AngleFunction,
    AngleVector,
    Channel,
    ForceLaw,
    LocalForce,
    Observable,
    Observation,
    constant,
    derivative,
    force_sum,
    hunt_crossley_contact,
    observable_sum,
    spring_damper,
)
from flexcam.dynamics.cam_motion import cam_angle
from flexcam.dynamics.force_laws import LINE_CONTACT
from flexcam.fem.dofs import COMPONENTS
from flexcam.fem.sections import Material
from flexcam.valvetrain.cam_functions import (
    ANGLES,
    cached_profile,
    cam_sliding,
    face_sliding,
    lift_polynomials,
    lift_ratio,
    normal_force_ratio,
    outer_flank,
    pressure_tangent,
    profile_table,
    reach,
    relative_radius,
    sliding_distance,
    sliding_ratio,
    transverse_lift_ratio,
)
from flexcam.valvetrain.camshaft import has_elastic_drive
from flexcam.valvetrain.coupling import Coupling
from flexcam.valvetrain.lubrication import (
    Film,
    cam_surface_velocity,
    entrainment_velocity,
    flash_temperature,
    half_width,
    wear_depth,
)
from flexcam.valvetrain.parts import Cam, CamContact, CamPair
from flexcam.valvetrain.structure import Structure, find_node

STRAIGHT = 10.0
"""Maximum ratio of relative radius to depth: the logarithm is invalid for conformal contact of cam and roller."""


@dataclass(frozen=True, eq=False)
class HertzLine:
    """Line contact of cam and follower with a relative radius of curvature that depends on the cam angle.

    A cylinder of radius R pressed by p per length approaches its middle by ``(1 - nu^2) p/(pi E) (2 ln(4 R/a) - 1)``
    and sinks into a flat body of depth d by ``(1 - nu^2) p/(pi E) (2 ln(2 d/a) - nu/(1 - nu))``, with the half width
    ``a^2 = 4 p R/(pi E*)`` of the relative radius: K. L. Johnson, Contact Mechanics (1985), eqs. 4.43, 5.57 and 5.58.
    In the sum the radius cancels: with ``q = (1 - nu^2) p/(pi E)`` the approach is ``q (2 ln(d/q) - 1 - nu/(1 - nu))``,
    and of two cylinders ``q (2 ln(2 (R1 + R2)/q) - 2)``: only the distance of their axes remains. The curvature of the
    cam enters the pressure, but the stiffness at most by a logarithm, which is evaluated for the base circle.
    """

    width: float  #: length of the line, m
    #: `modulus`, `poisson`: E and nu of both bodies
    modulus: float
    poisson: float
    radius: AngleFunction  #: relative radius of curvature over the cam angle, m, above zero; `STRAIGHT` depths at most
    depth: float  #: depth of the flat body, or twice the distance of the axes of two cylinders on the base circle, m
    dissipation: float = 0.0  #: chi of Hunt and Crossley, s/m
    rolls: bool = False  #: whether both bodies are cylinders

    @property
    def plane_strain(self) -> float:
        """E/(1 - nu^2) of one body, Pa."""
        return self.modulus / (1.0 - self.poisson**2)

    def law(self, cosine: AngleFunction = ONE) -> ForceLaw:
        """Return the force law along a direction inclined to the contact normal.

        The law is linear above the load at which the half width is half the radius, ``pi E/(128 (1 - nu^2)) R``.
        """
        compliance = 1.0 / (math.pi * self.plane_strain)
        term = 2.0 if self.rolls else 1.0 + self.poisson / (1.0 - self.poisson)
        limit = math.pi * self.plane_strain / 128.0
        constants = (self.width, compliance, term, self.depth, self.dissipation, limit)
        return ForceLaw(LINE_CONTACT, constants, (self.radius, cosine))

    def pressure(self, force: FloatArray, radius: FloatArray) -> FloatArray:
        """Return the largest Hertz pressure, ``sqrt(p E*/(pi R))``."""
        p = np.maximum(force, 0.0) / self.width
        return np.sqrt(p * 0.5 * self.plane_strain / (math.pi * radius))


_LENGTH_TOLERANCE = 1e-6  # tolerance of lengths for rounding of input digits
_ARM_TOLERANCE = 1e-2  # tolerance between an arm and its member, of lengths and of the right angle to the lift


def transverse_row(structure: Structure, contact: CamContact, cam: Cam) -> FloatArray:
    """Return the row of the cam motion relative to the follower, to the right in the plane of the profile."""
    direction = cam.turn * contact.across
    follower = structure.row(contact.follower, direction) if structure.is_node(contact.follower) else 0.0
    return structure.row(cam.at, direction) - follower


def check_arm(structure: Structure, contact: CamContact, cam: Cam, where: str) -> None:
    """Refuse a swinging follower that differs from its finger or from the nodes of its arm."""
    follower = cam.follower
    if not isinstance(follower, SwingRollerFollower | SwingFlatFollower):
        return
    finger, key = structure.model.rocker_points.get(contact.follower), f"cams.{contact.cam}.follower"
    given, why = f"{1e3 * follower.arm:g} mm", "the cam's profile is made for the path of the finger"
    if finger is not None:
        if abs(follower.arm - finger.arms[0]) > _LENGTH_TOLERANCE * finger.arms[0]:
            name = next(name for name, rocker in structure.model.rockers.items() if rocker is finger)
            allowed = f"{1e3 * finger.arms[0]:g} mm, that of rockers.{name}.arms"
            raise refuse(f"{key}.arm", given, allowed, why, "correct one of the two")
        return
    mesh = structure.model.mesh
    for pivot in find_pivot(structure, contact):
        name = mesh.node_name(pivot)
        length, normal = _arm(structure, contact, cam, pivot)
        if min(abs(length - follower.arm), abs(abs(normal) - follower.arm)) > _ARM_TOLERANCE * follower.arm:
            allowed = f"{1e3 * length:g} mm, from {name} to {contact.follower}"
            raise refuse(f"{key}.arm", given, allowed, why, f"see {where}")
        if follower.side * normal < 0.0:
            given, allowed = ("clockwise", "counterclockwise")[:: follower.side]
            why = f"{name}, about which it turns, lies on the other side of the cam"
            raise refuse(f"{key}.rotation", given, allowed, why, f"or turn the cam, see {where}")
        if isinstance(follower, SwingRollerFollower) and length - abs(normal) > 0.5 * _ARM_TOLERANCE**2 * length:
            arm = mesh.nodes[mesh.node(contact.follower)] - mesh.nodes[pivot]
            lift = np.cross(contact.shaft_axis, arm)
            lift *= math.copysign(1.0, float(lift @ contact.direction[:3])) / np.linalg.norm(lift)
            allowed = f"{[round(float(x), 4) + 0.0 for x in lift]}"
            why = f"the roller moves perpendicular to its arm from {name}"
            given = f"{[round(float(x), 4) + 0.0 for x in contact.direction[:3]]}"
            raise refuse(f"{where}.direction", given, allowed, why, "correct it, or the nodes")


def find_pivot(structure: Structure, contact: CamContact) -> list[int]:
    """Return the pivot node of the follower's member in the plane of the cam, if unique.

    Of several along one line, such as those of a shaft that carries the arm, it is the nearest.
    """
    mesh, vector = structure.model.mesh, structure.dofs.vector
    node = find_node(structure.model, contact.follower, "follower")
    plane = contact.direction, contact.across
    fixed = [n for n in mesh.connected_nodes(node).tolist() if not any(vector(n, axis).any() for axis in plane)]
    fixed.sort(key=lambda n: float(np.linalg.norm(mesh.nodes[n] - mesh.nodes[node])))
    arm = mesh.nodes[node] - mesh.nodes[fixed[:1]]
    offsets = np.cross(mesh.nodes[fixed] - mesh.nodes[fixed[:1]], contact.shaft_axis)
    is_unique = bool(fixed) and float(np.abs(offsets).max()) <= _LENGTH_TOLERANCE * float(np.linalg.norm(arm))
    # A node beyond the pivot only moves sideways.
    lifts = abs(arm @ contact.across[:3]) > _ARM_TOLERANCE * np.linalg.norm(arm, axis=1)
    return fixed[:1] if is_unique and lifts.all() and vector(fixed[0], contact.rotation).any() else []


def _arm(structure: Structure, contact: CamContact, cam: Cam, pivot: int) -> tuple[float, float]:
    """Return the distance of the follower from its pivot, m, and its component normal to the lift, inwards positive."""
    mesh = structure.model.mesh
    arm = mesh.nodes[pivot] - mesh.nodes[mesh.node(contact.follower)]
    lift, right = (float(arm @ axis[:3]) for axis in (contact.direction, cam.turn * contact.across))
    return float(np.hypot(lift, right)), right


def sliding_path(structure: Structure, name: str, contact: CamContact, cam: Cam) -> AngleVector:
    """Return the derivative of the path along the face by the unknowns, per force along the normal.

    By virtual work (C. Lanczos, The Variational Principles of Mechanics, 4th ed., ch. III) the friction T does work T
    times the displacement of the cam's surface minus that of the face. A swinging face at the distance e from its pivot
    moves along itself by e per angle, lift by arm: that is the moment T e of friction about the pivot. With the force f
    along the lift, T is mu f over the reach, so every displacement is divided by the reach.
    """
    where = f"contacts.{name}.friction"
    if cam.follower is None:
        remedy = f"give the cam {' and '.join(cam.missing)}"
        raise refuse(where, contact.friction, "a cam with a profile", "the velocity of sliding follows from it", remedy)
    if np.isfinite(cam.follower.roller_radius):
        why = "a roller rolls without sliding"
        raise refuse(where, contact.friction, "a follower with a flat face", why, "leave friction out")
    twist, right = structure.row(cam.at, contact.rotation), cam.turn * contact.across
    if not isinstance(cam.follower, SwingFlatFollower):
        rows = np.array([transverse_row(structure, contact, cam), twist])
        return AngleVector(rows, (constant(1.0), cam_sliding(cam)))
    rows = [structure.row(cam.at, right), -structure.row(cam.at, contact.direction), twist]
    rows.append(-_face_row(structure, contact, cam, cam.follower))
    functions = lift_ratio(cam), transverse_lift_ratio(cam), cam_sliding(cam), normal_force_ratio(cam)
    return AngleVector(np.array(rows), functions)


def _face_row(structure: Structure, contact: CamContact, cam: Cam, face: SwingFlatFollower) -> FloatArray:
    """Return the row of the motion of a swinging face along itself, to the right."""
    path = face_sliding(cam.follower) * structure.row(contact.follower, contact.direction)
    if not structure.is_node(contact.follower):
        return path
    across, rotation = (structure.row(contact.follower, axis) for axis in (cam.turn * contact.across, contact.rotation))
    if not rotation.any():
        return across + path
    mesh = structure.model.mesh
    node, centre = (mesh.nodes[mesh.node(point)] for point in (contact.follower, cam.at))
    height = face.base_radius - float((node - centre) @ contact.direction[:3])  # of the face above its node
    return across - cam.turn * height * rotation


def couple_cam(structure: Structure, name: str, contact: CamContact, *, twists: bool = True) -> Coupling:
    """Return the contact of a cam and its follower; with `twists` the lift may be that at the angle of the shaft."""
    cam, where = structure.model.cams[contact.cam], f"contacts.{name}"
    sense, law = [_penetration_rows(structure, contact, cam, where)], _cam_law(structure, name, contact, cam)
    offset: list[AngleFunction] = [cam.event]
    torque: Observable = force_sum(0, factor=derivative(cam.event))
    if contact.friction:
        # The second scalar is the sliding path along the face.
        sense.append(sliding_path(structure, name, contact, cam))
        law = replace(law, friction=(contact.friction, contact.friction_speed))
        offset.append(sliding_distance(cam))
    if twists and contact.restitution is None and has_elastic_drive(structure, contact):
        # The last scalar is the angle of the cam, at which the law takes the lift.
        law, approach = replace(law, lift=lift_polynomials(cam.event)), sense[0]
        i = approach.functions.index(derivative(cam.event))
        remaining = AngleVector(
            np.delete(approach.vectors, i, axis=0), (*approach.functions[:i], *approach.functions[i + 1 :])
        )
        sense = [remaining, *sense[1:], AngleVector.constant(approach.vectors[i])]
        offset, torque = [constant(0.0), *offset[1:], cam_angle], force_sum(len(sense) - 1)
    if contact.friction:
        torque = observable_sum(torque, force_sum(1, factor=cam_sliding(cam)))
    act = tuple(AngleVector(-vector.vectors, vector.functions) for vector in sense)
    force = LocalForce(where, tuple(sense), act, law, tuple(offset), contact.restitution)

    def gap(obs: Observation) -> FloatArray:
        lift = law.lift(obs.penetrations[:, -1], 0) if law.lift else 0.0
        return -obs.penetrations[:, 0] - lift

    return Coupling((), (force,), (
        Channel(f"{where}.force", "N", force_sum(0)),
        Channel(f"{where}.torque", "N m", torque),
        Channel(f"{where}.gap", "m", gap),
        *_profile_channels(structure, name, contact, cam),
        *_lubrication_channels(structure, name, contact),
    ))  # fmt: skip


def _penetration_rows(structure: Structure, contact: CamContact, cam: Cam, where: str) -> AngleVector:
    """Return the derivative of the penetration by the unknowns."""
    lift, axis = contact.direction, contact.rotation
    follower = structure.row(contact.follower, lift, f"{where}.follower")
    if not follower.any():
        raise fixed_follower_error(structure, contact, f"{where}.follower")
    check_arm(structure, contact, cam, where)
    twist = structure.row(cam.at, axis)
    rolls = cam.follower is not None and np.isfinite(cam.follower.roller_radius)
    swings = isinstance(cam.follower, SwingRollerFollower | SwingFlatFollower)
    # A follower without a stated shape is a foot that is free to turn; an arm rotates by its lift.
    tilts = isinstance(cam.follower, FlatFollower) and structure.is_node(contact.follower)
    tilt = structure.row(contact.follower, axis) if tilts else np.zeros_like(twist)
    rows = [structure.row(cam.at, lift) - follower, twist - tilt]
    functions: list[AngleFunction] = [constant(1.0), derivative(cam.event)]
    if swings:  # the normal rotates with the arm
        rows = [twist, structure.row(cam.at, lift), structure.row(cam.at, cam.turn * contact.across)]
        arm, funcs = zip(*_swing_rows(structure, contact, cam), strict=True)
        return AngleVector(np.array([*rows, *arm]), (functions[1], lift_ratio(cam), transverse_lift_ratio(cam), *funcs))
    if rolls:
        rows.append(transverse_row(structure, contact, cam))
        functions.append(transverse_lift_ratio(cam))
    return AngleVector(np.array(rows), tuple(functions))


def _swing_rows(structure: Structure, contact: CamContact, cam: Cam) -> list[tuple[FloatArray, AngleFunction]]:
    """Return rows and functions of the motion of a swinging follower away from the cam.

    A finger that is a member has its node at the arm's length. A flat face is touched at the distance q from the pivot.
    There the finger moves by ``u + (q - arm) phi``, with u and phi of its node, and by virtual work the force N bends
    it as the same force at the node and the couple N (q - arm) do (J. L. Meriam and L. G. Kraige, Engineering
    Mechanics: Statics, ch. 2, force-couple systems): by lift, N and path are taken q/arm times. A roller's force passes
    through its centre; along the finger it is the tangent of the pressure angle, measured from the turned arm.
    """
    opening = -structure.row(contact.follower, contact.direction)
    if not structure.is_node(contact.follower):
        return [(opening, constant(1.0))]
    if not isinstance(cam.follower, SwingFlatFollower):
        return [
            (opening, constant(1.0)),
            (-structure.row(contact.follower, cam.turn * contact.across), pressure_tangent(cam)),
        ]
    rotation = structure.row(contact.follower, contact.rotation)
    if not rotation.any():
        return [(opening, constant(1.0))]
    rigid = cam.follower.side * cam.turn * cam.follower.arm * rotation  # motion by rotation about the pivot
    return [(rigid, constant(1.0)), (opening - rigid, normal_force_ratio(cam))]


def fixed_follower_error(structure: Structure, contact: CamPair, where: str) -> InputError:
    """Return the error of a follower that cannot move along the lift."""
    mesh, follower = structure.model.mesh, contact.follower
    supported = [COMPONENTS.index(name) for name in structure.model.supports.get(follower, ())]
    free = np.delete(contact.direction, supported).any()
    if structure.is_node(follower) and free and mesh.node(follower) not in mesh.elements():
        given, why = f"{follower!r}, a node with nothing that moves", "members, masses and springs give a node unknowns"
        allowed = "a node of a member, or one with a mass or a spring along the lift"
        remedy = f"end a member there, or add masses.NAME = {{ at = {follower!r}, mass = ... }}"
        return refuse(where, given, allowed, why, remedy)
    given, why = f"{follower!r}, held along the lift", "the cam cannot move this follower"
    return refuse(where, given, "a point that is free along the lift", why, "free it in [supports]")


def _cam_law(structure: Structure, name: str, contact: CamContact, cam: Cam) -> ForceLaw:
    if not contact.unilateral:
        return spring_damper(contact.stiffness or 0.0)
    if contact.stiffness is not None:
        return hunt_crossley_contact(contact.stiffness, contact.dissipation)
    cosine = ONE if isinstance(cam.follower, FlatFollower) else reach(cam)
    return hertz_line(structure, name, contact, cam).law(cosine)


def hertz_line(
    structure: Structure, name: str, contact: CamContact, cam: Cam,
    key: Literal["stiffness", "lubrication"] = "stiffness",
) -> HertzLine:  # fmt: skip
    """Return the Hertz line contact of a cam with its follower; messages name the key of the contact that needs it."""
    where, given = f"contacts.{name}.{key}", "hertz" if key == "stiffness" else "a table"
    if cam.follower is None or cam.width is None:
        missing = [*(cam.missing if cam.follower is None else ()), *(["width"] if cam.width is None else [])]
        number = "or write the stiffness as a number, such as '200 MN/m'"
        hint = number if key == "stiffness" else "or leave lubrication out"
        why, remedy = f"cams.{contact.cam} has no {' and no '.join(missing)}", f"add {' and '.join(missing)}, {hint}"
        raise refuse(where, given, "a cam with base_radius, follower and width", why, remedy)
    material = _cam_material(structure, cam)
    if material is None:
        given, why = f"{given}, of a cam at {cam.at!r} on no member", "the material is that of the member"
        raise refuse(where, given, "a number, or a cam on a member" if key == "stiffness" else "a cam on a member", why)
    follower, roller = cam.follower, cam.follower.roller_radius
    cam_radius = profile_table(cam).radius
    curvature = 1.0 / cam_radius + 1.0 / roller
    if (crossed := undercut(cam_radius, follower) | (curvature < 0.0)).any():
        place = f"first at {math.degrees(ANGLES[np.argmax(crossed)]):.4g} deg of cam angle"
        why = f"the profile is undercut (it would cross itself), {place}"
        if np.isfinite(roller) and not undercut(cam_radius, follower).any():
            why = f"the profile has a hollow that is narrower than the roller, {place}"
        radius = f"{1e3 * follower.base_radius:g} mm"
        allowed = f"a larger base circle for a lift of {describe_height(cam.event)}"
        remedy = "flexcam cam prints the minimum base-circle radius; a longer event also helps"
        if cam.event.height > MAX_LIFT:
            remedy = f"did you mean a lift of {cam.event.height:.3g} mm?"
        raise refuse(f"cams.{contact.cam}.base_radius", radius, allowed, why, remedy)
    rolls = bool(np.isfinite(roller))
    depth = 2.0 * (follower.base_radius + roller) if rolls else follower.base_radius  # the base circle for the cam
    radius = relative_radius(cam, STRAIGHT * depth)
    return HertzLine(cam.width, material.E, material.nu, radius, depth, contact.dissipation, rolls)


def _cam_material(structure: Structure, cam: Cam) -> Material | None:
    """Return the material of the member on which a cam sits; None without a member."""
    model = structure.model
    node = find_node(model, cam.at, "cam")
    return next((m.material for n, m in model.members.items() if node in model.mesh.lines[n]), None)


def _profile_channels(structure: Structure, name: str, contact: CamContact, cam: Cam) -> list[Channel]:
    """Return the channels Hertz pressure, sliding velocity and friction, if the profile is known."""
    if cam.follower is None:
        return []
    where = f"contacts.{name}"
    channels: list[Channel] = []
    follower = cam.follower
    regular = not undercut(profile_table(cam).radius, follower).any()
    on_member = structure.model.mesh.on_members()[find_node(structure.model, cam.at, f"cams.{contact.cam}.at")]
    if cam.width is not None and regular and on_member:
        line = hertz_line(structure, name, contact, cam)
        flanks = [(1.0, line.radius)]
        outer = outer_flank(profile_table(cam).radius, follower.roller_radius)
        if line.rolls and not contact.unilateral and not undercut(outer, follower).any():
            flanks.append((-1.0, relative_radius(cam, STRAIGHT * line.depth, outer=True)))

        def pressure(obs: Observation) -> FloatArray:
            force = obs.forces[:, 0] / cached_profile(cam, obs.cam).touch.reach
            return np.max([line.pressure(sign * force, obs.cam(radius, 0)) for sign, radius in flanks], axis=0)

        channels.append(Channel(f"{where}.pressure", "Pa", pressure))
    if not np.isfinite(follower.roller_radius):
        path = sliding_ratio(cam)
        channels.append(Channel(f"{where}.sliding", "m/s", lambda obs: obs.cam(path, 0) * obs.motion.speed))
    if contact.friction:
        channels.append(Channel(f"{where}.friction", "N", force_sum(1, factor=normal_force_ratio(cam))))
    return channels


WEAR_REVOLUTIONS = 1e6
"""Number of revolutions of the channel `wear`."""


def _lubrication_channels(structure: Structure, name: str, contact: CamContact) -> list[Channel]:
    """Return the channels of film, flash temperature and wear, if the contact has oil.

    The forces of the contact law are that along the lift and the friction divided by the reach.
    """
    lubrication, cam = contact.lubrication, structure.model.cams[contact.cam]
    if lubrication is None:
        return []
    where, line = f"contacts.{name}", hertz_line(structure, name, contact, cam, "lubrication")
    film = Film(line.plane_strain, lubrication.viscosity, lubrication.pressure_viscosity)
    wear_coefficient = lubrication.wear_coefficient
    if line.rolls and wear_coefficient is not None:
        given, why = f"{wear_coefficient:g} m^2/N", "a roller rolls without sliding"
        key = f"{where}.lubrication.wear_coefficient"
        raise refuse(key, given, "a follower with a flat face", why, "leave wear_coefficient out")

    def state(obs: Observation) -> tuple[CamProfile, FloatArray, FloatArray]:
        """Return profile, load per length (N/m) and relative radius of curvature (m)."""
        profile = cached_profile(cam, obs.cam)
        load = np.maximum(obs.forces[:, 0], 0.0) / (profile.touch.reach * line.width)
        return profile, load, obs.cam(line.radius, 0)

    def entrainment(obs: Observation) -> FloatArray:
        return entrainment_velocity(cached_profile(cam, obs.cam)) * obs.motion.speed

    def minimum_film(obs: Observation) -> FloatArray:
        return film.minimum(entrainment(obs), *state(obs)[1:])

    channels = [
        Channel(f"{where}.entrainment", "m/s", entrainment),
        Channel(f"{where}.film", "m", minimum_film),
        Channel(f"{where}.central_film", "m", lambda obs: film.central(entrainment(obs), *state(obs)[1:])),
    ]
    if lubrication.roughness is not None:
        roughness = lubrication.roughness
        channels.append(Channel(f"{where}.lambda", "1", lambda obs: minimum_film(obs) / roughness))
    material = _cam_material(structure, cam)
    if contact.friction and material and lubrication.conductivity and lubrication.specific_heat:
        if not material.density:
            why, remedy = "the heat that the cam takes up depends on it", "give the cam's member a density"
            raise refuse(f"{where}.lubrication.conductivity", "no density", "a cam with a density", why, remedy)
        effusivity = math.sqrt(lubrication.conductivity * material.density * lubrication.specific_heat)

        def temperature(obs: Observation) -> FloatArray:
            profile, load, radius = state(obs)
            u1, sliding = (v * obs.motion.speed for v in (cam_surface_velocity(profile), profile.touch.sliding))
            heat = np.abs(obs.forces[:, 1] / profile.touch.reach * sliding) / line.width
            width = half_width(load, radius, line.plane_strain)
            return flash_temperature(heat, width, effusivity, u1, u1 - sliding)

        channels.append(Channel(f"{where}.flash_temperature", "K", temperature))
    if wear_coefficient is not None:

        def wear(obs: Observation) -> FloatArray:
            profile, load, _ = state(obs)
            depth = wear_depth(wear_coefficient, load, profile.touch.sliding, cam_surface_velocity(profile))
            return WEAR_REVOLUTIONS * depth

        channels.append(Channel(f"{where}.wear", "m", wear))
    return channels
