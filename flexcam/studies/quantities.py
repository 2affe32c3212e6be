"""Quantities of a case by name: numbers, natural frequencies, properties of cams, speed limits and scalars of a run."""

from __future__ import annotations

import math
import re
from collections.abc import Generator, Iterable, Mapping, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from flexcam.analysis.limits import (
    LIMITS,
    ConditionResults,
    Search,
    SpeedRuns,
    applicable_limits,
    evaluate_speed,
    find_limits,
)
from flexcam.analysis.preparation import build_problem, prepare
from flexcam.cams import Event, event_extremes, harmonics, joints
from flexcam.case.builder import build_model
from flexcam.case.case import Case
from flexcam.case.problem_builder import steps_per_revolution
from flexcam.case.reader import CaseFile
from flexcam.case.schema.contacts import BilateralRecord, UnilateralRecord
from flexcam.case.variants import Number, get_number
from flexcam.core import FloatArray
from flexcam.core.errors import Fault, InputError, refuse, suggest_name
from flexcam.core.units import RPM, shaft_name
from flexcam.dynamics import Cause, ProgressCallback, RunFailedError, Status, floquet, outline, solve
from flexcam.io.sweep_table import unknown_scalar_fault
from flexcam.studies.evaluation import are_probe_scalars, evaluate, get_history, history_units, scalar_names
from flexcam.studies.executors import KILLED_STATUS, BrokenProcessPool, open_evaluators, open_processes
from flexcam.studies.plan import Axis, Plan, Row, Value, make_plan
from flexcam.studies.variables import Runs, column
from flexcam.valvetrain import Metric, build_structure, model_modes, modes_on_the_lift

_FREQUENCY = re.compile(r"frequency\.([1-9]\d{0,2})$")
_CLOSED = re.compile(r"contacts\.(.+)\.(base_circle|full_lift)\.frequency\.[1-9]\d{0,2}$")
_CAM = re.compile(r"cams\.(.+)\.(area|velocity|acceleration|deceleration|jerk)$")
_MULTIPLIER = re.compile(r"multiplier\.([1-9]\d{0,2})$")
_LIMIT, _STATIC = re.compile(r"limits\.(.*)"), re.compile(r"static\.(.*)")
_Matches = Mapping[str, re.Match[str]]  # names of one kind of quantity
_KINDS = (
    "frequency.N, contacts.NAME.full_lift.frequency.N (base_circle; contacts closed) or multiplier.N (Floquet) with N "
    "from 1; limits.NAME; cams.NAME.area; static.CHANNEL; CHANNEL.rms; "
    "CHANNEL.pnorm_8 (smooth maximum); or a numeric key of the case"
)
"""Kinds of results in addition to the scalars of a run, for messages."""
_CAM_PROPERTIES = {  # unit, and order of the derivative by the cam angle
    "area": ("m rad", 0), "velocity": ("m/rad", 1), "acceleration": ("m/rad^2", 2), "deceleration": ("m/rad^2", 2),
    "jerk": ("m/rad^3", 3),
}  # fmt: skip
_PERIODIC = 1e-6  # relative residual above which a motion is not periodic


def frequency_number(name: str) -> int | None:
    """Return the number of a natural frequency from its name, from 1; None for other names."""
    match = _FREQUENCY.match(name)
    return int(match[1]) if match else None


def is_frequency(case: Case, name: str) -> bool:
    """Return whether a name is that of a natural frequency of a case, with open or closed contacts."""
    return bool((_FREQUENCY.match(name) or _CLOSED.match(name)) and _is_known_name(case, name))


def quantity_row(case: Case, names: Sequence[str], search: Search | None = None, runs: int = 1) -> Row:
    """Return the row with the requested quantities of a case; raise an error if a run fails."""
    metrics = compute_quantities(case, names, search, runs)
    values = {name: metrics[name].value for name in names if name in metrics}
    return Row(Status(), values, {name: metrics[name].unit for name in values})


def compute_quantities(
    case: Case, names: Sequence[str], search: Search | None = None, runs: int = 1
) -> dict[str, Metric]:
    """Return the requested quantities of a case; raise an error if a run fails."""
    metrics = dict[str, Metric]()
    for pattern, compute in (
        (_FREQUENCY, _frequencies), (_LIMIT, partial(_limits, search=search, runs=runs)), (_CAM, _cams),
        (_STATIC, _statics), (_MULTIPLIER, _multipliers), (_CLOSED, _closed_frequencies),
    ):  # fmt: skip
        if matches := {name: match for name in names if (match := pattern.match(name))}:
            metrics |= compute(case, matches)
    numbers = [(name, _number(case, name)) for name in names if name not in metrics]
    metrics |= {name: Metric(name, number.value, number.unit) for name, number in numbers if number}
    of_a_run = [name for name in names if name not in metrics and not _LIMIT.match(name)]
    if not of_a_run:
        return metrics
    row = require_complete(evaluate(case, runs=runs, channels=not are_probe_scalars(of_a_run), names=of_a_run))
    if lacking := [name for name in of_a_run if name not in row.scalars]:
        raise InputError(_unknown_name_fault(name, row.scalars, case.record.cams) for name in lacking)
    return metrics | {name: Metric(name, row.scalars[name], row.units[name]) for name in of_a_run}


def check_names(case: Case, names: Sequence[str], where: str = "scalar") -> None:
    """Raise an error for names that a case cannot have, before a run."""
    others = [name for name in names if not _is_known_name(case, name)]
    limits = {name: match[1] for name in others if (match := _LIMIT.match(name))}
    runs = [name for name in others if name not in limits]
    known = scalar_names(case, runs) if runs else []
    faults = [_unknown_name_fault(name, known, case.record.cams) for name in runs if name not in known]
    applicable = [f"limits.{limit}" for limit in applicable_limits(case)] if limits else []
    for name, limit in limits.items():
        if name not in applicable:
            why = "the case lacks the part" if limit in LIMITS else "there is no such limit"
            faults.append(Fault("scalar", repr(name), ", ".join(applicable), why, suggest_name(name, applicable)))
    if faults:
        raise InputError(replace(fault, where=where) for fault in faults)


def _is_known_name(case: Case, name: str) -> bool:
    """Return whether a name is that of a frequency, multiplier, cam property, static result or number of the case."""
    if static := _STATIC.match(name):
        return static[1] in history_units(outline(build_problem(case)[1]))
    if closed := _CLOSED.match(name):
        return isinstance(case.record.contacts.get(closed[1]), BilateralRecord | UnilateralRecord)
    cam = _CAM.match(name)
    of_a_cam = cam and cam[1] in case.record.cams
    return bool(frequency_number(name) or _MULTIPLIER.match(name) or of_a_cam or _number(case, name))


def is_run_scalar(case: Case, name: str) -> bool:
    """Return whether a quantity is a scalar of a run, and no speed limit."""
    return not (_LIMIT.match(name) or _is_known_name(case, name))


def _unknown_name_fault(name: str, known: Iterable[str], cams: Iterable[str]) -> Fault:
    of_cams = [f"cams.{cam}.{kind}" for cam in cams for kind in _CAM_PROPERTIES]
    near = suggest_name(name, [*known, "frequency.1", *(f"limits.{limit}" for limit in LIMITS), *of_cams])
    if near:
        return Fault("scalar", repr(name), "", f"there is no result {name!r}", near)
    return replace(unknown_scalar_fault(name, known, others=_KINDS), where="scalar", remedy="")


def require_complete(row: Row) -> Row:
    """Return a row if it is complete, otherwise raise an error."""
    if row.status.cause is Cause.REFUSED:
        raise refuse("case", "a case whose run failed", "a case that can be run", row.status.text)
    if not row.status.ok:
        raise RunFailedError(row.status)
    return row


def _frequencies(case: Case, matches: _Matches) -> dict[str, Metric]:
    modes = model_modes(build_structure(build_model(case))).modes
    return _select(matches, modes.frequencies[modes.rigid :], "Hz", "the model has no more modes")


def _closed_frequencies(case: Case, matches: _Matches) -> dict[str, Metric]:
    """Return natural frequencies with the contacts closed as at the base circle or at full lift of a cam."""
    model, metrics = build_model(case), dict[str, Metric]()
    for contact, place in sorted({(match[1], match[2]) for match in matches.values()}):
        modes = modes_on_the_lift(model, contact, case.speed, base_circle=place == "base_circle").model_modes.modes
        names = [name for name, match in matches.items() if match.groups() == (contact, place)]
        metrics |= _select(names, modes.frequencies[modes.rigid :], "Hz", "the model has no more modes")
    return metrics


def _select(matches: Iterable[str], values: FloatArray, unit: str, why: str) -> dict[str, Metric]:
    """Return the values of names such as ``frequency.2``, which end in numbers from 1."""
    for name in matches:
        if int(name.rpartition(".")[2]) > len(values):
            kind = name.rpartition(".")[0]
            raise refuse("scalar", name, f"{kind}.1 to {kind}.{len(values)}", why)
    return {name: Metric(name, float(values[int(name.rpartition(".")[2]) - 1]), unit) for name in matches}


def _statics(case: Case, matches: _Matches) -> dict[str, Metric]:
    """Return channels and motions of probes in the equilibrium at the cam angle of the start."""
    ready = prepare(case.with_run({"start": "equilibrium"}))
    response = solve(replace(ready.problem, steps=1), ready.scheme, save=ready.save)
    if not response.status.ok:
        raise RunFailedError(response.status)
    units = history_units(response.outline)
    return {n: Metric(n, float(get_history(response, match[1])[0]), units[match[1]]) for n, match in matches.items()}


def _multipliers(case: Case, matches: _Matches) -> dict[str, Metric]:
    """Return magnitudes of Floquet multipliers of the periodic motion."""
    ready = prepare(case.with_newmark().with_run({"start": "periodic"}))
    start, steps = ready.problem.start, steps_per_revolution(case, ready.problem)
    if start is not None and (residual := start.periodicity or 0.0) > _PERIODIC:
        change = f"differs from that at its start by {100.0 * residual:.2g} % of the amplitude"
        text = f"no periodic motion was found: the state after one revolution {change}"
        remedy = "add damping, or use another speed: contacts that open, also on the base circle, may prevent it"
        raise RunFailedError(Status(Cause.NO_CONVERGENCE, text, remedy))
    magnitudes = np.abs(floquet(replace(ready.problem, steps=steps)).multipliers)
    return _select(matches, magnitudes, "1", "the model has no more")


def _limits(case: Case, matches: _Matches, search: Search | None, runs: int) -> dict[str, Metric]:
    names = [match[1] for match in matches.values()]
    scale, unit = case.turns, f"{shaft_name(case.turns)} rpm"
    where = search or Search(0.5 * case.speed, 2.0 * case.speed, 10.0 * RPM / scale)
    limits = find_limits(case, where, names, runs=runs).limits
    if lacking := [name for name in names if name not in limits]:
        allowed = ", ".join(f"limits.{name}" for name in limits)
        raise refuse("scalar", f"limits.{lacking[0]}", allowed, "the case lacks the part")
    if broken := [limit for limit in limits.values() if not limit.known]:
        raise RunFailedError(Status(Cause.NO_CONVERGENCE, broken[0].words))
    speeds = {f"limits.{name}": scale * limit.rpm for name, limit in limits.items() if limit.rpm is not None}
    return {name: Metric(name, rpm, unit) for name, rpm in speeds.items()}


def _cams(case: Case, matches: _Matches) -> dict[str, Metric]:
    cams, metrics = build_model(case).cams, dict[str, Metric]()
    for name, (cam, kind) in ((name, match.groups()) for name, match in matches.items() if match[1] in cams):
        metrics[name] = Metric(name, _lift_property(cams[cam].event, kind), _CAM_PROPERTIES[kind][0])
    return metrics


def _lift_property(event: Event, kind: str) -> float:
    """Return a property of a lift, as derivatives by the cam angle."""
    if kind == "area":
        return 2.0 * math.pi * float(harmonics(event, 1)[0].real)
    if kind == "jerk" and any(joint.steps[2] for joint in joints(event)):
        allowed = "a lift whose acceleration does not step"
        raise refuse("scalar", "the jerk of a lift", allowed, "it is infinite at a step")
    low, high = event_extremes(event, _CAM_PROPERTIES[kind][1])
    if kind == "deceleration":
        return -low.value
    return high.value if kind == "acceleration" else max(abs(low.value), abs(high.value))


def _number(case: Case, name: str) -> Number | None:
    try:
        return get_number(case, name, "scalar")
    except InputError:
        return None


@contextmanager
def create_evaluator(
    file: CaseFile, fixed: Sequence[str], names: Sequence[str], search: Search | None = None,
    *, plan: Plan | None = None, workers: int = 1, runs: int = 1, advance: ProgressCallback | None = None,
) -> Generator[Runs]:  # fmt: skip
    """Yield a function that evaluates variants of the file as it is now."""
    row = partial(quantity_row, names=tuple(names), search=search, runs=runs)
    with open_evaluators(file, fixed, row, plan=plan, workers=workers, advance=advance) as (evaluate_variants,):
        yield evaluate_variants


@dataclass(frozen=True, eq=False)
class LimitMap:
    """Speed limits over one number or two."""

    axes: tuple[Axis, ...]  #: axis of the rows, and that of the columns if there are two
    #: speed by limit, such as ``loss_of_contact``, shape (rows,) or (rows, columns), of the crankshaft if the case
    #: gives ``crank_speed``, else of the camshaft; NaN if the limit is not met in the search range, or a run failed
    rpm: Mapping[str, FloatArray]
    statuses: tuple[Status, ...]  #: status of every variant, row by row


def grid_plan(axes: Sequence[Axis], fixed: Sequence[str] = ()) -> Plan:
    """Return the grid plan of one axis or two."""
    for axis in axes:
        if not axis.is_varied or not axis.is_numeric:
            given = "one value" if len(axis.values) == 1 else f"{len(axis.values)} values"
            raise refuse(axis.where, given, "several numbers", "the map needs a grid of values")
    if len({axis.key for axis in axes}) < len(axes):
        raise refuse("--and", axes[0].key, "another key than that of --over", "the map needs two different values")
    pairs = [setting.partition("=") for setting in fixed]
    fixed_axes = [Axis(key.strip(), f"--set {key}={text}", (Value(text.strip(), None),)) for key, _, text in pairs]
    return make_plan([*fixed_axes, *axes])


def limit_map(plan: Plan, names: Sequence[str], runs: Runs) -> LimitMap:
    """Return the map of limits over a grid."""
    rows = list(runs(plan.variants))
    if all(row.status.cause is Cause.REFUSED for row in rows):
        require_complete(rows[0])
    rpm = {name: column(rows, f"limits.{name}").reshape(plan.shape) for name in names}
    return LimitMap(plan.varied_axes, rpm, tuple(row.status for row in rows))


@contextmanager
def open_speed_runs(case: Case, search: Search, workers: int) -> Generator[SpeedRuns | None]:
    """Yield a function that begins runs of a case at several speeds of a search for limits; None for one worker."""
    if workers < 2:
        yield None
        return
    with open_processes(workers) as submit:

        def wait(future: Future[ConditionResults]) -> ConditionResults:
            try:
                return future.result()
            except BrokenProcessPool:
                raise RunFailedError(KILLED_STATUS) from None

        yield lambda speeds: [partial(wait, submit(evaluate_speed, case, search, speed)) for speed in speeds]
