"""What a report is about: a result, the case it keeps, and what that case tells beside the result."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flexcam.analysis.comparison import Comparison
from flexcam.analysis.limits import Margins
from flexcam.analysis.natural_modes import modes
from flexcam.analysis.preparation import Prepared, prepare
from flexcam.analysis.stored_model import reopened
from flexcam.case.builder import build_model
from flexcam.case.case import Case
from flexcam.case.reader import recalled_case
from flexcam.core.errors import FlexcamError, InputError
from flexcam.core.units import RPM, shaft_speed
from flexcam.dynamics import Response, RunFailedError, solve
from flexcam.io import Result, read_result
from flexcam.report.model_tables import comparison_words, couplings, left_out
from flexcam.report.result_tables import unknowns
from flexcam.valvetrain import Metric, ModelModes, Structure, build_structure

MODES = 12
"""Lowest ones, as `flexcam modes` shows."""


@dataclass(frozen=True, eq=False)
class Known:
    """What the case of a result tells.

    Parameters
    ----------
    case
        The case.
    ready
        It, ready for a run.
    response
        Of the result, its fields in the unknowns of the equations.
    structure
        The passive part of the model.
    """

    case: Case
    ready: Prepared
    response: Response
    structure: Structure


@dataclass(frozen=True, eq=False)
class Subject:
    """A result and what is known of it.

    Parameters
    ----------
    path
        Its file.
    result
        What the file holds.
    known
        What its case tells; None where it cannot be made again.
    rigid
        The same run with rigid members; None where there is none.
    modes
        Of its structure; None where there are none.
    lacking
        Sentences: what is not known, and why.
    """

    path: Path
    result: Result
    known: Known | None
    rigid: Response | None
    modes: ModelModes | None
    lacking: tuple[str, ...]

    @property
    def stem(self) -> str:
        """Name of the file without its endings."""
        return self.path.name.partition(".")[0]


def subject(path: Path) -> Subject:
    """Return a result with everything its case tells."""
    result = read_result(path)
    try:
        case = recalled_case(result)
        known = Known(case, *reopened(case, result), build_structure(build_model(case)))
    except FlexcamError as refusal:
        what = "the comparison with a rigid train, modes, stresses with their safety, and what was left out of the run"
        return Subject(path, result, None, None, None, (f"Not in this report: {what}; {_why(refusal)}",))
    lacking: list[str] = []
    rigid = found = None
    if case.record.fidelity.model != "rigid" and known.ready.model.driven:
        try:
            ready = prepare(case, rigid=True)
            rigid = solve(ready.problem, ready.scheme, save=ready.save)
        except FlexcamError as refusal:
            lacking.append(f"Not in this report: the comparison with a rigid train; {_why(refusal)}")
    try:
        found = modes(case, MODES)
    except FlexcamError as refusal:
        lacking.append(f"Not in this report: modes; {_why(refusal)}")
    return Subject(path, result, known, rigid, found, tuple(lacking))


def _why(refusal: FlexcamError) -> str:
    match refusal:
        case InputError():
            return "; ".join(map(str, refusal.faults))
        case RunFailedError():
            return refusal.status.text
        case _:
            return str(refusal)


_SAME_LIFT = 0.01
_SAME_ACCELERATION = 0.1
"""Parts by which a flexible train may differ for a rigid one to tell the same."""

_MODELS = {
    "beams": "flexible beams", "rigid": "rigid members", "sdof": "one mass", "chain": "a chain of masses",
}  # fmt: skip


def modelled(about: Subject, known: Known, figures: Sequence[Metric] = ()) -> list[str]:
    """Return what was modelled, and what was left out of the run."""
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
            f"Run at {case.told_speed} for {covers} of the camshaft, in {response.stats.steps} steps "
            f"({per:.6g} per revolution) of {unknowns(known.response)}."
        ),
    ]
    said += couplings(case, figures)
    left = left_out(ready)
    return [*said, f"Left out of the run, as nothing moves it: {'; '.join(left)}."] if left else said


def _count(number: int, word: str) -> str:
    if number == 1:
        return f"1 {word}"
    return f"{number} {word}es" if word.endswith("s") else f"{number} {word}s"


def verdict(compared: Comparison) -> list[str]:
    """Return whether a rigid train would have told the same."""
    off, ratio = compared.peak_deviation, compared.peak_acceleration_ratio
    same = off <= _SAME_LIFT and abs(ratio - 1.0) <= _SAME_ACCELERATION
    bounds = f"{100 * _SAME_LIFT:g} % of the lift, {100 * _SAME_ACCELERATION:g} % of the largest acceleration"
    said = "A rigid train would tell nearly the same" if same else "A rigid train would not tell the same"
    return [f"{said} (held against {bounds}).", *comparison_words(compared, None)]


def left_in_hand(margins: Margins, turns: float) -> list[str]:
    """Return what the train has in hand at its speed."""
    said: list[str] = []
    if margins.rigid_rpm is not None and margins.spring is not None:
        said.append(
            f"A rigid train would leave its cam at {shaft_speed(margins.rigid_rpm * RPM, turns)}; at this speed its "
            f"springs push {1.0 + margins.spring:.3g} times what its inertia asks for."
        )
    said += [
        f"The buckling load of {name} is {margin:.3g} times its compression at full lift, at rest."
        for name, margin in margins.buckling.items()
    ]
    return said
