"""Content of a report as plain values: tables, charts, scenes and chapters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from rich.table import Table

from flexcam.analysis.comparison import Comparison
from flexcam.analysis.error_estimate import estimate_errors
from flexcam.analysis.limits import Limits, find_limits
from flexcam.analysis.model_choice import evaluate_ladder
from flexcam.analysis.run import member_strength
from flexcam.case.case import Case
from flexcam.core import FloatArray
from flexcam.core.errors import InputError
from flexcam.dynamics import Response
from flexcam.dynamics.memory import ExtremesSink
from flexcam.report.fidelity_tables import TRADE_LEGEND, error_table, format_with_error, trade_table, trade_warnings
from flexcam.report.limits_table import limits_table
from flexcam.report.model_tables import comparison_table, mode_table, model_table
from flexcam.report.result_tables import info_table, metrics_table, run_table, strength_table
from flexcam.report.sentences import ReportSubject
from flexcam.valvetrain import Metric


@dataclass(frozen=True)
class ReportTable:
    """Table.

    Parameters
    ----------
    title
        Title above the table.
    heads
        Column headers; empty if the first column describes the rows.
    rows
        Cells as text.
    words
        Indices of the columns that contain words; the others contain numbers.
    """

    title: str
    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    words: tuple[int, ...] = (0,)


@dataclass(frozen=True, eq=False)
class Curve:
    """Curve.

    Parameters
    ----------
    name
        Name in the legend.
    group
        Index of its run, which determines its colour.
    rigid
        Whether it belongs to the rigid train.
    x, y
        Values in the units of the axes, shape (m,).
    """

    name: str
    group: int
    rigid: bool
    x: FloatArray
    y: FloatArray


@dataclass(frozen=True, eq=False)
class Panel:
    """Curves on one axis.

    Parameters
    ----------
    label
        Label of the vertical axis with unit.
    curves
        Curves.
    """

    label: str
    curves: tuple[Curve, ...]


@dataclass(frozen=True, eq=False)
class Chart:
    """Panels stacked vertically over the cam angle in degrees.

    Parameters
    ----------
    name
        Name of the content, such as a probe.
    words
        Text alternative of the chart.
    panels
        Panels from top to bottom.
    """

    name: str
    words: tuple[str, ...]
    panels: tuple[Panel, ...]


@dataclass(frozen=True, eq=False)
class ChartGroup:
    """Group of charts of which the reader selects one.

    Parameters
    ----------
    title
        Title above the group.
    what
        Kind of item selected, such as ``probe``.
    charts
        One or more charts.
    """

    title: str
    what: str
    charts: tuple[Chart, ...]


@dataclass(frozen=True, eq=False)
class Shape:
    """Motion of the lines of a scene.

    Parameters
    ----------
    name
        Name, such as ``mode 2, 67.11 Hz``.
    words
        Description of the motion.
    frames
        Displacements, m, shape (frames, points, 3); a single frame oscillates, several are played in sequence.
    """

    name: str
    words: str
    frames: FloatArray


@dataclass(frozen=True, eq=False)
class Scene:
    """Members as lines in space and their motion.

    Parameters
    ----------
    points
        Points, m, shape (points, 3), global axes.
    lines
        Range of points by member.
    names
        Index of the point by name.
    shapes
        Selectable motions.
    """

    points: FloatArray
    lines: Mapping[str, tuple[int, int]]
    names: Mapping[str, int]
    shapes: tuple[Shape, ...]


@dataclass(frozen=True)
class Picture:
    """Static image, also for printing.

    Parameters
    ----------
    title
        Title above the image.
    png
        Content of the PNG file.
    words
        Text alternative of the image.
    """

    title: str
    png: bytes
    words: str


@dataclass(frozen=True, eq=False)
class Chapter:
    """Report on one result.

    Parameters
    ----------
    name
        Name that distinguishes it from the other chapters.
    title
        Title of its case, with the speed.
    verdict
        Sentences that compare flexible and rigid models; empty without a comparison.
    summary
        Sentences about the model and its results.
    warnings
        Warnings, and sentences about content omitted from the report.
    sheets
        Tables.
    pictures
        Images of additionally requested results.
    scene
        Members and their motions; None if there is nothing to draw.
    case
        Text of the case file.
    origin
        Origin of the result: files, versions, date.
    """

    name: str
    title: str
    verdict: tuple[str, ...]
    summary: tuple[str, ...]
    warnings: tuple[str, ...]
    sheets: tuple[ReportTable, ...]
    pictures: tuple[Picture, ...]
    scene: Scene | None
    case: str
    origin: ReportTable


@dataclass(frozen=True, eq=False)
class Report:
    """Report on one or more results.

    Parameters
    ----------
    title
        Title of the page.
    chapters
        One chapter per result.
    albums
        Charts with the curves of all results.
    notes
        Sentences about omitted curves.
    still
        Image of the most important curves for printing; None without motion.
    """

    title: str
    chapters: tuple[Chapter, ...]
    albums: tuple[ChartGroup, ...]
    notes: tuple[str, ...]
    still: Picture | None


_MAX_NUMBER_LENGTH = 24
"""Maximum length of a cell that counts as a number, characters."""


def report_table(table: Table) -> ReportTable:
    """Convert a table for the terminal to a value."""
    heads = tuple(str(column.header) for column in table.columns) if table.show_header else ()
    columns = [[str(cell) for cell in column.cells] for column in table.columns]
    cells = tuple(zip(*columns, strict=True))
    words = (
        i
        for i, of in enumerate(columns)
        if table.columns[i].justify == "left" or max(map(len, of), default=0) > _MAX_NUMBER_LENGTH
    )
    return ReportTable(str(table.title or ""), heads, cells, tuple(words))


def result_tables(about: ReportSubject, compared: Comparison | None, figures: list[Metric]) -> list[ReportTable]:
    """Return the tables of a result."""
    response, known = about.result.response, about.known
    turns = 1.0 if known is None else known.case.turns
    found = [report_table(comparison_table(compared, turns))] if compared is not None else []
    found += [report_table(metrics_table(figures))] if figures else []
    if known is not None:
        stressed = member_strength(known.ready, known.response)
        found += [report_table(strength_table(stressed))] if stressed else []
        found.append(
            replace(report_table(run_table(known.case, ExtremesSink.of(response))), title="Range of the probes")
        )
    found += [energy_table(response)] if len(response.time) else []
    found += [report_table(mode_table(about.modes))] if about.modes is not None else []
    if known is not None and about.modes is not None:
        found.append(replace(report_table(model_table(known.ready, about.modes)), title="The model"))
    return found


def energy_table(response: Response) -> ReportTable:
    """Return the table of the energies of a run."""
    parts = {name.removeprefix("energy."): v for name, v in response.channels.items() if name.startswith("energy.")}
    rows = [
        (name, *(f"{value:.4g}" for value in (values.min(), values.max(), values[-1])))
        for name, values in parts.items()
        if np.any(values)
    ]
    return ReportTable("Energy over the run", ("J", "least", "largest", "at the end"), tuple(rows))


def origin_table(about: ReportSubject) -> ReportTable:
    """Return the table of the origin of a result."""
    result = about.result if about.known is None else replace(about.result, response=about.known.response)
    return replace(report_table(info_table(result)), title="The result file")


_LIMIT_TOLERANCE = 0.01
"""Width of the bracket of limits relative to the speed."""


@dataclass(frozen=True)
class ReportOptions:
    """Additional content of a report, which requires runs of the case.

    Parameters
    ----------
    errors
        Whether to estimate errors.
    limits
        Whether to find the speed limits of the train.
    trade
        Whether to evaluate error versus cost of models.
    """

    errors: bool = False
    limits: bool = False
    trade: bool = False


@dataclass(frozen=True)
class AdditionalContent:
    """Additional content of a chapter.

    Parameters
    ----------
    sentences, sheets, pictures
        Content to be added to the chapter.
    """

    sentences: tuple[str, ...] = ()
    sheets: tuple[ReportTable, ...] = ()
    pictures: tuple[Picture, ...] = ()


def additional_content(case: Case, probe: str, asked: ReportOptions) -> list[AdditionalContent]:
    """Return the additional content from runs of the case."""
    found: list[AdditionalContent] = []
    if asked.errors or case.record.fidelity.estimate:
        found.append(_errors(case, probe))
    if asked.limits:
        found.append(_limits(case))
    if asked.trade:
        found.append(_trade(case, probe))
    return found


def _errors(case: Case, probe: str) -> AdditionalContent:
    errors = estimate_errors(case, probe)
    told = "; ".join(f"{one.quantity} {format_with_error(one)}" for one in errors if one.holds)
    unknown = ", ".join(one.quantity for one in errors if not one.holds)
    said = [f"Largest values of {probe} and the contacts with their errors: {told}."] if told else []
    if unknown:
        said.append(f"No estimate of the error holds for {unknown}: shorter steps do not bring the runs together.")
    return AdditionalContent(tuple(said), (report_table(error_table(errors)),))


def _limits(case: Case) -> AdditionalContent:
    scale = case.turns
    try:
        limits = find_limits(
            case, lowest=0.5 * case.speed, highest=2.0 * case.speed, tolerance=_LIMIT_TOLERANCE * case.speed
        )
    except InputError as refusal:  # the rest of the page is still valid
        return AdditionalContent(
            tuple(f"Limits were not looked for: {fault.why or fault.given}." for fault in refusal.faults), ()
        )
    return AdditionalContent((_first(limits, scale),), (report_table(limits_table(limits, scale)),))


def _first(limits: Limits, scale: float) -> str:
    if limits.first is None:
        return "Nothing gives way up to twice the speed."
    one = limits.limits[limits.first]
    speed = f"{scale * (one.rpm or 0.0):.4g} rpm of the {'crankshaft' if scale == 2.0 else 'camshaft'}"
    return f"What gives way first is {limits.first.replace('_', ' ')}, from {speed}: {one.words}."


def _trade(case: Case, probe: str) -> AdditionalContent:
    from flexcam.plotting.figures import render_png
    from flexcam.plotting.study_curves import work_precision_figure

    against, rungs = evaluate_ladder(case, probe, repeats=1)
    table = report_table(trade_table(against, rungs))
    best = ", ".join(f"{one.rung} at {one.steps} steps" for one in rungs if one.best)
    words = (
        f"Error over work, both logarithmic. No other model beats, in both: {best}. "
        f"The table has the numbers ({TRADE_LEGEND})."
    )
    title = "What a cheaper model costs in error"
    return AdditionalContent(
        tuple(trade_warnings(against, rungs)),
        (table,),
        (Picture(title, render_png(work_precision_figure(rungs)), words),),
    )
