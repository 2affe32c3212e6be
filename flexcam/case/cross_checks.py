"""Checks across the tables of a case: exclusive keys, references, nodes, shafts, rockers and lashes.

Checks of raw tables join the report of invalid values; checks of mesh and model need valid ones (`valid_parts`).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from flexcam.case.case import CaseRecord
from flexcam.case.fault_report import KeyLocations, Path, value_at
from flexcam.case.schema.cams import LAW_KEYS, LIFT_TABLE_CONFLICTS
from flexcam.case.schema.contacts import AdjusterRecord, LashRecord, PublishedLoadRecord
from flexcam.case.schema.parts import LeverRecord
from flexcam.core.errors import NAME, Fault, InputError, suggest_name
from flexcam.core.units import parse
from flexcam.fem.dofs import component, default_orientation, triads
from flexcam.fem.mesh import Mesh, coincident_nodes, number_places
from flexcam.valvetrain import Adjuster, Lash, Model, rocker_of, shaft_axes

Table = Mapping[str, Any]

_PART_REFERENCES = (  # table, key, referenced table and description of the value
    ("members", "material", "materials", "a material"),
    ("members", "section", "sections", "a section"),
    ("contacts", "cam", "cams", "a cam"),
    ("loads", "member", "members", "a member"),
    ("friction", "spring", "springs", "a spring"),
    ("friction", "inside", "springs", "a spring"),
    ("phasers", "cams", "cams", "a cam"),
)
_POINT_REFERENCES = (  # table, key and whether the output point of a rocker is allowed
    ("masses", "at", True), ("springs", "at", True), ("springs", "to", True), ("bearings", "at", False),
    ("friction", "at", True), ("friction", "to", True), ("loads", "at", True), ("rockers", "from", False),
    ("cams", "at", False), ("contacts", "follower", True), ("contacts", "at", True), ("contacts", "from", True),
    ("contacts", "to", False), ("superelements", "nodes", False), ("rigid_links", "from", False),
    ("rigid_links", "to", False),
)  # fmt: skip


def joined_points(tables: Table) -> Iterator[list[str]]:
    """Yield the names of the points that each spring or contact of raw tables joins."""
    cams = dict(_tables(tables, "cams"))
    for _, part in (*_tables(tables, "springs"), *_tables(tables, "contacts")):
        points = [part.get(key) for key in ("at", "from", "to", "follower")]
        points.append(cams.get(str(part.get("cam")), {}).get("at"))
        yield [point for point in points if isinstance(point, str)]


def _tables(tables: Table, kind: str) -> Iterator[tuple[str, Table]]:
    """Yield name and table of the parts of a kind."""
    table = tables.get(kind)
    for name, part in cast("Table", table).items() if isinstance(table, Mapping) else ():
        if isinstance(part, Mapping):
            yield name, cast("Table", part)


@dataclass(frozen=True)
class RawTables:
    """Raw tables of a case, to be checked before all values are known to be valid."""

    raw: Table  #: parsed TOML before validation; values of the wrong type are skipped
    mesh: Mesh | None  #: mesh of the mesh file; None for a case with its own nodes, or if the file could not be read
    places: KeyLocations  #: source of every key

    def faults(self) -> Iterator[Fault]:
        """Yield all faults across tables; those of names and places only if the copies of parts are known."""
        yield from self.exclusive_key_faults()
        if "repeat" not in self.raw:
            yield from self.reference_faults()
            yield from self.coincident_node_faults()

    def reference_faults(self) -> Iterator[Fault]:
        """Yield names without a target, or with several nodes where one is required."""
        yield from self._part_faults()
        yield from self._lift_faults()
        yield from self._member_node_faults()
        yield from self._same_end_faults()
        yield from self._shear_faults()
        if self.mesh is not None or "nodes" in self.raw:
            yield from self._point_faults()

    def exclusive_key_faults(self) -> Iterator[Fault]:
        """Yield missing tables and keys that exclude each other."""
        yield from _exclusive_keys(self.raw, ("mesh", "nodes"), 1, "case file", "the geometry comes from one place")
        with_mass = any("mass" in table for _, table in self._parts("springs"))
        if not with_mass and not {"members", "masses", "superelements"} & set(self.raw):
            allowed = "[members], [masses], [superelements] or a spring with mass"
            why = "a mechanism consists of beams, of masses at points, or of coils"
            yield Fault("case file", "no members and no masses", allowed, why, "add [members]")
        if isinstance(self.raw.get("run"), Mapping):
            run, where = self._table("run"), self.places.place(("run",))
            for pair, minimum in ((("speed", "crank_speed"), 1), (("steps_per_revolution", "step"), 0)):
                yield from _exclusive_keys(run, pair, minimum, where, "one determines the other")

    def coincident_node_faults(self) -> Iterator[Fault]:
        """Yield coincident nodes, and members that contain a node twice."""
        at = dict[str, list[float]]()
        for name, place in self._table("nodes").items():
            with suppress(InputError):  # its own fault
                at[name] = [parse(cast("Any", value), "length", noise=True) for value in _as_list(place)]
        at = {name: place for name, place in at.items() if len(place) == 3}
        names = list(at)
        links = (link for _, link in self._parts("rigid_links"))
        joined = [[link.get("from"), *_as_list(link.get("to"))] for link in links] + [*joined_points(self.raw)]
        groups = [[i for i, name in enumerate(names) if name in group] for group in joined]
        places = number_places(np.array([*at.values()]).reshape(-1, 3))
        for i, j in coincident_nodes(places, [np.array(group, dtype=int) for group in groups]):
            other, name = names[i], names[j]
            remedy = f"move {name!r}, join both by a rigid link, or use {other!r} in place of {name!r}"
            if any({name, other} <= {*_as_list(member.get("nodes"))} for _, member in self._parts("members")):
                remedy = f"move {name!r}"
            given, why = f"the coordinates of {other!r}", "members are connected only at a shared node"
            yield self._fault(("nodes", name), given, "other coordinates", why, remedy)
        for name, table in self._parts("members"):
            nodes = [node for node in _as_list(table.get("nodes")) if isinstance(node, str)]
            for node in dict.fromkeys(node for node in nodes if nodes.count(node) > 1):
                allowed, remedy = "every node once", "divide a closed member into two"
                yield self._fault(("members", name, "nodes"), f"{node!r} twice", allowed, "", remedy)

    def _fault(self, path: Path, given: str, allowed: str, why: str = "", remedy: str = "") -> Fault:
        return Fault(self.places.place(path), given, allowed, why, remedy)

    def _table(self, kind: str) -> Table:
        table = self.raw.get(kind)
        return cast("Table", table) if isinstance(table, Mapping) else {}

    def _parts(self, kind: str) -> Iterator[tuple[str, Table]]:
        return _tables(self.raw, kind)

    def _check_name(self, path: Path, name: object, known: Sequence[str], what: str) -> Iterator[Fault]:
        if isinstance(name, str) and name not in known:
            allowed = f"{what} of the case: {', '.join(known)}" if known else f"{what}, and the case has none"
            yield self._fault(path, repr(name), allowed, "", suggest_name(name, known))

    def _check_point(self, path: Path, name: object, counts: Mapping[str, int]) -> Iterator[Fault]:
        yield from self._check_name(path, name, list(counts), "a point")
        if isinstance(name, str) and counts.get(name, 1) != 1:
            why, remedy = f"it names {counts[name]} nodes", "give the node a separate group"
            yield self._fault(path, repr(name), "a point of one node", why, remedy)

    def _part_faults(self) -> Iterator[Fault]:
        for name, table in self._parts("contacts"):
            if table.get("model") in ("lash", "lash-adjuster"):
                rockers = list(self._table("rockers"))
                yield from self._check_name(("contacts", name, "at"), table.get("at"), rockers, "a rocker")
        path = ("run", "free_running", "cam")
        yield from self._check_name(path, value_at(self.raw, path), list(self._table("cams")), "a cam")
        if self._table("phasers") and value_at(self.raw, ("run", "free_running")) is not None:
            yield self._fault(("phasers",), "a phaser", "no phaser with run.free_running", "the shaft has no drive")
        first: dict[object, str] = {}
        for name, table in self._parts("phasers"):
            for cam in _names("phasers", table.get("cams")):
                if first.setdefault(cam, name) != name:
                    given, why = repr(cam), f"phasers.{first[cam]} turns it"
                    yield self._fault(("phasers", name, "cams"), given, "other cams", why)
        for kind, key, target, what in _PART_REFERENCES:
            for name, table in self._parts(kind):
                for value in _names(kind, table.get(key)):
                    yield from self._check_name((kind, name, key), value, list(self._table(target)), what)

    def _lift_faults(self) -> Iterator[Fault]:
        """Yield missing keys of cams, and keys that conflict with a lift file."""
        for name, table in self._parts("cams"):
            if "lift_table" not in table:
                for key in [key for key in LAW_KEYS if key not in table]:
                    why = "the key is required without a lift_table"
                    yield self._fault(("cams", name, key), "nothing", LAW_KEYS[key], why, f"add {key!r}")
                continue
            for key in LIFT_TABLE_CONFLICTS:
                if key in table and not (key == "law" and table[key] == "table"):
                    why = "the lift table defines the whole lift"
                    given = f"{key} and lift_table"
                    yield self._fault(("cams", name, key), given, "one of them", why, "remove one")

    def _shear_faults(self) -> Iterator[Fault]:
        """Yield custom sections of members with shear deformation that lack a shear factor."""
        sheared = ((name, member) for name, member in self._parts("members") if member.get("shear") is True)
        users = {str(member.get("section")): name for name, member in sheared}
        for name, section in self._parts("sections"):
            keys = [key for key in ("kappa_y", "kappa_z") if key not in section]
            if keys and section.get("shape") == "custom" and name in users:
                why = f"members.{users[name]} has shear = true, and the factors of a custom section are unknown"
                remedy = f"add {' and '.join(keys)}, such as 5/6 = 0.833 of a rectangle or 0.9 of a circle"
                yield self._fault(("sections", name, keys[0]), "nothing", "a shear factor", why, remedy)

    def _member_node_faults(self) -> Iterator[Fault]:
        """Yield members without named nodes, and members and line groups of a mesh without each other."""
        named = list(self._table("nodes"))
        for name, table in self._parts("members"):
            if self.mesh is not None:
                yield from self._check_name(("members", name), name, list(self.mesh.lines), "a line group of the mesh")
                if "nodes" in table:
                    why = "the mesh file defines its nodes"
                    yield self._fault(("members", name, "nodes"), "nodes", "nothing", why, "remove the key")
            elif "mesh" not in self.raw:
                if "nodes" not in table:
                    why, remedy = "the case has no mesh file", 'add nodes = ["...", "..."]'
                    yield self._fault(("members", name), "no nodes", "the named nodes along it", why, remedy)
                for node in _as_list(table.get("nodes")):
                    yield from self._check_name(("members", name, "nodes"), node, named, "a named node")
        for name in self.mesh.lines if self.mesh is not None else ():
            if name not in self._table("members"):
                yield Fault(f"mesh group {name!r}", "no member", "a table under [members]", "", f"add [members.{name}]")

    def _same_end_faults(self) -> Iterator[Fault]:
        """Yield springs and lashes with both ends at one point."""
        for kind, first, last in (("springs", "at", "to"), ("contacts", "from", "to")):
            for name, table in self._parts(kind):
                if first in table and table.get(last) == table[first]:
                    why = "between a point and itself it has no effect"
                    yield self._fault((kind, name, last), repr(table[last]), "another point", why)

    def _point_faults(self) -> Iterator[Fault]:
        counts = dict.fromkeys(self._table("nodes"), 1)
        if self.mesh is not None:
            counts = {name: len(index) for name, index in self.mesh.points.items()}
        outputs = {name: to for name, rocker in self._parts("rockers") if isinstance(to := rocker.get("to"), str)}
        fingers = [str(rocker.get("from")) for _, rocker in self._parts("rockers") if _is_finger(rocker, counts)]
        rocker_points = [*outputs.values(), *fingers]
        with_rockers = {**counts, **dict.fromkeys(rocker_points, 1)}
        for name, to in outputs.items():
            if to in counts or rocker_points.count(to) > 1:
                why = "a rocker defines a new point"
                yield self._fault(("rockers", name, "to"), repr(to), "a new name", why, "choose another name")
        for kind, key, rocker_point_allowed in _POINT_REFERENCES:
            for name, table in self._parts(kind):
                of_lash = kind == "contacts" and key == "at" and table.get("model") != "seat"
                owner = next((rocker for rocker, to in outputs.items() if to == table.get(key)), None)
                if kind == "contacts" and key in ("to", "follower") and owner is not None:
                    remedy = f"write at = {owner!r} for a lash or an adjuster there"
                    remedy = "name the node that the cam moves" if key == "follower" else remedy
                    why = f"it is the output point of rocker {owner!r}"
                    yield self._fault((kind, name, key), repr(table.get(key)), "a node", why, remedy)
                elif not of_lash and not (kind == "rockers" and _is_finger(table, counts)):
                    allowed = with_rockers if rocker_point_allowed else counts
                    for point in _names(kind, table.get(key)):
                        yield from self._check_point((kind, name, key), point, allowed)
        for name, table in self._parts("superelements"):
            nodes = _names("superelements", table.get("nodes"))
            if len({*map(str, nodes)}) < len(nodes):
                given, why = ", ".join(map(str, nodes)), "each interface node is another node of the case"
                yield self._fault(("superelements", name, "nodes"), given, "different nodes", why)
        for name in self._table("supports"):
            yield from self._check_name(("supports", name), name, list(counts), "a point")
        supports, at_bearings = list(self._table("supports")), [part.get("at") for _, part in self._parts("bearings")]
        for name in _as_list(self._table("output").get("reactions")):
            if name in at_bearings and name not in supports:
                why, remedy = "a bearing with stiffness or film is no support", "use its displacement (output.probes)"
                yield self._fault(("output", "reactions"), repr(name), "a point of [supports]", why, remedy)
            elif not isinstance(name, str) or re.match(NAME, name):
                yield from self._check_name(("output", "reactions"), name, supports, "a support")
        for probe in _as_list(self._table("output").get("probes")):
            if not isinstance(probe, str) or re.match(NAME, probe):  # the schema reports other texts
                yield from self._check_point(("output", "probes"), probe, with_rockers)


def _exclusive_keys(table: Table, pair: tuple[str, str], minimum: int, where: str, why: str) -> Iterator[Fault]:
    keys = [key for key in pair if key in table]
    if not minimum <= len(keys) <= 1:
        given = " and ".join(keys) or f"neither {pair[0]} nor {pair[1]}"
        yield Fault(where, given, f"either {pair[0]} or {pair[1]}", why if keys else "one of them is required", "")


def _as_list(value: object) -> list[object]:
    return cast("list[object]", value) if isinstance(value, list) else []


def _names(kind: str, value: object) -> list[object]:
    """Return the names that a reference gives: one, or in some tables those of a list or a table."""
    if kind not in ("phasers", "superelements", "rigid_links"):
        return [value]
    return list(cast("Table", value).values()) if isinstance(value, Mapping) else _as_list(value) or [value]


def _is_finger(rocker: Table, nodes: Mapping[str, int]) -> bool:
    return rocker.get("model") == "lever" and isinstance(rocker.get("from"), str) and rocker["from"] not in nodes


def mesh_faults(record: CaseRecord, places: KeyLocations, mesh: Mesh) -> Iterator[Fault]:
    """Yield the faults of followers, lashes, levers, temperatures and orientations on a mesh."""
    yield from _shared_point_faults(record, places, mesh)
    yield from _link_faults(record, places)
    for name, member in record.members.items():
        span = np.diff(mesh.nodes[mesh.lines[name]], axis=0)
        axes = span / np.linalg.norm(span, axis=1, keepdims=True)
        try:
            triads(axes, np.broadcast_to(member.orientation or default_orientation(axes), axes.shape))
        except InputError as refusal:
            where = places.place(("members", name, "orientation"))
            yield from (replace(fault, where=where) for fault in refusal.faults)
        if member.temperature and not record.materials[member.material].expansion:
            where, why = places.place(("members", name, "temperature")), f"material {member.material!r} does not expand"
            remedy = f'add expansion to it, such as materials.{member.material}.expansion = "12e-6 1/K"'
            yield Fault(where, f"{member.temperature:g} K", "a material with expansion", why, remedy)


def _shared_point_faults(record: CaseRecord, places: KeyLocations, mesh: Mesh) -> Iterator[Fault]:
    """Yield published loads on one train, lashes of one rocker, and levers with one driven end."""
    owners: dict[tuple[str, str, int | str], str] = {}
    users: list[tuple[str, str, str, int | str, str]] = []
    for name, contact in record.contacts.items():
        if isinstance(contact, PublishedLoadRecord) and contact.follower in mesh.points:
            train = int(mesh.connected_nodes(mesh.node(contact.follower, "follower"))[0])
            users.append(("contacts", name, "follower", train, "the preload of a published load uses the whole train"))
        if isinstance(contact, LashRecord | AdjusterRecord) and contact.at is not None:
            users.append(("contacts", name, "at", contact.at, "a rocker has one lash or adjuster"))
    for name, rocker in record.rockers.items():
        if isinstance(rocker, LeverRecord):
            users.append(("rockers", name, "from", rocker.start, "two levers cannot share a driven end"))
    for table, name, key, shared, why in users:
        other = owners.setdefault((table, key, shared), name)
        if other != name:
            given = repr(shared) if isinstance(shared, str) else "the same train"
            yield Fault(places.place((table, name, key)), f"{given}, as {table}.{other}", "another one", why, "")


def _link_faults(record: CaseRecord, places: KeyLocations) -> Iterator[Fault]:
    """Yield nodes that follow two nodes, or that follow one node and lead others, end a superelement or are held."""
    users = {link.start: f"it leads rigid_links.{name}" for name, link in record.rigid_links.items()}
    for name, body in record.superelements.items():
        users |= dict.fromkeys(body.nodes.values(), f"superelements.{name} ends there")
    for name, link in record.rigid_links.items():
        for node in link.to:
            why = users.get(node, "")
            if fixed := [c for c in record.supports.get(node, ()) if c in link.components and not why]:
                why = f"supports.{node} holds {' '.join(fixed)}"
            if why:
                allowed, remedy = f"a node that only follows {link.start!r}", "choose another leading node"
                yield Fault(places.place(("rigid_links", name, "to")), repr(node), allowed, why, remedy)
            users[node] = f"it follows in rigid_links.{name}"


# Allowed relative difference of the stiffnesses in two directions; chosen, as published properties are rounded.
_ROUNDNESS_TOLERANCE = 0.01
_PARALLEL = 1e-6  # smallest component of a direction along an axis that is no rounding


def model_faults(places: KeyLocations, model: Model) -> Iterator[Fault]:
    """Yield the faults of shafts that are not round, drag and opposite cams on them, and of rockers."""
    yield from _unsymmetric_shaft_faults(places, model)
    yield from _drag_faults(places, model)
    yield from _rotation_faults(places, model)
    yield from _undriven_rocker_faults(places, model)
    yield from _reversed_rocker_faults(places, model)


def _unsymmetric_shaft_faults(places: KeyLocations, model: Model) -> Iterator[Fault]:
    """Yield members that rotate with a cam and are not equally stiff in all directions."""
    shafts: dict[str, str] = {}
    for cam, part in model.cams.items():
        nodes = model.mesh.connected_nodes(model.mesh.node(part.at), turning=True)
        for member, line in model.mesh.lines.items():
            if np.isin(line, nodes).any():
                shafts.setdefault(member, cam)
    for name, cam in shafts.items():
        member = model.members[name]
        ends = {member.section.at(0.0), member.section.at(1.0)}
        pairs = [(section.Iy, section.Iz, "Iy = {:.4g} m^4 and Iz = {:.4g} m^4") for section in ends]
        if member.shear:
            pairs += [(section.kappa_y, section.kappa_z, "kappa_y = {:.4g} and kappa_z = {:.4g}") for section in ends]
        differences = [text.format(a, b) for a, b, text in pairs if abs(a - b) > _ROUNDNESS_TOLERANCE * max(a, b)]
        if differences:
            why = f"it turns with cam {cam!r}, and flexcam models no stiffness that varies with the rotation"
            allowed = f"a section that is as stiff along y as along z, within {100.0 * _ROUNDNESS_TOLERANCE:g} %"
            remedy = "use a circle, a tube, or a custom section with the mean of both"
            yield Fault(places.place(("members", name, "section")), "; ".join(differences), allowed, why, remedy)


def _drag_faults(places: KeyLocations, model: Model) -> Iterator[Fault]:
    """Yield frictions to ground about the axis of a rotating shaft."""
    axes = shaft_axes(model)
    for name, friction in model.friction.items():
        nodes = model.mesh.points.get(friction.at, ()) if friction.to is None else ()
        if any(abs(float(friction.direction[3:] @ axes[node])) > _PARALLEL for node in nodes if node in axes):
            given, why = "the axis of a rotating shaft", "rotations of a shaft are relative to its drive"
            allowed, remedy = "a direction that does not rotate", "leave it out, and add it to the drive torque"
            yield Fault(places.place(("friction", name, "direction")), given, allowed, why, remedy)


def _rotation_faults(places: KeyLocations, model: Model) -> Iterator[Fault]:
    """Yield cams of one shaft with opposite senses of rotation or different phasers."""
    first, reported = dict[int, str](), set[int]()
    axes = {contact.cam: contact.shaft_axis for contact in model.cam_contacts.values()}
    for name, axis in axes.items():
        shaft = int(model.mesh.connected_nodes(model.mesh.node(model.cams[name].at), turning=True)[0])
        other = first.setdefault(shaft, name)
        if float(axis @ axes[other]) < 0.0:
            shown, against = (f"[{', '.join(f'{x:g}' for x in (v + 0.0).tolist())}]" for v in (axis, axes[other]))
            given = f"{shown}, against cam {other!r} about {against}"
            where, why = places.place(("cams", name, "axis")), f"{name!r} and {other!r} are on one shaft"
            yield Fault(where, given, "one sense of rotation", why, "change the sign of one axis")
        if model.cams[name].phaser is not model.cams[other].phaser and shaft not in reported:
            reported.add(shaft)
            why, allowed = f"{name!r} and {other!r} are on one shaft", "one phaser for all cams of a shaft"
            given, remedy = f"a phaser only of {name!r} or {other!r}", "list both in cams"
            yield Fault(places.place(("phasers",)), given, allowed, why, remedy)


def _undriven_rocker_faults(places: KeyLocations, model: Model) -> Iterator[Fault]:
    for name, rocker in model.rockers.items():
        if rocker.finger:
            continue
        node = model.mesh.node(rocker.start)
        fixed = {c for point, dofs in model.supports.items() if node in model.mesh.points[point] for c in dofs}
        if not np.delete(rocker.direction, [component(c) for c in fixed]).any():
            given, why = f"{rocker.start!r}, fixed along the rocker's direction", "nothing could drive the rocker"
            allowed, remedy = "a node that can move along it", "give the direction in which the node moves, or free it"
            yield Fault(places.place(("rockers", name, "from")), given, allowed, why, remedy)


def _reversed_rocker_faults(places: KeyLocations, model: Model) -> Iterator[Fault]:
    """Yield lashes and adjusters at the point of a rocker that the lift of its cam opens instead of closing."""
    joints = [
        (name, part.ends[0], part.direction)
        for name, part in model.contacts.items()
        if isinstance(part, Lash | Adjuster) and part.ends is not None and part.direction is not None
    ]
    for contact in model.cam_contacts.values():
        rocker = rocker_of(model, contact)
        at_point = {name: direction for name, start, direction in joints if rocker and start == rocker.point}
        if rocker and at_point:
            lifts = rocker.direction * float(rocker.direction @ contact.direction)
            if max(float(direction @ lifts) for direction in at_point.values()) < 0.0:
                given, allowed = f"a direction against the lift of cam {contact.cam!r}", "the direction of this lift"
                why = f"the rocker moves {rocker.point!r} with {rocker.start!r}: it does not reverse the motion"
                remedy = f"reverse the directions of all parts beyond {rocker.point!r}, and place their nodes to suit"
                yield Fault(places.place(("contacts", next(iter(at_point)), "direction")), given, allowed, why, remedy)
