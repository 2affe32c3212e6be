"""Run a case, write its result file, resume an incomplete run, and reload a result."""

from __future__ import annotations

import json
import platform
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, distribution, version
from itertools import islice, zip_longest
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np

from flexcam.analysis.preparation import PreparedRun, prepare
from flexcam.analysis.resources import ResourceEstimate, check_resources, estimate_resources
from flexcam.case.case import Case
from flexcam.case.input_checks import check_values
from flexcam.case.schema.run import ResultStartRecord
from flexcam.core import FloatArray, IntArray
from flexcam.core.errors import Fault, InputError, refuse
from flexcam.dynamics import Block, Response, Series, Sink, Stats, fingerprint, outline, solve
from flexcam.dynamics.checkpoint import CompletedPart
from flexcam.dynamics.memory import RecentSink
from flexcam.io import Geometry, PartialResult, Result, ResultFile, create_folder, partial_path
from flexcam.valvetrain import MemberStrength, Model, StrengthSink, build_structure, element_loads


def output_geometry(model: Model) -> Geometry:
    """Return the output geometry of a model."""
    structure = build_structure(model)
    sections = {name: member.section for name, member in model.members.items()}
    return Geometry(model.mesh, structure.dofs, structure.beams, sections, element_loads(structure), model.damping)


def open_result_file(
    ready: PreparedRun, folder: str | Path, *, overwrite: bool = False, resume: PartialResult | None = None,
    warnings: Callable[[Stats], Sequence[str]] | None = None,
) -> ResultFile:  # fmt: skip
    """Open the result file of a run, to be passed to `solve` as a sink."""
    if ready.case.name.endswith(_PARTIAL):
        why = f"the partial result of {ready.case.name.removesuffix(_PARTIAL)}.toml has the name of this one's result"
        raise refuse("case file", ready.case.path.name, f"a name that does not end in {_PARTIAL}", why, "rename it")
    path = create_folder(Path(folder)) / f"{ready.case.name}.vtkhdf"
    about = _metadata(ready.case) if resume is None else resume.about
    return ResultFile(
        path, output_geometry(ready.model), outline(ready.problem.system), steps=ready.problem.steps, save=ready.save,
        about=about, overwrite=overwrite, resume=None if resume is None else resume.checkpoint, warnings=warnings,
    )  # fmt: skip


def open_partial_result(ready: PreparedRun, folder: str | Path) -> PartialResult:
    """Open the partial result of a run of a case that was stopped, interrupted or killed."""
    path = Path(folder) / f"{ready.case.name}.vtkhdf"
    if not partial_path(path).exists():
        why = f"{path} is complete" if path.exists() else "there is no such file"
        raise refuse("--resume", str(partial_path(path)), "the partial result of a run", why, "leave out --resume")
    earlier = PartialResult(partial_path(path), output_geometry(ready.model), outline(ready.problem.system), ready.save)
    _check_same_case(ready, earlier)
    earlier.verify()
    return earlier


_PARTIAL = ".partial"
"""Suffix of a partial result."""


def _check_same_case(ready: PreparedRun, earlier: PartialResult) -> None:
    """Raise an error if a run with another case, other package versions or another problem is resumed."""
    found = find_differences(_metadata(ready.case), earlier.about)
    if not found and earlier.checkpoint.problem != fingerprint(ready.problem, ready.scheme, ready.save):
        found = [difference_fault("a mesh or a table beside the case")]
    if found:
        raise InputError(found)


def _metadata(case: Case) -> dict[str, str]:
    """Return the texts stored with a result: the case as written and resolved, and the versions."""
    return {
        "title": case.record.title,
        "case_file": str(case.path),
        "case": case.text,
        "overrides": json.dumps(case.overrides),
        "resolved": case.record.model_dump_json(by_alias=True),
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
    found = re.search(r"^Version: (.+)$", text, re.MULTILINE)
    return found[1].strip() if found else version(package)


def summary_sink(ready: PreparedRun) -> RecentSink:
    """Return a sink that keeps only the data required for a summary."""
    return RecentSink(outline(ready.problem.system, channels=ready.save.channels), ready.revolution)


def estimate_case_resources(ready: PreparedRun, keep: Literal["all", "revolution"] = "all") -> ResourceEstimate:
    """Return the memory and disk space required by a run."""
    kept = None if keep == "all" else round(ready.revolution / ready.problem.step)
    return estimate_resources(ready.problem, ready.model.mesh, ready.save, kept=kept)


def run(
    case: Case, *, rigid: bool = False, sinks: Sequence[Sink] = (), keep: Literal["all", "revolution"] = "all",
    allow_large: bool = False, resume: CompletedPart | None = None,
) -> Response:  # fmt: skip
    """Run a time-domain simulation of a case with the model set in it.

    `flexcam.analysis.model_choice` chooses a model within ``fidelity.tolerance``; `flexcam.analysis.error_estimate`
    estimates errors.

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
    return solve(ready.problem, ready.scheme, save=ready.save, sinks=sinks, memory=memory, resume=resume)


_STORED_TEXTS = ("all", "revolution")


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


_WHY = "a run goes on only as it began"
_REMEDY = "restore it, or run the case again with --overwrite"

_MAX_CHARACTERS, _MAX_VALUES = 60, 4
"""Maximum length of a reported value, characters, and maximum number of values."""

_NONE = "nothing"


def find_differences(now: Mapping[str, str], then: Mapping[str, str]) -> list[Fault]:
    """Return the differences between a run and an earlier run that it resumes."""
    return [
        difference_fault(f"{what}{place}", given, allowed)
        for key, (what, parts) in _COMPARED_TEXTS.items()
        if now.get(key, "") != then.get(key, "")
        for place, given, allowed in islice(parts(now.get(key, ""), then.get(key, "")), _MAX_VALUES)
    ]


def difference_fault(what: str, given: str = "another one", allowed: str = "the one it began with") -> Fault:
    """Return a difference as a fault."""
    return Fault(f"--resume: {what}", _shorten(given), _shorten(allowed), _WHY, _REMEDY)


Part = tuple[str, str, str]
"""Position within a text, current value and previous value."""


def _compare_lines(now: str, then: str) -> Iterator[Part]:
    """Yield the first line in which two texts differ; a missing line is reported as the end of the text."""
    pairs = zip_longest(now.split("\n"), then.split("\n"), fillvalue="its end")
    first = next(((i, *pair) for i, pair in enumerate(pairs, start=1) if pair[0] != pair[1]), None)
    number, *both = first or (1, now, then)
    yield f", line {number}", both[0].strip() or "an empty line", both[1].strip() or "an empty line"


def _compare_texts(now: str, then: str) -> Iterator[Part]:
    yield "", now or _NONE, then or _NONE


def _compare_overrides(now: str, then: str) -> Iterator[Part]:
    """Yield the overrides that only one of two runs has; for the same overrides, their order."""
    one, other = (list[str](json.loads(text or "[]")) for text in (now, then))
    own = [[x for x in a if x not in b] for a, b in ((one, other), (other, one))]
    given, allowed = own if any(own) else (one, other)
    yield "", ", ".join(given) or _NONE, ", ".join(allowed) or _NONE


def _compare_values(now: str, then: str) -> Iterator[Part]:
    """Yield the keys that differ between two cases."""
    one, other = ({} if not text else dict(_iterate_values(json.loads(text))) for text in (now, then))
    for key in dict.fromkeys([*one, *other]):
        if one.get(key, _NONE) != other.get(key, _NONE):
            yield f", {key}", one.get(key, _NONE), other.get(key, _NONE)


def _iterate_values(value: object, path: str = "") -> Iterator[tuple[str, str]]:
    """Yield dotted key and text of every value in nested tables."""
    if not isinstance(value, dict):
        yield path, json.dumps(value)
        return
    for name, inner in cast("dict[str, Any]", value).items():
        yield from _iterate_values(inner, f"{path}.{name}".removeprefix("."))


def _shorten(text: str) -> str:
    return text if len(text) <= _MAX_CHARACTERS else f"{text[: _MAX_CHARACTERS - 3]}..."


_COMPARED_TEXTS: dict[str, tuple[str, Callable[[str, str], Iterator[Part]]]] = {
    "case": ("the text of the case", _compare_lines), "overrides": ("--set", _compare_overrides),
    "resolved": ("values of the case", _compare_values),
    **{name: (name, _compare_texts) for name in ("flexcam", "python", "numpy", "scipy", "numba")},
}  # fmt: skip
"""Texts of a result that must be equal for identical numbers, their description and comparison function."""
