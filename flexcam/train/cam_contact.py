"""Contact of a cam and its follower at the true point of contact.

The depth is counted along the lift: the lift, plus what the cam moves towards the follower, less what the follower
moves away. A flat follower is touched s' beside its axis: the cam's twist lifts it, the force twists the cam by F s',
and the follower's tilt lets it sink. Under a roller the force is inclined by the pressure angle, so that the cam feels
it sideways as well; a roller may tilt. The normal of a swinging follower turns with its arm, and a swinging flat face
is touched at another distance from its pivot than that of its lift. Friction acts along the face, against the velocity
at which the cam's surface slides; where a swinging face lies off its pivot, friction has a moment about that.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from flexcam.cam import (
    CamProfile,
    FlatFollower,
    SwingFlatFollower,
    SwingRollerFollower,
    profile_at,
    undercut,
)
from flexcam.cam.profile import Motion
from flexcam.checks import InputError, refuse
from flexcam.linalg import FloatArray
from flexcam.system import (
    AngleFunction,
    AngleVector,
    Channel,
    Evaluated,
    Following,
    LocalForce,
    LocalLaw,
    Observable,
    Observed,
    constant,
    derivative,
    force_sum,
    total,
)
from flexcam.train.contacts import conservative
from flexcam.train.coupling import Coupling
from flexcam.train.model import Cam, CamContact
from flexcam.train.penalty import Bilateral, HertzLine, HuntCrossley, Inclined, Sliding
from flexcam.train.structure import Structure, find_node

_ANGLES = np.linspace(0.0, 2.0 * np.pi, 7201)
"""Where the curvature is taken; between these it is interpolated, as it is asked for at every iteration."""

_STRAIGHT = 1e-2
"""Least relative curvature, 1/m: a flank with a radius above 100 m is as good as straight."""


def couple_cam(structure: Structure, name: str, contact: CamContact) -> Coupling:
    """Return the contact of a cam and its follower.

    Parameters
    ----------
    structure
        The structure.
    name
        Of the contact.
    contact
        The contact.

    Returns
    -------
    Coupling
        A local force with the channels force, torque and gap; pressure, sliding and friction where they are known.

    Raises
    ------
    InputError
        If the follower cannot move, or something is asked of a profile that is not given or not possible.
    """
    cam, where = structure.model.cams[contact.cam], f"contacts.{name}"
    depth = _depth(structure, contact, cam, where)
    law = _cam_law(structure, name, contact, cam)
    force = conservative(where, depth, law, cam.event, contact.restitution)
    torque: Observable = force_sum(0, factor=derivative(cam.event))
    if contact.friction:
        force = _rubbing(structure, name, contact, cam, force)
        torque = total(torque, force_sum(1, factor=_rub(cam)))
    return Coupling((), (force,), (
        Channel(f"{where}.force", "N", force_sum(0)),
        Channel(f"{where}.torque", "N m", torque),
        Channel(f"{where}.gap", "m", lambda seen: -seen.gaps[:, 0]),
        *_profile_channels(structure, name, contact, cam, law),
    ))  # fmt: skip


def _depth(structure: Structure, contact: CamContact, cam: Cam, where: str) -> AngleVector:
    """Return the derivative of the depth by the unknowns."""
    lift, axis = contact.direction, _turning(contact.shaft_axis)
    follower = structure.row(contact.follower, lift, f"{where}.follower")
    if not follower.any():
        raise _stands_still(structure, contact.follower, f"{where}.follower")
    _refuse_other_arm(structure, contact, cam, where)
    twist = structure.row(cam.at, axis)
    rolls = cam.follower is not None and np.isfinite(cam.follower.roller_radius)
    swings = isinstance(cam.follower, SwingRollerFollower | SwingFlatFollower)
    tilts = not rolls and not swings and structure.is_node(contact.follower)  # an arm turns by its lift
    tilt = structure.row(contact.follower, axis) if tilts else np.zeros_like(twist)
    rows = [structure.row(cam.at, lift) - follower, twist - tilt]
    functions: list[AngleFunction] = [constant(1.0), derivative(cam.event)]
    if swings:  # the normal turns with the arm
        rows = [twist, structure.row(cam.at, lift), structure.row(cam.at, _right(contact, cam))]
        more, by = zip(*_carried(structure, contact, cam), strict=True)
        return AngleVector(np.array([*rows, *more]), (functions[1], _along(cam), _beside(cam), *by))
    if rolls:
        rows.append(_sideways(structure, contact, cam))
        functions.append(_beside(cam))
    return AngleVector(np.array(rows), tuple(functions))


def _carried(structure: Structure, contact: CamContact, cam: Cam) -> list[tuple[FloatArray, AngleFunction]]:
    """Return rows and functions of what a swinging follower moves away.

    A finger that is a member has its node at the arm's length. A flat face is touched at the distance q from the pivot:
    there the finger moves by ``u + (q - arm) phi``, with u and phi of its node, and by virtual work the force N bends
    it as the same force at the node and the couple N (q - arm) do (S. P. Timoshenko, Strength of Materials I, on
    equivalent systems of forces): by lift, N and path are taken q/arm times. A roller's force passes through its
    centre; along the finger it is the tangent of the pressure angle, measured from the turned arm.
    """
    away = -structure.row(contact.follower, contact.direction)
    if not structure.is_node(contact.follower):
        return [(away, constant(1.0))]
    if not isinstance(cam.follower, SwingFlatFollower):
        return [(away, constant(1.0)), (-structure.row(contact.follower, _right(contact, cam)), _leaning(cam))]
    turned = structure.row(contact.follower, _turning(contact.shaft_axis))
    if not turned.any():
        return [(away, constant(1.0))]
    stiff = cam.follower.side * cam.turn * cam.follower.arm * turned  # what turning about the pivot moves away
    return [(stiff, constant(1.0)), (away - stiff, _lightened(cam))]


def _stands_still(structure: Structure, follower: str, where: str) -> InputError:
    mesh = structure.model.mesh
    if structure.is_node(follower) and not (structure.dofs.numbers[mesh.node(follower)] >= 0).any():
        given, why = f"{follower!r}, a node with nothing that moves", "members, masses and springs give a node unknowns"
        allowed = "a node of a member, or one with a mass or a spring along the lift"
        if mesh.node(follower) not in mesh.elements():
            return refuse(where, given, allowed, why, "end a member there, or put a mass on it")
    given, why = f"{follower!r}, held along the lift", "a follower that cannot move feels no cam"
    return refuse(where, given, "a point that is free along the lift", why, "free it in [supports]")


def _refuse_other_arm(structure: Structure, contact: CamContact, cam: Cam, where: str) -> None:
    """Refuse a follower whose profile is made for another arm than that of the finger it stands for."""
    swinging = cam.follower
    if not isinstance(swinging, SwingRollerFollower | SwingFlatFollower):
        return
    finger, key = structure.model.rocker_at(contact.follower), f"cams.{contact.cam}.follower"
    given, why = f"{1e3 * swinging.arm:g} mm", "the cam's profile is made for the path of the finger"
    if finger is not None:
        if abs(swinging.arm - finger.arms[0]) > _SAME * finger.arms[0]:
            allowed = f"{1e3 * finger.arms[0]:g} mm, that of the rocker"
            raise refuse(f"{key}.arm", given, allowed, why, f"see {where}")
        return
    for pivot in _pivots(structure, contact, cam):
        name = structure.model.mesh.node_name(pivot)
        length, square = _arm(structure, contact, cam, pivot)
        if min(abs(length - swinging.arm), abs(abs(square) - swinging.arm)) > _NEAR * swinging.arm:
            allowed = f"{1e3 * length:g} mm, from {name} to {contact.follower}"
            raise refuse(f"{key}.arm", given, allowed, why, f"see {where}")
        if swinging.side * square < 0.0:
            given, allowed = ("clockwise", "counterclockwise")[:: swinging.side]
            why = f"{name}, about which it turns, lies on the other side of the cam"
            raise refuse(f"{key}.rotation", given, allowed, why, f"or turn the cam, see {where}")


def _pivots(structure: Structure, contact: CamContact, cam: Cam) -> list[int]:
    """Return the node about which the follower's member turns in the plane of the cam, if that is just one."""
    mesh, vector = structure.model.mesh, structure.dofs.vector
    node = find_node(structure.model, contact.follower, "follower")
    plane = contact.direction, _right(contact, cam)
    held = [n for n in mesh.connected(node).tolist() if not any(vector(n, one).any() for one in plane)]
    turns = [n for n in held if vector(n, _turning(contact.shaft_axis)).any()]
    return turns if len(held) == 1 else []


def _arm(structure: Structure, contact: CamContact, cam: Cam, pivot: int) -> tuple[float, float]:
    """Return the distance of the follower from its pivot, m, and its part square to the lift, inwards positive."""
    mesh = structure.model.mesh
    away = mesh.nodes[pivot] - mesh.nodes[mesh.node(contact.follower)]
    lift, right = (float(away @ one[:3]) for one in (contact.direction, _right(contact, cam)))
    return float(np.hypot(lift, right)), right


_SAME = 1e-6
"""Difference of lengths that is a matter of digits written."""

_NEAR = 1e-2
"""Difference of an arm and its member that is a matter of how a finger was drawn."""


def _turning(axis: FloatArray) -> FloatArray:
    return np.concatenate([np.zeros(3), axis])


def _right(contact: CamContact, cam: Cam) -> FloatArray:
    """Return the direction to the right of the lift in the profile's drawing, shape (6,)."""
    return np.concatenate([cam.turn * np.cross(contact.direction[:3], contact.shaft_axis), np.zeros(3)])


def _sideways(structure: Structure, contact: CamContact, cam: Cam) -> FloatArray:
    """Return the row of what the cam moves to the right of the follower, in the profile's drawing."""
    along = _right(contact, cam)
    own = structure.row(contact.follower, along) if structure.is_node(contact.follower) else 0.0
    return structure.row(cam.at, along) - own


def _profile(cam: Cam, angle: FloatArray, motion: Motion | None = None) -> CamProfile:
    if cam.follower is None:
        raise refuse("follower", "none", "a follower and a base circle", "the profile follows from them")
    return profile_at(cam.event, cam.follower, angle, cam.turn, motion)


@lru_cache(maxsize=8)
def _around(cam: Cam) -> CamProfile:
    """Return the profile at `_ANGLES`, of which several things are tabled."""
    return _profile(cam, _ANGLES)


@dataclass(frozen=True, eq=False)
class _OfProfile(Following):
    """A function of the cam angle that follows from the profile, with its derivative."""

    cam: Cam
    value: Callable[[CamProfile], FloatArray]
    slope: Callable[[CamProfile], FloatArray]

    def of(self, cam: Evaluated, order: int) -> FloatArray:
        return (self.value, self.slope)[order](_touched(self.cam, cam))


def _touched(cam: Cam, at: Evaluated) -> CamProfile:
    """Return the profile at cam angles, made once for all that ask."""

    def made() -> CamProfile:
        event = cam.event
        return _profile(cam, at.angle, (at(event, 0), at(event, 1), at(event, 2)))

    return at.once((_touched, id(cam)), made)


@lru_cache(maxsize=8)
def _along(cam: Cam) -> AngleFunction:
    """Return the lift per motion of the cam along the lift as it begins."""
    return _OfProfile(cam, lambda made: made.push.real, lambda made: made.push_rate.real)


@lru_cache(maxsize=8)
def _beside(cam: Cam) -> AngleFunction:
    """Return the lift per motion of the cam to the right: the tangent of the pressure angle where nothing swings."""
    return _OfProfile(cam, lambda made: -made.push.imag, lambda made: -made.push_rate.imag)


@lru_cache(maxsize=8)
def _leaning(cam: Cam) -> AngleFunction:
    """Return the tangent of the pressure angle, from the motion of the follower where the arm has turned to."""
    return _OfProfile(
        cam, lambda made: np.tan(made.pressure_angle), lambda made: made.pressure_rate / made.touch.reach**2
    )


@lru_cache(maxsize=8)
def _slide(cam: Cam) -> AngleFunction:
    """Return the path per cam angle, m, by which the cam's surface slides to the right of a flat face."""
    return _OfProfile(cam, lambda made: made.touch.sliding, lambda made: made.touch.sliding_rate)


@lru_cache(maxsize=8)
def _lightened(cam: Cam) -> AngleFunction:
    """Return the force along the normal per force along the lift."""
    return _OfProfile(cam, lambda made: 1.0 / made.touch.reach, lambda made: _by_reach_rate(made, 1.0, 0.0))


@lru_cache(maxsize=8)
def _rub(cam: Cam) -> AngleFunction:
    """Return the path per cam angle, m, of the cam's surface alone along a flat face, by the reach."""
    off = _off_pivot(cam)
    return _OfProfile(
        cam,
        lambda made: (made.touch.sliding + off * made.velocity) / made.touch.reach,
        lambda made: _by_reach_rate(
            made, made.touch.sliding + off * made.velocity, made.touch.sliding_rate + off * made.acceleration
        ),
    )


def _by_reach_rate(made: CamProfile, value: FloatArray | float, rate: FloatArray | float) -> FloatArray:
    """Return the derivative of a value by the reach."""
    return (rate - value * made.touch.reach_rate / made.touch.reach) / made.touch.reach


def _off_pivot(cam: Cam) -> float:
    """Return the path to the right of a swinging flat face along itself, per lift."""
    one = cam.follower
    return one.side * one.face / one.arm if isinstance(one, SwingFlatFollower) else 0.0


@lru_cache(maxsize=8)
def _travelled(cam: Cam) -> AngleFunction:
    """Return the path that has slid past since cam angle zero, by the reach, m."""
    slid = _OfProfile(
        cam,
        lambda made: made.touch.sliding / made.touch.reach,
        lambda made: _by_reach_rate(made, made.touch.sliding, made.touch.sliding_rate),
    )
    return _Travelled(slid, cam, _off_pivot(cam))


class _Travelled(Following):
    """The path that has slid past since cam angle zero, m; `path` is its derivative.

    What the face itself has moved, `off` of the lift, is added: it counts with the motion of the follower.
    """

    def __init__(self, path: AngleFunction, cam: Cam, off: float) -> None:
        self._cam, self._off = cam, off
        width = _ANGLES[1]
        x, w = np.polynomial.legendre.leggauss(4)
        within = path((_ANGLES[:-1, None] + 0.5 * width * (1.0 + x)).ravel(), 0).reshape(-1, 4)
        self._path, self._slopes = path, path(_ANGLES, 0)
        self._sums = np.concatenate([[0.0], np.cumsum(0.5 * width * (within @ w))])

    def of(self, cam: Evaluated, order: int) -> FloatArray:
        slid = cam(self._path, order - 1) if order else self._slid(cam.angle)
        if not self._off:
            return slid
        made = _touched(self._cam, cam)
        if order:
            return slid + self._off * _by_reach_rate(made, made.lift, made.velocity)
        return slid + self._off * made.lift / made.touch.reach

    def _slid(self, angle: FloatArray) -> FloatArray:
        width, sums, slopes = _ANGLES[1], self._sums, self._slopes
        turns, rest = np.divmod(angle, 2.0 * np.pi)
        i = np.minimum((rest / width).astype(int), len(_ANGLES) - 2)
        z = (rest - _ANGLES[i]) / width
        y = 1.0 - z
        # Hermite's cubic through sums and slopes.
        ends = y * y * (1.0 + 2.0 * z) * sums[i] + z * z * (3.0 - 2.0 * z) * sums[i + 1]
        return turns * sums[-1] + ends + width * z * y * (y * slopes[i] - z * slopes[i + 1])


def _rubbing(structure: Structure, name: str, contact: CamContact, cam: Cam, force: LocalForce) -> LocalForce:
    """Return the contact with friction: a second scalar whose rate is the velocity of sliding."""
    where = f"contacts.{name}.friction"
    if cam.follower is None:
        remedy = "give base_radius and follower of the cam"
        raise refuse(where, contact.friction, "a cam with a profile", "the velocity of sliding follows from it", remedy)
    if np.isfinite(cam.follower.roller_radius):
        why = "a roller takes the sliding up by turning"
        raise refuse(where, contact.friction, "a follower with a flat face", why, "leave friction out")
    along = _rubbed(structure, contact, cam)
    acting = AngleVector(-along.vectors, along.functions)
    law = Sliding(force.law, contact.friction, contact.friction_speed)
    offset = (*force.offset, _travelled(cam))
    return LocalForce(
        force.name, (*force.sense, along), (*force.act, acting), law, offset, force.switching, force.restitution
    )  # fmt: skip


def _rubbed(structure: Structure, contact: CamContact, cam: Cam) -> AngleVector:
    """Return the derivative of the path along the face by the unknowns, per force along the normal.

    By virtual work (C. Lanczos, The Variational Principles of Mechanics, 4th ed., ch. III) the friction T does
    T times the path of the cam's surface less that of the face. A swinging face at the distance e from its pivot moves
    along itself by e per angle, lift by arm: that is the moment T e of friction about the pivot. With the force f along
    the lift, T is mu f over the reach, by which every path is divided here.
    """
    twist, right = structure.row(cam.at, _turning(contact.shaft_axis)), _right(contact, cam)
    if not isinstance(cam.follower, SwingFlatFollower):
        return AngleVector(np.array([_sideways(structure, contact, cam), twist]), (constant(1.0), _rub(cam)))
    rows = [structure.row(cam.at, right), -structure.row(cam.at, contact.direction), twist]
    rows.append(-_drawn(structure, contact, cam, cam.follower))
    return AngleVector(np.array(rows), (_along(cam), _beside(cam), _rub(cam), _lightened(cam)))


def _drawn(structure: Structure, contact: CamContact, cam: Cam, face: SwingFlatFollower) -> FloatArray:
    """Return the row of how far a swinging face moves along itself, to the right."""
    along = _off_pivot(cam) * structure.row(contact.follower, contact.direction)
    if not structure.is_node(contact.follower):
        return along
    own, turned = (structure.row(contact.follower, d) for d in (_right(contact, cam), _turning(contact.shaft_axis)))
    if not turned.any():
        return own + along
    mesh = structure.model.mesh
    node, centre = (mesh.nodes[mesh.node(one)] for one in (contact.follower, cam.at))
    height = face.base_radius - float((node - centre) @ contact.direction[:3])  # of the face above its node
    return own - cam.turn * height * turned


def _cam_law(structure: Structure, name: str, contact: CamContact, cam: Cam) -> LocalLaw:
    if not contact.unilateral:
        return Bilateral(contact.stiffness or 0.0)
    if contact.stiffness is not None:
        return HuntCrossley(contact.stiffness, contact.dissipation)
    law = hertz_line(structure, name, contact, cam)
    return law if isinstance(cam.follower, FlatFollower) else Inclined(law, _table(_around(cam).touch.reach))


def _table(values: FloatArray) -> AngleFunction:
    """Return what interpolates values at `_ANGLES`; its derivatives are not asked for."""

    def looked_up(angle: FloatArray, order: int) -> FloatArray:
        del order
        return np.interp(np.mod(angle, 2.0 * np.pi), _ANGLES, values)

    return looked_up


def hertz_line(structure: Structure, name: str, contact: CamContact, cam: Cam) -> HertzLine:
    """Return the line contact of a cam with its follower.

    Parameters
    ----------
    structure
        The structure: the member at the cam says the material.
    name
        Of the contact.
    contact
        The contact.
    cam
        Its cam, with follower, base circle and width.

    Returns
    -------
    HertzLine
        The law.

    Raises
    ------
    InputError
        If follower or width are not given, or the profile is hollow under a flat face.
    """
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
    own = _around(cam).radius
    curvature = 1.0 / own + 1.0 / roller
    if (undercut(own, follower) | (curvature < 0.0)).any():
        given = "a profile that is undercut or hollow under its follower"
        raise refuse(where, given, "one that touches along a line", "see flexcam cam", "a larger base circle")
    radius = _table(1.0 / np.maximum(curvature, _STRAIGHT))
    depth = roller if np.isfinite(roller) else cam.follower.base_radius
    return HertzLine(cam.width, material.E, material.nu, radius, depth, contact.dissipation)


def _profile_channels(structure: Structure, name: str, contact: CamContact, cam: Cam, law: LocalLaw) -> list[Channel]:
    """Return Hertz pressure, sliding velocity and friction, where the profile is known."""
    if cam.follower is None:
        return []
    where = f"contacts.{name}"
    channels: list[Channel] = []
    follower = cam.follower
    whole = not undercut(_around(cam).radius, follower).any()
    on_member = structure.model.mesh.on_members()[find_node(structure.model, cam.at, f"cams.{contact.cam}.at")]
    if cam.width is not None and whole and on_member:
        own = law.normal if isinstance(law, Inclined) else law
        line = own if isinstance(own, HertzLine) else hertz_line(structure, name, contact, cam)
        channels.append(Channel(f"{where}.pressure", "Pa", _pressure(line, cam)))
    if not np.isfinite(follower.roller_radius):
        channels.append(Channel(f"{where}.sliding", "m/s", _per_time(_slide(cam))))
    if contact.friction:
        channels.append(Channel(f"{where}.friction", "N", force_sum(1, factor=_lightened(cam))))
    return channels


def _per_time(path: AngleFunction) -> Observable:
    return lambda seen: seen.cam(path, 0) * seen.motion.speed


def _pressure(line: HertzLine, cam: Cam) -> Observable:
    def pressed(seen: Observed) -> FloatArray:
        reach = _touched(cam, seen.cam).touch.reach
        return line.pressure(seen.forces[:, 0] / reach, seen.cam(line.radius, 0))

    return pressed
