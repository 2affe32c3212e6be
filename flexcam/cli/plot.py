"""Command that draws results and cases: plot."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from cyclopts import Parameter

from flexcam.analysis.model_choice import evaluate_ladder
from flexcam.analysis.natural_modes import modes
from flexcam.analysis.preparation import scalar_probe
from flexcam.case.builder import build_model
from flexcam.case.case import Case
from flexcam.case.input_checks import check_shared_seat_load
from flexcam.cli.app import Json, Overrides, Overwrite, app, parse_quantity, speed_range
from flexcam.cli.arguments import Source, name_sources, open_sources
from flexcam.core.errors import Fault, InputError, refuse, suggest_name
from flexcam.core.units import shaft_name
from flexcam.dynamics import Response, Status
from flexcam.report.terminal import print_json, result_console, show_count
from flexcam.valvetrain import Cam, build_structure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from flexcam.plotting.histories import Abscissa

FigureKind = Literal["motion", "force", "energy", "svaj", "profile", "modes", "campbell", "waterfall", "work-precision"]


@dataclass(frozen=True)
class FigureOptions:
    """Sources and options of a figure.

    Parameters
    ----------
    sources
        Sources by distinguishing name.
    probe, channels, over, rigid, cam, angle, count
        Values of the options; None if not given.
    """

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
        return list(
            dict.fromkeys(told for one in ones for told in check_shared_seat_load(one.ready.model, one.case.speed))
        )


@app.command(
    help_prologue="""\
flexcam plot results/case.vtkhdf --rigid -o motion.pdf
flexcam plot slow.vtkhdf fast.vtkhdf --probe valve --over time
flexcam plot case.toml --what profile --angle 90deg
"""
)
def plot(
    files: Annotated[list[Path], Parameter(help="Results (.vtkhdf), or cases (.toml), which are run.")], *,
    what: Annotated[FigureKind, Parameter(help="What is drawn.")] = "motion",
    probe: Annotated[str | None, Parameter(help="Whose motion; the valve by default.")] = None,
    channels: Annotated[
        list[str] | None, Parameter("--channel", negative=(), help="Force or other channel; may be repeated.")
    ] = None,
    over: Annotated[Literal["angle", "time"] | None, Parameter(help="Cam angle by default.")] = None,
    rigid: Annotated[bool, Parameter(negative=(), help="Also the same mechanism with rigid members.")] = False,
    cam: Annotated[str | None, Parameter(help="svaj, profile: this cam alone.")] = None,
    angle: Annotated[str | None, Parameter(help="profile: cam angle at which it stands, such as '90 deg'.")] = None,
    count: Annotated[
        int | None, Parameter(help="modes: how many, 6 by default; campbell, waterfall: speeds, 9 by default.")
    ] = None,
    output: Annotated[Path | None, Parameter(["-o", "--output"], help="The picture: .svg, .png or .pdf.")] = None,
    overrides: Overrides = None, overwrite: Overwrite = False, as_json: Json = False,
) -> Status | None:  # fmt: skip
    """Draw runs, cams, modes or what cheaper models cost: motion and contact force over the cam angle by default.

    A run that ended early is drawn as far as it came.
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
    doubtful = asked.rigid_warnings()
    if as_json:
        print_json({"status": "ok", "files": [str(target)], "warnings": doubtful})
    else:
        result_console().print(str(target))
        for sentence in doubtful:
            result_console().print("\n" + sentence)
    return next((run.status for run in _own_runs(asked) if not run.status.ok), None)


def _own_runs(asked: FigureOptions) -> list[Response]:
    """Return the responses computed by this command."""
    return [one.response for one in asked.sources.values() if one.result is None and "response" in vars(one)]


_OF_CAMS = ("svaj", "profile")
_APPLIES = {
    "probe": ("motion", "waterfall", "work-precision"), "channel": ("motion", "force", "waterfall"),
    "rigid": ("motion", "force"), "over": ("motion", "force", "energy"), "cam": _OF_CAMS,
    "angle": ("profile",), "count": ("modes", "campbell", "waterfall"),
}  # fmt: skip


def _check_options(what: str, **options: object) -> None:
    """Raise an error for options without effect on this kind of figure."""
    faults = [
        Fault(f"--{name}", str(given), f"--what {' or '.join(_APPLIES[name])}", f"{what} does not have it", "")
        for name, given in options.items()
        if given is not None and what not in _APPLIES[name]
    ]
    if faults:
        raise InputError(faults)


def _motion(asked: FigureOptions) -> Figure:
    from flexcam.plotting.histories import contact_forces, motion_figure

    responses = asked.responses()
    channels = asked.channels if asked.channels is not None else contact_forces(asked.first.response)[:1]
    return motion_figure(
        responses, asked.probe or scalar_probe(asked.first.ready), channels, rigid=asked.rigid_responses(),
        over=asked.over or "angle", title=asked.title,
    )  # fmt: skip


def _force(asked: FigureOptions) -> Figure:
    from flexcam.plotting.histories import channel_figure, contact_forces

    responses, channels = asked.responses(), asked.channels or contact_forces(asked.first.response)
    if not channels:
        raise refuse("--what", "force", "a run with contacts", "this one has none", "name channels with --channel")
    return channel_figure(
        responses, channels, rigid=asked.rigid_responses(), over=asked.over or "angle", title=asked.title
    )


def _energy(asked: FigureOptions) -> Figure:
    from flexcam.plotting.histories import energy_figure

    responses = asked.responses()
    if not any(name.startswith("energy.") for one in responses.values() for name in one.channels):
        raise refuse("--what", "energy", "a run of flexible members", "a rigid model keeps no account of energy")
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
    cams = {name: one for name, one in _cams(source, asked.cam).items() if one.follower is not None}
    if not cams:
        why = f"{asked.cam or 'no cam of it'} has a profile" if asked.cam is None else f"{asked.cam!r} has no profile"
        raise refuse("--what", "profile", "a cam with a follower", why, "give the cam base_radius and follower")
    one = next(iter(cams.values()))
    turned = 0.0 if asked.angle is None else parse_quantity("--angle", asked.angle, "angle", "deg")
    if one.follower is None:
        raise refuse("--cam", repr(asked.cam), "a cam with a follower")
    return profile_figure(cam_profile(one.event, one.follower, count=720, turn=one.turn), angle=turned % math.tau)


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
    from flexcam.analysis.campbell import campbell
    from flexcam.plotting.figures import add_title
    from flexcam.plotting.spectra import campbell_figure

    case = _single_source(asked, "campbell").case
    scale = case.turns
    speeds = _speeds(asked, case)
    with show_count(len(speeds), "speeds") as shown:
        found = campbell(case, speeds, orders=range(1, _ORDERS + 1), advance=shown)
    return add_title(campbell_figure(found, scale, shaft_name(scale)), case.title)


def _waterfall(asked: FigureOptions) -> Figure:
    """Draw the orders of a motion and a force from 0.5 to 1.5 times the case's speed."""
    from flexcam.analysis.orders import waterfall
    from flexcam.cli.speeds import select_signals
    from flexcam.plotting.figures import add_title
    from flexcam.plotting.spectra import waterfall_figure

    case = _single_source(asked, "waterfall").case
    seen = select_signals(case, asked.channels, None if asked.probe is None else [asked.probe])
    scale, speeds = case.turns, _speeds(asked, case)
    with show_count(len(speeds), "speeds") as shown:
        found = waterfall(case, speeds, seen, _ORDERS, advance=shown)
    return add_title(waterfall_figure(found, scale, shaft_name(scale)), case.title)


_ORDERS = 24
"""Highest drawn order of the camshaft."""


def _speeds(asked: FigureOptions, case: Case) -> list[float]:
    """Return camshaft speeds, rad/s."""
    count = 9 if asked.count is None else asked.count
    return np.linspace(*speed_range(None, None, count, case.speed, case.turns), count).tolist()


def _work_precision(asked: FigureOptions) -> Figure:
    from flexcam.plotting.figures import add_title
    from flexcam.plotting.study_curves import work_precision_figure

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
