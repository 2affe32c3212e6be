"""Build the model of a case: members, springs, loads, rockers, contacts and cams from records and mesh."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from flexcam import valvetrain
from flexcam.cams import Follower, Turn, unique_event
from flexcam.case.case import Case, CaseRecord, require_case
from flexcam.case.cross_checks import joined_points, mesh_faults, model_faults
from flexcam.case.fault_report import KeyLocations, check_record, parse_toml
from flexcam.case.schema import contacts, parts
from flexcam.case.schema.base import Length, Record
from flexcam.case.schema.cams import FollowerRecord
from flexcam.core import FloatArray, IntArray
from flexcam.core.errors import Fault, InputError, refuse, suggest_name
from flexcam.fem.assembly import Member
from flexcam.fem.dofs import ROTATIONS, default_orientation, direction
from flexcam.fem.mesh import Mesh, refine
from flexcam.fem.superelements import Superelement, reduce_superelement

# Default stiffness of touching faces relative to the member behind them, to whose compliance it adds a tenth.
DEFAULT_LASH_STIFFNESS_RATIO = 10.0
_SAME_LENGTH = 1e-9  # m, rounding of diameters
_PERPENDICULAR_TOLERANCE = 1e-6  # maximum cosine of the angle between directions that count as perpendicular


class _FollowerRecord(Record):
    """Follower and the base circle of its cam."""

    follower: FollowerRecord
    base_radius: Length | None = None


def parse_follower(follower: str, base_radius: str | None = None, *, clockwise: bool = False) -> tuple[Follower, Turn]:
    """Return the follower of the options --follower and --base-radius, and the direction of rotation of its cam."""
    try:
        table = parse_toml(f"follower = {follower}")["follower"]
    except ValueError as fault:
        allowed = 'a table in TOML notation, such as { type = "roller", radius = "9 mm" }'
        remedy = "give a table in braces with quotes around each string"
        raise refuse("follower", follower, allowed, str(fault), remedy) from None
    raw = {"follower": table, "base_radius": base_radius}
    record, faults, *_ = check_record(_FollowerRecord, raw, KeyLocations({}), {})
    if record is None or faults:
        raise InputError(faults)
    result = record.follower.build(record.base_radius)
    if result is None:
        allowed, why = "the radius of the base circle", "the lift starts there"
        raise refuse("--base-radius", "nothing", allowed, why, "add --base-radius")
    return result, -1 if clockwise else 1


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
    require_case(case)
    record = case.record
    mesh = _mesh(case)
    geometry = _Geometry(record, mesh)
    faults: list[Fault] = list(mesh_faults(case.record, case.places, mesh))

    def build_all(kind: str, table: Mapping[str, In], make: Callable[[In], Out]) -> dict[str, Out]:
        result: dict[str, Out] = {}
        for name, part in table.items():
            try:
                result[name] = make(part)
            except InputError as refusal:
                where = case.place((kind, name))
                faults.extend(replace(fault, where=f"{where}: {fault.where}") for fault in refusal.faults)
        return result

    elastic, films = dict[str, valvetrain.Spring](), dict[str, valvetrain.FilmBearing]()
    for name, bearing in build_all("bearings", record.bearings, geometry.bearing).items():
        if isinstance(bearing, valvetrain.FilmBearing):
            films[name] = bearing
        else:
            elastic |= {f"bearing {name}, {label} direction": spring for label, spring in bearing.items()}
    phasers = {cam: phaser.part for phaser in record.phasers.values() for cam in phaser.cams}
    cams = {
        name: replace(cam.part, event=unique_event(cam.part.event), phaser=phasers.get(name))
        for name, cam in record.cams.items()
    }
    model = valvetrain.Model(
        mesh=mesh,
        members={name: geometry.member(member) for name, member in record.members.items()},
        superelements=build_all("superelements", record.superelements, geometry.superelement),
        rigid_links={name: tuple(link.components) for name, link in record.rigid_links.items()},
        supports={point: tuple(components) for point, components in record.supports.items()},
        masses={name: mass.part for name, mass in record.masses.items()},
        springs={name: spring.part for name, spring in record.springs.items()} | elastic,
        rockers=build_all("rockers", record.rockers, geometry.rocker),
        cams=cams,
        contacts=build_all("contacts", record.contacts, geometry.contact),
        friction=build_all("friction", record.friction, geometry.friction),
        loads={name: load.part for name, load in record.loads.items()},
        gravity=record.run.gravity,
        damping=record.run.damping.part,
        probes=tuple(record.output.probes),
        reactions=tuple(record.output.reactions),
        bearings=films,
    )
    faults.extend(model_faults(case.places, model))
    if faults:
        raise InputError(faults)
    return model


def _mesh(case: Case) -> Mesh:
    record, mesh = case.record, case.mesh
    points = mesh.points if mesh is not None else {name: np.array([i]) for i, name in enumerate(record.nodes)}

    def numbers(names: Iterable[str]) -> IntArray:
        return np.concatenate([points[name] for name in names])

    bodies = {name: numbers(body.nodes.values()) for name, body in record.superelements.items()}
    links = {name: numbers((link.start, *link.to)) for name, link in record.rigid_links.items()}
    tables = record.model_dump(by_alias=True, include={"springs": True, "contacts": True, "cams": {"__all__": {"at"}}})
    joined = [[point for point in group if point in points] for group in joined_points(tables)]
    couplings = {str(i): numbers(group) for i, group in enumerate(joined) if group}
    joints = frozenset(name for name, link in record.rigid_links.items() if not {*ROTATIONS} <= {*link.components})
    try:
        if mesh is None:
            lines = {name: numbers(member.nodes or []) for name, member in record.members.items()}
            mesh = Mesh(np.array(list(record.nodes.values())), lines, points, bodies, links, couplings, joints)
        else:
            mesh = replace(mesh, bodies=bodies, links=links, couplings=couplings, joints=joints)
        return refine(mesh, {name: member.elements for name, member in record.members.items()})
    except InputError as refusal:
        where = case.place(("nodes",) if case.mesh is None else ("mesh",))
        raise InputError(
            fault if fault.where.startswith("members") else replace(fault, where=f"{where}: {fault.where}")
            for fault in refusal.faults
        ) from None


@dataclass(frozen=True)
class _Geometry:
    """Records of a case on its mesh, from which the parts take directions and default stiffnesses."""

    case: CaseRecord
    mesh: Mesh

    def member(self, record: parts.MemberRecord) -> Member:
        """Return a member with its material and section."""
        return Member(
            self.case.materials[record.material].part, self.case.sections[record.section].part, record.orientation,
            record.shear, record.rotary_inertia, record.mass, record.geometric_stiffness, record.bow,
            record.temperature,
        )  # fmt: skip

    def superelement(self, record: parts.SuperelementRecord) -> Superelement:
        """Return a superelement between its nodes."""
        nodes = tuple(record.nodes.values())
        positions = self.mesh.nodes[[self.mesh.node(name) for name in nodes]]
        return reduce_superelement(nodes, positions, record.matrices(), record.modes)

    def bearing(self, record: parts.BearingRecord) -> dict[str, valvetrain.Spring] | valvetrain.FilmBearing:
        """Return two springs, perpendicular to the shaft and to each other, or a journal bearing."""
        node, film = self.mesh.node(record.at), record.film
        if film is None:
            axis = self._tangent(node)
        else:  # the axis of rotation of the cams on its shaft
            shaft = self.mesh.connected_nodes(node, turning=True)
            cams = [name for name, cam in self.case.cams.items() if self.mesh.node(cam.at, "at") in shaft]
            if not cams:
                allowed, why = "a node of a member with a cam", "the cams of a shaft define its rotation"
                raise refuse("film", f"a film at {self.mesh.node_name(node)!r}", allowed, why, "use stiffness")
            axis = self._rotation_axis(cams[0])
        first = _direction_to_follower(default_orientation(axis), axis)
        directions = {"first": _six_components(first), "second": _six_components(np.cross(axis, first))}
        if film is not None:
            size = film.diameter, film.length, film.radial_clearance, film.viscosity
            return valvetrain.FilmBearing(record.at, np.array(list(directions.values())), *size)
        size = record.stiffness or 0.0, record.damping
        return {label: valvetrain.Spring(record.at, vector, *size) for label, vector in directions.items()}

    def rocker(self, record: parts.LumpedRecord | parts.LeverRecord) -> valvetrain.Rocker:
        """Return a rocker with the direction in which it is driven."""
        finger = isinstance(record, parts.LeverRecord) and record.start not in self.mesh.points
        followers = [contact.follower for contact in self._cam_contacts()]
        if finger and record.start not in followers:
            known = [*self.mesh.points, *followers]
            allowed = f"a named node, or the follower of a cam's contact: {', '.join(known)}"
            hint = suggest_name(record.start, known)
            raise refuse("from", repr(record.start), allowed, "nothing would drive the lever", hint)
        vector = _finger_direction(record) if finger else self._rocker_direction(record)
        common = record.start, record.to, record.arms, record.inertia, vector
        if isinstance(record, parts.LumpedRecord):
            return valvetrain.Rocker(*common)
        stiffness = record.drive_stiffness or record.stiffness, record.stiffness
        return valvetrain.Lever(*common, finger, record.angles, stiffness, (record.drive_damping, record.damping))

    def _cam_contacts(self) -> list[contacts.CamContactRecord]:
        return [contact for contact in self.case.contacts.values() if isinstance(contact, contacts.CamContactRecord)]

    def _rocker_direction(self, record: parts.LumpedRecord | parts.LeverRecord) -> FloatArray:
        """Return the direction in which a rocker is driven: given, or along the member, away from the cam."""
        if record.direction is not None:
            return direction(record.direction)
        start = self.mesh.node(record.start, "from")
        tangent, train = self._tangent(start), self.mesh.connected_nodes(start)
        cam_contacts = [contact for contact in self._cam_contacts() if contact.follower in self.mesh.points]
        opposite = False
        for contact in cam_contacts:
            if self.mesh.node(contact.follower, "follower") in train:
                with suppress(InputError):  # the fault of the contact
                    opposite |= float(self._lift_direction(contact)[:3] @ tangent) < 0.0
        return _six_components(-tangent if opposite else tangent)

    def contact(self, record: contacts.ContactRecord) -> valvetrain.Contact:
        """Return a contact with its directions and default stiffness."""
        match record:
            case contacts.SeatRecord():
                vector = np.zeros(6) if record.direction is None else direction(record.direction)
                values = record.stiffness, record.damping, record.restitution, record.damping_depth
                return valvetrain.Seat(record.at, vector, *values)
            case contacts.LashRecord() | contacts.AdjusterRecord():
                vector = None if record.direction is None else direction(record.direction)
                if isinstance(record, contacts.LashRecord):
                    values = self._lash_stiffness(record), record.damping
                    return valvetrain.Lash(record.at, record.gap, *values, record.ends, vector, record.damping_depth)
                size = *record.column, record.refill, record.plunger_force
                chamber = record.oil and record.oil.part
                if chamber is not None and not chamber.follows_pressure:
                    chamber = None
                travel = self._plunger_travel(record)
                return valvetrain.Adjuster(record.at, *size, record.ends, vector, chamber, travel)
            case _:
                pass
        between = record.cam, record.follower, self._lift_direction(record), self._rotation_axis(record.cam)
        match record:
            case contacts.PublishedLoadRecord():
                factors = record.preload_factor, record.cam_deflection, record.cam_torque
                return valvetrain.PublishedLoad(*between, *factors)
            case contacts.BilateralRecord():
                return valvetrain.CamContact(*between, record.stiffness, unilateral=False)
            case contacts.UnilateralRecord():
                stiffness = None if record.stiffness == "hertz" else record.stiffness
                return valvetrain.CamContact(
                    *between, stiffness, unilateral=True, dissipation=record.dissipation,
                    restitution=record.restitution, friction=record.friction, friction_speed=record.friction_speed,
                    lubrication=None if record.lubrication is None else record.lubrication.part,
                )  # fmt: skip

    def friction(self, record: parts.FrictionRecord) -> valvetrain.Friction:
        """Return a friction at a point or between the coils of two springs."""
        names = None if record.spring is None else self._nest(record.spring, str(record.inside))
        force = self._nest_friction(record, names) if names and record.force is None else record.force or 0.0
        breakaway = force if record.breakaway_force is None else record.breakaway_force
        size = force, breakaway, record.stribeck_speed, record.friction_speed, record.damping
        if record.at is not None and record.direction is not None:
            return valvetrain.Friction(record.at, direction(record.direction), *size, record.to)
        inner = self.case.springs[str(record.spring)].part
        return valvetrain.Friction(inner.at, inner.direction, *size, inner.to, names)

    def _nest(self, *names: str) -> tuple[str, str]:
        """Return the names of the inner and the outer spring of a nest."""
        inner, outer = (self.case.springs[name].part for name in names)
        nested = names[0] != names[1] and valvetrain.share_ends(inner, outer) and not inner.turns
        if not nested or any(spring.mass == 0.0 or spring.elements == 1 for spring in (inner, outer)):
            why, allowed = "coils rub on those of another spring at the same height", "two springs of a nest"
            remedy = "give both the same at, to and direction along a line, a mass, and two elements or more"
            raise refuse("spring", f"{names[0]!r} inside {names[1]!r}", allowed, why, remedy)
        return names[0], names[1]

    def _nest_friction(self, record: parts.FrictionRecord, names: tuple[str, str]) -> float:
        """Return the friction of coils that press on each other by their interference, N."""
        springs = [self.case.springs[name] for name in names]
        for key, name, spring in zip(("spring", "inside"), names, springs, strict=True):
            if spring.active_coils is None:
                allowed, why = "a spring with coils of one diameter", "the force between the coils follows from them"
                remedy = f"add coil_diameter, active_coils and shear_modulus to springs.{name}.wire, or give force"
                raise refuse(key, f"{name!r} without such coils", allowed, why, remedy)
        inner, outer = (spring.part for spring in springs)
        diameters = [s.wire.coil_diameter for s in (inner, outer) if s.wire is not None]
        if diameters[0] >= diameters[1]:
            given = f"coils of {diameters[0]:.6g} m inside coils of {diameters[1]:.6g} m"
            raise refuse("spring", given, "a spring narrower than that around it", "", "exchange spring and inside")
        by_diameters = valvetrain.nest_interference(inner, outer)
        interference = by_diameters if record.interference is None else record.interference
        if by_diameters < -_SAME_LENGTH or not interference > 0.0:
            given, why = f"a radial clearance of {-by_diameters:.3g} m", "by their diameters the coils do not touch"
            raise refuse("coefficient", given, "coils with interference", why, "correct the diameters, or give force")
        compliance = sum(1.0 / valvetrain.radial_stiffness(s.part, s.active_coils or 0.0) for s in springs)
        return (record.coefficient or 0.0) * interference / compliance

    def _plunger_travel(self, record: contacts.AdjusterRecord) -> valvetrain.PlungerTravel | None:
        """Return the stops of a plunger, which can hold it back but not the part that it pushes."""
        if record.travel is None:
            return None
        with_mass, on_members = {mass.at for mass in self.case.masses.values()}, self.mesh.on_members()
        nodes = [end for end in record.ends or () if end in with_mass and end in self.mesh.points]
        if all(on_members[self.mesh.node(end)] for end in nodes):
            given = f"an adjuster from {' to '.join(record.ends or ())}"
            why = "the retaining ring holds the plunger and not the part that it pushes"
            remedy = "add a node with a mass for the plunger, and a lash of no gap from it to that part"
            raise refuse("travel", given, "an end at a mass on no member", why, remedy)
        return record.travel.part

    def _lash_stiffness(self, record: contacts.LashRecord) -> float:
        """Return the stiffness of both sides of a lash when they touch, N/m."""
        if record.stiffness is not None:
            return record.stiffness
        ends, ratio = record.ends, 1.0
        if record.direction is not None and not direction(record.direction)[:3].any():
            why = "no member defines the stiffness of a lash about an axis"
            remedy = 'add it, such as stiffness = "5 kN m/rad"'
            raise refuse("stiffness", "nothing", "a value", why, remedy)
        if ends is None:
            rocker = self.case.rockers[str(record.at)]
            ends, ratio = (rocker.start,), rocker.arms[1] / rocker.arms[0]
        nodes = [self.mesh.node(name) for name in ends if name in self.mesh.points]
        members = [name for name, line in self.mesh.lines.items() if np.isin(nodes, line[[0, -1]]).any()]
        if not members:
            why = "no member ends at the lash, so that there is no default"
            raise refuse("stiffness", "nothing", "a stiffness", why, 'add it, such as stiffness = "20 MN/m"')
        softest = math.inf
        for name in members:
            member, line = self.member(self.case.members[name]), self.mesh.nodes[self.mesh.lines[name]]
            length = float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
            softest = min(softest, member.material.E * member.section.at(0.5).A / length)
        return DEFAULT_LASH_STIFFNESS_RATIO * softest / ratio**2

    def _lift_direction(self, record: contacts.CamContactRecord) -> FloatArray:
        """Return the direction of the lift: given, or from cam to follower perpendicular to the shaft."""
        cam = self.mesh.nodes[self.mesh.node(self.case.cams[record.cam].at, "cam")]
        axis = self._rotation_axis(record.cam)
        if record.direction is None:
            for rocker in self.case.rockers.values():
                if record.follower == rocker.start and record.follower not in self.mesh.points:
                    return _finger_direction(rocker)
            span = self.mesh.nodes[self.mesh.node(record.follower, "follower")] - cam
            return _six_components(_direction_to_follower(span, axis))
        lift = direction(record.direction)
        given = lift[:3].tolist()
        if abs(float(lift[:3] @ axis)) > _PERPENDICULAR_TOLERANCE * float(np.linalg.norm(lift[:3])):
            raise refuse("direction", given, "a direction perpendicular to the shaft", "a plate cam lifts in its plane")
        if record.follower in self.mesh.points:
            span = self.mesh.nodes[self.mesh.node(record.follower)] - cam
            if float(span @ lift[:3]) < -_PERPENDICULAR_TOLERANCE * float(np.linalg.norm(span)):
                why = "the follower lies on the other side, and the cam would pass through it"
                remedy = "reverse the sign of direction; for a desmodromic closing cam, define a second follower node "
                remedy += "on the far side of the shaft and connect it to this follower by a lash"
                raise refuse("direction", given, "a direction from the cam to its follower", why, remedy)
        return lift

    def _rotation_axis(self, name: str) -> FloatArray:
        """Return the axis of rotation: along the shaft, toward the given side or toward positive coordinates."""
        cam = self.case.cams[name]
        node = self.mesh.node(cam.at, "at")
        if not self.mesh.on_members()[node]:
            if cam.axis is None or not any(cam.axis):
                given, why = f"nothing, for a cam at {cam.at!r} on no member", "the case has no shaft that defines it"
                raise refuse("axis", given, "a vector along the axis of rotation", why, "add axis = [1, 0, 0]")
            return np.array(cam.axis) / np.linalg.norm(cam.axis)
        tangent = self._tangent(node)
        side = np.array(cam.axis) if cam.axis is not None else np.sign(tangent[np.argmax(np.abs(tangent))]) * tangent
        if abs(float(side @ tangent)) <= 0.5 * float(np.linalg.norm(side)):
            raise refuse("axis", side.tolist(), "a vector along the shaft", "the cam turns with the shaft")
        return tangent if float(side @ tangent) > 0.0 else -tangent

    def _tangent(self, node: int) -> FloatArray:
        """Return the unit vector along the member at a node, from the member's first node to its last."""
        for line in self.mesh.lines.values():
            at = np.flatnonzero(line == node)
            if at.size:
                before, after = max(int(at[0]) - 1, 0), min(int(at[0]) + 1, len(line) - 1)
                span = self.mesh.nodes[line[after]] - self.mesh.nodes[line[before]]
                return span / np.linalg.norm(span)
        raise refuse(self.mesh.node_name(node), "a node without a member", "a node of a member")


def _finger_direction(record: parts.LumpedRecord | parts.LeverRecord) -> FloatArray:
    if record.direction is None:
        why = "the point of a finger is on no member that defines it"
        raise refuse("direction", "nothing", "the direction in which the cam drives it", why, 'add direction = "uy"')
    return direction(record.direction)


def _direction_to_follower(span: FloatArray, axis: FloatArray) -> FloatArray:
    """Return the unit vector from cam to follower, perpendicular to the shaft."""
    normal = span - (span @ axis) * axis
    length = float(np.linalg.norm(normal))
    if length < 1e-9 * max(float(np.linalg.norm(span)), np.finfo(float).tiny):
        why = "the follower is on the axis of its cam, so that the lift has no direction"
        raise refuse("direction", "nothing", "", why, 'correct the key "at" of the cam, or add direction = "uy"')
    return normal / length


def _six_components(translation: FloatArray) -> FloatArray:
    return np.concatenate([translation, np.zeros(3)])
