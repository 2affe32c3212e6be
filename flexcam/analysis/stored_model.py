"""Reload a result file: prepare its case again and map its fields to the degrees of freedom of the equations.

May import `analysis` and everything below it. Nothing is solved.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flexcam.analysis.preparation import PreparedRun, prepare
from flexcam.case.case import Case
from flexcam.case.schema.run import ResultStartRecord
from flexcam.core import FloatArray, IntArray
from flexcam.core.errors import InputError, refuse
from flexcam.dynamics import Block, Response, Series, outline
from flexcam.io import Result
from flexcam.valvetrain import MemberStrength, StrengthSink, build_structure


def reload_result(case: Case, result: Result) -> tuple[PreparedRun, Response]:
    """Return the prepared case of a result and its response as originally computed."""
    start = case.record.run.start
    standing = (
        case.with_run({"start": "equilibrium"}) if start == "periodic" or isinstance(start, ResultStartRecord) else case
    )
    ready = replace(prepare(standing), case=case)
    names = outline(ready.problem.system)
    response = result.response
    free = build_structure(ready.model).dofs.numbers >= 0
    if response.fields.displacement.shape[1] != free.size:
        raise refuse("result", "another number of nodes", "a result of its case")
    beside = names.unknowns[int(free.sum()) :]
    at = np.searchsorted(response.time, response.field_time - 1e-12 * np.abs(response.field_time))
    series = [
        np.concatenate([values.reshape(-1, *free.shape)[:, free], *_internal_dofs(response, beside, kind, at)], axis=1)
        for kind, values in vars(response.fields).items()
    ]
    return ready, replace(response, outline=names, fields=Series(*series))


def _internal_dofs(response: Response, names: tuple[str, ...], kind: str, at: IntArray) -> list[FloatArray]:
    """Return internal degrees of freedom, stored at every step, at selected steps."""
    try:
        return [np.asarray(getattr(response[name], kind))[at, None] for name in names]
    except InputError as refusal:
        if response.stats.unknowns == 0:  # internal nodes of a spring do not move in the rigid model and are not stored
            return [np.zeros((len(at), len(names)))]
        why = f"it does not hold {refusal.faults[0].given}"
        raise refuse("result", "a result without an unknown of its case", "a result of its case", why) from None


def member_strength(ready: PreparedRun, response: Response) -> dict[str, MemberStrength]:
    """Return the stresses of the members over a run, from its saved fields."""
    if ready.case.record.fidelity.model != "beams":
        return {}
    sink = StrengthSink(build_structure(ready.model))
    channels = np.zeros((len(response.time), 0))
    sink.write(
        Block(response.time, response.angle, response.probes, channels,
              response.field_time, response.field_angle, response.fields)
    )  # fmt: skip
    return sink.members()
