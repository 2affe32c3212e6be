"""Input and output of commands: result or case as source, output files, tables, JSON, CSV and figures."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from flexcam.analysis.cam_analysis import CamSet, load_cams
from flexcam.analysis.preparation import PreparedRun, prepare
from flexcam.analysis.run import reload_result
from flexcam.case.builder import build_model
from flexcam.case.case import Case
from flexcam.case.reader import case_from_result, has_mechanism
from flexcam.cli.app import check_figure_path, load_case
from flexcam.core.errors import Fault, InputError, collect_errors, refuse
from flexcam.dynamics import Response, Status, reraise_interrupt, solve
from flexcam.io import Result, check_writable, read_result, write_text
from flexcam.report.formatting import StudyOutput, make_unique
from flexcam.report.terminal import print_json, result_console, show_progress
from flexcam.valvetrain import Cam

if TYPE_CHECKING:
    from matplotlib.figure import Figure


StudyAnswer = tuple[StudyOutput, Callable[[], "Figure"]]
"""Output of a study, and the function that draws it."""


def write_answer(
    answer: StudyAnswer, csv: Path | None, plot: Path | None, ended: Status, *, overwrite: bool, as_json: bool,
    written: Sequence[Path] = (),
) -> None:  # fmt: skip
    """Print the output of a study and write its table and figure, also after an interruption; name every file."""
    told, draw = answer
    if csv is not None:
        write_text(csv, told.csv, overwrite=overwrite)
    if plot is not None:
        from flexcam.plotting.figures import save_figure

        save_figure(draw(), plot, overwrite=overwrite)
    files = [str(path) for path in (csv, plot, *written) if path is not None]
    if as_json:
        print_json({"status": "ok" if ended.ok else str(ended.cause), **told.json, "files": files})
        return
    for i, table in enumerate(told.tables):
        result_console().print(*([""] if i else []), table, sep="\n")
    for sentence in told.words:
        result_console().print("\n" + sentence)
    for path in files:
        result_console().print(path)


_UNITS = {"h": 3600.0, "min": 60.0, "s": 1.0, "ms": 1e-3}
_PART = re.compile(r"\s*(\d+\.?\d*|\.\d+)\s*([A-Za-z]+)\s*")
_BARE = re.compile(r"\s*(\d+\.?\d*|\.\d+)\s*$")
_ALLOWED = "a time above zero with its unit, such as 90s, 5min30s or 2h"


def parse_duration(where: str, text: str) -> float:
    """Parse a duration."""
    whole = 0.0
    position = 0
    while found := _PART.match(text, position):
        if found[2] not in _UNITS:
            raise _refusal(where, text, f"{found[2]!r} is none of {', '.join(_UNITS)}")
        whole += float(found[1]) * _UNITS[found[2]]
        position = found.end()
    if position < len(text) or not position:
        raise _refusal(where, text, _describe_remainder(text[position:]))
    if not 0.0 < whole < math.inf:
        raise _refusal(where, text, "nothing is done in no time" if whole == 0.0 else "the number is not finite")
    return whole


def _describe_remainder(rest: str) -> str:
    """Return why the remaining text is not a duration."""
    if _BARE.match(rest):
        return f"{rest.strip()} without a unit could be anything"
    return "time does not run backwards" if rest.lstrip().startswith("-") else f"{rest!r} is no number with a unit"


def _refusal(where: str, text: str, why: str) -> InputError:
    bare = _BARE.match(text)
    remedy = (
        f"write {bare[1]}s or {bare[1]}min" if bare else "write a number and h, min or s; leave it out for no limit"
    )
    return refuse(where, text or "nothing", _ALLOWED, why, remedy)


RESULT = ".vtkhdf"


@dataclass(frozen=True, eq=False)
class Source:
    """Result file, or a case that is run when its response is first used.

    Parameters
    ----------
    path
        Path of the file.
    overrides
        Overrides of the case.
    """

    path: Path
    overrides: tuple[str, ...] = ()

    @cached_property
    def result(self) -> Result | None:
        """Result file; None for a case."""
        return read_result(self.path) if self.path.suffix == RESULT else None

    @cached_property
    def case(self) -> Case:
        """Case; of a result, the case stored in it."""
        return load_case(self.path, self.overrides) if self.result is None else case_from_result(self.result)

    @cached_property
    def ready(self) -> PreparedRun:
        """Prepared run of the case."""
        return prepare(self.case) if self.result is None else reload_result(self.case, self.result)[0]

    @cached_property
    def response(self) -> Response:
        """Response of the result, or of a run of the case."""
        return _solve_source(self.ready) if self.result is None else self.result.response

    @cached_property
    def rigid(self) -> Response:
        """Response with rigid members."""
        return _solve_source(prepare(self.case, rigid=True))

    @cached_property
    def cams_only(self) -> CamSet | None:
        """Cams of a file without a mechanism; None for a result or a complete case."""
        if self.path.suffix == RESULT or has_mechanism(self.path):
            return None
        return load_cams(self.path, self.overrides)

    @property
    def cams(self) -> Mapping[str, Cam]:
        """Cams by name."""
        return build_model(self.case).cams if self.cams_only is None else self.cams_only.cams

    @property
    def subject(self) -> str:
        """Title of the case or of the file of cams."""
        return self.case.title if self.cams_only is None else self.cams_only.title or self.stem

    @property
    def stem(self) -> str:
        """Name of the file without suffixes."""
        return self.path.name.partition(".")[0]

    @property
    def title(self) -> str:
        """Title of the case with its speed."""
        return f"{self.case.record.title or self.stem}, {self.case.speed_text}"


def _solve_source(ready: PreparedRun) -> Response:
    with show_progress(ready.problem.steps) as bar:
        response = solve(ready.problem, ready.scheme, save=ready.save, sinks=bar)
    reraise_interrupt(response.status)
    return response


def open_sources(paths: Sequence[Path], overrides: Sequence[str] | None, *, cams: bool = False) -> list[Source]:
    """Return the sources of several files; unreadable files are rejected before a computation.

    With `cams`, files that contain only cams are accepted.
    """
    if not paths:
        raise refuse("command line", "no file", "one or more results (.vtkhdf) or cases (.toml)")
    if overrides and any(path.suffix == RESULT for path in paths):
        raise refuse("--set", overrides[0], "cases alone", "a result has been computed", "give the case, or run it")
    found = [Source(path, tuple(overrides or ())) for path in paths]
    for one in found:
        _ = one.result or (cams and one.cams_only) or one.case
    return found


def name_sources(sources: Sequence[Source]) -> dict[str, Source]:
    """Return sources by a distinguishing name: empty for a single one, else file name, speed or number."""
    if len(sources) == 1:
        return {"": sources[0]}
    speeds = ["" if one.cams_only else one.case.speed_text for one in sources]
    return dict(zip(make_unique([one.stem for one in sources], speeds), sources, strict=True))


def check_distinct_files(written: Mapping[str, Path | None], read: Sequence[Path] = ()) -> None:
    """Raise an error if output files coincide with each other or with an input file, regardless of overwriting."""
    taken = {_real(path): "what is read" for path in read}
    faults: list[Fault] = []
    for option, path in written.items():
        if path is None:
            continue
        if (other := taken.setdefault(_real(path), option)) != option:
            why = "it would be lost" if other == "what is read" else "the one would replace the other"
            faults.append(Fault(option, str(path), f"another file than {other}", why, "name another file"))
    if faults:
        raise InputError(faults)


def check_targets(csv: Path | None, plot: Path | None, read: Path, *, overwrite: bool) -> None:
    """Raise an error if a table or a figure cannot be written, before a computation."""
    collect_errors(
        lambda: check_distinct_files({"--csv": csv, "--plot": plot}, [read]),
        lambda: None if csv is None else check_writable("output", csv, overwrite=overwrite),
        lambda: check_figure_path(plot, overwrite),
    )


def _real(path: Path) -> str:
    return os.path.realpath(path)
