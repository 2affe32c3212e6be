"""Contact of a cam and its follower at the true point of contact.

The depth is counted along the lift: the lift, plus what the cam moves towards the follower, less what the follower
moves away. A flat follower is touched s' beside its axis: the cam's twist lifts it, the force twists the cam by F s',
and the follower's tilt lets it sink. Under a roller the force is inclined by the pressure angle, so that the cam feels
it sideways as well; a roller may tilt. The normal of a swinging follower turns with its arm, and a swinging flat face
is touched at another distance from its pivot than that of its lift. Friction acts along the face, against the velocity
at which the cam's surface slides; where a swinging face lies off its pivot, friction has a moment about that.
"""

from __future__ import annotations

import numpy as np

from flexcam.cam import FlatFollower, SwingFlatFollower, SwingRollerFollower, undercut
from flexcam.checks import InputError, refuse
from flexcam.linalg import FloatArray
from flexcam.system import (
    AngleFunction,
    AngleVector,
    Channel,
    ForceLaw,
    Observable,
    Observed,
    constant,
    derivative,
    force_sum,
    hunt_crossley_contact,
    spring_damper,
    total,
)
from flexcam.train.cam_friction import rubbing
from flexcam.train.cam_functions import (
    along_lift,
    around,
    beside_lift,
    leaning,
    lightened,
    rub,
    slide,
    tabled,
    touched,
)
from flexcam.train.cam_plane import refuse_other_arm, sideways, to_right, turning
from flexcam.train.contacts import conservative
from flexcam.train.coupling import Coupling
from flexcam.train.model import Cam, CamContact
from flexcam.train.penalty import STRAIGHT, HertzLine
from flexcam.train.structure import Structure, find_node


def couple_cam(structure: Structure, name: str, contact: CamContact) -> Coupling:
    """Return the contact of a cam and its follower."""
    cam, where = structure.model.cams[contact.cam], f"contacts.{name}"
    depth = _depth(structure, contact, cam, where)
    law = _cam_law(structure, name, contact, cam)
    force = conservative(where, depth, law, cam.event, contact.restitution)
    torque: Observable = force_sum(0, factor=derivative(cam.event))
    if contact.friction:
        force = rubbing(structure, name, contact, cam, force)
        torque = total(torque, force_sum(1, factor=rub(cam)))
    return Coupling((), (force,), (
        Channel(f"{where}.force", "N", force_sum(0)),
        Channel(f"{where}.torque", "N m", torque),
        Channel(f"{where}.gap", "m", lambda seen: -seen.gaps[:, 0]),
        *_profile_channels(structure, name, contact, cam),
    ))  # fmt: skip


def _depth(structure: Structure, contact: CamContact, cam: Cam, where: str) -> AngleVector:
    """Return the derivative of the depth by the unknowns."""
    lift, axis = contact.direction, turning(contact.shaft_axis)
    follower = structure.row(contact.follower, lift, f"{where}.follower")
    if not follower.any():
        raise _stands_still(structure, contact.follower, f"{where}.follower")
    refuse_other_arm(structure, contact, cam, where)
    twist = structure.row(cam.at, axis)
    rolls = cam.follower is not None and np.isfinite(cam.follower.roller_radius)
    swings = isinstance(cam.follower, SwingRollerFollower | SwingFlatFollower)
    tilts = not rolls and not swings and structure.is_node(contact.follower)  # an arm turns by its lift
    tilt = structure.row(contact.follower, axis) if tilts else np.zeros_like(twist)
    rows = [structure.row(cam.at, lift) - follower, twist - tilt]
    functions: list[AngleFunction] = [constant(1.0), derivative(cam.event)]
    if swings:  # the normal turns with the arm
        rows = [twist, structure.row(cam.at, lift), structure.row(cam.at, to_right(contact, cam))]
        more, by = zip(*_carried(structure, contact, cam), strict=True)
        return AngleVector(np.array([*rows, *more]), (functions[1], along_lift(cam), beside_lift(cam), *by))
    if rolls:
        rows.append(sideways(structure, contact, cam))
        functions.append(beside_lift(cam))
    return AngleVector(np.array(rows), tuple(functions))


def _carried(structure: Structure, contact: CamContact, cam: Cam) -> list[tuple[FloatArray, AngleFunction]]:
    """Return rows and functions of what a swinging follower moves away.

    A finger that is a member has its node at the arm's length. A flat face is touched at the distance q from the pivot:
    there the finger moves by ``u + (q - arm) phi``, with u and phi of its node, and by virtual work the force N bends
    it as the same force at the node and the couple N (q - arm) do (J. L. Meriam and L. G. Kraige, Engineering
    Mechanics: Statics, ch. 2, force-couple systems): by lift, N and path are taken q/arm times. A roller's force passes
    through its centre; along the finger it is the tangent of the pressure angle, measured from the turned arm.
    """
    away = -structure.row(contact.follower, contact.direction)
    if not structure.is_node(contact.follower):
        return [(away, constant(1.0))]
    if not isinstance(cam.follower, SwingFlatFollower):
        return [(away, constant(1.0)), (-structure.row(contact.follower, to_right(contact, cam)), leaning(cam))]
    turned = structure.row(contact.follower, turning(contact.shaft_axis))
    if not turned.any():
        return [(away, constant(1.0))]
    stiff = cam.follower.side * cam.turn * cam.follower.arm * turned  # what turning about the pivot moves away
    return [(stiff, constant(1.0)), (away - stiff, lightened(cam))]


def _stands_still(structure: Structure, follower: str, where: str) -> InputError:
    mesh = structure.model.mesh
    if structure.is_node(follower) and not (structure.dofs.numbers[mesh.node(follower)] >= 0).any():
        given, why = f"{follower!r}, a node with nothing that moves", "members, masses and springs give a node unknowns"
        allowed = "a node of a member, or one with a mass or a spring along the lift"
        if mesh.node(follower) not in mesh.elements():
            return refuse(where, given, allowed, why, "end a member there, or put a mass on it")
    given, why = f"{follower!r}, held along the lift", "a follower that cannot move feels no cam"
    return refuse(where, given, "a point that is free along the lift", why, "free it in [supports]")


def _cam_law(structure: Structure, name: str, contact: CamContact, cam: Cam) -> ForceLaw:
    if not contact.unilateral:
        return spring_damper(contact.stiffness or 0.0)
    if contact.stiffness is not None:
        return hunt_crossley_contact(contact.stiffness, contact.dissipation)
    line = hertz_line(structure, name, contact, cam)
    return line.law() if isinstance(cam.follower, FlatFollower) else line.law(tabled(around(cam).touch.reach))


def hertz_line(structure: Structure, name: str, contact: CamContact, cam: Cam) -> HertzLine:
    """Return the line contact of a cam with its follower."""
    where = f"contacts.{name}.stiffness"
    if cam.follower is None or cam.width is None:
        remedy = "give base_radius, follower and width of the cam, or a stiffness"
        raise refuse(where, "hertz", "a cam with a profile and a width", "the radius of curvature decides", remedy)
    model = structure.model
    node = find_node(model, cam.at, where)
    material = next((m.material for n, m in model.members.items() if node in model.mesh.lines[n]), None)
    if material is None:
        given, why = f"hertz, of a cam at {cam.at!r} on no member", "the member says the material"
        raise refuse(where, given, "a number, or a cam on a member", why)
    follower, roller = cam.follower, cam.follower.roller_radius
    own = around(cam).radius
    curvature = 1.0 / own + 1.0 / roller
    if (undercut(own, follower) | (curvature < 0.0)).any():
        given = "a profile that is undercut or hollow under its follower"
        raise refuse(where, given, "one that touches along a line", "see flexcam cam", "a larger base circle")
    rolls = bool(np.isfinite(roller))
    depth = 2.0 * (follower.base_radius + roller) if rolls else follower.base_radius  # the base circle for the cam
    radius = tabled(1.0 / np.maximum(curvature, 1.0 / (STRAIGHT * depth)))
    return HertzLine(cam.width, material.E, material.nu, radius, depth, contact.dissipation, rolls)


def _profile_channels(structure: Structure, name: str, contact: CamContact, cam: Cam) -> list[Channel]:
    """Return Hertz pressure, sliding velocity and friction, where the profile is known."""
    if cam.follower is None:
        return []
    where = f"contacts.{name}"
    channels: list[Channel] = []
    follower = cam.follower
    whole = not undercut(around(cam).radius, follower).any()
    on_member = structure.model.mesh.on_members()[find_node(structure.model, cam.at, f"cams.{contact.cam}.at")]
    if cam.width is not None and whole and on_member:
        line = hertz_line(structure, name, contact, cam)
        channels.append(Channel(f"{where}.pressure", "Pa", _pressure(line, cam)))
    if not np.isfinite(follower.roller_radius):
        channels.append(Channel(f"{where}.sliding", "m/s", _per_time(slide(cam))))
    if contact.friction:
        channels.append(Channel(f"{where}.friction", "N", force_sum(1, factor=lightened(cam))))
    return channels


def _per_time(path: AngleFunction) -> Observable:
    return lambda seen: seen.cam(path, 0) * seen.motion.speed


def _pressure(line: HertzLine, cam: Cam) -> Observable:
    def pressed(seen: Observed) -> FloatArray:
        reach = touched(cam, seen.cam).touch.reach
        return line.pressure(seen.forces[:, 0] / reach, seen.cam(line.radius, 0))

    return pressed
