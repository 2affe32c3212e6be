"""Checked sweeps: validation of variants and scalar names, execution, and output files."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from functools import partial
from importlib.metadata import version
from pathlib import Path

from flexcam import __version__
from flexcam.analysis.run import check_case_resources
from flexcam.case.case import Case
from flexcam.case.fault_report import KeyLocations
from flexcam.case.reader import CaseFile
from flexcam.core.errors import Fault, InputError, collect_errors, parse_all, refuse, require_packages
from flexcam.dynamics import Cause, RunFailedError, Status
from flexcam.io import atomic_write_path, check_writable
from flexcam.io.sweep_table import PARQUET, SweepTable, is_scalar_prefix, unknown_scalar_fault, write_table
from flexcam.studies.evaluation import are_probe_scalars, evaluate_chunk, scalar_names
from flexcam.studies.executors import Chunk, Evaluate, SerialWorkers, Workers, divide_variants, open_runner
from flexcam.studies.journal import Journal, journal_contains, make_table
from flexcam.studies.plan import (
    MAX_VARIANTS,
    Axis,
    Bundle,
    Plan,
    Row,
    evaluate_each,
    make_bundle,
    make_plan,
    open_case,
    parse_axes,
    parse_axis,
    parse_sample,
)
from flexcam.studies.quantities import is_frequency, quantity_row
from flexcam.studies.variables import require_units

_QUICK_CHECK_LIMIT = 1000  # variants above which the ends of the axes are checked first: reading a case takes 0.5 ms
_MAX_LISTED = 3  # number of variants and values listed in a report


def validate_plan(file: CaseFile, plan: Plan) -> Case:
    """Check every variant of a plan, of many those at the ends of the axes first; return the first one."""
    variants = plan.variants
    if len(variants) > _QUICK_CHECK_LIMIT:
        _check_variants(file, plan, end_variants(plan))
    _check_variants(file, plan, range(len(variants)))
    return file.read(variants[0])


def _check_variants(file: CaseFile, plan: Plan, indices: Sequence[int]) -> None:
    """Raise an error that reports faults of the same reason at the same key once."""
    variants, groups = plan.variants, dict[tuple[str, str, str], list[tuple[int, Fault]]]()
    for i in indices:
        try:
            file.read(variants[i])
        except InputError as refusal:
            for fault in refusal.faults:
                placed = _locate_fault(fault, plan.axes)
                groups.setdefault((placed.where, fault.allowed, fault.why), []).append((i, placed))
    if groups:
        raise InputError(_summarize_faults(group, len(indices)) for group in groups.values())


def end_variants(plan: Plan) -> list[int]:
    """Return the variants with the first and the last value of every axis; for a sample, its first and last point."""
    if plan.sample is not None:
        return sorted({0, len(plan) - 1})
    indices, stride = {0}, len(plan)
    for count in plan.shape:
        stride //= count
        indices.add((count - 1) * stride)
    return sorted(indices)


def _locate_fault(fault: Fault, axes: Sequence[Axis]) -> Fault:
    """Return a fault with the option of the axis that it concerns; otherwise unchanged."""
    for axis in axes:
        if f"--set {axis.key}=" in fault.where:
            key, new, _ = fault.where.partition("(created by ")
            return replace(fault, where=f"{key}{new}{axis.where})" if new else axis.where)
    return fault


def _summarize_faults(group: Sequence[tuple[int, Fault]], count: int) -> Fault:
    """Return the fault of several variants, with their numbers if these are not all of the checked ones."""
    fault, indices = group[0][1], list(dict.fromkeys(i for i, _ in group))
    where = f"in variant{'s' * (len(indices) > 1)} {_list_some([str(i + 1) for i in indices])}"
    why = "; ".join(filter(None, (fault.why, where if len(indices) < count else "")))
    return replace(fault, given=_list_some(list(dict.fromkeys(item.given for _, item in group))), why=why)


def _list_some(items: Sequence[str]) -> str:
    more = f" and {len(items) - _MAX_LISTED} more" if len(items) > _MAX_LISTED else ""
    return ", ".join(items[:_MAX_LISTED]) + more


def check_names(file: CaseFile, plan: Plan, names: Sequence[str]) -> None:
    """Raise an error for scalars that no variant has.

    The parts of a case determine its scalars, and numbers rarely do: variants are checked only until every name is
    found, first those with the ends of every axis and with every value that is a word.
    """
    known, missing, variants = dict[str, None](), list(names), plan.variants
    words = [f"{axis.key}={value.text}" for axis in plan.axes if not axis.is_numeric for value in axis.values]
    with_words = [next((i for i, variant in enumerate(variants) if word in variant), 0) for word in words]
    for i in dict.fromkeys([*end_variants(plan), *with_words]):
        if not missing:
            break
        with suppress(InputError):  # a variant with inconsistent parts
            known |= dict.fromkeys(scalar_names(file.read(variants[i])))
        missing = [name for name in missing if not is_scalar_prefix(name, known)]
    if known and missing:
        raise InputError(replace(unknown_scalar_fault(name, known), where="--scalars") for name in missing)


GRID = "grid"


@dataclass(frozen=True, eq=False)
class Sweep:
    """Checked sweep: all variants are readable."""

    name: str  #: name of the case, used for output files
    title: str  #: title of the case
    plan: Plan  #: plan of the variants
    bundle: Bundle  #: case and its files at the time of the check
    size: int  #: number of variants per chunk
    scalars: tuple[str, ...] = ()  #: names or prefixes of the scalars to keep; empty for all
    #: whether contacts, members and energies are computed; otherwise only the motion of the probes
    channels: bool = True
    frequencies: tuple[str, ...] = ()  #: names of requested natural frequencies
    time_limit: float | None = None  #: maximum time of a variant, s; None for no limit

    @property
    def chunks(self) -> tuple[Chunk, ...]:
        """Chunks of the plan."""
        return divide_variants(self.plan.variants, self.size)

    def evaluate(self, *, histories: bool = False) -> Evaluate:
        """Return the function that evaluates a chunk."""
        run = partial(
            evaluate_chunk, histories=histories, runs=len(self.plan), channels=self.channels, time_limit=self.time_limit
        )
        return partial(_evaluate_with_frequencies, run, self.frequencies) if self.frequencies else run

    def about(self) -> dict[str, str]:
        """Return the metadata of the table: case, plan and versions."""
        plan = {
            "set": {axis.key: [value.text for value in axis.values] for axis in self.plan.axes},
            "intervals": [axis.key for axis in self.plan.axes if axis.interval],
            "sample": None if self.plan.sample is None else asdict(self.plan.sample),
        }
        return {
            "title": self.title, "case_file": self.bundle.name,
            "case": self.bundle.files[self.bundle.name].decode(), "files": self.bundle.digest,
            "plan": json.dumps(plan), "flexcam": __version__,
            **{package: version(package) for package in ("numpy", "scipy", "h5py")},
        }  # fmt: skip

    def identification(self, *, histories: bool) -> dict[str, object]:
        """Return the identification of the sweep's journal."""
        plan = hashlib.sha256(json.dumps([self.size, self.plan.variants]).encode()).hexdigest()
        return {
            "format": 2, "flexcam": __version__, "case": self.bundle.digest, "plan": plan, "histories": histories,
            "variants": len(self.plan), "channels": self.channels,
            **({"frequencies": [*self.frequencies]} if self.frequencies else {}),
        }  # fmt: skip


def _evaluate_with_frequencies(
    run: Evaluate, names: Sequence[str], source: Bundle | Path, variants: Sequence[tuple[str, ...]]
) -> list[Row]:
    """Run consecutive variants in a worker, and add natural frequencies to the rows of complete runs."""
    rows, modes = run(source, variants), evaluate_each(source, variants, partial(quantity_row, names=names))

    def merge(row: Row, mode: Row) -> Row:
        if not row.status.ok:
            return row
        if not mode.status.ok:
            texts = [status.text for status in (row.status, mode.status) if status != Status()]
            return replace(row, status=Status(text=" | ".join(texts)))
        return replace(row, scalars={**row.scalars, **mode.scalars}, units={**row.units, **mode.units})

    return list(map(merge, rows, modes))


def make_sweep(
    path: str | Path, settings: Sequence[str] = (), *, sampled: str | None = None, seed: int | None = None,
    scalars: Sequence[str] = (), limit: int = MAX_VARIANTS,
) -> Sweep:  # fmt: skip
    """Return the sweep of a case with all variants checked."""
    file = CaseFile.open(path)
    defaults = file.sweep
    if limit < 1:
        raise refuse("--limit", limit, "a whole number, at least 1", "it is the maximum number of variants")
    axes = _axes(file, settings, limit)
    method = sampled if sampled is not None else (defaults.sample if defaults else None) or GRID
    if seed is not None and method == GRID:
        why, remedy = "every combination is run, and none is drawn", "add --sample, or leave --seed out"
        raise refuse("--seed", seed, "--seed only with --sample", why, remedy)
    number = seed if seed is not None else defaults.seed if defaults else 0
    plan, _ = collect_errors(
        lambda: make_plan(axes, None if method == GRID else parse_sample(method, number), limit=limit),
        lambda: _check_units(file, axes),
    )
    first = validate_plan(file, plan)
    if first.record.fidelity.estimate:
        where, why = first.place(("fidelity", "estimate")), "a sweep stores no estimates"
        raise refuse(where, "true", "false", why, "--set fidelity.estimate=false")
    names = tuple(scalars or (defaults.scalars if defaults else ()))
    frequencies = tuple(name for name in names if is_frequency(first, name))
    others = [name for name in names if name not in frequencies]
    check_names(file, plan, others)
    bundle, size = make_bundle(file, plan), chunk_size(plan, first)
    return Sweep(
        first.name, first.record.title, plan, bundle, size, names, not are_probe_scalars(others), frequencies
    )  # fmt: skip


def _check_units(file: CaseFile, axes: Sequence[Axis]) -> None:
    try:
        first = file.read([f"{axis.key}={axis.values[0].text}" for axis in axes])
    except InputError:  # the check of the variants reports it
        return
    require_units(first, [axis for axis in axes if axis.where.startswith("--set")])


_MAX_CHUNK_SIZE = 16  # maximum number of variants per chunk, which limits the loss in a crash
_CHUNK_COUNT = 64  # desired number of chunks of a plan, enough for many workers
_MAX_CHUNK_STEPS = 120_000  # maximum number of steps per chunk; a longer run is a separate chunk


def chunk_size(plan: Plan, case: Case) -> int:
    """Return the number of variants per chunk, independent of the number of workers."""
    run = case.record.run
    steps = int(run.revolutions * (run.steps_per_revolution or 3600))
    return max(1, min(_MAX_CHUNK_SIZE, len(plan) // _CHUNK_COUNT, _MAX_CHUNK_STEPS // max(steps, 1)))


def _axes(file: CaseFile, settings: Sequence[str], limit: int) -> tuple[Axis, ...]:
    """Return the axes of the case's table, replaced and extended by those of the command line."""
    defaults, places = file.sweep.set_ if file.sweep else {}, KeyLocations.of_text(file.text)
    replaced = {setting.partition("=")[0].strip() for setting in settings}

    def read(key: str) -> Axis:
        spec = "0" if key in replaced else defaults[key]  # a replaced axis keeps its position
        return parse_axis(key, spec, where=places.place(("sweep", "set", key)), limit=limit)

    pair = collect_errors(lambda: parse_all(read, defaults), lambda: parse_axes(settings, limit=limit))
    axes = {axis.key: axis for part in pair for axis in part}
    for axis in axes.values():
        if axis.key.partition(".")[0] == "sweep":
            allowed, remedy = "a key of the mechanism or its run", "use --sample or --seed"
            raise refuse(axis.where, axis.key, allowed, "it defines the sweep", remedy)
    return tuple(axes.values())


def check_sweep_resources(asked: Sweep, folder: Path | None = None, *, together: int = 1) -> None:
    """Raise an error if memory or disk space is insufficient for the first variants of a sweep."""
    first = open_case(asked.bundle).read(asked.plan.variants[0])
    check_case_resources(first, folder, runs=len(asked.plan), together=min(together, len(asked.plan)))


@dataclass(frozen=True)
class OutputTarget:
    """Output folder of a sweep and the treatment of existing files."""

    folder: Path  #: folder, created if necessary
    resume: bool = False  #: whether to resume or replace an existing sweep
    overwrite: bool = False
    histories: bool = False  #: whether to keep the result file of every variant
    parquet: bool = False  #: whether to write a Parquet table too

    def tables(self, name: str) -> list[Path]:
        """Return the paths of the tables of a sweep."""
        return [self.folder / f"{name}.sweep{end}" for end in (".h5", ".csv", *([".parquet"] if self.parquet else []))]

    def journal(self, name: str) -> Path:
        """Return the path of the journal of a sweep."""
        return self.folder / f"{name}.sweep.jsonl"

    def history(self, name: str, variant: int, ending: str) -> Path:
        """Return the path of the result file of a variant, counted from 1."""
        return self.folder / f"{name}.sweep" / f"variant-{variant:05d}{ending}"

    def existing_histories(self, name: str) -> list[Path]:
        """Return the existing result files of variants, of this sweep or of an earlier one."""
        return sorted((self.folder / f"{name}.sweep").glob("variant-*.vtkhdf*"))


def run_sweep(
    asked: Sweep, workers: Workers | None = None, *, advance: Callable[[int], None] | None = None
) -> SweepTable:
    """Run a sweep and return its table without writing files."""
    rows: dict[int, list[Row]] = {}
    with open_runner(workers or SerialWorkers(), asked.bundle) as run_chunks:
        for chunk, results in run_chunks(asked.evaluate(), asked.chunks):
            rows[chunk.index] = results
            if advance:
                advance(len(results))
    return _make_table(asked, rows)


def run_sweep_to_files(
    asked: Sweep, target: OutputTarget, workers: Workers | None = None, *, advance: Callable[[int], None] | None = None
) -> tuple[SweepTable, list[Path]]:
    """Run a sweep with a journal and write its tables."""
    if target.parquet:
        require_packages(*PARQUET)
    begun = target.resume and journal_contains(target.journal(asked.name), "channels")
    if begun or target.histories:  # the journal has all scalars, or result files are kept
        asked = replace(asked, channels=True)
    try:
        with _open_journal(asked, target) as journal:
            _run_missing_chunks(asked, target, journal, workers or SerialWorkers(), advance)
            table = _make_table(asked, journal.rows)
            try:
                table = table.select(asked.scalars) if asked.scalars else table
            except InputError as refusal:
                remedy = "nothing is lost: --resume with other --scalars writes the tables at once"
                mended = [replace(f, remedy="; ".join(filter(None, (f.remedy, remedy)))) for f in refusal.faults]
                raise InputError(mended) from None
            return table, [write_table(table, path, overwrite=True) for path in target.tables(asked.name)]
    except KeyboardInterrupt:
        raise RunFailedError(_interrupted_status(asked, target)) from None


def _run_missing_chunks(
    sweep: Sweep, target: OutputTarget, journal: Journal, workers: Workers, advance: Callable[[int], None] | None
) -> None:
    rows = journal.rows
    if advance:
        advance(sum(len(part) for part in rows.values()))
    late = {i for i, part in rows.items() if any(row.status.cause is Cause.TIME_LIMIT for row in part)}  # run again
    missing = [chunk for chunk in sweep.chunks if chunk.index not in rows or chunk.index in late]
    stale = target.existing_histories(sweep.name) if target.histories and not rows else []
    with open_runner(workers, sweep.bundle) as run_chunks:
        for chunk, results in run_chunks(sweep.evaluate(histories=target.histories), missing):
            while stale:  # result files of an earlier sweep would not match the table
                stale.pop().unlink()
            for variant, row in enumerate(results, start=chunk.first + 1):
                if row.history is not None:
                    ending, content = row.history
                    with atomic_write_path(target.history(sweep.name, variant, ending)) as draft:
                        draft.write_bytes(content)
            journal.add(chunk.index, [replace(row, history=None) for row in results])
            if advance:
                advance(len(results))


def _interrupted_status(sweep: Sweep, target: OutputTarget) -> Status:
    """Return the status of an interrupted sweep; the file has its finished rows, also one written at the interrupt."""
    path, count = target.journal(sweep.name), 0
    if path.exists():
        with _open_journal(sweep, replace(target, resume=True)) as journal:
            count = sum(len(part) for part in journal.rows.values())
    if not count:
        return Status(Cause.INTERRUPTED, "stopped before the first variant ended", "run it again")
    text = f"stopped: {count} of {len(sweep.plan)} variants are kept in {path}"
    return Status(Cause.INTERRUPTED, text, "the same command with --resume does the rest")


@contextmanager
def _open_journal(sweep: Sweep, target: OutputTarget) -> Generator[Journal]:
    """Open the journal of a sweep after checking that its tables may be written."""
    path, belongs = target.journal(sweep.name), sweep.identification(histories=target.histories)
    resumed = target.resume and path.exists()
    for table in target.tables(sweep.name):
        check_writable("table", table, overwrite=target.overwrite or resumed)
    if target.histories and not (target.overwrite or resumed) and (files := target.existing_histories(sweep.name)):
        why, remedy = "flexcam overwrites no file by itself", "--overwrite replaces them; or name another folder"
        raise refuse("histories", f"{len(files)} in {files[0].parent}", "none from an earlier sweep", why, remedy)
    journal = Journal(path, belongs, resume=target.resume, overwrite=target.overwrite)
    try:
        yield journal
    finally:
        journal.close()


def _make_table(sweep: Sweep, rows: dict[int, list[Row]]) -> SweepTable:
    return make_table(sweep.plan, [row for _, part in sorted(rows.items()) for row in part], sweep.about())
