"""Command that compares two models, cases or results: compare."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from flexcam.analysis.comparison import compare_responses
from flexcam.analysis.model_ladder import model_ladder
from flexcam.analysis.preparation import prepare, scalar_probe
from flexcam.analysis.published_claims import check_claims as fidelity_claims
from flexcam.analysis.published_claims import deviation, excited_mode
from flexcam.analysis.run import run as solve_case
from flexcam.case.case import Case
from flexcam.cli.app import Json, Overrides, app, load_beams, load_case
from flexcam.core.errors import refuse, suggest_name
from flexcam.core.units import RPM
from flexcam.dynamics import Response, Status, reraise_interrupt
from flexcam.io import read_result
from flexcam.report.model_tables import (
    claim_table,
    comparison_json,
    comparison_table,
    describe_comparison,
    describe_contacts,
)
from flexcam.report.terminal import print_json, result_console


@app.command(
    help_prologue="""\
flexcam compare case.toml
flexcam compare case.toml --probe valve --set run.speed=4000rpm
"""
)
def compare(
    case: Annotated[Path, Parameter(help="Case file (TOML), or a result with --against another.")], *,
    probe: str | None = None,
    against: Annotated[
        str | None, Parameter(help="Model of the ladder, other case, or result; rigid if absent.")
    ] = None,
    overrides: Overrides = None, as_json: Json = False,
) -> Status:  # fmt: skip
    """Compare the flexible mechanism with the rigid one at a probe, or any two models, cases or results.

    Parameters
    ----------
    probe
        Point or component to compare at; by default a rocker's point, else the first probe that a cam moves.
    """
    if against is not None:
        return _compare_pair(case, against, probe, overrides, as_json)
    read = load_beams(case, overrides)
    at = probe or scalar_probe(prepare(read))
    found = deviation(read, at)
    published = any(contact.model == "published-load" for contact in read.record.contacts.values())
    mode_hz = excited_mode(read)[0] if published else None
    claims = fidelity_claims(read, at, found) if read.record.paper and found.status.ok else []
    if as_json:
        print_json({
            **comparison_json(found), "loaded_mode_hz": mode_hz,
            "claims": [asdict(claim) for claim in claims],
        })  # fmt: skip
        return found.status
    result_console().print(comparison_table(found, read.turns))
    words = describe_comparison(found, mode_hz)
    for sentence in words + describe_contacts(read):
        result_console().print("\n" + sentence)
    if claims:
        result_console().print()
        result_console().print(claim_table(claims))
    return found.status


def _compare_pair(case: Path, against: str, probe: str | None, overrides: Overrides, as_json: bool) -> Status:
    """Compare two models of a case, two cases or two results."""
    if case.suffix == _RESULT:
        from flexcam.cli.arguments import Source

        if overrides and Path(against).suffix == _RESULT:
            why = "both have been computed"
            raise refuse("--set", overrides[0], "a case among what is compared", why, "give the case, or leave it out")
        one, read = read_result(case).response, None
        at = probe or scalar_probe(Source(case).ready)
    else:
        read = load_case(case, overrides)
        one, at = _require_complete(solve_case(read)), probe or scalar_probe(prepare(read))
    other = _second_response(against, read, overrides)
    found = compare_responses(one, other, at, _speed_rpm(one), (case.stem, Path(against).stem))
    if as_json:
        print_json({**comparison_json(found), "compared": list(found.names)})
        return found.status
    result_console().print(comparison_table(found))
    for sentence in describe_comparison(found, None):
        result_console().print("\n" + sentence)
    return found.status


def _second_response(against: str, read: Case | None, overrides: Overrides) -> Response:
    """Return the response compared with: of a result, another case, or a model of the case's ladder."""
    path = Path(against)
    if path.suffix == _RESULT:
        return read_result(path).response
    if path.suffix == ".toml":
        return _require_complete(solve_case(load_case(path, overrides)))
    rungs = {} if read is None else {rung.name: rung for rung in model_ladder(read)}
    if against not in rungs:
        allowed = f"a case, a result, or one of {', '.join(rungs)}" if rungs else "a case or a result"
        raise refuse("--against", repr(against), allowed, "", suggest_name(against, list(rungs)))
    return _require_complete(rungs[against].run())


def _require_complete(response: Response) -> Response:
    """Return a complete run for a comparison; Ctrl-C during the run ends the command."""
    reraise_interrupt(response.status)
    return response


def _speed_rpm(response: Response) -> float:
    """Return the mean camshaft speed of a run, rpm."""
    turned, passed = (float(one[-1] - one[0]) for one in (response.angle, response.time))
    return turned / passed / RPM if passed > 0.0 else 0.0


_RESULT = ".vtkhdf"
