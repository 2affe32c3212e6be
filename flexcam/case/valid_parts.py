"""Valid part of a case: its tables without the faulty parts, so that one report has the faults of all others."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from copy import deepcopy
from dataclasses import dataclass, field
from typing import Any, cast

from flexcam.case.fault_report import Path, value_at
from flexcam.case.records import example_value
from flexcam.core.errors import Fault
from flexcam.fem.mesh import Mesh

_TRAIN = frozenset(
    [
        "nodes",
        "members",
        "superelements",
        "rigid_links",
        "supports",
        "masses",
        "springs",
        "bearings",
        "loads",
        "rockers",
        "cams",
        "contacts",
    ]
)
# Parts and keys whose checks search other tables, and those tables.
_SEARCHED = {
    "bearings": {"cams"}, "rockers": {"contacts", "supports"}, "cams": {"members"}, "contacts": {"nodes"},
    "run.start": _TRAIN, "run.start.displacement": _TRAIN, "run.start.velocity": _TRAIN,
    "run.step": {"run.speed"}, "run.adaptive.smallest": {"run.step", "run.speed"},
}  # fmt: skip
# Tables without a fault, also with all other parts, that replace faulty ones; None for a key that the faulty one keeps.
_STAND_INS: Mapping[str, Any] = {
    "format": 1,
    "materials": {"E": 2e11, "nu": 0.3, "density": 8e3, "expansion": 1e-5},
    "sections": {"shape": "circle", "diameter": 0.01},
    "members": {"nodes": None, "material": "stand-in", "section": "stand-in"},
    "rockers": {"model": "lumped", "from": None, "to": None, "direction": None, "arms": [1.0, 1.0]},
    "cams": {"at": None, "axis": None, "law": "cycloidal", "lift": 1e-3, "rise": 1.0, "return": 1.0,
             "base_radius": 0.1, "width": 0.01, "follower": {"type": "flat"}},
    "run": {"speed": 100.0, "start": None, "integrator": None},
}  # fmt: skip
_OPTIONAL = ("run", "fidelity", "output")  # tables whose keys are left out one by one


def _path(fault: Fault) -> Path:
    return tuple(re.split(r" \(|:", fault.where)[0].split("."))


@dataclass
class ValidParts:
    """Tables of a case from which faulty parts are left out; the smallest change that cures a fault is made first."""

    given: dict[str, Any]  #: tables that are left
    mesh: Mesh | None
    #: parts and keys that were changed, and tables that lack a part, as `springs.valve` and `springs`
    changed: set[str] = field(default_factory=set[str])
    replaced: set[str] = field(default_factory=set[str])  #: parts that have a stand-in

    @property
    def exact(self) -> bool:
        """Whether no part of the train is changed."""
        return all(key.partition(".")[0] in (*_OPTIONAL, "format") for key in self.changed)

    @property
    def connected(self) -> bool:
        """Whether no part of the train is missing."""
        return self.changed.isdisjoint(_TRAIN)

    def tables(self) -> dict[str, Any]:
        """Return the tables; if parts are missing, with few elements, and with masses that let every point move."""
        found = deepcopy(self.given)
        if "mesh" not in found and not self._table("nodes"):
            found["nodes"] = {"stand-in": [0.0, 0.0, 0.0]}
        for kind in ("materials", "sections"):
            found[kind] = self._table(kind) | {"stand-in": _STAND_INS[kind]}
        if not self.connected:
            points = {name: [0] for name in self._table("nodes")} if self.mesh is None else self.mesh.points
            masses = {
                f"at {one}": {"at": one, "mass": 1.0, "inertia": [1.0] * 3} for one, n in points.items() if len(n) == 1
            }
            found["masses"] = self._table("masses") | masses
            members = self._table("members")
            found["members"] = {name: self._table("members", name) | {"elements": 1} for name in members}
        return found

    def follows(self, fault: Fault) -> bool:
        """Return whether a fault may follow from the changes."""
        path = _path(fault)
        searched = _SEARCHED.get(path[0], set()) | _SEARCHED.get(".".join(path), set())
        return ".".join(path[:2]) in self.changed or not self.changed.isdisjoint(searched)

    def leave_out(self, faults: Iterable[Fault]) -> bool:
        """Leave out what has a fault; return whether anything was left to change."""
        parts: dict[Path, list[Fault]] = {}
        for fault in faults:
            parts.setdefault(_path(fault)[:2], []).append(fault)
        return any([any([self._cure(one) for one in own]) or self._replace(*part) for part, own in parts.items()])

    def _table(self, *path: str) -> dict[str, Any]:
        table = value_at(self.given, path)
        return cast("dict[str, Any]", table) if isinstance(table, dict) else {}

    def _cure(self, fault: Fault) -> bool:
        """Remove an unknown or an optional key, or replace a quantity by an example; return whether this changed it."""
        path, part = _path(fault), ".".join(_path(fault)[:2])
        if fault.given == f"key {path[-1]!r}":
            return self._table(*path[:-1]).pop(path[-1], None) is not None
        if path[0] in _OPTIONAL and len(path) > 1:
            self.changed.add(part)
            return self._table(path[0]).pop(path[1], None) is not None
        holder, key = value_at(self.given, path[:-1]), cast("Any", path[-1])
        example = example_value(path) if isinstance(holder, dict) and len(path) > 2 else None
        if example is None or self._table(*path[:-1]).get(key) == example:
            return False
        self._table(*path[:-1])[key] = example
        self.changed.add(part)
        return True

    def _replace(self, kind: str, name: str = "") -> bool:
        """Replace a part by its stand-in, or remove it; return whether this changed it."""
        holder, key = (self._table(kind), name) if name else (self.given, kind)
        part, own, stand_in = ".".join(filter(None, (kind, name))), holder.get(key), _STAND_INS.get(kind)
        self.changed.add(part)
        if stand_in is None or part in self.replaced:
            self.changed.add(kind)
            return holder.pop(key, None) is not None
        if isinstance(stand_in, dict):
            kept = own if isinstance(own, dict) else {}
            stand_in = {at: kept.get(at) if one is None else one for at, one in stand_in.items()}
            stand_in = {at: one for at, one in stand_in.items() if one is not None}
            if kind == "members" and self.mesh is None:
                stand_in["nodes"] = [one for one in dict.fromkeys(kept.get("nodes", [])) if one in self._table("nodes")]
        self.replaced.add(part)
        holder[key] = stand_in
        return True
