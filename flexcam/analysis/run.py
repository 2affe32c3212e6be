"""Run a case, write its result file, and resume an incomplete run."""

from __future__ import annotations

import json
import platform
import re
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, distribution, version
from pathlib import Path
from typing import Literal

from flexcam.analysis.case_diff import difference_fault, find_differences
from flexcam.analysis.preparation import PreparedRun, prepare
from flexcam.analysis.resources import ResourceEstimate, check_resources, estimate_resources
from flexcam.case.case import Case
from flexcam.case.input_checks import check_values
from flexcam.core.errors import InputError, refuse
from flexcam.dynamics import Response, Sink, Stats, fingerprint, outline, solve
from flexcam.dynamics.checkpoint import CompletedPart
from flexcam.dynamics.memory import RecentSink
from flexcam.io import Geometry, PartialResult, ResultFile, create_folder, partial_path
from flexcam.valvetrain import Model, build_structure, element_loads


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
