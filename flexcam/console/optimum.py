"""Tables of optimizations: the best variant, its bounds, fronts, and every evaluation."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from rich.table import Table

from flexcam.console.told import Told, csv_of, or_none, shown
from flexcam.console.words import fixed
from flexcam.study import Design, Evaluations, active, feasible, front, value_of
from flexcam.terminal import facts, table

_ROUNDING = 1e-9
"""Part of a bound by which a value may miss it."""

_NEAR = 0.01
"""Part of the intervals within which a variant that passes a bound says that the bound decides."""


def told_optimum(design: Design, found: Evaluations) -> Told:
    """Return the best variant as tables."""
    best = found.best
    at = found.nearest if best is None else best
    goal, row = design.goals[0], found.rows[at]
    head = (
        f"Best of {len(found.rows)} variants" if best is not None else "Nearest to all bounds, which no variant meets"
    )
    rows = [(goal.words, f"{shown(value_of(row, goal.name))} {_unit(row.units, goal.name)}".strip())]
    point = zip(design.points.variables, found.points[at].tolist(), strict=True)
    rows += [(f"--set {one.key}", f"{shown(x)}{one.unit}") for one, x in point]  # every digit: --json, --csv, -o
    tables = [facts(head, rows)]
    if design.bounds:
        tables.append(_bounds(design, found, at))
    words = [_ends(design, found, at), _failed(found)]
    json = {"best": None if best is None else _variant(design, found, best), "nearest": _variant(design, found, at),
            "evaluations": len(found.rows), "failed": _failures(found)}  # fmt: skip
    return Told(tables, [one for one in words if one], json, _csv(design, found))


def told_front(design: Design, found: Evaluations) -> Told:
    """Return a front as a table."""
    best = front(found)
    names = [goal.name for goal in design.goals]
    head = (*(f"{goal.words}, {design.unit(goal.name, found.rows)}".rstrip(", ") for goal in design.goals),
            *(_key(one.key, one.unit) for one in design.points.variables))  # fmt: skip
    rows = [
        (*(shown(value_of(found.rows[i], name)) for name in names), *(shown(x) for x in found.points[i].tolist()))
        for i in best
    ]
    title = f"Front of {len(found.rows)} variants: no other is better in both"
    told = table(title if rows else "No variant that was evaluated is within all bounds", head, rows)
    json = {"front": [_variant(design, found, i) for i in best], "evaluations": len(found.rows),
            "failed": _failures(found)}  # fmt: skip
    return Told([told], [one for one in [_failed(found)] if one], json, _csv(design, found))


def _key(key: str, unit: str) -> str:
    return f"{key}, {unit}" if unit else key


def _unit(units: Mapping[str, str], name: str) -> str:
    unit = units.get(name, "")
    return "" if unit == "1" else unit


def _bounds(design: Design, found: Evaluations, at: int) -> Table:
    row, passed = found.rows[at], found.violations[at]
    rows = [
        (
            one.words,
            f"{shown(value_of(row, one.name))} {_unit(row.units, one.name)}".strip(),
            _closeness(float(passed[i]), found.outside(at, i)),
            _step(found.outside(at, i)),
        )
        for i, one in enumerate(design.bounds)
    ]
    return table("Bounds", ("subject to", "is", "how close", "first passed, in the intervals"), rows)


def _closeness(passed: float, outside: float) -> str:
    if passed > _ROUNDING:
        return f"passed by {fixed(100.0 * passed, 2)} %"
    return f"decides: {-passed:.2%} away" if active(passed) or outside <= _NEAR else f"{-passed:.1%} away"


def _step(outside: float) -> str:
    return "nowhere" if math.isinf(outside) else f"{outside:.2%} on"


def _ends(design: Design, found: Evaluations, at: int) -> str:
    """Return which intervals end where the best variant is: a wider one may have a better."""
    met = [
        one.key
        for one, value in zip(design.points.variables, found.points[at].tolist(), strict=True)
        if min(value - one.low, one.high - value) <= 0.01 * (one.high - one.low)
    ]
    return f"At an end of its interval: {', '.join(met)}; beyond it there may be a better variant." if met else ""


def _failures(found: Evaluations) -> int:
    return sum(not row.status.ok for row in found.rows)


def _failed(found: Evaluations) -> str:
    failed = [row.status for row in found.rows if not row.status.ok]
    if not failed:
        return ""
    return f"{len(failed)} variants have no numbers and count as outside every bound; the first: {failed[0]}"


def _variant(design: Design, found: Evaluations, i: int) -> dict[str, object]:
    row = found.rows[i]
    names = [*(goal.name for goal in design.goals), *(one.name for one in design.bounds)]
    return {
        "overrides": list(design.points.overrides(found.points[i])),
        "values": {name: or_none(value_of(row, name)) for name in names},
        "units": {name: row.units.get(name, "") for name in names},
        "bounds": [
            {"bound": one.words, "slack": or_none(-float(x)), "outside": or_none(found.outside(i, k)),
             "active": active(float(x)) or found.outside(i, k) <= _NEAR}
            for k, (one, x) in enumerate(zip(design.bounds, found.violations[i].tolist(), strict=False))
        ],
    }  # fmt: skip


def _csv(design: Design, found: Evaluations) -> str:
    """Return every evaluation in its order."""
    names = list(dict.fromkeys([*(goal.name for goal in design.goals), *(one.name for one in design.bounds)]))
    head = [*(_key(one.key, one.unit) for one in design.points.variables), *names, "within all bounds", "status"]
    inside = feasible(found.violations).tolist()
    rows: list[Sequence[object]] = [
        (*point, *(value_of(row, name) for name in names), "yes" if good else "no", str(row.status.cause))
        for point, row, good in zip(found.points.tolist(), found.rows, inside, strict=True)
    ]
    return csv_of(head, rows)


def goal_history(found: Evaluations) -> list[float]:
    """Return the best goal so far after every evaluation, for a picture."""
    best, told = math.inf, list[float]()
    for cost, good in zip(found.costs[:, 0].tolist(), feasible(found.violations).tolist(), strict=True):
        best = min(best, cost) if good else best
        told.append(math.nan if math.isinf(best) else best)
    return told
