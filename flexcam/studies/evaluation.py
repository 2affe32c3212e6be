"""The scalars of a run: what a sweep keeps of a variant, each by a stable name, in SI.

``probes.POINT.SERIES.largest`` (of a component: ``probes.POINT.COMPONENT.SERIES.largest``) is the largest absolute
displacement, velocity or acceleration in the last revolution, of the dense output; ``deviation.peak`` and
``deviation.rms`` are those of the whole run from the rigid train at the default probe, as parts of the lift;
``energy.residual.largest`` is what does not add up. All others are the figures of `flexcam.valvetrain.train_metrics`.
"""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np

from flexcam.analysis.comparison import compare
from flexcam.analysis.model_choice import chosen
from flexcam.analysis.preparation import Prepared, described, figures_of, prepare, scalar_probe
from flexcam.analysis.run import result_file
from flexcam.case.builder import build_model
from flexcam.case.case import Case
from flexcam.case.reader import CaseFile
from flexcam.core.errors import InputError
from flexcam.core.units import RPM
from flexcam.dynamics import (
    SLOPES,
    Cause,
    Response,
    RunFailedError,
    SaveAt,
    Status,
    outline,
    peak,
    prescribed_probes,
    solve,
)
from flexcam.io import scratch
from flexcam.io.exports import component_unit
from flexcam.io.result_writer import SERIES
from flexcam.studies.plan import Bundle, Plan, opened
from flexcam.valvetrain import ANY_SPEED, Metric, Model, build_rigid, train_metric_names


def scalars_of(ready: Prepared, response: Response) -> list[Metric]:
    """Return the scalars of a run."""
    figures = [
        *(figures_of(ready, response) if response.outline.channels else ()),
        *_motions(response, ready.revolution),
        *_deviations(ready, response),
        *_residual(response),
    ]
    return [figure for figure in figures if np.isfinite(figure.value)]


def of_motion(names: Sequence[str]) -> bool:
    """Tell whether scalars are all of the probes' motion, for which nothing else of a run is needed."""
    return bool(names) and all(name.partition(".")[0] in ("probes", "deviation") for name in names)


def scalar_names(case: Case) -> list[str]:
    """Return the names of all scalars that a run of a case may have, without running it."""
    model, system = described(case)
    named = outline(system)
    names = train_metric_names(model, [name for name, _ in named.channels])
    probes = [component for name, components in named.probes for component in _components(name, components)]
    names += [f"probes.{probe}.{series}.largest" for probe in probes for series in SERIES]
    compared = case.record.fidelity.model != "rigid" and bool(case.record.output.probes) and bool(model.driven)
    return [*names, *(_DEVIATIONS if compared else ()), *(() if system.carried else (_RESIDUAL,))]


_DEVIATIONS = ("deviation.peak", "deviation.rms")
_RESIDUAL = "energy.residual.largest"


def _components(probe: str, components: Sequence[str]) -> list[str]:
    """Return what the components of a probe are called; a probe of one has its own name."""
    return [probe] if len(components) == 1 else [f"{probe}.{component}" for component in components]


def _motions(response: Response, period: float) -> Iterator[Metric]:
    """Yield the largest motions of every probe's components in the last revolution."""
    last = response.latest(period)
    for probe, components in response.outline.probes:
        for component, name in zip(components, _components(probe, components), strict=True):
            history = response[name]
            for series, unit in SERIES.items():
                slopes = getattr(history, SLOPES[series])[last] if series in SLOPES else None
                largest, _ = peak(response.time[last], getattr(history, series)[last], slopes)
                yield Metric(f"probes.{name}.{series}.largest", largest, component_unit(component, unit))


def _deviations(ready: Prepared, response: Response) -> Iterator[Metric]:
    """Yield how far the default probe strays from the rigid train, where there is one that moves it."""
    if ready.case.record.fidelity.model == "rigid" or not ready.case.record.output.probes:
        return
    try:
        found = compare(response, _rigid(ready, response), scalar_probe(ready), ready.case.speed / RPM)
    except InputError:
        return
    for name, part in zip(_DEVIATIONS, (found.peak_deviation, found.rms_deviation), strict=True):
        yield Metric(name, part, "1")


def _rigid(ready: Prepared, response: Response) -> Response:
    """Return the rigid train's motion at the instants of a response."""
    rigid, motion = build_rigid(ready.model, ANY_SPEED), ready.problem.drive.at(response.time)
    return replace(response, outline=outline(rigid), probes=prescribed_probes(rigid, motion))


def _residual(response: Response) -> Iterator[Metric]:
    if "energy.residual" in response.channels:
        residual = response.channels["energy.residual"]
        yield Metric(_RESIDUAL, float(np.abs(residual).max(initial=0.0)), "J")


@dataclass(frozen=True)
class Row:
    """What a sweep keeps of one variant.

    Parameters
    ----------
    status
        How its run ended; ``refused`` where it could not start.
    scalars
        Name to value, SI (`flexcam.studies.evaluation`); empty unless the run is complete.
    units
        SI unit of each scalar.
    seconds
        Time it took; it stays out of the tables, which are the same on every machine.
    """

    status: Status
    scalars: Mapping[str, float] = field(default_factory=dict[str, float])
    units: Mapping[str, str] = field(default_factory=dict[str, str])
    seconds: float = 0.0


def evaluate(
    case: Case, *, folder: Path | None = None, model: Model | None = None, runs: int = 1, channels: bool = True
) -> Row:
    """Run a case and return what a sweep keeps of it."""
    begun = time.perf_counter()
    row = _row(case, folder, model, runs, channels)
    return Row(row.status, row.scalars, row.units, time.perf_counter() - begun)


_SELDOM = SaveAt(field_every=4096)
"""Fields of one of many linear runs, which nobody keeps: blocks are long, and rows are those of one run to rounding."""


def _row(case: Case, folder: Path | None, model: Model | None, runs: int, channels: bool) -> Row:
    try:
        read, choice = chosen(case)
        ready = prepare(read, model=model)
        sinks = [] if folder is None else [result_file(ready, folder)]
        alone = sinks or runs == 1 or ready.problem.system.local_forces
        save = ready.save if alone else _SELDOM
        save = save if channels or sinks else replace(save, channels=False)
        response = solve(replace(ready.problem, runs=runs), ready.scheme, save=save, sinks=sinks)
        row = row_of(ready, response)
    except InputError as refusal:
        return refused(refusal)
    except RunFailedError as failure:
        return Row(failure.status)
    except Exception as fault:  # noqa: BLE001 - a fault in one variant must not cost the others
        return Row(_fault(fault))
    if choice is None or not row.status.ok:
        return row
    named = f"{choice.found.rung}, {choice.found.steps} steps per revolution"
    met = Status(text=f"chosen within the tolerance: {named}")
    missed = Status(Cause.TOLERANCE, f"the tolerance is not met: {choice.why}; that is {named}")
    return Row(met if choice.met else missed, row.scalars, row.units)


def row_of(ready: Prepared, response: Response) -> Row:
    """Return the row of a run that has been solved."""
    if not response.status.ok:
        return Row(response.status)
    figures = scalars_of(ready, response)
    values, units = {one.name: one.value for one in figures}, {one.name: one.unit for one in figures}
    return Row(response.status, values, units, response.stats.seconds)


def refused(refusal: InputError) -> Row:
    """Return the row of a variant that cannot start."""
    return Row(Status(Cause.REFUSED, " | ".join(map(str, refusal.faults))))


def _fault(fault: Exception) -> Status:
    """Return the status of a fault of flexcam itself, with the line it happened on."""
    last = traceback.extract_tb(fault.__traceback__)[-1]
    text = f"a fault of flexcam itself: {type(fault).__name__}: {fault} ({Path(last.filename).name}:{last.lineno})"
    return Status(Cause.FAULT, text, "please report it; flexcam run with the same keys shows more")


_MOST = 16
"""Variants of a chunk: what a crash may cost."""

_MANY = 64
"""Chunks that a plan should have, so that many workers have something to do."""

_STEPS = 120_000
"""Steps of a chunk: a longer run is a chunk of its own."""


@dataclass(frozen=True)
class Chunk:
    """Some successive variants of a plan.

    Parameters
    ----------
    index
        Of the chunk, from 0.
    first
        Index of its first variant.
    variants
        Overrides of each.
    """

    index: int
    first: int
    variants: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Outcome:
    """What comes back of a variant.

    Parameters
    ----------
    row
        Its row.
    history
        Its result file, where histories are kept, and the ending of its name.
    """

    row: Row
    history: tuple[str, bytes] | None = None


def chunk_size(plan: Plan, case: Case) -> int:
    """Return the variants per chunk: the same for every number of workers."""
    run = case.record.run
    steps = int(run.revolutions * (run.steps_per_revolution or 3600))
    return max(1, min(_MOST, len(plan) // _MANY, _STEPS // max(steps, 1)))


def chunks_of(plan: Plan, size: int) -> tuple[Chunk, ...]:
    """Return the chunks of a plan."""
    variants = plan.variants
    starts = range(0, len(variants), size)
    return tuple(Chunk(i, first, variants[first : first + size]) for i, first in enumerate(starts))


def evaluated(
    source: Bundle | Path, variants: Sequence[tuple[str, ...]], *, histories: bool = False, runs: int = 1,
    channels: bool = True,
) -> list[Outcome]:  # fmt: skip
    """Run some variants of a case: what a worker does."""
    file = opened(source)
    cases = [_read(file, overrides) for overrides in variants]
    run = partial(_kept, runs=runs) if histories else partial(_ran, runs=runs, channels=channels)
    ran = iter(_evaluated([case for case in cases if isinstance(case, Case)], run))
    found = [next(ran) if isinstance(case, Case) else Outcome(case) for case in cases]
    if any(one.row.status.cause is Cause.INTERRUPTED for one in found):
        raise KeyboardInterrupt
    return [_placed(one, file.path.parent) for one in found]


def _read(file: CaseFile, overrides: Sequence[str]) -> Case | Row:
    """Return a variant, or the row of one that this machine cannot read."""
    try:
        return file.read(overrides)
    except InputError as refusal:
        return refused(refusal)


def _evaluated(cases: Sequence[Case], run: Callable[[Case, Model | None], Outcome]) -> list[Outcome]:
    """Run the cases of a chunk: the one place where cases become rows."""
    return [run(case, model) for case, model in zip(cases, _models(cases), strict=True)]


def _models(cases: Sequence[Case]) -> list[Model | None]:
    """Return the model of each case that is like its predecessor but for its speed; None where it is to be built."""
    models: list[Model | None] = []
    for i, case in enumerate(cases):
        if i and _same_mechanism(cases[i - 1], case):
            models[-1] = models[-1] or _built(cases[i - 1])
            models.append(models[-1])
        else:
            models.append(None)
    return models


def _built(case: Case) -> Model | None:
    """Return the model of a case; None of one that cannot be built, which its own run will tell."""
    try:
        return build_model(case)
    except InputError:
        return None


def _same_mechanism(one: Case, other: Case) -> bool:
    speeds = {"speed": None, "crank_speed": None}
    return one.with_run(speeds).record == other.with_run(speeds).record


def _ran(case: Case, model: Model | None, *, runs: int, channels: bool) -> Outcome:
    return Outcome(evaluate(case, model=model, runs=runs, channels=channels))


def _kept(case: Case, model: Model | None, *, runs: int) -> Outcome:
    """Run a case and return its result file too."""
    with scratch() as folder:
        row = evaluate(case, folder=folder, model=model, runs=runs)
        written = next(folder.iterdir(), None)
        if written is None:
            return Outcome(row)
        return Outcome(row, (written.name.removeprefix(case.name), written.read_bytes()))


def _placed(outcome: Outcome, folder: Path) -> Outcome:
    """Return an outcome whose words name files as the case does, wherever it was unpacked."""
    status = outcome.row.status
    text = status.text.replace(f"{folder}/", "")
    return replace(outcome, row=replace(outcome.row, status=replace(status, text=text)))
