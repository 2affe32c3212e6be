"""Numbers that are possible but hardly meant: told with the number that was likely meant, never refused.

The bounds are those of machines that exist, with room to spare. A case beyond them still runs.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import Any, cast

import numpy as np

from flexcam.case.case import Case
from flexcam.case.odd import odd
from flexcam.case.report import filled, si_unit
from flexcam.case.usual import STRAIGHT, TWISTED, USUAL, Usual
from flexcam.fem import Mesh

_SLENDER = 2000.0
_STOUT = 0.2
"""Length of a member by the size of its section, outside of which units do not fit together."""


def unusual(case: Case) -> list[str]:
    """Return which numbers of a case are hardly meant, in words."""
    tables = filled(case.record)
    found = [_told(case, path, value, one) for one in USUAL for path, value in _beyond(tables, one)]
    others = (odd, _soft_or_stiff, _held_twice, _on_held, _ill_proportioned)
    return list(dict.fromkeys([*found, *(said for one in others for said in one(case))]))


def _beyond(tables: Mapping[str, Any], usual: Usual) -> Iterator[tuple[tuple[str, ...], float]]:
    """Yield the path and number of what is not usual, one per key."""
    for path, value in _values(tables, tuple(usual.key.split(".")), ()):
        several = cast("list[object]", value) if isinstance(value, list) else [value]
        numbers = [abs(float(x)) for x in several if isinstance(x, int | float) and not isinstance(x, bool)]
        if beyond := [x for x in numbers if (x or usual.zero) and not usual.least <= x <= usual.most]:
            yield path, beyond[0]


def _values(table: object, steps: tuple[str, ...], path: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], object]]:
    """Yield path and value of every key that a pattern names."""
    if not steps:
        yield path, table
    elif isinstance(table, dict):
        inner = cast("dict[str, Any]", table)
        for name in inner if steps[0] == "*" else [one for one in inner if one == steps[0]]:
            yield from _values(inner[name], steps[1:], (*path, name))


def _told(case: Case, path: tuple[str, ...], value: float, usual: Usual) -> str:
    unit = si_unit(path) or usual.si
    bounds = f"{usual.least:g} to {usual.most:g}" if usual.least else f"up to {usual.most:g}"
    near = [f"{value:g} {name}" for name, size in usual.meant.items() if usual.least <= value * size <= usual.most]
    meant = f": did you mean {near[0]}?" if near else ""
    given, outside = f"{value:g} {unit}".rstrip(), f"{bounds} {unit}".rstrip()
    return f"Warning: {case.place(path)}: {given} is no usual {usual.what} ({outside}){meant}"


def _soft_or_stiff(case: Case) -> Iterator[str]:
    """Yield the springs of hardly any stiffness, or too much; what is soft depends on whether they twist."""
    tables = filled(case.record)
    twist = {name for name, one in case.record.springs.items() if one.made().turns}
    for usual, turning in ((STRAIGHT, False), (TWISTED, True)):
        for path, value in _beyond(tables, usual):
            if (path[1] in twist) == turning:
                yield _told(case, path, value, usual)


def _held_twice(case: Case) -> Iterator[str]:
    """Yield the components that two supports hold at one node, or one support twice."""
    seen: dict[tuple[int, str], str] = {}
    for point, held in case.record.supports.items():
        place = case.place(("supports", point))
        for component in sorted({one for one in held if held.count(one) > 1}):
            yield f"Warning: {place}: {component} is listed {held.count(component)} times"
        for node, component in product(_nodes(case, point), dict.fromkeys(held)):
            other = seen.setdefault((node, component), point)
            if other != point:
                yield f"Warning: {place}: {component} is held by support {other!r} already, at a node of both"


def _nodes(case: Case, point: str) -> list[int]:
    if case.mesh is None:
        names = list(case.record.nodes)
        return [names.index(point)] if point in names else []
    return case.mesh.points[point].tolist() if point in case.mesh.points else []


def _on_held(case: Case) -> Iterator[str]:
    """Yield the springs to ground that act on nothing, as a support holds what they push."""
    held = {
        (node, one)
        for point, several in case.record.supports.items()
        for node in _nodes(case, point)
        for one in several
    }
    for name, spring in case.record.springs.items():
        along = spring.direction.lstrip("+-") if isinstance(spring.direction, str) else ""
        nodes = _nodes(case, spring.at)
        if spring.to is None and along and nodes and all((node, along) in held for node in nodes):
            place = case.place(("springs", name))
            yield f"Warning: {place}: a support holds {along} of {spring.at!r}, so that the spring acts on nothing"


def _ill_proportioned(case: Case) -> Iterator[str]:
    """Yield the members whose length and thickness do not belong together."""
    for name, member in case.record.members.items():
        size = 2.0 * case.record.sections[member.section].made().radius
        length = _length(case.mesh, name) if case.mesh is not None else _length_of_nodes(case, member.nodes or [])
        ratio = length / size
        if not _STOUT <= ratio <= _SLENDER:
            sizes = f"{length:g} m long and {size:g} m thick, {ratio:.2g} to one"
            question = "do lengths and sections have the same unit?"
            yield f"Warning: {case.place(('members', name))}: {sizes}: {question}"


def _length(mesh: Mesh, name: str) -> float:
    return _along(mesh.nodes[mesh.lines[name]])


def _length_of_nodes(case: Case, names: Sequence[str]) -> float:
    return _along([case.record.nodes[name] for name in names])


def _along(points: Any) -> float:  # noqa: ANN401 - any array-like
    return float(np.linalg.norm(np.diff(np.asarray(points, dtype=float), axis=0), axis=1).sum())
