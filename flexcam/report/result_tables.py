"""Tables of a run and its result."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np
from rich.table import Table

from flexcam.case.case import Case
from flexcam.core import FloatArray
from flexcam.core.units import to_display_unit
from flexcam.dynamics import Response, Stats
from flexcam.dynamics.memory import ExtremesSink
from flexcam.fem.frames import ROTATIONS
from flexcam.io import Result, VerificationSummary
from flexcam.report.formatting import count_decimals, format_fixed
from flexcam.report.run_checks import describe_balance
from flexcam.report.terminal import facts_table, plain_table
from flexcam.valvetrain import MemberStrength, Metric


def run_table(case: Case, extremes: ExtremesSink) -> Table:
    """Return the table of the extremes of every probe."""
    moved = [
        (name if len(components) == 1 else f"{name}.{component}", component in ROTATIONS, 1e3 * np.array(bounds))
        for name, components in extremes.outline.probes
        for component, *bounds in zip(components, *extremes.probe(name), strict=True)
    ]
    largest = max((float(np.abs(bounds).max()) for _, turns, bounds in moved if not turns), default=0.0)
    least = min(_REST_AMPLITUDE, _RELATIVE_REST_AMPLITUDE * largest)
    rows = [(name, *_bounds(bounds, "mrad" if turns else "mm")) for name, turns, bounds in moved
            if float(np.abs(bounds).max()) > least]  # fmt: skip
    title = f"{case.title}, {case.speed_text}"
    return plain_table(title, ("probe", "least", "largest"), rows or [("no probe moves", "", "")])


def metrics_table(figures: Sequence[Metric]) -> Table:
    """Return the table of the metrics of the last revolution."""
    rows: list[tuple[str, str]] = []
    for figure in figures:
        factor, unit = to_display_unit(figure.unit)
        words = figure.name.replace(".", " ").replace("_", " ")
        rows.append(
            (words, f"{factor * figure.value + 0.0:.4g} {unit}".rstrip())
        )  # + 0.0 removes the sign of a negative zero
    return facts_table("The train in the last revolution", rows)


def periodicity_error(response: Response) -> float | None:
    """Return the relative deviation of a periodic run from its initial state; None if it was not periodic."""
    return response.stats.periodicity if response.stats.periodicity >= 0.0 else None


def equilibrium_residual(response: Response) -> float | None:
    """Return the largest equilibrium residual relative to the largest force; None if it was not computed."""
    return response.stats.imbalance if response.stats.imbalance >= 0.0 else None


def strength_table(members: Mapping[str, MemberStrength]) -> Table:
    """Return the table of the maximum stresses of every member."""
    rows = [
        (name, f"{one.von_mises / 1e6:.4g}", f"{one.mean / 1e6:.4g}", f"{one.alternating / 1e6:.4g}",
         f"{one.safety:.3g}" if one.safety else "unlimited" if one.rated else "not stated", one.place)
        for name, one in members.items()
    ]  # fmt: skip
    head = ("stress, MPa", "von Mises", "mean", "alternating", "fatigue safety", "at")
    return plain_table("Stresses at the saved instants", head, rows)


def describe_dofs(response: Response) -> str:
    """Return the number of degrees of freedom of a result and how many were integrated, as far as known."""
    every, integrated = response.stats.size or len(response.outline.unknowns), response.stats.unknowns
    if not response.stats.is_complete:
        return f"{response.stats.size} unknowns" if response.stats.size else "unknowns not counted"
    count = f"{every} unknowns" + (f", {integrated} integrated" if integrated != every else "")
    return count + _ENGINES.get(response.stats.engine, "")


_ENGINES = {"modal": ", modal engine", "kernel": ", kernel engine"}
"""Names of solver engines."""


def describe_verification(path: Path, found: VerificationSummary) -> str:
    """Return a sentence that a file is sound, with the verified checksums."""
    partial = "" if found.complete else ". The run that wrote it did not come to its end; what it holds is whole"
    return f"{path} is sound: {found.datasets} datasets, {found.bytes} bytes, as they were written{partial}"


def stats_json(stats: Stats) -> dict[str, object]:
    """Return the known statistics of a run for JSON."""
    return (
        asdict(stats) if stats.is_complete else {"steps": stats.steps, **({"size": stats.size} if stats.size else {})}
    )


def _warning_rows(result: Result) -> list[tuple[str, str]]:
    """Return the warnings of the run and of its case."""
    told = dict.fromkeys([*result.warnings, *result.about.get("warnings", "").splitlines()])
    return [("warning", one.removeprefix("Warning: ")) for one in told] or [("warnings", "none")]


def _seconds(stats: Stats) -> str:
    return f", {stats.seconds:.3g} s" if stats.is_complete else ""


def _bounds(bounds: FloatArray, unit: str) -> list[str]:
    largest = float(np.abs(bounds).max())
    places = 4 if largest >= _FOUR_DECIMAL_AMPLITUDE else count_decimals(largest, 4)
    return [f"{format_fixed(float(one), places)} {unit}" for one in bounds]


_REST_AMPLITUDE, _RELATIVE_REST_AMPLITUDE = 5e-5, 1e-5
"""A probe is at rest if it moves less than this, mm or mrad, and less than this fraction of the largest motion."""

_FOUR_DECIMAL_AMPLITUDE = 1e-3
"""Motion, mm or mrad, for which four decimals are sufficient."""

_OMITTED_TEXTS = ("case", "resolved", "overrides", "warnings")
"""Texts of a result shown in other rows or not at all."""


def info_table(result: Result) -> Table:
    """Return the table of a result file's contents."""
    response = result.response
    about = [(name, text) for name, text in result.about.items() if name not in _OMITTED_TEXTS]
    rows = [
        ("run", str(response.status)),
        ("steps", f"{response.stats.steps} of {describe_dofs(response)}{_seconds(response.stats)}"),
        *(
            [("periodic within", f"{response.stats.periodicity:.3g} of the motion")]
            if response.stats.periodicity >= 0.0
            else []
        ),
        *([("energy balance", told)] if (told := describe_balance(ExtremesSink.of(response), response.stats)) else []),
        ("saved", f"{len(response.time)} instants of the probes, {len(response.field_time)} of the fields"),
        ("probes", ", ".join(name for name, _ in response.outline.probes) or "none"),
        ("channels", ", ".join(f"{name} [{unit}]" for name, unit in response.outline.channels) or "none"),
        ("fields", ", ".join([*result.field_names, *result.recovered])),
        ("members", ", ".join(f"{name} ({len(line) - 1})" for name, line in result.mesh.lines.items()) or "none"),
        *about,
        *_warning_rows(result),
        ("overrides", ", ".join(json.loads(result.about["overrides"])) or "none"),
    ]
    return facts_table("Result", rows)
