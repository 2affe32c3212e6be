"""Tables about a run and its result."""

from __future__ import annotations

import json
from collections.abc import Mapping

import numpy as np
from rich.table import Table

from flexcam.case import Case
from flexcam.console.cases import rpm
from flexcam.io import Result
from flexcam.response import Response
from flexcam.terminal import facts, table
from flexcam.train import MemberStrength


def run_table(case: Case, response: Response) -> Table:
    """Return the extremes of every probe.

    Parameters
    ----------
    case
        The case.
    response
        Its response.

    Returns
    -------
    Table
        For rich.
    """
    rows: list[tuple[str, ...]] = []
    for name, components in response.outline.probes:
        for component in components:
            full = name if len(components) == 1 else f"{name}.{component}"
            moved = response[full].displacement
            unit = "mrad" if component.startswith("r") else "mm"
            if len(moved) and round(1e3 * float(np.abs(moved).max()), 4) > 0.0:
                rows.append((full, *(f"{round(1e3 * x, 4) + 0.0:.4f} {unit}" for x in (moved.min(), moved.max()))))
    title = f"{case.record.title or case.name}, {rpm(case):g} rpm"
    return table(title, ("probe", "least", "largest"), rows or [("no probe moves", "", "")])


def strength_table(members: Mapping[str, MemberStrength]) -> Table:
    """Return the most stressed place of every member.

    Parameters
    ----------
    members
        From a `StrengthSink`.

    Returns
    -------
    Table
        For rich.
    """
    rows = [
        (name, f"{one.von_mises / 1e6:.4g}", f"{one.mean / 1e6:.4g}", f"{one.alternating / 1e6:.4g}",
         "not stated" if one.safety is None else f"{one.safety:.3g}", one.place)
        for name, one in members.items()
    ]  # fmt: skip
    head = ("stress, MPa", "von Mises", "mean", "alternating", "fatigue safety", "at")
    return table("Stresses at the saved instants", head, rows)


def info_table(result: Result) -> Table:
    """Return what a result file holds.

    Parameters
    ----------
    result
        The result.

    Returns
    -------
    Table
        For rich.
    """
    response = result.response
    about = [(name, text) for name, text in result.about.items() if name not in ("case", "resolved", "overrides")]
    rows = [
        ("run", str(response.status)),
        ("steps", f"{response.stats.steps} of {response.stats.unknowns} unknowns, {response.stats.seconds:.3g} s"),
        ("saved", f"{len(response.time)} instants of the probes, {len(response.field_time)} of the fields"),
        ("probes", ", ".join(name for name, _ in response.outline.probes) or "none"),
        ("channels", ", ".join(f"{name} [{unit}]" for name, unit in response.outline.channels) or "none"),
        ("fields", ", ".join([*result.field_names, *result.recovered])),
        ("members", ", ".join(f"{name} ({len(line) - 1})" for name, line in result.mesh.lines.items())),
        *about,
        ("overrides", ", ".join(json.loads(result.about["overrides"])) or "none"),
    ]
    return facts("Result", rows)
