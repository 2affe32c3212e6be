"""Command that draws results and cases: plot."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from cyclopts import Parameter

from flexcam.analysis.cam_analysis import CamSet, load_cams
from flexcam.analysis.model_choice import evaluate_ladder
from flexcam.analysis.natural_modes import modes
from flexcam.analysis.preparation import PreparedRun, driven_probe, prepare, scalar_probe
from flexcam.analysis.run import reload_result
from flexcam.case.builder import build_model
from flexcam.case.case import Case
from flexcam.case.input_checks import check_shared_seat_load
from flexcam.case.reader import case_from_result, has_mechanism
from flexcam.cli import app as cli
from flexcam.core.errors import Fault, InputError, refuse, suggest_name
from flexcam.core.units import to_display_unit
from flexcam.dynamics import Response, Status, reraise_interrupt, solve
from flexcam.io import Result, read_result
from flexcam.report.terminal import make_unique, show_progress
from flexcam.valvetrain import Cam, build_structure, driving_contact

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from flexcam.cams import CamProfile
    from flexcam.core import FloatArray
    from flexcam.plotting.histories import Abscissa

_RESULT = ".vtkhdf"


@dataclass(frozen=True, eq=False)
class Source:
    """Result file, or a case that is run when its response is first used."""

    path: Path
    overrides: tuple[str, ...] = ()

    @cached_property
    def result(self) -> Result | None:
        """Result file; None for a case."""
        return read_result(self.path) if self.path.suffix == _RESULT else None

    @cached_property
    def case(self) -> Case:
        """Case; of a result, the case stored in it."""
        return cli.load_case(self.path, self.overrides) if self.result is None else case_from_result(self.result)

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
        if self.path.suffix == _RESULT or has_mechanism(self.path):
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
    if overrides and any(path.suffix == _RESULT for path in paths):
        raise refuse("--set", overrides[0], "--set with a case only", "a result cannot be changed", "give the case")
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


FigureKind = Literal["motion", "force", "energy", "svaj", "profile", "modes", "campbell", "waterfall", "work-precision"]


@dataclass(frozen=True)
class FigureOptions:
    """Sources and options of a figure."""

    sources: Mapping[str, Source]
    probe: str | None
    channels: list[str] | None
    over: Abscissa | None
    rigid: bool
    cam: str | None
    angle: str | None
    count: int | None

    @property
    def first(self) -> Source:
        """The first source."""
        return next(iter(self.sources.values()))

    @property
    def title(self) -> str:
        """Title of a figure with a single source."""
        return self.first.title if len(self.sources) == 1 else ""

    def responses(self) -> dict[str, Response]:
        """Return the responses by name; the name of a single run is empty."""
        return {name: one.response for name, one in self.sources.items()}

    def rigid_responses(self) -> dict[str, Response]:
        """Return the rigid responses by name; empty if they are not requested."""
        return {name: one.rigid for name, one in self.sources.items()} if self.rigid else {}

    def rigid_warnings(self) -> list[str]:
        """Return sentences about the limits of a drawn rigid train."""
        ones = self.sources.values() if self.rigid else ()
        found = [check_shared_seat_load(one.ready.model, one.case.speed) for one in ones]
        return list(dict.fromkeys(chain.from_iterable(found)))


@cli.app.command(
    help_prologue="""\
flexcam plot results/case.vtkhdf --rigid -o motion.pdf
flexcam plot slow.vtkhdf fast.vtkhdf --probe valve --over time
flexcam plot case.toml --what profile --angle 90deg
flexcam plot results/case.vtkhdf --what profile --channel contacts.intake.pressure
"""
)
def plot(
    files: Annotated[list[Path], Parameter(help="Result files (.vtkhdf), or case files (.toml), which are run.")], *,
    what: Annotated[FigureKind, Parameter(help="Kind of figure; svaj: lift and its derivatives.")] = "motion",
    probe: Annotated[str | None, Parameter(
        help="motion, waterfall, work-precision: point or component; the valve by default.")] = None,
    channels: Annotated[list[str] | None, Parameter(
        "--channel", help="motion, force, waterfall: force or other channel, repeatable; profile: channel "
        "that colours the cam.")] = None,
    over: Annotated[Literal["angle", "time"] | None, Parameter(
        help="motion, force, energy: abscissa; cam angle by default.")] = None,
    rigid: Annotated[bool, Parameter(help="motion, force: also draw the rigid model.")] = False,
    cam: Annotated[str | None, Parameter(help="svaj, profile: draw this cam only.")] = None,
    angle: Annotated[str | None, Parameter(help="profile: cam angle at which it is drawn, such as '90 deg'.")] = None,
    count: Annotated[int | None, Parameter(
        help="modes: number of modes, 6 by default; campbell, waterfall: number of speeds, 9 by default.")] = None,
    output: Annotated[Path | None, Parameter(
        ["-o", "--output"], help="File of the figure (.svg, .png or .pdf).")] = None,
    overrides: cli.Overrides = None, overwrite: cli.Overwrite = False, as_json: cli.Json = False,
) -> Status | None:  # fmt: skip
    """Draw a figure of results or cases: motion, forces, energy, cams, modes, orders, or error over run time.

    By default it draws motion and contact force over the cam angle. A run that ended early is drawn as far as it came.
    """
    from flexcam.plotting.figures import check_figure_path, save_figure

    _check_options(
        what, probe=probe, channel=channels, rigid=rigid or None, over=over, cam=cam, angle=angle, count=count
    )
    target = output or Path(f"{files[0].name.partition('.')[0] if files else 'flexcam'}-{what}.svg")
    check_figure_path(target, overwrite=overwrite)
    sources = name_sources(open_sources(files, overrides, cams=what in _OF_CAMS))
    asked = FigureOptions(sources, probe, channels, over, rigid, cam, angle, count)
    save_figure(_FIGURES[what](asked), target, overwrite=overwrite)
    warnings = asked.rigid_warnings()
    cli.write_output(cli.CommandOutput(warnings, {"warnings": warnings}), as_json=as_json, written=[target])
    own = [one.response for one in asked.sources.values() if one.result is None and "response" in vars(one)]
    return next((run.status for run in own if not run.status.ok), None)


_OF_CAMS = ("svaj", "profile")
_APPLIES = {
    "probe": ("motion", "waterfall", "work-precision"), "channel": ("motion", "force", "profile", "waterfall"),
    "rigid": ("motion", "force"), "over": ("motion", "force", "energy"), "cam": _OF_CAMS,
    "angle": ("profile",), "count": ("modes", "campbell", "waterfall"),
}  # fmt: skip


def _check_options(what: str, **options: object) -> None:
    """Raise an error for options without effect on this kind of figure."""
    faults = [
        Fault(
            f"--{name}",
            str(given),
            "",
            f"--what {what} has no --{name}",
            f"use it with --what {' or '.join(_APPLIES[name])}",
        )
        for name, given in options.items()
        if given is not None and what not in _APPLIES[name]
    ]
    if faults:
        raise InputError(faults)


def _motion(asked: FigureOptions) -> Figure:
    from flexcam.plotting.histories import contact_forces, motion_figure

    lifted = driven_probe(asked.first.ready, asked.probe)
    probe = lifted.component if lifted else asked.probe or scalar_probe(asked.first.ready)
    contact = lifted.contact if lifted else driving_contact(asked.first.ready.model, probe.partition(".")[0])
    forces = contact_forces(asked.first.response)
    own = [name for name in forces if name == f"contacts.{contact}.force"]
    return motion_figure(
        asked.responses(), probe, (own or forces)[:1] if asked.channels is None else asked.channels,
        rigid=asked.rigid_responses(), over=asked.over or "angle", title=asked.title,
        lift=lifted.name if lifted else "", sign=lifted.sign if lifted else 1.0,
    )  # fmt: skip


def _force(asked: FigureOptions) -> Figure:
    from flexcam.plotting.histories import channel_figure, contact_forces

    responses, channels = asked.responses(), asked.channels or contact_forces(asked.first.response)
    if not channels:
        raise refuse("--what", "force", "a run with contacts", "this run has none", "name channels with --channel")
    return channel_figure(
        responses, channels, rigid=asked.rigid_responses(), over=asked.over or "angle", title=asked.title
    )


def _energy(asked: FigureOptions) -> Figure:
    from flexcam.plotting.histories import energy_figure

    responses = asked.responses()
    if not any(name.startswith("energy.") for one in responses.values() for name in one.channels):
        raise refuse("--what", "energy", "a run of flexible members", "a rigid model has no energy balance")
    return energy_figure(responses, over=asked.over or "angle", title=asked.title)


def _svaj(asked: FigureOptions) -> Figure:
    from flexcam.plotting.curves import lift_figure
    from flexcam.plotting.figures import add_title

    events = {
        ", ".join(filter(None, (name, cam))): one.event
        for name, source in asked.sources.items()
        for cam, one in _cams(source, asked.cam).items()
    }
    return add_title(lift_figure(events), asked.first.subject if len(asked.sources) == 1 else "")


def _profile(asked: FigureOptions) -> Figure:
    from flexcam.cams import cam_profile
    from flexcam.plotting.curves import profile_figure

    source = _single_source(asked, "profile")
    cam = asked.cam if asked.channels is None else _cam_of_channel(source, asked, asked.channels)
    cams = {name: one for name, one in _cams(source, cam).items() if one.follower is not None}
    if not cams:
        why = f"{cam or 'no cam of it'} has a profile" if cam is None else f"{cam!r} has no profile"
        raise refuse("--what", "profile", "a cam with a follower", why, "give the cam base_radius and follower")
    one = next(iter(cams.values()))
    turned = 0.0 if asked.angle is None else cli.parse_quantity("--angle", asked.angle, "angle", "deg")
    if one.follower is None:
        raise refuse("--cam", repr(asked.cam), "a cam with a follower")
    profile = cam_profile(one.event, one.follower, count=720, turn=one.turn)
    coloured = None if asked.channels is None else _profile_values(source, profile, asked.channels[0])
    return profile_figure(profile, angle=turned % math.tau, coloured=coloured)


def _cam_of_channel(source: Source, asked: FigureOptions, channels: Sequence[str]) -> str:
    """Return the cam whose profile a channel colours."""
    if source.cams_only is not None:
        raise refuse("--channel", channels[0], "a result, or a case with contacts", "a file of cams is not run")
    contacts = source.ready.model.cam_contacts
    contact = channels[0].partition(".")[2].rpartition(".")[0]
    if len(channels) > 1 or contact not in contacts:
        known = ", ".join(f"contacts.{name}.force" for name in contacts) or "(there is none)"
        allowed = f"one channel of a cam's contact, such as {known}"
        raise refuse("--channel", ", ".join(channels), allowed, "it colours the profile of that cam")
    cam = contacts[contact].cam
    if asked.cam not in (None, cam):
        raise refuse("--cam", repr(asked.cam), repr(cam), "it is the cam of the channel", "leave --cam out")
    return cam


def _profile_values(source: Source, profile: CamProfile, channel: str) -> tuple[CamProfile, FloatArray, str]:
    """Return the profile at the instants of the last revolution, the values of a channel and their label."""
    from flexcam.cams import profile_at
    from flexcam.plotting.histories import channel_unit, short_name

    response = source.response
    unit, last = channel_unit(response, channel), response.latest(source.ready.revolution)
    values, (factor, symbol) = response.channels[channel][last], to_display_unit(unit)
    if unit == "m" and float(np.abs(values).max(initial=0.0)) < _THIN:
        factor, symbol = 1e6, "µm"
    touched = profile_at(profile.event, profile.follower, response.angle[last], profile.turn)
    return touched, factor * values, ", ".join(filter(None, (short_name(channel), symbol)))


_THIN = 1e-4  # length, m, up to which lengths are drawn in micrometres


def _modes(asked: FigureOptions) -> Figure:
    from flexcam.plotting.spectra import mode_figure

    count = 6 if asked.count is None else asked.count
    if count < 1:
        raise refuse("--count", count, "a whole number from 1")
    case = _single_source(asked, "modes").case
    structure = build_structure(build_model(case))
    return mode_figure(structure, modes(case, count), title=case.title)


def _campbell(asked: FigureOptions) -> Figure:
    """Draw modes and orders from 0.5 to 1.5 times the case's speed."""
    from flexcam.cli.campbell import modes_over_speed

    case = _single_source(asked, "campbell").case
    return modes_over_speed(case, _speeds(asked, case), range(1, _ORDERS + 1))[0].figure()


def _waterfall(asked: FigureOptions) -> Figure:
    """Draw the orders of a motion and a force from 0.5 to 1.5 times the case's speed."""
    from flexcam.cli.campbell import orders_of_response, select_signals

    case = _single_source(asked, "waterfall").case
    seen = select_signals(case, asked.channels, None if asked.probe is None else [asked.probe])
    return orders_of_response(case, _speeds(asked, case), seen, _ORDERS)[0].figure()


_ORDERS = 24  # highest drawn order of the camshaft


def _speeds(asked: FigureOptions, case: Case) -> list[float]:
    return cli.spaced_speeds(None, None, 9 if asked.count is None else asked.count, case)


def _work_precision(asked: FigureOptions) -> Figure:
    from flexcam.plotting.figures import add_title
    from flexcam.plotting.histories import work_precision_figure

    source = _single_source(asked, "work-precision")
    probe = asked.probe or scalar_probe(source.ready)
    return add_title(work_precision_figure(evaluate_ladder(source.case, probe, repeats=1)[1]), source.title)


_FIGURES: Mapping[str, Callable[[FigureOptions], Figure]] = {
    "motion": _motion, "force": _force, "energy": _energy, "svaj": _svaj, "profile": _profile, "modes": _modes,
    "campbell": _campbell, "waterfall": _waterfall, "work-precision": _work_precision,
}  # fmt: skip


def _single_source(asked: FigureOptions, what: str) -> Source:
    if len(asked.sources) > 1:
        raise refuse("--what", what, "one file", f"{len(asked.sources)} were given")
    return asked.first


def _cams(source: Source, name: str | None) -> Mapping[str, Cam]:
    """Return the cams of a source, or the requested one."""
    cams = source.cams
    known: Sequence[str] = list(cams)
    if name is not None and name not in cams:
        raise refuse("--cam", repr(name), ", ".join(known), "", suggest_name(name, known))
    if not cams:
        raise refuse("cams", "none", "a case with cams")
    return cams if name is None else {name: cams[name]}
