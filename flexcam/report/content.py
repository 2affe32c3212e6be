"""Content of a report as plain values: the results with their cases, and their chapters, tables, charts and scenes."""

from __future__ import annotations

import math
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from rich.table import Table

from flexcam import plotting
from flexcam.analysis.comparison import Comparison
from flexcam.analysis.limits import Search, find_limits
from flexcam.analysis.model_choice import estimate_errors, evaluate_ladder
from flexcam.analysis.natural_modes import modes
from flexcam.analysis.preparation import PreparedRun
from flexcam.analysis.run import member_strength, reload_result, run
from flexcam.analysis.run_metrics import Margins, compute_margins, describe_span
from flexcam.case.builder import build_model
from flexcam.case.case import Case
from flexcam.case.reader import case_from_result
from flexcam.core import FloatArray
from flexcam.core.errors import FlexcamError, InputError
from flexcam.core.units import RPM, shaft_name, shaft_speed
from flexcam.dynamics import Response
from flexcam.dynamics.memory import ExtremesSink
from flexcam.io import Result, read_result
from flexcam.io.exports import energies
from flexcam.report import tables
from flexcam.report.fidelity_tables import error_table, format_with_error, trade_legend, trade_table, trade_warnings
from flexcam.valvetrain import Metric, ModelModes, Structure, build_structure

MODES = 12  # number of modes, as in `flexcam modes`
_SAME_LIFT = 0.01
_SAME_ACCELERATION = 0.1  # relative difference in acceleration up to which the rigid train counts as equivalent
_COUNTED = {
    "members": "member", "masses": "mass", "springs": "spring", "rockers": "rocker", "cams": "cam",
    "contacts": "contact",
}  # fmt: skip
_MODELS = {"beams": "flexible beams", "rigid": "rigid members", "sdof": "one mass", "chain": "a chain of masses"}
_MAX_NUMBER_LENGTH = 24  # maximum length of a cell that counts as a number, characters
_LIMIT_TOLERANCE = 0.01  # width of the bracket of limits relative to the speed


@dataclass(frozen=True, eq=False)
class ReportSubject:
    """Result and the data derived from it."""

    path: Path  # path of the file
    result: Result  # content of the file
    case: Case
    ready: PreparedRun  # prepared run of the case
    response: Response  # response of the result, with fields in the degrees of freedom of the equations
    structure: Structure  # passive part of the model
    rigid: Response | None  # the same run with rigid members; None if there is none
    modes: ModelModes | None  # modes of its structure; None if there are none
    lacking: tuple[str, ...]  # sentences about missing data and the reasons

    @property
    def stem(self) -> str:
        """Name of the file without suffixes."""
        return self.path.name.partition(".")[0]


def load_subject(path: Path) -> ReportSubject:
    """Return a result with all data derived from its case."""
    result, lacking = read_result(path, empty=False), list[str]()

    @contextmanager
    def omit_on_error(what: str) -> Generator[None]:
        try:
            yield
        except FlexcamError as refusal:
            lacking.append(f"Not in this report: {what}; {'; '.join(str(refusal).splitlines())}")

    case, rigid, natural_modes = case_from_result(result), None, None
    ready, response = reload_result(case, result)
    if case.record.fidelity.model != "rigid" and ready.model.cam_contacts:
        with omit_on_error("the comparison with a rigid train"):
            rigid = run(case, rigid=True)
    with omit_on_error("modes"):
        natural_modes = modes(case, MODES)
    structure = build_structure(build_model(case))
    return ReportSubject(path, result, case, ready, response, structure, rigid, natural_modes, tuple(lacking))


def describe_model(about: ReportSubject, figures: Sequence[Metric] = ()) -> list[str]:
    """Return sentences about the model and the parts omitted from the run."""
    case, ready, response, record = about.case, about.ready, about.result.response, about.case.record
    kind = _MODELS.get(record.fidelity.model, record.fidelity.model)
    if record.fidelity.modes is not None:
        kind += f" in {record.fidelity.modes} shapes"
    per = 2.0 * math.pi / (case.speed * ready.problem.step)
    revolutions = f"{float(np.ptp(response.angle)) / (2.0 * math.pi):.4g}" if len(response.angle) else "0"
    covers = f"{revolutions} revolution{'' if revolutions == '1' else 's'}"
    counts = {key: len(getattr(record, key)) for key in _COUNTED}
    parts = [f"{count} {key if count > 1 else _COUNTED[key]}" for key, count in counts.items() if count]
    steps = f"{response.stats.steps} steps ({per:.6g} per revolution) of {tables.describe_dofs(about.response)}"
    sentences = [
        f"Modelled with {kind}: {', '.join(parts)}.",
        f"Run at {case.speed_text} for {covers} of the camshaft, in {steps}.",
        *tables.describe_contacts(case, figures),
    ]
    inactive = tables.describe_inactive(ready)
    return [*sentences, f"Inactive: {'; '.join(inactive)}."] if inactive else sentences


def describe_verdict(compared: Comparison) -> list[str]:
    """Return sentences that compare the flexible result with the rigid one."""
    deviation, ratio = compared.peak_deviation, compared.peak_acceleration_ratio
    same = deviation <= _SAME_LIFT and abs(ratio - 1.0) <= _SAME_ACCELERATION
    bounds = f"{100 * _SAME_LIFT:g} % of the lift, {100 * _SAME_ACCELERATION:g} % of the maximum acceleration"
    verdict = "agrees with" if same else "differs significantly from"
    return [
        f"The flexible result {verdict} the rigid one (criteria: {bounds}).",
        *tables.describe_comparison(compared, None),
    ]


def describe_margins(margins: Margins, turns: float) -> list[str]:
    """Return sentences about the margins of the train at its speed."""
    sentences: list[str] = []
    if margins.rigid_rpm is not None and margins.spring_margin is not None:
        text = f"The rigid train loses contact at {shaft_speed(margins.rigid_rpm * RPM, turns)}"
        ratio = f"{1.0 + margins.spring_margin:.3g} times its inertia force"
        sentences.append(f"{text}; at the speed of the run its spring force is {ratio}.")
    for name, margin in margins.buckling_margins.items():
        sentences.append(f"The buckling load of {name} is {margin:.3g} times its static compression at full lift.")
    if margins.unknown:
        sentences.append(f"The buckling margins are not known: {margins.unknown}.")
    return sentences


@dataclass(frozen=True)
class ReportTable:
    """Table."""

    title: str  # title above the table
    heads: tuple[str, ...]  # column headers; empty if the first column describes the rows
    rows: tuple[tuple[str, ...], ...]  # cells as text
    words: tuple[int, ...] = (0,)  # indices of the columns that contain words; the others contain numbers


@dataclass(frozen=True, eq=False)
class Curve:
    """Curve."""

    name: str  # name in the legend
    group: int  # index of its run, which determines its colour
    rigid: bool  # whether it belongs to the rigid train
    x: FloatArray  # values in the units of the axes, shape (m,)
    y: FloatArray


@dataclass(frozen=True, eq=False)
class Panel:
    """Curves on one axis."""

    label: str  # label of the vertical axis with unit
    curves: tuple[Curve, ...]


@dataclass(frozen=True, eq=False)
class Chart:
    """Panels stacked vertically over the cam angle in degrees."""

    name: str  # name of the content, such as a probe
    words: tuple[str, ...]  # text alternative of the chart
    panels: tuple[Panel, ...]  # panels from top to bottom


@dataclass(frozen=True, eq=False)
class ChartGroup:
    """Group of charts of which the reader selects one."""

    title: str  # title above the group
    what: str  # kind of item selected, such as ``probe``
    charts: tuple[Chart, ...]  # one or more charts


@dataclass(frozen=True, eq=False)
class Shape:
    """Motion of the lines of a scene."""

    name: str  # name, such as ``mode 2, 67.11 Hz``
    words: str  # description of the motion
    # displacements, m, shape (frames, points, 3); a single frame oscillates, several are played in sequence
    frames: FloatArray


@dataclass(frozen=True, eq=False)
class Scene:
    """Members as lines in space and their motion."""

    points: FloatArray  # points, m, shape (points, 3), global axes
    lines: Mapping[str, tuple[int, int]]  # range of points by member
    names: Mapping[str, int]  # index of the point by name
    shapes: tuple[Shape, ...]  # selectable motions


@dataclass(frozen=True)
class Picture:
    """Static image, used for printing too."""

    title: str  # title above the image
    png: bytes  # content of the PNG file
    words: str  # text alternative of the image


@dataclass(frozen=True, eq=False)
class Chapter:
    """Report on one result."""

    name: str  # name that distinguishes it from the other chapters
    title: str  # title of its case, with the speed
    verdict: tuple[str, ...]  # sentences that compare flexible and rigid models; empty without a comparison
    summary: tuple[str, ...]  # sentences about the model and its results
    warnings: tuple[str, ...]  # warnings, and sentences about content omitted from the report
    sheets: tuple[ReportTable, ...]  # tables
    pictures: tuple[Picture, ...]  # images of additionally requested results
    scene: Scene | None  # members and their motions; None if there is nothing to draw
    case: str  # text of the case file
    origin: ReportTable  # origin of the result: files, versions, date


@dataclass(frozen=True, eq=False)
class Report:
    """Report on one or more results."""

    title: str  # title of the page
    chapters: tuple[Chapter, ...]  # one chapter per result
    albums: tuple[ChartGroup, ...]  # charts with the curves of all results
    notes: tuple[str, ...]  # sentences about omitted curves
    still: Picture | None  # image of the most important curves for printing; None without motion


def report_table(table: Table) -> ReportTable:
    """Convert a table for the terminal to a value."""
    heads = tuple(str(column.header) for column in table.columns) if table.show_header else ()
    columns = [[str(cell) for cell in column.cells] for column in table.columns]
    cells = tuple(zip(*columns, strict=True))
    long = [max(map(len, column), default=0) > _MAX_NUMBER_LENGTH for column in columns]
    words = (i for i, column in enumerate(table.columns) if column.justify == "left" or long[i])
    return ReportTable(str(table.title or ""), heads, cells, tuple(words))


def result_tables(about: ReportSubject, compared: Comparison | None, figures: list[Metric]) -> list[ReportTable]:
    """Return the tables of a result."""
    response, turns = about.result.response, about.case.turns
    sheets = [report_table(tables.comparison_table(compared, turns))] if compared is not None else []
    span = describe_span(about.ready, response.stats.steps)
    sheets += [report_table(tables.metrics_table(about.ready.model, figures, span))] if figures else []
    strength = member_strength(about.ready, about.response)
    sheets += [report_table(tables.strength_table(strength))] if strength.members() else []
    probes = report_table(tables.run_table(about.case, ExtremesSink.of(response)))
    sheets.append(replace(probes, title="Range of the probes"))
    if len(response.time):
        parts = {name: values for name, values in energies(response).items() if values.any()}
        rows = [(name, f"{v.min():.4g}", f"{v.max():.4g}", f"{v[-1]:.4g}") for name, v in parts.items()]
        sheets.append(ReportTable("Energy over the run", ("J", "min", "max", "at the end"), tuple(rows)))
    if about.modes is not None:
        sheets.append(report_table(tables.mode_table(about.modes, turns=turns)))
        sheets.append(replace(report_table(tables.model_table(about.ready, about.modes)), title="The model"))
    return sheets


@dataclass(frozen=True)
class ReportOptions:
    """Additional content of a report, which requires runs of the case."""

    errors: bool = False  # whether to estimate errors
    limits: bool = False  # whether to find the speed limits of the train
    trade: bool = False  # whether to evaluate error versus cost of models


def additional_content(
    case: Case, probe: str, asked: ReportOptions
) -> tuple[list[str], list[ReportTable], list[Picture]]:
    """Return the sentences, tables and pictures from additional runs of the case."""
    sentences, sheets, pictures = list[str](), list[ReportTable](), list[Picture]()
    if asked.errors or case.record.fidelity.estimate:
        errors = estimate_errors(case, probe)
        known = "; ".join(f"{error.quantity} {format_with_error(error)}" for error in errors if error.holds)
        unknown = ", ".join(error.quantity for error in errors if not error.holds)
        if known:
            sentences.append(f"Maximum values of {probe} and the contacts with their estimated errors: {known}.")
        if unknown:
            sentences.append(f"No error estimate for {unknown}: the results do not converge with shorter steps.")
        sheets.append(report_table(error_table(errors)))
    if asked.limits:
        _add_limits(sentences, sheets, case)
    if asked.trade:
        against, rungs = evaluate_ladder(case, probe, repeats=1)
        sentences.extend(trade_warnings(against, rungs))
        sheets.append(report_table(trade_table(against, rungs)))
        best = ", ".join(f"{model.rung} at {model.steps} steps" for model in rungs if model.best)
        words = f"Error over work, both logarithmic. Best models in both: {best}. The table has the numbers"
        png = plotting.figures.render_png(plotting.histories.work_precision_figure(rungs))
        pictures.append(Picture("Error and cost of models", png, f"{words} ({trade_legend(against)})."))
    return sentences, sheets, pictures


def _add_limits(sentences: list[str], sheets: list[ReportTable], case: Case) -> None:
    scale = case.turns
    try:
        limits = find_limits(
            case, Search(0.5 * case.speed, 2.0 * case.speed, _LIMIT_TOLERANCE * case.speed, nearby=True)
        )
    except InputError as refusal:  # the rest of the page is still valid
        sentences.extend(f"No speed limits: {fault.why or fault.given}." for fault in refusal.faults)
        return
    text = "No speed limit was found up to twice the speed."
    if limits.first is not None:
        limit = limits.limits[limits.first]
        speed = f"{scale * (limit.rpm or 0.0):.4g} rpm of the {shaft_name(scale)}"
        text = f"The first speed limit is {limits.first.replace('_', ' ')}, from {speed}: {limit.words}."
        text += f" {tables.limits_legend(limits)}."
    sentences.append(text)
    if unknown := [name.replace("_", " ") for name, limit in limits.limits.items() if not limit.known]:
        sentences.append(f"Not known, because runs failed: {', '.join(unknown)}.")
    sheets.append(report_table(tables.limits_table(limits, compute_margins(case), scale)))
