"""Command that designs motion laws and lifts: synthesize law, synthesize harmonic, synthesize polydyne."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import App, Group, Parameter
from rich.table import Table

from flexcam import __version__, plotting
from flexcam.analysis import cam_analysis
from flexcam.cams import Family, HarmonicFamily, SingleMass, SplineFamily, Synthesis, event_extremes, minimax, pareto
from flexcam.case.reader import has_mechanism
from flexcam.cli import app as cli
from flexcam.cli.law import CRITERIA_LEGEND, format_criteria
from flexcam.core.errors import positive, refuse
from flexcam.core.units import RPM, format_quantity, parse
from flexcam.dynamics import component_unit
from flexcam.io import check_writable, create_folder, write_law, write_lift
from flexcam.report.terminal import facts_table, plain_table, remove_noise

_FAMILY = Group("Family of laws", sort_key=1)
_LEGEND = f"{CRITERIA_LEGEND}; z: angle / duration of the rise"


def _synthesis_json(result: Synthesis) -> dict[str, object]:
    c = result.criteria
    return {
        "family": result.family, "objective": result.objective, "family_bound": result.bound, "gap": result.gap,
        "bound_over_all_laws": result.bound_all, "Cv": c.Cv, "Ca": c.Ca, "Cj": c.Cj, "Cm": c.Cm, "rms": c.rms[1],
        "broken": list(c.violations), "converged": result.converged, "not_converged": list(result.open),
    }  # fmt: skip


def synthesis_table(found: Synthesis) -> Table:
    """Return the table of a synthesized law and its criteria."""
    c = found.criteria
    bound = "none: this objective is not convex; the law is a local optimum"
    if found.bound is not None and found.gap is not None:
        gap = remove_noise(found.gap, abs(found.bound))
        place = f"lies {abs(gap):.1e} {'above' if gap > 0.0 else 'below'} it (duality gap)" if gap else "attains it"
        bound = f"{found.bound:.9g}; the law {place}"
    overall = "unknown"
    if found.bound_all:
        above = 100.0 * (found.objective / found.bound_all - 1.0)
        overall = f"{found.bound_all:.6g} (this law: {above:+.2f} %)"
    rows = [
        ("objective", f"{found.objective:.9g}"),
        *(("not converged", reason) for reason in found.open),
        ("lower bound of the family", bound),
        ("lower bound of all laws", overall),
        ("C_v, C_a, C_j, C_m", ", ".join(format_criteria(c))),
        *(("between two dwells", violation) for violation in c.violations),
    ]
    return facts_table(f"Best of {found.family}", rows)


def _pareto_table(front: Sequence[Synthesis]) -> Table:
    rows = [
        (str(i), *format_criteria(result.criteria, 5), "-" if result.gap is None else f"{result.gap:.0e}",
         "yes" if result.converged else "no")
        for i, result in enumerate(front, start=1)
    ]  # fmt: skip
    head = ("no.", "C_v", "C_a", "C_j", "C_m", "gap", "converged")
    return plain_table(f"Pareto front of {front[0].family}", head, rows)


def _polydyne_table(cam: cam_analysis.PolydyneCam) -> Table:
    unit = component_unit((cam.probe or "").rpartition(".")[2], "um")
    rows = [
        (f"{speed / RPM:.6g}", *(f"{1e6 * value:.4g}" if math.isfinite(value) else "resonance" for value in deviations))
        for speed, *deviations in np.array([cam.speeds, cam.plain, cam.compensated]).T.tolist()
    ]
    head = ("camshaft rpm", f"plain cam, {unit}", f"polydyne cam, {unit}")
    title = f"Max deviation of {cam.probe or 'the mass'} from the target motion"
    return plain_table(f"{title}; design speed: camshaft {cam.speed / RPM:.6g} rpm", head, rows)


def _polydyne_properties_table(cam: cam_analysis.PolydyneCam) -> Table:
    design = cam.design
    lift, bend, count = event_extremes(design.event), event_extremes(design.event, 2), len(design.event.cosine)
    rows = [
        ("lift", format_quantity("m", *(end.value for end in lift))),
        ("acceleration", format_quantity("m/rad^2", *(end.value for end in bend), digits=5)),
        ("harmonics", f"{count}; truncation changes the target motion by up to {1e6 * design.left_out:.3g} um"),
    ]  # fmt: skip
    if lift[0].value < -cam_analysis.NEGATIVE_LIFT_TOLERANCE * lift[1].value:
        below = f"the profile lies up to {format_quantity('m', -lift[0].value, digits=4)} inside its base circle"
        rows.append(("warning", f"{below}. A lower design speed (--speed) reduces this depth"))
    return facts_table("Polydyne cam", rows)


synthesize = App(
    name="synthesize",
    help="Design a motion law with minimum peak values, or a lift that excites the train less.",
    help_prologue="""\
flexcam synthesize law --minimize Ca --bound Cj=52.5 -o best.toml
flexcam synthesize harmonic case.toml --tolerance "20 um" -o lift.toml
flexcam synthesize polydyne case.toml --speed 3000rpm -o lift.toml
""",
    help_format="plaintext",
)
cli.app.command(synthesize)
_command = partial(cli.command, group=synthesize)

LiftOutput = Annotated[Path | None, Parameter(
    ["-o", "--output"],
    help='Also write the lift to this file (.toml), which a cam reads with lift_table = "FILE".')]  # fmt: skip


@_command("""\
flexcam synthesize law --minimize Ca --bound Cj=52.5 -o best.toml
flexcam synthesize law --family polynomial --degree 11 --minimize Ca --pareto Cj
flexcam synthesize law --family harmonic --orders 1 --orders 3 --orders 5 --minimize Cm
""")
def law(
    *,
    minimize: Annotated[list[str], Parameter(
        "--minimize", help="Cv, Ca, Cj: peak of velocity, acceleration, jerk; Cm: peak of velocity times acceleration; "
        "rms: rms acceleration. For a weighted sum give CRITERION=WEIGHT several times.")],
    bounds: Annotated[list[str] | None, Parameter("--bound", help="Upper bound: CRITERION=VALUE. Repeatable.")] = None,
    against: Annotated[str | None, Parameter(
        "--pareto", help="Second criterion: find a Pareto front instead of one law.")] = None,
    count: Annotated[int | None, Parameter(help="Number of laws of the front; 9 by default.")] = None,
    conditions: Annotated[list[str] | None, Parameter(
        "--condition", help="Prescribed derivative: POSITION,ORDER,VALUE, such as 0.5,1,1.8; POSITION is between 0 "
        "and 1. Repeatable.")] = None,
    turning_back: Annotated[bool, Parameter(help="Allow negative velocity.")] = False,
    family: Annotated[Literal["spline", "polynomial", "harmonic"], Parameter(
        group=_FAMILY, help="Family of the law.")] = "spline",
    degree: Annotated[int | None, Parameter(
        group=_FAMILY, help="Degree of a spline (5 by default) or polynomial (11).")] = None,
    pieces: Annotated[int | None, Parameter(group=_FAMILY, help="Pieces of a spline; 24 by default.")] = None,
    orders: Annotated[list[int] | None, Parameter(
        group=_FAMILY, help="Orders of a harmonic law; 1 to 5 by default.")] = None,
    rest: Annotated[int | None, Parameter(
        group=_FAMILY, help="Number of derivatives that are zero at both ends; 2 by default.")] = None,
    asymmetric: Annotated[bool, Parameter(group=_FAMILY, help="Allow asymmetric laws.")] = False,
    output: Annotated[Path | None, Parameter(
        ["-o", "--output"], help='Also write the law to this file (.toml), which a cam reads with law = "FILE"; with '
        "--pareto every law to a numbered file.")] = None,
    plot: cli.Picture = None, overwrite: cli.Overwrite = False, as_json: cli.Json = False,
) -> cli.CommandOutput:  # fmt: skip
    """Find the motion law with minimum peak values in a family of laws, and a proven lower bound of these values."""
    cli.refuse_without("--pareto", {"--count": count}, present=against is not None)
    cli.check_targets(None, plot, overwrite=overwrite)
    law_family = _family(family, degree, pieces, orders, rest, symmetric=not asymmetric)
    weights, limits = _numbers("--minimize", minimize, 1.0), _numbers("--bound", bounds or [], None)
    fixed = [_condition(text) for text in conditions or []]
    goals = None
    if against is not None:
        if len(weights) != 1 or limits:
            allowed = "one criterion of --minimize, and no --bound"
            raise refuse("--pareto", "with --bound or several --minimize", allowed)
        number, goals = 9 if count is None else count, (next(iter(weights)), against)
        front = pareto(law_family, *goals, count=number, conditions=fixed, monotone=not turning_back)
    else:
        front = [minimax(law_family, weights, bounds=limits, conditions=fixed, monotone=not turning_back)]
    files = _write_law_files(front, goals, output, plot, overwrite=overwrite)
    parts = [_pareto_table(front) if against else synthesis_table(front[0]), _LEGEND]
    names = {path: f'{path}  (in a case: law = "{path.name}")' for path in files if path.suffix == ".toml"}
    json = {"laws": [_synthesis_json(result) for result in front]}
    return cli.CommandOutput(parts, json, files=files, describe_file=lambda path: names.get(path, str(path)))


def _family(
    kind: str, degree: int | None, pieces: int | None, orders: list[int] | None, rest: int | None, *, symmetric: bool
) -> Family:
    harmonic = kind == "harmonic"
    cli.refuse_without("--family harmonic", {"--orders": orders}, present=harmonic)
    cli.refuse_without("--family spline", {"--pieces": pieces}, present=kind == "spline")
    of_splines = {"--degree": degree, "--rest": rest, "--asymmetric": not symmetric}
    cli.refuse_without("--family spline or polynomial", of_splines, present=not harmonic)
    if harmonic:
        return HarmonicFamily(tuple(orders)) if orders else HarmonicFamily()
    order = 2 if rest is None else rest
    if kind == "polynomial":
        return SplineFamily(11 if degree is None else degree, 1, order, symmetric)
    return SplineFamily(5 if degree is None else degree, 24 if pieces is None else pieces, order, symmetric)


def _numbers(option: str, pairs: list[str], default: float | None) -> dict[str, float]:
    numbers: dict[str, float] = {}
    for pair in pairs:
        name, equals, text = pair.partition("=")
        if not equals and default is None:
            raise refuse(option, repr(pair), "CRITERION=VALUE, such as Cj=52.5")
        if name.strip() in numbers:
            raise refuse(option, repr(pair), "every criterion once", f"{name.strip()} is given twice", "leave one out")
        numbers[name.strip()] = parse(text.strip(), "number", option) if equals else default or 0.0
    return numbers


def _condition(text: str) -> tuple[float, int, float]:
    try:
        z, order, value = text.split(",")
        return float(z), int(order), float(value)
    except ValueError:
        allowed = "position, order of the derivative and value, such as 0.5,1,1.8"
        raise refuse("--condition", repr(text), allowed) from None


def _write_law_files(
    front: list[Synthesis], goals: tuple[str, str] | None, output: Path | None, plot: Path | None, *, overwrite: bool
) -> list[Path]:
    files: list[Path] = []
    paths = [] if output is None else [output]
    if output is not None and len(front) > 1:  # numbered
        paths = [output.with_name(f"{output.stem}-{i}{output.suffix}") for i in range(1, len(front) + 1)]
    for path in paths:  # before files are written
        check_writable("output", path, overwrite=overwrite)
    for result, path in zip(front, paths, strict=False):
        about = {"flexcam": __version__, **{k: v for k, v in _synthesis_json(result).items() if v is not None}}
        files.append(write_law(result.law, create_folder(path.parent) / path.name, about=about, overwrite=overwrite))
    if plot is not None:
        curves = plotting.curves
        figure = curves.law_front_figure(front, *goals) if goals else curves.law_figure({front[0].family: front[0].law})
        files.append(plotting.figures.save_figure(figure, plot, overwrite=overwrite))
    return files


@_command("""\
flexcam synthesize harmonic case.toml --tolerance "20 um" -o intake-harmonic.toml
flexcam synthesize harmonic case.toml --cam intake --count 12 --bound "0.2 mm"
""")
def harmonic(
    case: cli.CaseFile, *,
    name: cli.CamName = None,
    tolerance: Annotated[str, Parameter(help="Maximum deviation from the cam's lift in its dwells.")] = "20 um",
    bound: Annotated[str | None, Parameter(help="Maximum deviation elsewhere.")] = None,
    count: Annotated[int | None, Parameter(
        help="Number of harmonics; by default those below the lowest mode that the cam excites.")] = None,
    output: LiftOutput = None, overrides: cli.Overrides = None, overwrite: cli.Overwrite = False,
    as_json: cli.Json = False,
) -> cli.CommandOutput:  # fmt: skip
    """Replace the lift of a cam by its low harmonics, below the lowest mode that the cam excites.

    In the dwells the new lift differs from the old one by at most --tolerance.
    """
    cli.check_distinct_files({"--output": output}, [case])
    strict = cli.parse_quantity("--tolerance", tolerance, "length", "um")
    wide = cli.parse_optional("--bound", bound, "length", "mm")
    cam = cam_analysis.harmonic_cam(cli.load_case(case, overrides), name, tolerance=strict, count=count, bound=wide)
    fit, hertz = cam.fit, cam.frequency / (2.0 * math.pi)
    about = {"flexcam": __version__, "made_for": str(case), "harmonics": cam.count}
    lift, ends = fit.event.with_delay(-cam.phase), [end.value for end in event_extremes(fit.event)]
    files = [] if output is None else [write_lift(lift, output, about=about, overwrite=overwrite)]
    json = {
        "harmonics": cam.count, "harmonics_below_first_mode": cam.limit, "first_mode_hz": hertz,
        "dwell_deviation": fit.strict_deviation, "deviation": fit.deviation, "rms_deviation": fit.rms_deviation,
        "lift": ends,
    }  # fmt: skip
    rows = [
        ("harmonics", f"{cam.count}; {cam.limit} lie below the lowest mode that the cam excites, {hertz:.4g} Hz"),
        ("max deviation in the dwells", f"{1e6 * fit.strict_deviation:.4g} um"),
        ("max deviation elsewhere", f"{1e6 * fit.deviation:.4g} um, {1e6 * fit.rms_deviation:.4g} um rms"),
        ("lift", format_quantity("m", *ends)),
    ]
    tables = [facts_table("Lift composed of low harmonics", rows)]
    describe_file = partial(cli.describe_lift_file, phase=cam.phase)
    return cli.CommandOutput(tables, json, files=files, describe_file=describe_file)


@_command("""\
flexcam synthesize polydyne case.toml --speed 3000rpm -o intake-polydyne.toml
flexcam synthesize polydyne cams.toml --frequency "400 Hz" --damping 0.02 --speed 3000rpm
""")
def polydyne(
    case: Annotated[Path, Parameter(
        help="Case file; with --frequency also a file with only format = 1 and [cams.NAME] tables.")], *,
    name: cli.CamName = None,
    speed: Annotated[str | None, Parameter(help="Design speed of the camshaft; by default that of the case.")] = None,
    frequency: Annotated[str | None, Parameter(
        help="Natural frequency of one mass on a spring, instead of the train of the case.")] = None,
    damping: Annotated[float, Parameter(help="Damping ratio of that mass.")] = 0.0,
    probe: cli.Probe = None, count: Annotated[int, Parameter(help="Number of harmonics.")] = 60,
    output: LiftOutput = None, overrides: cli.Overrides = None, overwrite: cli.Overwrite = False,
    as_json: cli.Json = False,
) -> cli.CommandOutput:  # fmt: skip
    """Design a polydyne cam: at the design speed the flexible train moves a point as a rigid one would."""
    cli.check_distinct_files({"--output": output}, [case])
    at = None if speed is None else positive("--speed", cli.parse_quantity("--speed", speed, "speed", "rpm"), "rad/s")
    if damping and frequency is None:
        raise refuse("--damping", damping, "--damping only with --frequency", "the train of the case has its own")
    if frequency is not None:
        cli.refuse_options({"--probe": probe}, "--frequency replaces the train by a single mass")
        omega = 2.0 * math.pi * cli.parse_quantity("--frequency", frequency, "frequency", "Hz")
        cams = cam_analysis.load_cams(case, overrides or ())
        design_speed = cams.speed if at is None else at
        if design_speed is None:
            raise refuse("--speed", "nothing", "the design speed, such as 3000rpm", f"{cams.name} has no speed")
        cam = cam_analysis.design_polydyne(cams, name, SingleMass(omega, damping), design_speed, count)
    elif has_mechanism(case):
        cam = cam_analysis.polydyne_cam(cli.load_case(case, overrides), name, probe=probe, speed=at, count=count)
    else:
        text, remedy = f"{case.name}, which has only cams", "add --frequency for one mass on a spring"
        raise refuse("case", text, "a case with the train that the cam drives", "", remedy)
    about = {"flexcam": __version__, "made_for": str(case), "design_speed_rpm": cam.speed / RPM}
    lift = cam.design.event.with_delay(-cam.phase)
    files = [] if output is None else [write_lift(lift, output, about=about, overwrite=overwrite)]
    json = {
        "design_speed_rpm": cam.speed / RPM, "probe": cam.probe, "left_out": cam.design.left_out,
        "lift": [end.value for end in event_extremes(cam.design.event)],
        "acceleration": [end.value for end in event_extremes(cam.design.event, 2)], "ratio": cam.ratio,
        "speeds_rpm": cam.speeds / RPM, "plain": cam.plain, "polydyne": cam.compensated,
    }  # fmt: skip
    tables = [_polydyne_properties_table(cam), _polydyne_table(cam)]
    describe_file = partial(cli.describe_lift_file, phase=cam.phase)
    return cli.CommandOutput(tables, json, files=files, describe_file=describe_file)
