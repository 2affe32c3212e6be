"""A plan cut into chunks, which are what workers are given; a chunk is a function of plain data alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from flexcam.case import Case, CaseFile, build_model
from flexcam.checks import InputError
from flexcam.io import scratch
from flexcam.response import Cause
from flexcam.sweep.bundle import Bundle, opened
from flexcam.sweep.evaluate import Row, evaluate, refused
from flexcam.sweep.plan import Plan
from flexcam.train import Model

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
