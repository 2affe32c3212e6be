"""Run a case, write its result file, resume an incomplete run, and reload a result."""

from __future__ import annotations

import json
import platform
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from functools import lru_cache, partial
from importlib.metadata import PackageNotFoundError, distribution, version
from itertools import zip_longest
from pathlib import Path
from typing import Literal

import numpy as np

from flexcam.analysis.preparation import PreparedRun, prepare, prepare_without_periodic_search
from flexcam.analysis.resources import ResourceEstimate, check_resources, estimate_resources
from flexcam.analysis.run_metrics import compute_metrics
from flexcam.case.case import Case
from flexcam.case.input_checks import check_values
from flexcam.case.schema.run import ResultStartRecord
from flexcam.core.errors import Fault, InputError, refuse
from flexcam.dynamics import Response, RunFailedError, Sink, Stats, fingerprint, outline, solve
from flexcam.dynamics.blocks import CompletedPart
from flexcam.dynamics.memory import RecentSink
from flexcam.fem.assembly import sections_at_nodes
from flexcam.io import Geometry, PartialResult, Result, ResultFile, create_folder, partial_path
from flexcam.io.result_reader import unknown_fields
from flexcam.valvetrain import Model, StrengthSink, build_structure, element_loads


def output_geometry(model: Model) -> Geometry:
    """Return the output geometry of a model."""
    structure = build_structure(model)
    sections = sections_at_nodes(model.mesh, model.members)
    return Geometry(model.mesh, structure.dofs, structure.beams, sections, element_loads(structure), model.damping)


def open_result_file(
    ready: PreparedRun, folder: str | Path, *, overwrite: bool = False, resume: PartialResult | None = None,
    warnings: Callable[[Stats], Sequence[str]] | None = None,
) -> ResultFile:  # fmt: skip
    """Open the result file of a run, to be passed to `solve` as a sink."""
    if ready.case.name.endswith(_PARTIAL):
        why = f"the result would have the name of the partial result of {ready.case.name.removesuffix(_PARTIAL)}.toml"
        raise refuse("case file", ready.case.path.name, f"a name that does not end in {_PARTIAL}", why, "rename it")
    path = create_folder(Path(folder)) / f"{ready.case.name}.vtkhdf"
    about = _metadata(ready) if resume is None else resume.about
    return ResultFile(
        path, output_geometry(ready.model), outline(ready.problem.system), steps=ready.problem.steps, save=ready.save,
        about=about, overwrite=overwrite, resume=None if resume is None else resume.checkpoint, warnings=warnings,
    )  # fmt: skip


def open_partial_result(ready: PreparedRun, folder: str | Path) -> PartialResult:
    """Open the partial result of a run of a case that was stopped, interrupted or killed."""
    path = Path(folder) / f"{ready.case.name}.vtkhdf"
    partial = partial_path(path)
    if not partial.exists():
        why, remedy = f"there is no partial result {partial} to continue", "leave out --resume"
        if path.exists():
            why, remedy = f"{path} is complete", "leave out --resume, and use --overwrite to run again"
        raise refuse("--resume", str(partial), "", why, remedy)
    earlier = PartialResult(partial, output_geometry(ready.model), outline(ready.problem.system), ready.save)
    faults = find_differences(_metadata(ready), earlier.about)
    if not faults and earlier.checkpoint.problem != fingerprint(ready.problem, ready.scheme, ready.save):
        faults = [_difference("a mesh or a table of the case", "another one", "the one at the start of the run")]
    if faults:
        raise InputError(faults)
    return earlier


_PARTIAL = ".partial"  # suffix of a partial result


def _metadata(ready: PreparedRun) -> dict[str, str]:
    """Return the texts stored with a result: the case as written and resolved, and the versions."""
    case = ready.case
    return {
        "title": case.record.title,
        # Relative paths as given; an absolute one would tell others the folders of this machine.
        "case_file": case.path.name if case.path.is_absolute() else case.path.as_posix(),
        "case": case.text,
        "overrides": json.dumps(case.overrides),
        "files": json.dumps(case.files),
        "resolved": ready.explicit_case.record.model_dump_json(by_alias=True),
        "warnings": "\n".join(check_values(case)),
        "flexcam": _version("flexcam"),
        "python": platform.python_version(),
        **{package: _version(package) for package in ("numpy", "scipy", "h5py", "meshio", "numba")},
        "platform": platform.platform(),
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
    }


@lru_cache
def _version(package: str) -> str:
    """Return the version of a package from the first lines of its metadata: parsing all of it takes milliseconds."""
    try:
        text = distribution(package).read_text("METADATA") or ""
    except PackageNotFoundError:
        return "none"
    match = re.search(r"^Version: (.+)$", text, re.MULTILINE)
    return match[1].strip() if match else version(package)


def summary_sink(ready: PreparedRun, revolutions: float = 1.0) -> RecentSink:
    """Return a sink that keeps only the data required for a summary: the last revolutions."""
    return RecentSink(outline(ready.problem.system, ready.save), revolutions * ready.revolution)


def estimate_case_resources(ready: PreparedRun, keep: Literal["all", "revolution"] = "all") -> ResourceEstimate:
    """Return the memory and disk space required by a run."""
    steps = None if keep == "all" else round(2.0 * ready.revolution / ready.problem.step)
    return estimate_resources(ready.problem, ready.scheme, ready.model.mesh, ready.save, kept=steps)


def check_case_resources(case: Case, folder: Path | None = None, *, runs: int = 1, together: int = 1) -> None:
    """Raise an error if memory or disk space is insufficient for many runs of a case."""
    try:
        ready = prepare_without_periodic_search(case)
    except (InputError, RunFailedError):  # its row reports it
        return
    needs = estimate_case_resources(ready)
    check_resources(replace(needs, file=runs * needs.file), folder, together=together)


def run(
    case: Case, *, rigid: bool = False, sinks: Sequence[Sink] = (), keep: Literal["all", "revolution"] = "all",
    allow_large: bool = False, resume: CompletedPart | None = None,
) -> Response:  # fmt: skip
    """Run a time-domain simulation of a case with the model set in it.

    `flexcam.analysis.model_choice` chooses a model within ``fidelity.tolerance`` and estimates errors.

    Parameters
    ----------
    case
        Checked case from `flexcam.read_case`.
    rigid
        Solve the same mechanism with rigid members.
    sinks
        Further sinks for the results, such as a result file.
    keep
        Content of the response: the whole run, or its last revolution and last field, so that memory does not grow with
        the length of the run.
    allow_large
        Whether a run may exceed the available memory.
    resume
        Partial result of an incomplete run of this case, from `open_partial_result`; the run continues from
        its checkpoint.

    Returns
    -------
    Response
        Histories of the probes, fields and status.

    Raises
    ------
    InputError
        If parts are inconsistent, or memory is insufficient.
    RunFailedError
        If the run cannot start.

    Examples
    --------
    ``flexcam.run(flexcam.read_case("cases/tayeb/model-3-shm.toml"))["valve"].displacement`` is the valve lift.
    """
    if keep not in _STORED_TEXTS:
        raise refuse("keep", repr(keep), " or ".join(map(repr, _STORED_TEXTS)))
    ready = prepare(case, rigid=rigid, allow_large=allow_large)
    if not allow_large:
        check_resources(estimate_case_resources(ready, keep))
    memory = summary_sink(ready) if keep == "revolution" else None
    response = solve(ready.problem, ready.scheme, save=ready.save, sinks=sinks, memory=memory, resume=resume)
    return replace(response, evaluator=partial(_metrics_by_name, case, rigid=rigid))


def _metrics_by_name(case: Case, response: Response, *, rigid: bool = False) -> dict[str, float]:
    """Return the metrics of a response; a case, unlike a prepared run, can be sent to other processes."""
    ready = prepare(case, rigid=True, allow_large=True) if rigid else prepare_without_periodic_search(case)
    return {metric.name: metric.value for metric in compute_metrics(ready, response)}


_STORED_TEXTS = ("all", "revolution")


def reload_result(case: Case, result: Result) -> tuple[PreparedRun, Response]:
    """Return the prepared case of a result and its response as originally computed."""
    from_result = isinstance(case.record.run.start, ResultStartRecord)
    variant = case.with_run({"start": "equilibrium"}) if from_result else case
    ready = replace(prepare_without_periodic_search(variant), case=case)
    names = outline(ready.problem.system)
    response = result.response
    free = build_structure(ready.model).dofs.numbers >= 0
    if response.fields.displacement.shape[1] != free.size:
        raise refuse("result", "a result with another number of nodes", "a result of this case")
    internal = names.unknowns[int(free.sum()) :]
    # Internal nodes of a spring do not move in the rigid model and are not stored.
    missing = None if response.stats.unknowns else np.zeros((len(response.field_time), len(internal)))
    fields = unknown_fields(response, free, internal, missing)
    return ready, replace(response, outline=names, fields=fields, evaluator=partial(_metrics_by_name, case))


def strength_sink(ready: PreparedRun) -> StrengthSink:
    """Return a sink for the stresses of the members of a run."""
    return StrengthSink(build_structure(ready.model), [name for name, _ in outline(ready.problem.system).channels])


def member_strength(ready: PreparedRun, response: Response) -> StrengthSink:
    """Return the stresses of the members over a run, from its saved fields."""
    sink = strength_sink(ready)
    if ready.case.record.fidelity.model == "beams":
        sink.write(response.to_block())
    return sink


_MAX_CHARACTERS = 60  # maximum length of a reported value, characters


def find_differences(now: Mapping[str, str], then: Mapping[str, str]) -> list[Fault]:
    """Return the differences between a run and an earlier run that it resumes: keys, the first line, versions."""
    faults: list[Fault] = []
    for name in _COMPARED_TEXTS:
        what, current, earlier = name, now.get(name, ""), then.get(name, "")
        if current == earlier:
            continue
        if name == "case":
            lines = enumerate(zip_longest(current.split("\n"), earlier.split("\n")), start=1)
            number, (line, old) = next((number, pair) for number, pair in lines if pair[0] != pair[1])
            what, current, earlier = f"the text of the case, line {number}", line or "", old or ""
        elif name == "overrides":
            what, current, earlier = "--set", *(", ".join(json.loads(text or "[]")) for text in (current, earlier))
        faults.append(_difference(what, current, earlier))
    return faults


def _difference(what: str, given: str, allowed: str) -> Fault:
    why = "a run can only be resumed with an unchanged case"
    remedy = "restore the old value, or run the case again with --overwrite"
    texts = [text.strip() or "nothing" for text in (given, allowed)]
    shown = [text if len(text) <= _MAX_CHARACTERS else f"{text[: _MAX_CHARACTERS - 3]}..." for text in texts]
    return Fault(f"--resume: {what}", shown[0], shown[1], why, remedy)


# texts of a result that must be equal for identical numbers
_COMPARED_TEXTS = ("case", "overrides", "flexcam", "python", "numpy", "scipy", "numba")
