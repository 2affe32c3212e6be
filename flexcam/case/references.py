"""Names in a case that must exist elsewhere in it: checked on the raw tables, so that they join the one report."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, cast

from flexcam.case.lines import Path, place
from flexcam.checks import Fault, did_you_mean
from flexcam.motion import LAWS

Table = Mapping[str, Any]


def reference_faults(raw: Table, mesh_points: Iterable[str] | None, lines: dict[Path, int]) -> list[Fault]:
    """Return the references of a case that lead nowhere.

    Parameters
    ----------
    raw
        The parsed TOML, not yet validated.
    mesh_points
        Names of points and, after them, line groups the mesh file defines; None if it could not be read.
    lines
        Lines of the keys.

    Returns
    -------
    list
        One fault per reference.
    """
    points = None if mesh_points is None else [*mesh_points, *_names(raw, "nodes"), *_rocker_points(raw)]
    found = [*_simple(raw, lines), *_laws(raw, lines)]
    if points is not None:
        found += list(_points(raw, points, lines))
    return found


def _tables(raw: Table, kind: str) -> Iterator[tuple[str, Table]]:
    group = raw.get(kind)
    if isinstance(group, Mapping):
        for name, table in cast("Mapping[str, Any]", group).items():
            if isinstance(table, Mapping):
                yield name, cast("Table", table)


def _names(raw: Table, kind: str) -> list[str]:
    group = raw.get(kind)
    return list(cast("Mapping[str, Any]", group)) if isinstance(group, Mapping) else []


def _rocker_points(raw: Table) -> list[str]:
    return [str(rocker["to"]) for _, rocker in _tables(raw, "rockers") if "to" in rocker]


def _missing(path: Path, name: object, known: list[str], what: str, lines: dict[Path, int]) -> list[Fault]:
    if not isinstance(name, str) or name in known:
        return []
    hint = did_you_mean(name, known)
    return [Fault(place(path, lines), repr(name), f"{what}: {', '.join(known) or '(there is none)'}", "", hint)]


_SIMPLE = (
    ("members", "material", "materials", "a material"),
    ("members", "section", "sections", "a section"),
    ("contacts", "cam", "cams", "a cam"),
)


def _simple(raw: Table, lines: dict[Path, int]) -> Iterator[Fault]:
    for kind, key, target, what in _SIMPLE:
        for name, table in _tables(raw, kind):
            yield from _missing((kind, name, key), table.get(key), _names(raw, target), what, lines)


def _laws(raw: Table, lines: dict[Path, int]) -> Iterator[Fault]:
    for name, table in _tables(raw, "cams"):
        yield from _missing(("cams", name, "law"), table.get("law"), list(LAWS), "a motion law", lines)


_AT = (
    ("masses", "at"),
    ("springs", "at"),
    ("springs", "to"),
    ("rockers", "from"),
    ("cams", "at"),
    ("contacts", "follower"),
)


def _points(raw: Table, points: list[str], lines: dict[Path, int]) -> Iterator[Fault]:
    for kind, key in _AT:
        for name, table in _tables(raw, kind):
            yield from _missing((kind, name, key), table.get(key), points, "a point", lines)
    for name in _names(raw, "supports"):
        yield from _missing(("supports", name), name, points, "a point", lines)
    for name, table in _tables(raw, "members"):
        for node in _listed(table.get("nodes")):
            yield from _missing(("members", name, "nodes"), node, _names(raw, "nodes"), "a named node", lines)
    output = raw.get("output")
    if isinstance(output, Mapping):
        for probe in _listed(cast("Table", output).get("probes")):
            yield from _missing(("output", "probes"), probe, points, "a point", lines)


def _listed(value: object) -> list[object]:
    return cast("list[object]", value) if isinstance(value, list) else []
