"""Command that draws results and cases: plot."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from cyclopts import Parameter

from flexcam.analysis.model_checks import shared
from flexcam.analysis.natural_modes import modes
from flexcam.analysis.preparation import scalar_probe
from flexcam.analysis.trade import trade
from flexcam.case.builder import build_model
from flexcam.case.case import Case
from flexcam.cli.app import Json, Overrides, Overwrite, app, quantity, speed_range
from flexcam.cli.arguments import Source, named, opened
from flexcam.core.errors import Fault, InputError, did_you_mean, refuse
from flexcam.core.units import shaft_name
from flexcam.dynamics import Response, Status
from flexcam.report.terminal import counting, out, print_json
from flexcam.valvetrain import Cam, build_structure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from flexcam.plotting.histories import Over

What = Literal["motion", "force", "energy", "svaj", "profile", "modes", "campbell", "waterfall", "work-precision"]


@dataclass(frozen=True)
class Asked:
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
    over: Over | None
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

    def rigid_ones(self) -> dict[str, Response]:
        """Return the rigid responses by name; empty if they are not requested."""
        return {name: one.rigid for name, one in self.sources.items()} if self.rigid else {}

    def rigid_doubts(self) -> list[str]:
        """Return sentences about the limits of a drawn rigid train."""
        ones = self.sources.values() if self.rigid else ()
        return list(dict.fromkeys(told for one in ones for told in shared(one.ready.model, one.case.speed)))


@app.command(
    help_prologue="""\
flexcam plot results/case.vtkhdf --rigid -o motion.pdf
flexcam plot slow.vtkhdf fast.vtkhdf --probe valve --over time
flexcam plot case.toml --what profile --angle 90deg
"""
)
def plot(
    files: Annotated[list[Path], Parameter(help="Results (.vtkhdf), or cases (.toml), which are run.")], *,
    what: Annotated[What, Parameter(help="What is drawn.")] = "motion",
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
    from flexcam.plotting.figures import free_for_picture, save_figure

    _only_what_applies(
        what, probe=probe, channel=channels, rigid=rigid or None, over=over, cam=cam, angle=angle, count=count
    )
    target = output or Path(f"{files[0].name.partition('.')[0] if files else 'flexcam'}-{what}.svg")
    free_for_picture(target, overwrite=overwrite)
    sources = named(opened(files, overrides, cams=what in _OF_CAMS))
    asked = Asked(sources, probe, channels, over, rigid, cam, angle, count)
    save_figure(_FIGURES[what](asked), target, overwrite=overwrite)
    doubtful = asked.rigid_doubts()
    if as_json:
        print_json({"status": "ok", "files": [str(target)], "warnings": doubtful})
    else:
        out().print(str(target))
        for sentence in doubtful:
            out().print("\n" + sentence)
    return next((run.status for run in _solved(asked) if not run.status.ok), None)


def _solved(asked: Asked) -> list[Response]:
    """Return the responses computed by this command."""
    return [one.response for one in asked.sources.values() if one.result is None and "response" in vars(one)]


_OF_CAMS = ("svaj", "profile")
_APPLIES = {
    "probe": ("motion", "waterfall", "work-precision"), "channel": ("motion", "force", "waterfall"),
    "rigid": ("motion", "force"), "over": ("motion", "force", "energy"), "cam": _OF_CAMS,
    "angle": ("profile",), "count": ("modes", "campbell", "waterfall"),
}  # fmt: skip


def _only_what_applies(what: str, **options: object) -> None:
    """Raise an error for options without effect on this kind of figure."""
    faults = [
        Fault(f"--{name}", str(given), f"--what {' or '.join(_APPLIES[name])}", f"{what} does not have it", "")
        for name, given in options.items()
        if given is not None and what not in _APPLIES[name]
    ]
    if faults:
        raise InputError(faults)


def _motion(asked: Asked) -> Figure:
    from flexcam.plotting.histories import contact_forces, motion_figure

    responses = asked.responses()
    channels = asked.channels if asked.channels is not None else contact_forces(asked.first.response)[:1]
    return motion_figure(
        responses, asked.probe or scalar_probe(asked.first.ready), channels, rigid=asked.rigid_ones(),
        over=asked.over or "angle", title=asked.title,
    )  # fmt: skip


def _force(asked: Asked) -> Figure:
    from flexcam.plotting.histories import channel_figure, contact_forces

    responses, channels = asked.responses(), asked.channels or contact_forces(asked.first.response)
    if not channels:
        raise refuse("--what", "force", "a run with contacts", "this one has none", "name channels with --channel")
    return channel_figure(responses, channels, rigid=asked.rigid_ones(), over=asked.over or "angle", title=asked.title)


def _energy(asked: Asked) -> Figure:
    from flexcam.plotting.histories import energy_figure

    responses = asked.responses()
    if not any(name.startswith("energy.") for one in responses.values() for name in one.channels):
        raise refuse("--what", "energy", "a run of flexible members", "a rigid model keeps no account of energy")
    return energy_figure(responses, over=asked.over or "angle", title=asked.title)


def _svaj(asked: Asked) -> Figure:
    from flexcam.plotting.curves import lift_figure
    from flexcam.plotting.figures import titled

    events = {
        ", ".join(filter(None, (name, cam))): one.event
        for name, source in asked.sources.items()
        for cam, one in _cams(source, asked.cam).items()
    }
    return titled(lift_figure(events), asked.first.subject if len(asked.sources) == 1 else "")


def _profile(asked: Asked) -> Figure:
    from flexcam.cams import cam_profile
    from flexcam.plotting.curves import profile_figure

    source = _single(asked, "profile")
    cams = {name: one for name, one in _cams(source, asked.cam).items() if one.follower is not None}
    if not cams:
        why = f"{asked.cam or 'no cam of it'} has a profile" if asked.cam is None else f"{asked.cam!r} has no profile"
        raise refuse("--what", "profile", "a cam with a follower", why, "give the cam base_radius and follower")
    one = next(iter(cams.values()))
    turned = 0.0 if asked.angle is None else quantity("--angle", asked.angle, "angle", "deg")
    if one.follower is None:
        raise refuse("--cam", repr(asked.cam), "a cam with a follower")
    return profile_figure(cam_profile(one.event, one.follower, count=720, turn=one.turn), angle=turned % math.tau)


def _modes(asked: Asked) -> Figure:
    from flexcam.plotting.spectra import mode_figure

    count = 6 if asked.count is None else asked.count
    if count < 1:
        raise refuse("--count", count, "a whole number from 1")
    case = _single(asked, "modes").case
    structure = build_structure(build_model(case))
    return mode_figure(structure, modes(case, count), title=case.title)


def _campbell(asked: Asked) -> Figure:
    """Draw modes and orders from 0.5 to 1.5 times the case's speed."""
    from flexcam.analysis.campbell import campbell
    from flexcam.plotting.figures import titled
    from flexcam.plotting.spectra import campbell_figure

    case = _single(asked, "campbell").case
    scale = case.turns
    speeds = _speeds(asked, case)
    with counting(len(speeds), "speeds") as shown:
        found = campbell(case, speeds, orders=range(1, _ORDERS + 1), advance=shown)
    return titled(campbell_figure(found, scale, shaft_name(scale)), case.title)


def _waterfall(asked: Asked) -> Figure:
    """Draw the orders of a motion and a force from 0.5 to 1.5 times the case's speed."""
    from flexcam.analysis.orders import waterfall
    from flexcam.cli.speeds import signals
    from flexcam.plotting.figures import titled
    from flexcam.plotting.spectra import waterfall_figure

    case = _single(asked, "waterfall").case
    seen = signals(case, asked.channels, None if asked.probe is None else [asked.probe])
    scale, speeds = case.turns, _speeds(asked, case)
    with counting(len(speeds), "speeds") as shown:
        found = waterfall(case, speeds, seen, _ORDERS, advance=shown)
    return titled(waterfall_figure(found, scale, shaft_name(scale)), case.title)


_ORDERS = 24
"""Highest drawn order of the camshaft."""


def _speeds(asked: Asked, case: Case) -> list[float]:
    """Return camshaft speeds, rad/s."""
    count = 9 if asked.count is None else asked.count
    return np.linspace(*speed_range(None, None, count, case.speed, case.turns), count).tolist()


def _work_precision(asked: Asked) -> Figure:
    from flexcam.plotting.figures import titled
    from flexcam.plotting.study_curves import work_precision_figure

    source = _single(asked, "work-precision")
    probe = asked.probe or scalar_probe(source.ready)
    return titled(work_precision_figure(trade(source.case, probe, repeats=1)[1]), source.title)


_FIGURES: Mapping[str, Callable[[Asked], Figure]] = {
    "motion": _motion, "force": _force, "energy": _energy, "svaj": _svaj, "profile": _profile, "modes": _modes,
    "campbell": _campbell, "waterfall": _waterfall, "work-precision": _work_precision,
}  # fmt: skip


def _single(asked: Asked, what: str) -> Source:
    if len(asked.sources) > 1:
        raise refuse("--what", what, "one file", f"{len(asked.sources)} were given")
    return asked.first


def _cams(source: Source, name: str | None) -> Mapping[str, Cam]:
    """Return the cams of a source, or the requested one."""
    cams = source.cams
    known: Sequence[str] = list(cams)
    if name is not None and name not in cams:
        raise refuse("--cam", repr(name), ", ".join(known), "", did_you_mean(name, known))
    if not cams:
        raise refuse("cams", "none", "a case with cams")
    return cams if name is None else {name: cams[name]}
