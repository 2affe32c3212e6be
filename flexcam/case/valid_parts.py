"""Valid part of a case: its tables without the faulty parts, so that one report has the faults of all others."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from collections.abc import Set as AbstractSet
from copy import deepcopy
from dataclasses import dataclass, field
from typing import Any, cast

from flexcam.case.fault_report import Path, value_at
from flexcam.core.errors import Fault
from flexcam.fem.mesh import Mesh

# Tables of the train: without one of their parts no train is known to be complete.
TRAIN = frozenset(
    ("nodes", "members", "superelements", "rigid_links", "supports", "masses", "springs", "bearings", "loads",
     "rockers", "cams", "contacts")
)  # fmt: skip
_INNER = frozenset(("mesh", "members", "superelements", "springs", "rockers"))  # tables that name unknowns
# Parts and keys whose checks search other tables, and those tables and keys.
_SEARCHED: Mapping[str, AbstractSet[str]] = {
    "bearings": {"cams", "members"}, "rockers": {"contacts", "supports", "members"}, "cams": {"members"},
    "contacts": {"members"}, "run.damping.modal": TRAIN,
    "run.start": TRAIN, "run.start.displacement": _INNER, "run.start.velocity": _INNER, "run.step": {"run.speed"},
    "run.steps_per_revolution": {"run.speed"}, "run.adaptive.smallest": {"run", "run.step", "run.speed"},
}  # fmt: skip
# Tables without a fault, also with all other parts, that replace faulty ones; None for a key that the faulty one keeps.
_STAND_INS: Mapping[str, Mapping[str, Any]] = {
    "materials": {"E": 2e11, "nu": 0.3, "density": 8e3, "expansion": 1e-5},
    "sections": {"shape": "circle", "diameter": 0.01},
    "members": {"nodes": None, "material": "stand-in", "section": "stand-in"},
    "masses": {"at": None, "mass": 1.0},
    "springs": {"at": None, "to": None, "direction": None, "stiffness": 1e4},
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
    """Tables of a case from which faulty parts are left out: replaced by a valid part of its kind, else removed."""

    given: dict[str, Any]  #: tables that are left, which this object may change
    mesh: Mesh | None
    #: parts and keys that were changed, and tables that lack a part, as `springs.valve` and `springs`
    changed: set[str] = field(default_factory=set[str])

    def keeps(self, kinds: Iterable[str]) -> bool:
        """Return whether no part of some tables was changed."""
        return {key.partition(".")[0] for key in self.changed}.isdisjoint(kinds)

    @property
    def connected(self) -> bool:
        """True if no part of the train is missing."""
        return self.changed.isdisjoint(TRAIN)

    def tables(self) -> dict[str, Any]:
        """Return the tables; if parts are missing, with masses that let every point move."""
        tables, nodes = deepcopy(self.given) | {"format": 1}, self._table("nodes")
        lines, points = list[str](), list(nodes)
        if self.mesh is not None:
            lines, points = list(self.mesh.lines), [name for name, at in self.mesh.points.items() if len(at) == 1]
        else:
            tables.pop("mesh", None)
            tables["nodes"] = nodes or {"stand-in": [0.0, 0.0, 0.0]}
        extra: dict[str, dict[str, Any]] = {kind: {"stand-in": _STAND_INS[kind]} for kind in ("materials", "sections")}
        extra["members"] = {name: {"material": "stand-in", "section": "stand-in"} for name in lines}
        if not self.connected:
            mass = {"mass": 1.0, "inertia": [1.0, 1.0, 1.0]}
            extra["masses"] = {f"at {name}": {"at": name, **mass} for name in points}
            contacts = self._table("contacts").items()  # the preload of a published load needs a whole train
            tables["contacts"] = {name: part for name, part in contacts if part.get("model") != "published-load"}
        return tables | {kind: parts | self._table(kind) for kind, parts in extra.items()}

    def follows(self, fault: Fault) -> bool:
        """Return whether a fault may follow from the changes."""
        path, node = _path(fault), fault.given.strip("'").partition(".")[0]
        searched = _SEARCHED.get(path[0], set()) | _SEARCHED.get(".".join(path), set())
        keys = {".".join(path[:2]), f"nodes.{node}", "nodes" if node.startswith("node ") else "", *searched}
        if path[0] == "friction":  # of a nest of springs
            keys |= {f"springs.{name}" for name in self._table("springs")}
        return not self.changed.isdisjoint(keys)

    def leave_out(self, faults: Iterable[Fault]) -> bool:
        """Leave out the parts that have a fault; return whether anything was left to change."""
        changes = [self._leave_out(*part) for part in dict.fromkeys(_path(fault)[:2] for fault in faults)]
        return any(changes)

    def _table(self, *path: str) -> dict[str, Any]:
        table = value_at(self.given, path)
        return cast("dict[str, Any]", table) if isinstance(table, dict) else {}

    def _leave_out(self, kind: str, name: str = "") -> bool:
        """Remove an optional key, replace a part by its stand-in, or remove it; return whether this changed it."""
        if kind in _OPTIONAL and self._table(kind).pop(name, None) is not None:
            self.changed.add(f"{kind}.{name}")
            return True
        path = (kind,) if not name or kind in _OPTIONAL else (kind, name)
        holder, table, old = self._table(*path[:-1]), self._table(*path), value_at(self.given, path)
        self.changed.add(".".join(path))
        new = {key: table.get(key) if value is None else value for key, value in _STAND_INS.get(kind, {}).items()}
        new = {key: value for key, value in new.items() if value is not None}
        if isinstance(nodes := new.get("nodes"), list):
            named = (n for n in cast("list[object]", nodes) if isinstance(n, str) and n in self._table("nodes"))
            new["nodes"] = list(dict.fromkeys(named))
        if new and new != old:
            holder[path[-1]] = new
        else:
            self.changed.add(kind)
            holder.pop(path[-1], None)
        return old is not None
