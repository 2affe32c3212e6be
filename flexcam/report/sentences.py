"""Subject of a report: a result with its case, model and modes, and sentences about them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flexcam.analysis.comparison import Comparison
from flexcam.analysis.limits import Margins
from flexcam.analysis.natural_modes import modes
from flexcam.analysis.preparation import PreparedRun, prepare
from flexcam.analysis.run import reload_result
from flexcam.case.builder import build_model
from flexcam.case.case import Case
from flexcam.case.reader import case_from_result
from flexcam.core.errors import FlexcamError, InputError
from flexcam.core.units import RPM, shaft_speed
from flexcam.dynamics import Response, RunFailedError, solve
from flexcam.io import Result, read_result
from flexcam.report.model_tables import describe_comparison, describe_contacts, describe_inactive
from flexcam.report.result_tables import describe_dofs
from flexcam.valvetrain import Metric, ModelModes, Structure, build_structure

MODES = 12
"""Number of modes, as in `flexcam modes`."""


@dataclass(frozen=True, eq=False)
class RestoredCase:
    """Case of a result and the objects built from it.

    Parameters
    ----------
    case
        Case.
    ready
        Prepared run of the case.
    response
        Response of the result, with fields in the degrees of freedom of the equations.
    structure
        Passive part of the model.
    """

    case: Case
    ready: PreparedRun
    response: Response
    structure: Structure


@dataclass(frozen=True, eq=False)
class ReportSubject:
    """Result and the data derived from it.

    Parameters
    ----------
    path
        Path of the file.
    result
        Content of the file.
    known
        Objects built from its case; None if the case cannot be restored.
    rigid
        The same run with rigid members; None if there is none.
    modes
        Modes of its structure; None if there are none.
    lacking
        Sentences about missing data and the reasons.
    """

    path: Path
    result: Result
    known: RestoredCase | None
    rigid: Response | None
    modes: ModelModes | None
    lacking: tuple[str, ...]

    @property
    def stem(self) -> str:
        """Name of the file without suffixes."""
        return self.path.name.partition(".")[0]


def load_subject(path: Path) -> ReportSubject:
    """Return a result with all data derived from its case."""
    result = read_result(path)
    try:
        case = case_from_result(result)
        known = RestoredCase(case, *reload_result(case, result), build_structure(build_model(case)))
    except FlexcamError as refusal:
        what = "the comparison with a rigid train, modes, stresses with their safety, and what was left out of the run"
        return ReportSubject(
            path, result, None, None, None, (f"Not in this report: {what}; {_describe_error(refusal)}",)
        )
    lacking: list[str] = []
    rigid = found = None
    if case.record.fidelity.model != "rigid" and known.ready.model.cam_contacts:
        try:
            ready = prepare(case, rigid=True)
            rigid = solve(ready.problem, ready.scheme, save=ready.save)
        except FlexcamError as refusal:
            lacking.append(f"Not in this report: the comparison with a rigid train; {_describe_error(refusal)}")
    try:
        found = modes(case, MODES)
    except FlexcamError as refusal:
        lacking.append(f"Not in this report: modes; {_describe_error(refusal)}")
    return ReportSubject(path, result, known, rigid, found, tuple(lacking))


def _describe_error(refusal: FlexcamError) -> str:
    match refusal:
        case InputError():
            return "; ".join(map(str, refusal.faults))
        case RunFailedError():
            return refusal.status.text
        case _:
            return str(refusal)


_SAME_LIFT = 0.01
_SAME_ACCELERATION = 0.1
"""Relative difference in acceleration up to which the rigid train counts as equivalent."""

_MODELS = {
    "beams": "flexible beams", "rigid": "rigid members", "sdof": "one mass", "chain": "a chain of masses",
}  # fmt: skip


def describe_model(about: ReportSubject, known: RestoredCase, figures: Sequence[Metric] = ()) -> list[str]:
    """Return sentences about the model and the parts omitted from the run."""
    case, ready, response = known.case, known.ready, about.result.response
    record = case.record
    kind = _MODELS.get(record.fidelity.model, record.fidelity.model)
    if record.fidelity.modes is not None:
        kind += f" in {record.fidelity.modes} shapes"
    per = 2.0 * math.pi / (case.speed * ready.problem.step)
    turned = f"{float(np.ptp(response.angle)) / (2.0 * math.pi):.4g}" if len(response.angle) else "0"
    covers = f"{turned} revolution{'' if turned == '1' else 's'}"
    parts = ", ".join(
        _count(len(table), word)
        for word, table in (("member", record.members), ("mass", record.masses), ("spring", record.springs),
                            ("rocker", record.rockers), ("cam", record.cams), ("contact", record.contacts))
        if table
    )  # fmt: skip
    said = [
        f"Modelled with {kind}: {parts}.",
        (
            f"Run at {case.speed_text} for {covers} of the camshaft, in {response.stats.steps} steps "
            f"({per:.6g} per revolution) of {describe_dofs(known.response)}."
        ),
    ]
    said += describe_contacts(case, figures)
    left = describe_inactive(ready)
    return [*said, f"Left out of the run, as nothing moves it: {'; '.join(left)}."] if left else said


def _count(number: int, word: str) -> str:
    if number == 1:
        return f"1 {word}"
    return f"{number} {word}es" if word.endswith("s") else f"{number} {word}s"


def describe_verdict(compared: Comparison) -> list[str]:
    """Return sentences that compare the flexible result with the rigid one."""
    off, ratio = compared.peak_deviation, compared.peak_acceleration_ratio
    same = off <= _SAME_LIFT and abs(ratio - 1.0) <= _SAME_ACCELERATION
    bounds = f"{100 * _SAME_LIFT:g} % of the lift, {100 * _SAME_ACCELERATION:g} % of the largest acceleration"
    said = "A rigid train would tell nearly the same" if same else "A rigid train would not tell the same"
    return [f"{said} (held against {bounds}).", *describe_comparison(compared, None)]


def describe_margins(margins: Margins, turns: float) -> list[str]:
    """Return sentences about the margins of the train at its speed."""
    said: list[str] = []
    if margins.rigid_rpm is not None and margins.spring_margin is not None:
        said.append(
            f"A rigid train would leave its cam at {shaft_speed(margins.rigid_rpm * RPM, turns)}; at this speed its "
            f"springs push {1.0 + margins.spring_margin:.3g} times what its inertia asks for."
        )
    said += [
        f"The buckling load of {name} is {margin:.3g} times its compression at full lift, at rest."
        for name, margin in margins.buckling_margins.items()
    ]
    return said
