"""Command that draws results and cases: plot."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from itertools import chain, combinations, cycle
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, get_args

import numpy as np
from cyclopts import Parameter
from numpy.typing import NDArray

from flexcam import plotting
from flexcam.analysis.cam_analysis import CamFacts, cam_facts, case_cams, cylinders
from flexcam.analysis.natural_modes import modes
from flexcam.analysis.orders import run_over_speeds
from flexcam.analysis.preparation import driven_probe, scalar_probe
from flexcam.analysis.run import member_strength
from flexcam.analysis.run_metrics import compute_metrics
from flexcam.cams import CamProfile, cam_profile, profile_at
from flexcam.case.builder import build_model
from flexcam.case.input_checks import check_shared_seat_load
from flexcam.cli import app as cli
from flexcam.cli.sources import Source, name_sources, open_sources
from flexcam.core import FloatArray
from flexcam.core.errors import Fault, InputError, refuse, suggest_name
from flexcam.core.units import RPM, shaft_name, shaft_speed, to_display_unit
from flexcam.dynamics import Response, Status
from flexcam.io.sweep_table import read_table, unknown_scalar_fault
from flexcam.report.terminal import show_count
from flexcam.valvetrain import Cam, Spring, build_structure, contact_loss, driving_contact, spring_held_contacts
from flexcam.valvetrain.springs import has_channels, spring_curve

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_TABLES = (".h5", ".csv")

FigureKind = Literal[
    "motion", "force", "torque", "energy", "orbits", "svaj", "profile", "spring", "goodman", "modes", "map", "sweep",
]  # fmt: skip
_OF_CAMS = ("svaj", "profile")
_OF_ONE_FILE = ("profile", "spring", "goodman", "modes")
# Kinds of figures to which an option applies
_APPLIES = {
    "probe": ("motion",),
    "channel": ("motion", "force", "torque", "profile", "spring", "map"),
    "rigid": ("motion", "force", "torque"), "over": ("motion", "force", "torque", "energy"), "cam": _OF_CAMS,
    "angle": ("profile",), "count": ("modes", "map"), "x": ("sweep",), "y": ("sweep",),
    "map": ("sweep",), "set": tuple(kind for kind in get_args(FigureKind) if kind != "sweep"),
    "units": tuple(kind for kind in get_args(FigureKind) if kind != "orbits"),
}  # fmt: skip

_OPEN_LIFT = 1e-4  # lift above which a valve counts as open for the overlap, m
_OVERLAP = "valve overlap, both open by 0.1 mm"
_LOST = "lost"  # name of the channel of contact loss
_THIN = 1e-4  # length, m, up to which lengths are drawn in micrometres


@dataclass(frozen=True)
class FigureOptions:
    """Options of a figure, and its sources."""

    # fmt: off
    files: Annotated[list[Path], Parameter(help="Result files (.vtkhdf), case files (.toml), which flexcam runs, or "
        "the table of a sweep (.h5 or .csv).")]
    _: KW_ONLY
    what: Annotated[FigureKind | None, Parameter(
        help="Kind of figure; by default motion, or sweep for the table of a sweep. svaj: lift and its "
        "derivatives; orbits: journals in their oil films; map: a channel over cam angle and speed.")] = None
    probe: Annotated[str | None, Parameter(
        help=f"--what motion: point or component; {cli.DEFAULT_PROBE}.")] = None
    channels: Annotated[list[str] | None, Parameter(
        "--channel", help="--what motion, force, torque: force or other channel, repeatable; profile, map: "
        "channel shown by colours; spring: force of the spring.")] = None
    over: Annotated[Literal["angle", "time", "crank"] | None, Parameter(
        help="--what motion, force, torque, energy: abscissa; angle (cam angle) by default. crank: the last revolution "
        "over crank angle, with zero at top dead centre if the cam has the key tdc, otherwise at cam angle 0.")] = None
    rigid: Annotated[bool, Parameter(
        help="--what motion, force, torque: also draw the rigid model, and for motion the difference from it.")] = False
    cam: Annotated[str | None, Parameter(help="--what svaj, profile: draw only this cam.")] = None
    angle: Annotated[str | None, Parameter(
        help="--what profile: cam angle at which it is drawn, such as '90 deg'.")] = None
    count: Annotated[int | None, Parameter(
        help="--what modes: number of modes, 6 by default; map: number of speeds, 9 by "
        "default.")] = None
    x: Annotated[str | None, Parameter("--x", help="--what sweep: abscissa; the first varied key by default.")] = None
    y: Annotated[list[str] | None, Parameter(
        "--y", help="--what sweep: result value or other column, repeatable.")] = None
    as_map: Annotated[bool, Parameter("--map", help="--what sweep: contours over both varied keys.")] = False
    sources: Annotated[Mapping[str, Source], Parameter(parse=False)] = field(default_factory=dict[str, Source])
    # fmt: on

    @property
    def first(self) -> Source:
        """The first source."""
        return next(iter(self.sources.values()))

    @property
    def title(self) -> str:
        """Title of a figure with a single source."""
        return self.first.title if len(self.sources) == 1 else ""

    def responses(self) -> dict[str, Response]:
        """Return the drawn responses by name; the name of a single run is empty."""
        return {name: self.draw(source, source.response) for name, source in self.sources.items()}

    def rigid_responses(self) -> dict[str, Response]:
        """Return the drawn rigid responses by name; empty if they are not requested."""
        return {name: self.draw(source, source.rigid) for name, source in self.sources.items()} if self.rigid else {}

    def draw(self, source: Source, response: Response) -> Response:
        """Return a response, or its last revolution over the crank angle and of several runs."""
        tdc = self.tdc(source) if self.over == "crank" else None
        if tdc is not None:
            return plotting.histories.last_revolution(response, tdc, -math.pi)
        whole = self.over != "crank" and (len(self.sources) == 1 or self.over == "time")
        return response if whole else plotting.histories.last_revolution(response)

    def contact(self, source: Source) -> str | None:
        """Return the cam contact that drives the probe, or the first one."""
        model, point = source.ready.model, (self.probe or "").partition(".")[0]
        lifted = driven_probe(source.ready, point or None) if model.probes else None
        contact = lifted.contact if lifted else driving_contact(model, point) if point else None
        return contact or next(iter(model.cam_contacts), None)

    def tdc(self, source: Source) -> float | None:
        """Return the cam angle at top dead centre, rad, of the cam that drives the probe; None if not given."""
        contact, model = self.contact(source), source.ready.model
        return None if contact is None else source.case.record.cams[model.cam_contacts[contact].cam].tdc


@cli.command("""\
flexcam plot results/case.vtkhdf --rigid -o motion.pdf
flexcam plot slow.vtkhdf fast.vtkhdf --probe valve --over crank
flexcam plot results/case.sweep.h5 --x run.crank_speed --y deviation.peak
flexcam plot case.toml --what profile --angle 90deg
flexcam plot results/case.vtkhdf --what profile --channel contacts.intake.pressure
""")
def plot(
    asked: Annotated[FigureOptions, Parameter("*")], *,
    output: Annotated[Path | None, Parameter(
        ["-o", "--output"], help="File of the figure (.svg, .png or .pdf); by default NAME-WHAT.svg in "
        "the current folder, such as case-motion.svg.")] = None,
    overrides: cli.Overrides = None, units: cli.Units = None, overwrite: cli.Overwrite = False,
    as_json: cli.Json = False,
) -> cli.CommandOutput:  # fmt: skip
    """Draw a figure of results, cases or sweeps: motion, forces, cams, springs, modes, orders, maps.

    By default it draws motion and contact force over the cam angle. For an incomplete run it draws the completed part.
    """
    files = asked.files
    what = asked.what or ("sweep" if files and files[0].suffix in _TABLES else "motion")
    values = vars(asked) | {"channel": asked.channels, "map": asked.as_map, "set": overrides, "units": units}
    faults = [
        Fault(f"--{name}", str(values[name]), "", f"--what {what} has no --{name}",
              f"use it with --what {' or '.join(kinds)}")
        for name, kinds in _APPLIES.items()
        if what not in kinds and values[name] is not None and values[name] is not False
    ]  # fmt: skip
    if faults:
        raise InputError(faults)
    if units and any(path.suffix == ".csv" for path in files):
        raise refuse("--units", units, "the .h5 table of the sweep", "a CSV table has its own units")
    if what != "sweep" and any(path.suffix in _TABLES for path in files):
        why, remedy = "a .csv or .h5 file must be the table of a sweep", "for a lift table, give the case that uses it"
        raise refuse("--what", what, "sweep", why, remedy)
    target = output or Path(f"{files[0].name.partition('.')[0] if files else 'flexcam'}-{what}.svg")
    plotting.figures.check_figure_path(target, overwrite=overwrite)
    sources = {} if what == "sweep" else name_sources(open_sources(files, overrides, cams=what in _OF_CAMS))
    if what in _OF_ONE_FILE and len(sources) > 1:
        raise refuse("--what", what, "one file", f"{len(sources)} were given")
    figure = _FIGURES[what](replace(asked, what=what, sources=sources))
    plotting.figures.save_figure(figure, target, overwrite=overwrite)
    trains = [source.ready.model for source in sources.values()] if asked.rigid else []
    warnings = list(dict.fromkeys(chain.from_iterable(map(check_shared_seat_load, trains))))
    statuses = [s.response.status for s in sources.values() if s.result is None and "response" in vars(s)]
    failed = next((status for status in statuses if not status.ok), Status())
    return cli.CommandOutput(warnings, {"status": "ok", "warnings": warnings}, files=[target], status=failed)


def _motion(options: FigureOptions) -> Figure:
    lifted = driven_probe(options.first.ready, options.probe)
    probe = lifted.component if lifted else options.probe or scalar_probe(options.first.ready)
    forces, responses = plotting.histories.contact_forces(options.first.response), options.responses()
    driving = [f"contacts.{options.contact(source)}.force" for source in options.sources.values()]
    saved = [name for name in dict.fromkeys(driving) if any(name in run.channels for run in responses.values())]
    over = options.over or "angle"
    figure = plotting.histories.motion_figure(
        responses, probe, (saved or forces[:1]) if options.channels is None else options.channels,
        rigid=options.rigid_responses(), over=over, title=options.title, lift=lifted.name if lifted else "",
        sign=lifted.sign if lifted else 1.0, deviation=options.rigid,
    )  # fmt: skip
    colours = plotting.figures.COLOURS
    for (name, source), colour in zip(options.sources.items(), cycle((colours[4], *colours[1:4])), strict=False):
        contact, model, response = options.contact(source), source.ready.model, responses[name]
        if contact in spring_held_contacts(model) and f"contacts.{contact}.force" in response.channels:
            label = ", ".join(filter(None, (name, "contact lost during the lift")))
            channels = {_LOST: contact_loss(model, source.response, str(contact)).astype(float)}
            shaded = options.draw(source, replace(source.response, channels=channels)).channels[_LOST] > 0.0
            plotting.histories.shade(figure.axes, plotting.histories.abscissa(response, over), shaded, label, colour)
    return _mark_areas(options, figure)


def _mark_areas(options: FigureOptions, figure: Figure) -> Figure:
    """Mark dead centres and valve overlap over the crank angle, as far as a tdc is given, and name shaded areas."""
    tdc = options.tdc(options.first) if options.over == "crank" else None
    if tdc is not None:
        plotting.curves.mark_dead_centres(figure.axes)
        crank = np.linspace(-2.0 * math.pi, 2.0 * math.pi, 1441)
        plotting.histories.shade(figure.axes, np.degrees(crank), _valve_overlap(options, tdc, crank), _OVERLAP, "black")
    return plotting.histories.add_area_legend(figure)


def _valve_overlap(options: FigureOptions, tdc: float, crank: FloatArray) -> NDArray[np.bool_]:
    """Return at which crank angles from a top dead centre, rad, exhaust and intake of its cylinder are both open.

    A phaser has the position of the last revolution.
    """
    facts, opened = dict[str, CamFacts](), dict[str, NDArray[np.bool_]]()
    for name, source in options.sources.items():
        cams, end = case_cams(source.case), float(source.response.angle.max(initial=0.0))
        angle = end - np.mod(end - tdc - 0.5 * crank, math.tau)  # in the last revolution
        for key, cam in cams.cams.items():
            lobe = cam_facts(cam, ratio=cams.ratios[key], lash=cams.lashes[key], tdc=cams.tdcs[key])
            facts[f"{name} {key}"], opened[f"{name} {key}"] = lobe, lobe.valve_lift(cam.lift(angle, 0)) > _OPEN_LIFT
    cylinder = next(cylinder for cylinder in cylinders(facts) if any(lobe.tdc == tdc for lobe in cylinder.values()))
    both = np.zeros(len(crank), dtype=bool)
    for first, second in combinations(cylinder, 2):
        both |= opened[first] & opened[second] & cylinder[first].may_overlap(cylinder[second])
    return both


def _force(options: FigureOptions) -> Figure:
    runs, first = options.responses(), options.first.response
    torques = [name for name in first.channels if name.endswith(".torque")]
    channels = options.channels or (torques if options.what == "torque" else plotting.histories.contact_forces(first))
    if not channels:
        allowed = "a run with contacts" if options.what == "force" else "a run with cams"
        raise refuse("--what", str(options.what), allowed, "this run has none", "name channels with --channel")
    means = {
        name: {m.name.removesuffix(".mean"): m.value for m in compute_metrics(source.ready, source.response)}
        for name, source in options.sources.items()
        if options.what == "torque"
    }
    figure = plotting.histories.channel_figure(
        runs, channels, rigid=options.rigid_responses(), over=options.over or "angle", title=options.title, means=means
    )
    return _mark_areas(options, figure)


def _energy(options: FigureOptions) -> Figure:
    responses = options.responses()
    if not any(name.startswith("energy.") for response in responses.values() for name in response.channels):
        raise refuse("--what", "energy", "a run of the flexible model", "a rigid model has no energy balance")
    figure = plotting.histories.energy_figure(responses, over=options.over or "angle", title=options.title)
    return _mark_areas(options, figure)


def _orbits(options: FigureOptions) -> Figure:
    responses = {name: plotting.histories.last_revolution(source.response) for name, source in options.sources.items()}
    channels = (name for name in options.first.response.channels if name.endswith(".eccentricity"))
    bearings = [name.removesuffix(".eccentricity") for name in channels]
    if not bearings:
        why = "orbits need a run of the flexible model with an oil film in a bearing (bearings.NAME.film)"
        raise refuse("--what", "orbits", "", why)
    return plotting.histories.orbit_figure(responses, bearings)


def _svaj(options: FigureOptions) -> Figure:
    events = {
        ", ".join(filter(None, (name, key))): cam.event
        for name, source in options.sources.items()
        for key, cam in _cams(source, options.cam).items()
    }
    title = options.first.subject if len(options.sources) == 1 else ""
    return plotting.figures.add_title(plotting.curves.lift_figure(events), title)


def _profile(options: FigureOptions) -> Figure:
    source = options.first
    cam_name = options.cam if options.channels is None else _cam_of_channel(source, options, options.channels)
    cam = next((cam for cam in _cams(source, cam_name).values() if cam.follower is not None), None)
    if cam is None or cam.follower is None:
        why = "no cam of it has a profile" if cam_name is None else f"{cam_name!r} has no profile"
        raise refuse("--what", "profile", "a cam with a follower", why, "give the cam base_radius and follower")
    angle = 0.0 if options.angle is None else cli.parse_quantity("--angle", options.angle, "angle", "deg")
    profile = cam_profile(cam.event, cam.follower, count=720, turn=cam.turn)
    coloured = None if options.channels is None else _profile_values(source, cam, profile, options.channels[0])
    return plotting.curves.profile_figure(profile, angle=angle % math.tau, coloured=coloured)


def _cam_of_channel(source: Source, options: FigureOptions, channels: Sequence[str]) -> str:
    if source.cams_only is not None:
        raise refuse("--channel", channels[0], "a result, or a case with contacts", "a file of cams is not run")
    contacts = source.ready.model.cam_contacts
    contact = channels[0].partition(".")[2].rpartition(".")[0]
    if len(channels) > 1 or contact not in contacts:
        allowed_names = ", ".join(f"contacts.{name}.force" for name in contacts) or "(there is none)"
        allowed = f"one channel of a cam's contact, such as {allowed_names}"
        raise refuse("--channel", ", ".join(channels), allowed, "it colours the profile of that cam")
    cam = contacts[contact].cam
    if options.cam not in (None, cam):
        raise refuse("--cam", repr(options.cam), repr(cam), "it is the cam of the channel", "leave --cam out")
    return cam


def _profile_values(source: Source, cam: Cam, profile: CamProfile, channel: str) -> tuple[CamProfile, FloatArray, str]:
    """Return the profile at the instants of the last revolution, the values of a channel and their label."""
    response = source.response
    unit, last = plotting.histories.channel_unit(response, channel), response.latest(source.ready.revolution)
    values = response.channels[channel][last]
    factor, symbol = to_display_unit(unit, thin=float(np.abs(values).max(initial=0.0)) < _THIN)
    touched = profile_at(profile.event, profile.follower, cam.angle(response.angle[last]), profile.turn)
    return touched, factor * values, ", ".join(filter(None, (plotting.histories.short_name(channel), symbol)))


def _spring(options: FigureOptions) -> Figure:
    source = options.first
    springs = {
        f"springs.{name}.force": spring
        for name, spring in source.ready.model.springs.items()
        if has_channels(spring) and not spring.turns
    }
    if not springs:
        why = "no linear spring of the case has an installed force or a wire"
        raise refuse("--what", "spring", "another figure", why, "add installed_force or wire to a spring of the case")
    for name in options.channels or ():
        if name not in springs:
            raise refuse("--channel", repr(name), ", ".join(springs), "", suggest_name(name, springs))
    curves: dict[str, tuple[Spring, float]] = {}
    for name in options.channels or springs:
        curve, loaded = spring_curve(springs[name]), float(source.rigid.channels[name].max())
        curves[name.split(".")[1]] = springs[name], float(np.interp(loaded, curve.force, curve.travel))
    return plotting.figures.add_title(plotting.curves.spring_figure(curves), source.subject)


def _goodman(options: FigureOptions) -> Figure:
    source = options.first
    points = member_strength(*source.reloaded).members()
    if not points:
        raise refuse("--what", "goodman", "a run of the flexible model with saved fields")
    members = source.ready.model.members
    figure = plotting.curves.goodman_figure({name: (point, members[name].material) for name, point in points.items()})
    return plotting.figures.add_title(figure, source.title)


def _map(options: FigureOptions) -> Figure:
    """Draw a channel over cam angle and speed, of several results or from 0.5 to 1.5 times the speed of the case."""
    case, contact = options.first.case, options.contact(options.first)
    channels = options.channels or ([] if contact is None else [f"contacts.{contact}.force"])
    if len(channels) != 1:
        raise refuse("--channel", ", ".join(channels) or "nothing", "one channel", "a map shows one")
    if len(options.sources) > 1:
        speeds = [source.case.speed for source in options.sources.values()]
        if twice := next((speed for speed in speeds if speeds.count(speed) > 1), None):
            text = f"two at {shaft_speed(twice, case.turns)}"
            raise refuse("files", text, "one per speed", "a map has one row per speed")
        runs = {s.case.speed: s.response for s in sorted(options.sources.values(), key=lambda s: s.case.speed)}
    else:
        speeds = cli.spaced_speeds(None, None, 9 if options.count is None else options.count, case)
        with show_count(len(speeds), "speeds") as advance:
            results = list(run_over_speeds(case, speeds, advance))
        runs = {speed: None if isinstance(run, Status) else run[1] for speed, run in zip(speeds, results, strict=True)}
    if len(runs) < 2 or not any(runs.values()):
        raise refuse("--what", "map", "runs at two or more speeds", f"{len(runs)} given, or no run was completed")
    rpm = case.turns * np.array(list(runs)) / RPM
    figure = plotting.spectra.angle_map_figure(rpm, list(runs.values()), channels[0], shaft_name(case.turns))
    return plotting.figures.add_title(figure, options.first.subject)


def _sweep(options: FigureOptions) -> Figure:
    if len(options.files) > 1 or options.files[0].suffix not in _TABLES:
        raise refuse("files", ", ".join(map(str, options.files)), "one table of a sweep (.h5 or .csv)")
    table = read_table(options.files[0])
    x = options.x or next((column.name for column in table.inputs if len(set(column.values)) > 1), table.inputs[0].name)
    if not options.y:
        fault = unknown_scalar_fault("nothing", table.scalars)
        raise refuse("--y", "nothing", fault.allowed, "it names what is drawn")
    draw = plotting.histories.sweep_map if options.as_map else plotting.histories.sweep_figure
    return draw(table, x, options.y)


def _modes(options: FigureOptions) -> Figure:
    count = 6 if options.count is None else options.count
    cli.check_number("--count", count)
    case = options.first.case
    structure = build_structure(build_model(case))
    return plotting.spectra.mode_figure(structure, modes(case, count), title=case.title)


_FIGURES: Mapping[str, Callable[[FigureOptions], Figure]] = {
    "motion": _motion, "force": _force, "torque": _force, "energy": _energy, "orbits": _orbits,
    "svaj": _svaj, "profile": _profile, "spring": _spring, "goodman": _goodman, "modes": _modes, "map": _map,
    "sweep": _sweep,
}  # fmt: skip


def _cams(source: Source, name: str | None) -> Mapping[str, Cam]:
    cams = source.cams
    if name is not None and name not in cams:
        raise refuse("--cam", repr(name), ", ".join(cams), "", suggest_name(name, cams))
    if not cams:
        raise refuse("cams", "none", "a case with cams")
    return cams if name is None else {name: cams[name]}
