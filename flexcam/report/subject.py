"""What a report is about: a result, the case it keeps, and what that case tells beside the result."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from flexcam.case import Case, build_model, recalled_case
from flexcam.checks import FlexcamError, InputError
from flexcam.integrate import solve
from flexcam.io import Result, read_result
from flexcam.reopened import reopened
from flexcam.response import Response, RunFailedError
from flexcam.runner import Prepared, modes, prepare
from flexcam.train import ModelModes, build_structure
from flexcam.train.structure import Structure

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
