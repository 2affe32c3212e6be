"""Checks of references between tables, made on the raw tables so that the faults join the common report."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast

from flexcam.case.schema.cams import LAW_KEYS
from flexcam.case.toml_lines import KeyLocations, Path
from flexcam.core.errors import Fault, suggest_name
from flexcam.fem.mesh import Mesh

Table = Mapping[str, Any]


@dataclass(frozen=True)
class References:
    """References of a case.

    Parameters
    ----------
    raw
        Parsed TOML before validation; values of the wrong type are skipped.
    mesh
        Mesh of the mesh file; None for a case with its own nodes, or if the file could not be read.
    places
        Source of every key.
    """

    raw: Table
    mesh: Mesh | None
    places: KeyLocations

    def faults(self) -> list[Fault]:
        """Return the faults of references without a target, or with several nodes where one is required."""
        found = [*self._part_faults(), *self._lift_faults(), *self._member_nodes(), *self._spring_end_faults()]
        if self.mesh is not None:
            found += [*self._groups(self.mesh)]
        if self.mesh is not None or "nodes" in self.raw:
            found += [*self._point_faults()]
        return found

    def _table(self, kind: str) -> Table:
        table = self.raw.get(kind)
        return cast("Table", table) if isinstance(table, Mapping) else {}

    def _each(self, kind: str) -> Iterator[tuple[str, Table]]:
        for name, table in self._table(kind).items():
            if isinstance(table, Mapping):
                yield name, cast("Table", table)

    def _check_name(self, path: Path, name: object, known: Sequence[str], what: str) -> Iterator[Fault]:
        if isinstance(name, str) and name not in known:
            allowed = f"{what}: {', '.join(known) or '(there is none)'}"
            yield Fault(self.places.place(path), repr(name), allowed, "", suggest_name(name, known))

    def _part_faults(self) -> Iterator[Fault]:
        for name, table in self._each("contacts"):
            if table.get("model") in ("lash", "lash-adjuster"):
                yield from self._check_name(
                    ("contacts", name, "at"), table.get("at"), list(self._table("rockers")), "a rocker"
                )
        free = self._table("run").get("free_running")
        if isinstance(free, Mapping):
            cam = cast("Table", free).get("cam")
            yield from self._check_name(("run", "free_running", "cam"), cam, list(self._table("cams")), "a cam")
        for kind, key, target, what in _PART_REFERENCES:
            for name, table in self._each(kind):
                yield from self._check_name((kind, name, key), table.get(key), list(self._table(target)), what)

    def _lift_faults(self) -> Iterator[Fault]:
        """Yield missing keys of cams, and keys that conflict with a lift file."""
        for name, table in self._each("cams"):
            for key in LAW_KEYS if "lift_table" not in table else ():
                if key not in table:
                    where, why = self.places.place(("cams", name, key)), "the key is required without a lift_table"
                    yield Fault(where, "nothing", LAW_KEYS[key], why, f"add {key!r}")
            for key in (*LAW_KEYS, "dwell", "return_law", "ramps", "single_dwell") if "lift_table" in table else ():
                if key in table and not (key == "law" and table[key] == "table"):
                    why = "the lift table says all of it"
                    yield Fault(self.places.place(("cams", name, key)), key, "nothing", why, "remove one of them")

    def _member_nodes(self) -> Iterator[Fault]:
        named = list(self._table("nodes"))
        for name, table in self._each("members") if "mesh" not in self.raw else ():
            if "nodes" not in table:
                where, why = self.places.place(("members", name)), "the case has no mesh file"
                yield Fault(where, "no nodes", "the named nodes along it", why, 'add nodes = ["...", "..."]')
            for node in _as_list(table.get("nodes")):
                yield from self._check_name(("members", name, "nodes"), node, named, "a named node")

    def _spring_end_faults(self) -> Iterator[Fault]:
        """Yield springs with both ends at one point, which have no elongation."""
        for name, table in self._each("springs"):
            if "at" in table and table.get("to") == table["at"]:
                where, why = (
                    self.places.place(("springs", name, "to")),
                    "a spring between a point and itself does nothing",
                )
                yield Fault(where, repr(table["to"]), "another point", why, "leave it out for a spring to ground")

    def _groups(self, mesh: Mesh) -> Iterator[Fault]:
        members = self._table("members")
        for name, table in self._each("members"):
            yield from self._check_name(("members", name), name, list(mesh.lines), "a line group of the mesh")
            if "nodes" in table:
                why = "the mesh file says where it runs"
                yield Fault(self.places.place(("members", name, "nodes")), "nodes", "nothing", why, "remove the key")
        for name in mesh.lines:
            if name not in members:
                yield Fault(f"mesh group {name!r}", "no member", "a table under [members]", "", f"add [members.{name}]")

    def _point_faults(self) -> Iterator[Fault]:
        counts = dict.fromkeys(self._table("nodes"), 1)
        if self.mesh is not None:
            counts = {name: len(index) for name, index in self.mesh.points.items()}
        fingers = [str(one.get("from")) for _, one in self._each("rockers") if _is_finger(one, counts)]
        made = [rocker.get("to") for _, rocker in self._each("rockers")]
        rockers = [name for name in made if isinstance(name, str)] + fingers
        for name, rocker in self._each("rockers"):
            to = rocker.get("to")
            if isinstance(to, str) and (to in counts or rockers.count(to) > 1):
                why = "a rocker defines a point of its own"
                yield Fault(
                    self.places.place(("rockers", name, "to")), repr(to), "a new name", why, "choose another name"
                )
        for kind, key, of_rockers in _POINT_REFERENCES:
            for name, table in self._each(kind):
                if kind == "contacts" and key == "at" and table.get("model") != "seat":
                    continue
                if kind == "rockers" and _is_finger(table, counts):
                    continue
                allowed = {**counts, **(dict.fromkeys(rockers, 1) if of_rockers else {})}
                yield from self._check_point((kind, name, key), table.get(key), allowed)
        for name in self._table("supports"):
            yield from self._check_name(("supports", name), name, list(counts), "a point")
        for probe in _as_list(self._table("output").get("probes")):
            yield from self._check_point(("output", "probes"), probe, {**counts, **dict.fromkeys(rockers, 1)})

    def _check_point(self, path: Path, name: object, counts: Mapping[str, int]) -> Iterator[Fault]:
        yield from self._check_name(path, name, list(counts), "a point")
        if isinstance(name, str) and counts.get(name, 1) != 1:
            why = f"it names {counts[name]} nodes"
            yield Fault(
                self.places.place(path), repr(name), "a point of one node", why, "give the node a group of its own"
            )


_PART_REFERENCES = (
    ("members", "material", "materials", "a material"),
    ("members", "section", "sections", "a section"),
    ("contacts", "cam", "cams", "a cam"),
    ("loads", "member", "members", "a member"),
)
"""Table, key, referenced table and description of the value."""

_POINT_REFERENCES = (
    ("masses", "at", True),
    ("springs", "at", True),
    ("springs", "to", True),
    ("bearings", "at", False),
    ("loads", "at", True),
    ("rockers", "from", False),
    ("cams", "at", False),
    ("contacts", "follower", True),
    ("contacts", "at", True),
    ("contacts", "from", False),
    ("contacts", "to", False),
)
"""Table, key and whether the output point of a rocker is allowed."""


def _as_list(value: object) -> list[object]:
    return cast("list[object]", value) if isinstance(value, list) else []


def _is_finger(rocker: Table, nodes: Mapping[str, int]) -> bool:
    """Return whether a rocker is driven at a separate point."""
    return rocker.get("model") == "lever" and isinstance(rocker.get("from"), str) and rocker["from"] not in nodes
