"""Build the model of a case: default contact stiffnesses, members, springs, loads, rockers, contacts and cams."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TypeVar

import numpy as np
from pydantic import ValidationError

from flexcam import valvetrain
from flexcam.cams import Follower, Turn
from flexcam.case.case import Case
from flexcam.case.cross_checks import mesh_faults, model_faults
from flexcam.case.fault_report import convert_errors
from flexcam.case.records import CaseRecord
from flexcam.case.schema import cams, contacts, parts
from flexcam.case.schema.base import Length, Record
from flexcam.case.schema.cams import FollowerRecord
from flexcam.case.schema.contacts import LashRecord
from flexcam.case.toml_lines import KeyLocations, parse_toml
from flexcam.core import FloatArray
from flexcam.core.errors import Fault, InputError, refuse, suggest_name
from flexcam.fem.frames import default_orientation, direction
from flexcam.fem.members import Member
from flexcam.fem.mesh import Mesh, refine
from flexcam.valvetrain.surge import count_spring_parts

DEFAULT_LASH_STIFFNESS_RATIO = 10.0
"""Default stiffness of touching faces relative to the member behind them, to whose compliance it adds a tenth."""


def default_lash_stiffness(play: LashRecord, case: CaseRecord, mesh: Mesh) -> float:
    """Return the stiffness of both sides of a lash when they touch, N/m."""
    if play.stiffness is not None:
        return play.stiffness
    ends, ratio = _lash_sides(play, case)
    nodes = [mesh.node(name) for name in ends if name in mesh.points]
    found = [_axial(name, case, mesh) for name, line in mesh.lines.items() if np.isin(nodes, line[[0, -1]]).any()]
    if not found:
        why = "no member ends at the play whose own could be taken"
        raise refuse("stiffness", "nothing", "a value", why, 'add stiffness = "20 MN/m" or what is meant')
    return DEFAULT_LASH_STIFFNESS_RATIO * min(found) / ratio**2


def _lash_sides(play: LashRecord, case: CaseRecord) -> tuple[tuple[str, ...], float]:
    """Return the nodes on both sides, and the ratio of the lash displacement to the displacement of these nodes."""
    if play.ends is not None:
        return play.ends, 1.0
    rocker = case.rockers[str(play.at)]
    return (rocker.start,), rocker.arms[1] / rocker.arms[0]


def _axial(name: str, case: CaseRecord, mesh: Mesh) -> float:
    member = case.members[name]
    length = np.linalg.norm(np.diff(mesh.nodes[mesh.lines[name]], axis=0), axis=1).sum()
    return case.materials[member.material].part.E * case.sections[member.section].part.A / float(length)


def with_spring_parts(case: Case) -> Case:
    """Return a case with the springs that have mass divided into parts, unless the case gives the number of parts."""
    untold = {
        name: one for name, one in case.record.springs.items() if one.mass and "elements" not in one.model_fields_set
    }
    if not untold:
        return case
    lifts = [cam.part.event for cam in case.record.cams.values()]
    parts = {name: count_spring_parts(one.part, lifts, case.speed) for name, one in untold.items()}
    divided = {name: one.model_copy(update={"elements": parts[name]}) for name, one in untold.items()}
    springs = case.record.springs | divided
    return replace(case, record=case.record.model_copy(update={"springs": springs}))


class _FollowerRecord(Record):
    """Follower and the base circle of its cam."""

    follower: FollowerRecord
    base_radius: Length | None = None


def parse_follower(follower: str, base_radius: str | None = None, *, clockwise: bool = False) -> tuple[Follower, Turn]:
    """Return the follower of a TOML table and the direction of rotation of its cam."""
    try:
        table = parse_toml(f"follower = {follower}")["follower"]
    except ValueError as fault:
        allowed = 'a table such as { type = "roller", radius = "9 mm" }'
        raise refuse("follower", follower, allowed, str(fault), "texts need quotes") from None
    try:
        alone = _FollowerRecord.model_validate({"follower": table, "base_radius": base_radius})
    except ValidationError as refusal:
        raise InputError(convert_errors(refusal.errors(include_url=False), KeyLocations({}), _FollowerRecord)) from None
    made = alone.follower.build(alone.base_radius)
    if made is None:
        raise refuse("base_radius", "nothing", "the radius of the base circle", "the lift counts from it", "give it")
    return made, -1 if clockwise else 1


In = TypeVar("In")
Out = TypeVar("Out")


def build_model(case: Case) -> valvetrain.Model:
    """Build the model of a case.

    Parameters
    ----------
    case
        Checked case.

    Returns
    -------
    Model
        Model without matrices.

    Raises
    ------
    InputError
        If geometry or parts are invalid; the error lists all faults.

    Examples
    --------
    ``build_model(read_case("cases/tayeb/model-3-shm.toml")).mesh.lines["pushrod"]`` contains the nodes of the pushrod.
    """
    record = case.record
    faults: list[Fault] = []

    def each(kind: str, table: Mapping[str, In], make: Callable[[In], Out]) -> dict[str, Out]:
        made: dict[str, Out] = {}
        for name, part in table.items():
            try:
                made[name] = make(part)
            except InputError as refusal:
                faults.extend(_prefix_fault(case.place((kind, name)), fault) for fault in refusal.faults)
        return made

    mesh = _mesh(case)
    faults.extend(mesh_faults(case, mesh))
    pairs = each("bearings", record.bearings, lambda one: _bearing(one, mesh))
    model = valvetrain.Model(
        mesh=mesh,
        members={name: _member(member, record) for name, member in record.members.items()},
        supports={point: tuple(held) for point, held in record.supports.items()},
        masses={name: one.part for name, one in record.masses.items()},
        springs={**{name: one.part for name, one in record.springs.items()}, **_bearings(pairs)},
        rockers=each("rockers", record.rockers, lambda one: _rocker(one, record, mesh)),
        cams={name: one.part for name, one in record.cams.items()},
        contacts=each("contacts", record.contacts, lambda one: _contact(one, record, mesh)),
        loads={name: one.part for name, one in record.loads.items()},
        gravity=record.run.gravity,
        damping=record.run.damping.part,
        probes=tuple(record.output.probes),
    )
    faults.extend(model_faults(case, model))
    if faults:
        raise InputError(faults)
    return model


def _prefix_fault(where: str, fault: Fault) -> Fault:
    return Fault(f"{where}: {fault.where}", fault.given, fault.allowed, fault.why, fault.remedy)


def _mesh(case: Case) -> Mesh:
    try:
        return refine(case.mesh or _inline_mesh(case), {n: m.elements for n, m in case.record.members.items()})
    except InputError as refusal:
        where = case.place(("nodes",) if case.mesh is None else ("mesh",))
        faults = [f if f.where.startswith("members") else _prefix_fault(where, f) for f in refusal.faults]
        raise InputError(faults) from None


def _inline_mesh(case: Case) -> Mesh:
    names = list(case.record.nodes)
    index = {name: np.array([i]) for i, name in enumerate(names)}
    lines = {name: np.array([names.index(node) for node in m.nodes or []]) for name, m in case.record.members.items()}
    return Mesh(np.array(list(case.record.nodes.values())), lines, index)


def _member(member: parts.MemberRecord, case: CaseRecord) -> Member:
    return Member(
        case.materials[member.material].part, case.sections[member.section].part, member.orientation,
        member.shear, member.rotary_inertia, member.mass, member.geometric_stiffness, member.bow,
    )  # fmt: skip


def _bearing(bearing: parts.BearingRecord, mesh: Mesh) -> tuple[valvetrain.Spring, ...]:
    """Return two springs, perpendicular to the shaft and to each other."""
    axis = _tangent(mesh, mesh.node(bearing.at))
    first = _direction_to_follower(default_orientation(axis), axis)
    return tuple(
        valvetrain.Spring(bearing.at, _six_components(along), *bearing.part) for along in (first, np.cross(axis, first))
    )


def _bearings(pairs: Mapping[str, tuple[valvetrain.Spring, ...]]) -> dict[str, valvetrain.Spring]:
    return {
        f"bearing {name}, {which} direction": spring
        for name, pair in pairs.items()
        for which, spring in zip(("first", "second"), pair, strict=True)
    }


def _rocker(record: parts.LumpedRecord | parts.LeverRecord, case: CaseRecord, mesh: Mesh) -> valvetrain.Rocker:
    finger = isinstance(record, parts.LeverRecord) and record.start not in mesh.points
    touched = [one.follower for one in case.contacts.values() if isinstance(one, contacts.CamContactRecord)]
    if finger and record.start not in touched:
        allowed = f"a named node, or the follower of a cam's contact: {', '.join([*mesh.points, *touched])}"
        why, remedy = "nothing would drive the lever", suggest_name(record.start, [*mesh.points, *touched])
        raise refuse("from", repr(record.start), allowed, why, remedy)
    along = _rocker_direction(record, case, mesh) if not finger else _finger_direction(record)
    if isinstance(record, parts.LumpedRecord):
        return valvetrain.Rocker(record.start, record.to, record.arms, record.inertia, along)
    stiffness = record.drive_stiffness or record.stiffness, record.stiffness
    damping = record.drive_damping, record.damping
    return valvetrain.Lever(
        record.start, record.to, record.arms, record.inertia, along, finger, record.angles, stiffness, damping
    )


def _rocker_direction(record: parts.LumpedRecord | parts.LeverRecord, case: CaseRecord, mesh: Mesh) -> FloatArray:
    """Return the direction in which a rocker is driven: given, or along the member, away from the cam."""
    if record.direction is not None:
        return direction(record.direction)
    start = mesh.node(record.start, "from")
    tangent = _tangent(mesh, start)
    driven = [one for one in case.contacts.values() if isinstance(one, contacts.CamContactRecord)]
    lifts = [_lift_direction(one, case, mesh) for one in driven if _is_connected(one, start, mesh)]
    against = any(float(lift[:3] @ tangent) < 0.0 for lift in lifts)
    return _six_components(-tangent if against else tangent)


def _finger_direction(record: parts.LumpedRecord | parts.LeverRecord) -> FloatArray:
    if record.direction is None:
        why = "a finger's point lies on no member whose direction it could take"
        raise refuse("direction", "nothing", "the direction in which the cam drives it", why, 'add direction = "uy"')
    return direction(record.direction)


def _is_connected(contact: contacts.CamContactRecord, node: int, mesh: Mesh) -> bool:
    return contact.follower in mesh.points and node in mesh.connected_nodes(mesh.node(contact.follower, "follower"))


def _contact(record: contacts.ContactRecord, case: CaseRecord, mesh: Mesh) -> valvetrain.Contact:
    match record:
        case contacts.SeatRecord():
            along = np.zeros(6) if record.direction is None else direction(record.direction)
            resisting = record.stiffness, record.damping, record.restitution, record.damping_depth
            return valvetrain.Seat(record.at, along, *resisting)
        case contacts.LashRecord():
            resisting = default_lash_stiffness(record, case, mesh), record.damping
            return valvetrain.Lash(record.at, record.gap, *resisting, *_between(record), record.damping_depth)
        case contacts.AdjusterRecord():
            size = record.stiffness, record.leak, record.refill, record.plunger_force
            return valvetrain.Adjuster(record.at, *size, *_between(record))
        case _:
            return _driven(record, case, mesh)


def _between(
    record: contacts.LashRecord | contacts.AdjusterRecord,
) -> tuple[tuple[str, str] | None, FloatArray | None]:
    return record.ends, None if record.direction is None else direction(record.direction)


def _driven(
    record: contacts.CamContactRecord, case: CaseRecord, mesh: Mesh
) -> valvetrain.PublishedLoad | valvetrain.CamContact:
    between = (
        record.cam,
        record.follower,
        _lift_direction(record, case, mesh),
        _rotation_axis(case.cams[record.cam], mesh),
    )
    match record:
        case contacts.PublishedLoadRecord():
            return valvetrain.PublishedLoad(*between, record.preload_factor, record.cam_deflection, record.cam_torque)
        case contacts.BilateralRecord():
            return valvetrain.CamContact(*between, record.stiffness, unilateral=False)
        case contacts.UnilateralRecord():
            stiffness = None if record.stiffness == "hertz" else record.stiffness
            return valvetrain.CamContact(
                *between, stiffness, unilateral=True, dissipation=record.dissipation, restitution=record.restitution,
                friction=record.friction, friction_speed=record.friction_speed,
            )  # fmt: skip


def _lift_direction(record: contacts.CamContactRecord, case: CaseRecord, mesh: Mesh) -> FloatArray:
    """Return the direction of the lift: given, or from cam to follower perpendicular to the shaft."""
    if record.direction is not None:
        return _checked_lift_direction(direction(record.direction), record, case, mesh)
    cam = mesh.node(case.cams[record.cam].at, "cam")
    for rocker in case.rockers.values():
        if record.follower == rocker.start and record.follower not in mesh.points:
            return _finger_direction(rocker)
    follower = mesh.node(record.follower, "follower")
    return _six_components(
        _direction_to_follower(mesh.nodes[follower] - mesh.nodes[cam], _rotation_axis(case.cams[record.cam], mesh))
    )


def _checked_lift_direction(
    lift: FloatArray, record: contacts.CamContactRecord, case: CaseRecord, mesh: Mesh
) -> FloatArray:
    """Return a given lift direction after checking that it points away from the shaft and is perpendicular to it."""
    cam = mesh.node(case.cams[record.cam].at, "cam")
    if abs(float(lift[:3] @ _rotation_axis(case.cams[record.cam], mesh))) > _PERPENDICULAR_TOLERANCE * float(
        np.linalg.norm(lift[:3])
    ):
        raise refuse(
            "direction", lift[:3].tolist(), "a direction square to the shaft", "a plate cam lifts in its plane"
        )
    if record.follower in mesh.points:
        span = mesh.nodes[mesh.node(record.follower)] - mesh.nodes[cam]
        if float(span @ lift[:3]) < -_PERPENDICULAR_TOLERANCE * float(np.linalg.norm(span)):
            why = "the follower lies on the other side, and the cam would pass through it"
            raise refuse("direction", lift[:3].tolist(), "from the cam to its follower", why, "turn its sign")
    return lift


_PERPENDICULAR_TOLERANCE = 1e-6
"""Maximum cosine of the angle between directions that count as perpendicular."""


def _rotation_axis(cam: cams.CamRecord, mesh: Mesh) -> FloatArray:
    """Return the axis of rotation: along the shaft, toward the given side or toward positive coordinates."""
    if not mesh.on_members()[mesh.node(cam.at, "at")]:
        return _given_rotation_axis(cam)
    along = _tangent(mesh, mesh.node(cam.at, "at"))
    side = np.array(cam.axis) if cam.axis is not None else np.sign(along[np.argmax(np.abs(along))]) * along
    if abs(float(side @ along)) < 0.5 * float(np.linalg.norm(side)):
        raise refuse("axis", side.tolist(), "a vector along the shaft", "the cam turns with the shaft")
    return along if float(side @ along) > 0.0 else -along


def _given_rotation_axis(cam: cams.CamRecord) -> FloatArray:
    """Return the given axis of rotation of a cam at a node without a shaft."""
    if cam.axis is None or not any(cam.axis):
        given, why = f"nothing, for a cam at {cam.at!r} on no member", "there is no shaft to take it from"
        raise refuse("axis", given, "a vector along the axis of rotation", why, "add axis = [1, 0, 0] to the cam")
    return np.array(cam.axis) / np.linalg.norm(cam.axis)


def _tangent(mesh: Mesh, node: int) -> FloatArray:
    """Return the unit vector along the member at a node, from the member's first node to its last."""
    for line in mesh.lines.values():
        at = np.flatnonzero(line == node)
        if at.size:
            before, after = max(int(at[0]) - 1, 0), min(int(at[0]) + 1, len(line) - 1)
            span = mesh.nodes[line[after]] - mesh.nodes[line[before]]
            return span / np.linalg.norm(span)
    raise refuse(mesh.node_name(node), "a node without a member", "a node of a member")


def _direction_to_follower(span: FloatArray, axis: FloatArray) -> FloatArray:
    """Return the unit vector from cam to follower, perpendicular to the shaft."""
    across = span - (span @ axis) * axis
    length = float(np.linalg.norm(across))
    if length < 1e-9 * max(float(np.linalg.norm(span)), np.finfo(float).tiny):
        raise refuse(
            "direction", "a follower on the shaft's axis", "a direction of the lift", "", 'add direction = "uy"'
        )
    return across / length


def _six_components(translation: FloatArray) -> FloatArray:
    return np.concatenate([translation, np.zeros(3)])
