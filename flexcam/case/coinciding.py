"""Nodes of a case at one place, and members that meet a node twice: told with all other faults of the file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, cast

from flexcam.case.lines import Places
from flexcam.checks import Fault, InputError
from flexcam.units import parse

Table = Mapping[str, Any]


def coinciding(raw: Table, places: Places) -> list[Fault]:
    """Return the nodes that lie where another one does, and the members that meet a node twice."""
    return [*_at_one_place(raw, places), *_met_twice(raw, places)]


def _at_one_place(raw: Table, places: Places) -> Iterator[Fault]:
    first: dict[tuple[float, ...], str] = {}
    for name, place in _table(raw, "nodes").items():
        at = _located(place)
        if at is not None and (other := first.setdefault(at, name)) != name:
            where, why = places.place(("nodes", name)), "members meet only at a shared node"
            remedy = f"name {other!r} wherever {name!r} is meant"
            yield Fault(where, f"the place of {other!r}", "a place of its own", why, remedy)


def _located(place: object) -> tuple[float, ...] | None:
    """Return the coordinates of a node, m; None where they have faults of their own."""
    if not isinstance(place, list | tuple):
        return None
    try:
        return tuple(parse(one, "length", noise=True) for one in cast("list[Any]", place))
    except InputError:
        return None


def _met_twice(raw: Table, places: Places) -> Iterator[Fault]:
    for name, table in _table(raw, "members").items():
        nodes = cast("Table", table).get("nodes") if isinstance(table, Mapping) else None
        met = [one for one in cast("list[object]", nodes) if isinstance(one, str)] if isinstance(nodes, list) else []
        for node in dict.fromkeys(one for one in met if met.count(one) > 1):
            where, allowed = places.place(("members", name, "nodes")), "a chain that meets each node once"
            why, remedy = "a closed member has no end to start from", "make two members of it"
            yield Fault(where, repr(node), allowed, why, remedy)


def _table(raw: Table, kind: str) -> Table:
    table = raw.get(kind)
    return cast("Table", table) if isinstance(table, Mapping) else {}
