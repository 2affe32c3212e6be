"""Sources of figures and views: result files, cases that are run when needed, and files of cams."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from flexcam.analysis.cam_analysis import CamSet, load_cams
from flexcam.analysis.natural_modes import modes as case_modes
from flexcam.analysis.preparation import PreparedRun, prepare
from flexcam.analysis.run import reload_result
from flexcam.case.builder import build_model
from flexcam.case.case import Case
from flexcam.case.reader import case_from_result, has_mechanism
from flexcam.cli import app as cli
from flexcam.core.errors import refuse
from flexcam.core.units import RPM, shaft_name
from flexcam.dynamics import Response, reraise_interrupt, solve
from flexcam.io import Result, read_result
from flexcam.report.terminal import make_unique, show_progress
from flexcam.valvetrain import Cam, build_structure

if TYPE_CHECKING:
    from flexcam.plotting.scene.mechanism import Mechanism
    from flexcam.plotting.scene.motion import Motion

_RESULT = ".vtkhdf"


@dataclass(frozen=True, eq=False)
class Source:
    """Result file, or a case that is run when its response is first used."""

    path: Path
    overrides: tuple[str, ...] = ()

    @property
    def is_result(self) -> bool:
        """True for a result file, False for a case or a file of cams."""
        return self.path.suffix == _RESULT

    @cached_property
    def result(self) -> Result | None:
        """Result file; None for a case."""
        return read_result(self.path, empty=False) if self.is_result else None

    @cached_property
    def case(self) -> Case:
        """Case; of a result, the case stored in it."""
        return cli.load_case(self.path, self.overrides) if self.result is None else case_from_result(self.result)

    @cached_property
    def reloaded(self) -> tuple[PreparedRun, Response]:
        """Prepared run of the case, and its response with the fields of its unknowns."""
        return (self.ready, self.response) if self.result is None else reload_result(self.case, self.result)

    @cached_property
    def ready(self) -> PreparedRun:
        """Prepared run of the case."""
        return prepare(self.case) if self.result is None else self.reloaded[0]

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
        if self.is_result or has_mechanism(self.path):
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
    sources = [Source(path, tuple(overrides or ())) for path in paths]
    if overrides and any(source.is_result for source in sources):
        raise refuse("--set", overrides[0], "--set with a case only", "a result cannot be changed", "give the case")
    for source in sources:
        _ = source.result or (cams and source.cams_only) or source.case
    return sources


def name_sources(sources: Sequence[Source]) -> dict[str, Source]:
    """Return sources by a distinguishing name: empty for a single one, else file name with speed, or number."""
    if len(sources) == 1:
        return {"": sources[0]}
    names = [source.stem for source in sources]
    for i, source in enumerate(sources):
        if not source.cams_only:
            turns = source.case.turns
            names[i] += f", {shaft_name(turns)} {round(turns * source.case.speed / RPM, 9):g} rpm"
    return dict(zip(make_unique(names, [""] * len(names)), sources, strict=True))


def displayed_mechanism(
    source: Source, *, color: str | None = None, mode: int | None = None, angle: float | None = None
) -> tuple[Mechanism, Motion, str, int]:
    """Return the displayed mechanism, its motion, their title, and the index of the instant of an image.

    An image shows the instant at a cam angle, rad; without one full lift of a result, else the first instant.
    """
    from flexcam.plotting.scene.mechanism import build_mechanism
    from flexcam.plotting.scene.motion import case_motion, full_lift, mode_motion, result_motion

    case, result, title = source.case, source.result, source.case.title
    structure = build_structure(build_model(case))
    if mode is not None:
        if mode < 1:
            raise refuse("--mode", mode, "a whole number, at least 1, as flexcam modes counts them")
        modes = case_modes(case, mode).modes
        if mode > modes.shapes.shape[1]:
            raise refuse("--mode", mode, f"1 to {modes.shapes.shape[1]}, as flexcam modes counts them")
        if color not in (None, "displacement"):
            why = "the amplitude of a mode is arbitrary, so it has no stress"
            raise refuse("--color", repr(color), "displacement", why)
        motion = mode_motion(structure, modes.shapes[:, mode - 1], coloured=color is not None)
        title = f"{title}: mode {mode}, {modes.frequencies[mode - 1]:.4g} Hz"
    elif result is not None:
        motion = result_motion(structure, result, case.speed, color).last_revolution()
    else:
        motion, title = case_motion(structure, case.speed, color), f"{title}: rigid mechanism"
    still = 0 if angle is None else motion.nearest(angle)
    if angle is None and result is not None and mode is None:
        still = full_lift(case, result.response, motion.angle)
    return build_mechanism(structure), motion, title, still
