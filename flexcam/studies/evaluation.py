"""Evaluate variants: scalars of a run, each with a stable name, in SI.

``probes.POINT.SERIES.largest`` (of a component: ``probes.POINT.COMPONENT.SERIES.largest``) is the maximum absolute
displacement, velocity or acceleration in the last revolution, of the dense output. ``deviation.peak`` and
``deviation.rms`` are the deviations of the whole run from the rigid train at the default probe, relative to the lift.
``energy.residual.largest`` is the residual of the energy balance. ``periodicity`` is the difference of the default
probe between the last two revolutions, relative to its range. ``HISTORY.rms`` and ``HISTORY.pnorm_8`` are p-norms of a
channel or of the motion of a probe, computed only on request. All others are metrics of
`flexcam.valvetrain.train_metrics`.
"""

from __future__ import annotations

import re
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from flexcam.analysis.comparison import compare
from flexcam.analysis.model_choice import select_case
from flexcam.analysis.preparation import PreparedRun, build_problem, prepare, scalar_probe
from flexcam.analysis.run import open_result_file
from flexcam.analysis.run_checks import RunMonitor, check_lobes, check_motion, check_transient
from flexcam.analysis.run_metrics import compute_metrics, revolution_change
from flexcam.case.builder import build_model
from flexcam.case.case import Case
from flexcam.core import FloatArray
from flexcam.core.errors import InputError
from flexcam.core.units import RPM
from flexcam.dynamics import (
    SERIES,
    SLOPES,
    Cause,
    Outline,
    Response,
    SaveAt,
    Sink,
    Status,
    component_unit,
    outline,
    peak,
    prescribed_probes,
    scalar_probes,
    solve,
)
from flexcam.io import temporary_folder
from flexcam.studies.plan import Bundle, Row, catch_all_errors, evaluate_each
from flexcam.valvetrain import Adjuster, Metric, Model, rigid_motion, train_metric_names

_NORM = re.compile(r"(.+)\.(?:rms|pnorm_([2-9]|[1-9]\d))$")
_DEVIATIONS = ("deviation.peak", "deviation.rms")
_RESIDUAL, _PERIODICITY = "energy.residual.largest", "periodicity"


def compute_scalars(ready: PreparedRun, response: Response, names: Sequence[str] | None = None) -> list[Metric]:
    """Return the scalars of a run: all without a parameter, or those of the kinds of given names."""
    kinds = None if names is None else {name.partition(".")[0] for name in names}
    figures = [
        *(compute_metrics(ready, response, names) if response.outline.channels else ()),
        *(_probe_scalars(response, ready.revolution) if kinds is None or "probes" in kinds else ()),
        *(_deviation_scalars(ready, response) if kinds is None or "deviation" in kinds else ()),
    ]
    if (residual := response.channels.get("energy.residual")) is not None:
        figures.append(Metric(_RESIDUAL, float(np.abs(residual).max(initial=0.0)), "J"))
    if (kinds is None or _PERIODICITY in kinds) and (change := revolution_change(ready, response)) is not None:
        figures.append(Metric(_PERIODICITY, change.motion, "1"))
    figures += _norms(ready, response, names or ())
    return [figure for figure in figures if np.isfinite(figure.value)]


def are_probe_scalars(names: Sequence[str]) -> bool:
    """Return whether all scalars concern the motion of probes, so that no other results are required."""
    return bool(names) and all(name.partition(".")[0] in ("probes", "deviation", _PERIODICITY) for name in names)


def scalar_names(case: Case, asked: Sequence[str] = ()) -> list[str]:
    """Return the names of all scalars of a case, and of the p-norms among the requested ones, without a run."""
    model, system = build_problem(case)
    output = outline(system)
    names = train_metric_names(model, [name for name, _ in output.channels])
    names += [f"probes.{probe}.{series}.largest" for probe in scalar_probes(output) for series in SERIES]
    histories = history_units(output)
    names += [name for name in asked if (norm := _NORM.match(name)) and norm[1] in histories]
    compared = case.record.fidelity.model != "rigid" and bool(case.record.output.probes) and bool(model.cam_contacts)
    repeated = (_PERIODICITY,) if case.record.run.revolutions >= 2.0 else ()
    residual = () if system.prescribed_motion else (_RESIDUAL,)
    return [*names, *(_DEVIATIONS if compared else ()), *residual, *repeated]


def history_units(named: Outline) -> dict[str, str]:
    """Return the SI unit of every channel and of every motion of a probe, by name."""
    motions = {
        f"probes.{probe}.{series}": component_unit(component, unit)
        for probe, component in scalar_probes(named).items()
        for series, unit in SERIES.items()
    }
    return {**dict(named.channels), **motions}


def get_history(response: Response, name: str) -> FloatArray:
    """Return a channel or the motion of a probe, such as ``probes.valve.velocity``, shape (m,)."""
    if name in response.channels:
        return response.channels[name]
    probe, _, series = name.removeprefix("probes.").rpartition(".")
    return getattr(response[probe], series)


def _norms(ready: PreparedRun, response: Response, names: Sequence[str]) -> Iterator[Metric]:
    """Yield the requested p-norms of histories in the last revolution, ((1/T) int |x|^p dt)^(1/p)."""
    units, begin = history_units(response.outline), int(np.argmax(response.latest(ready.revolution)))
    time = response.time[max(begin - 1, 0) :]  # with both ends of the revolution
    for name in names:
        if (norm := _NORM.match(name)) and norm[1] in units:
            order, values = int(norm[2] or 2), np.abs(get_history(response, norm[1])[-len(time) :])
            size = float(values.max()) or 1.0
            mean = float(np.trapezoid((values / size) ** order, time)) / float(time[-1] - time[0])
            yield Metric(name, size * mean ** (1.0 / order), units[norm[1]])


def _probe_scalars(response: Response, period: float) -> Iterator[Metric]:
    """Yield the maximum motions of every probe component in the last revolution."""
    last = response.latest(period)
    for name, component in scalar_probes(response.outline).items():
        history = response[name]
        for series, unit in SERIES.items():
            slopes = getattr(history, SLOPES[series])[last] if series in SLOPES else None
            largest, _ = peak(response.time[last], getattr(history, series)[last], slopes)
            yield Metric(f"probes.{name}.{series}.largest", largest, component_unit(component, unit))


def _deviation_scalars(ready: PreparedRun, response: Response) -> Iterator[Metric]:
    """Yield the deviations of the default probe from the rigid train, if the rigid train moves it."""
    if ready.case.record.fidelity.model == "rigid" or not ready.case.record.output.probes:
        return
    try:
        system, motion = ready.problem.system, ready.problem.drive.at(response.time)
        rigid = replace(response, probes=prescribed_probes(system, rigid_motion(ready.model), motion))
        comparison = compare(response, rigid, scalar_probe(ready), ready.case.speed / RPM)
    except InputError:
        return
    for name, value in zip(_DEVIATIONS, (comparison.peak_deviation, comparison.rms_deviation), strict=True):
        yield Metric(name, value, "1")


# Output of one of many linear runs without saved fields: blocks are long; rows agree with a single run to rounding.
_SPARSE_OUTPUT = SaveAt(field_every=4096)


def evaluate(
    case: Case, *, folder: Path | None = None, model: Model | None = None, runs: int = 1, channels: bool = True,
    time_limit: float | None = None, names: Sequence[str] | None = None,
) -> Row:  # fmt: skip
    """Run a case, no longer than `time_limit`, s, and return its row, with scalars of the kinds of given names."""
    until = None if time_limit is None else time.monotonic() + time_limit

    def run() -> Row:
        variant, choice = select_case(case, until)
        ready = prepare(variant, model=model, until=until)
        sinks: list[Sink] = [] if folder is None else [open_result_file(ready, folder)]
        alone = bool(sinks or runs == 1 or ready.problem.system.local_forces)
        save = ready.save if alone else _SPARSE_OUTPUT
        balanced = bool(sinks) or names is None or any(name.startswith("energy.") for name in names)
        save = replace(save, channels=channels or bool(sinks), energies=balanced)
        monitor = None if names is not None else RunMonitor.of(replace(ready, save=save))
        if monitor:  # the few fields of sparse output do not show the resolution
            sinks += monitor.sinks if alone else monitor.sinks[:1]
        response = solve(replace(ready.problem, runs=runs), ready.scheme, save=save, sinks=sinks, until=until)
        if not response.status.ok:
            return Row(response.status)
        figures = compute_scalars(ready, response, names)
        values, units = {f.name: f.value for f in figures}, {f.name: f.unit for f in figures}
        warnings = _short_warnings(ready, monitor, response, figures) if monitor else []
        if choice is None:
            return Row(Status(text=" | ".join(warnings)) if warnings else response.status, values, units)
        words = f"{choice.evaluation.rung}, {choice.evaluation.steps} steps per revolution"
        met = Status(text=" | ".join([f"chosen within the tolerance: {words}", *warnings]))
        missed = Status(Cause.TOLERANCE, f"the tolerance is not met: {choice.why}; that is {words}")
        return Row(met if choice.is_met else missed, values, units)

    return catch_all_errors(run)


def _short_warnings(ready: PreparedRun, monitor: RunMonitor, response: Response, figures: list[Metric]) -> list[str]:
    """Return the warnings about the lobes and the motion of a run, without their remedies."""
    oiled = any(isinstance(part, Adjuster) for part in ready.model.contacts.values())
    sentences = [
        *check_lobes(ready.model),  # other checks of the input would take as long as a short run
        *check_motion(ready, monitor, figures, response.stats),
        *(check_transient(ready, revolution_change(ready, response)) if oiled else ()),
    ]
    return [sentence.rpartition("; ")[0] or sentence for sentence in sentences]


def evaluate_chunk(
    source: Bundle | Path, variants: Sequence[tuple[str, ...]], *, histories: bool = False, runs: int = 1,
    channels: bool = True, time_limit: float | None = None,
) -> list[Row]:  # fmt: skip
    """Run consecutive variants of a sweep, in a worker; variants that differ only in speed share their model."""
    built: tuple[Case, Model] | None = None

    def evaluate_one(case: Case) -> Row:
        nonlocal built
        speeds = {"speed": None, "crank_speed": None}
        if built is None or built[0].with_run(speeds).record != case.with_run(speeds).record:
            built = case, build_model(case)
        if not histories:
            return evaluate(case, model=built[1], runs=runs, channels=channels, time_limit=time_limit)
        with temporary_folder() as folder:
            row = evaluate(case, folder=folder, model=built[1], runs=runs, time_limit=time_limit)
            for file in folder.iterdir():
                row = replace(row, history=(file.name.removeprefix(case.name), file.read_bytes()))
        return row

    return evaluate_each(source, variants, evaluate_one)
