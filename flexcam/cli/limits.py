"""Commands and tables about speed limits, model divergence and stability."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter
from numpy.typing import NDArray
from rich.table import Table

from flexcam.analysis.limits import Search, find_limits
from flexcam.analysis.model_divergence import MODELS, ForceRange, SpeedResult, divergence_speed
from flexcam.analysis.model_divergence import compare_models_over_speed as compare_models
from flexcam.analysis.stability import Resonance, Stability, StepAmplification, stability_over_speeds
from flexcam.analysis.stability import assess_stability as find_causes
from flexcam.cli.app import (
    CaseFile,
    Json,
    Overrides,
    Overwrite,
    Picture,
    app,
    check_figure_path,
    load_beams,
    parse_quantity,
    parse_speed_tolerance,
    speed_range,
)
from flexcam.core import FloatArray
from flexcam.core.errors import positive, refuse
from flexcam.core.units import RPM, parse, shaft_name, shaft_speed
from flexcam.dynamics import Status
from flexcam.report.formatting import format_decimals
from flexcam.report.tables import limits_json, limits_table
from flexcam.report.terminal import facts_table, plain_table, print_json, result_console, show_count

_SHOWN = 5

_WORDS = {
    "broken off": "the run at this speed ended early, so contacts are judged by what there is of it",
    "numerical": "the time integration itself grows: take a smaller step or an unconditionally stable integrator",
    "parametric": "disturbances of the periodic motion grow from revolution to revolution",
    "resonance": "a harmonic of the cam meets a mode",
    "contact loss": "the follower is off its cam on the lift, or would have to be pulled",
}


def stability_table(found: Stability, scale: float) -> Table:
    """Return the table of the stability at a speed."""
    rows = [
        ("integrator", _describe_amplification(found.discrete)),
        ("periodic motion", _describe_growth(found)),
        ("off the cam", f"{math.degrees(found.open_on_the_lift):.3g} deg of the lift"),
        ("resonances", _count_resonances(found, scale)),
        *((_format_order(found, one), _format_resonance(one, scale)) for one in found.within[:_SHOWN]),
        ("verdict", "; ".join(f"{one}: {_WORDS[one]}" for one in found.causes) or _describe_stable(found)),
    ]  # fmt: skip
    return facts_table(f"Stability at {shaft_speed(found.rpm * RPM, scale)}", rows)


def _describe_stable(found: Stability) -> str:
    skipped = [] if found.discrete.is_available else ["the integrator"]
    skipped += ["the growth of disturbances"] if found.floquet is None else []
    return "nothing endangers this speed" + (f", but {' and '.join(skipped)} could not be looked at" if skipped else "")


def _describe_amplification(found: StepAmplification) -> str:
    if not found.is_available:
        return "not looked at"
    words = f"spectral radius {found.radius:.9g}, largest at {found.frequency:.5g} Hz ({', '.join(found.moving)})"
    return words + (f"; steps up to {found.critical_step:.4g} s" if math.isfinite(found.critical_step) else "")


def _format_order(found: Stability, one: Resonance) -> str:
    """Return the order of a resonance, with the contact if there are several cams."""
    several = len({other.contact for other in found.resonances}) > 1
    return f"harmonic {one.harmonic}" + (f", {one.contact}" if several else "")


def _format_resonance(one: Resonance, scale: float) -> str:
    sizes = f"{1e3 * one.amplitude:.3g} mm, {one.load:.3g} N"
    return f"{scale * one.rpm:.5g} {shaft_name(scale)} rpm, {one.frequency:.5g} Hz, {sizes}: {one.words}"


def _count_resonances(found: Stability, scale: float) -> str:
    """Return the number of resonances below and above the highest listed speed."""
    count = len(found.within)
    rpm = f"{shaft_name(scale)} rpm"
    words = f"{count or 'none'} up to {scale * found.highest_listed_rpm:.5g} {rpm}"
    if count > _SHOWN:
        words += f", of which the nearest {_SHOWN} are listed"
    if not found.higher_resonances:
        return words
    lowest = found.higher_resonances[0].rpm
    return f"{words}; {len(found.higher_resonances)} above, the lowest at {scale * lowest:.6g} {rpm}"


def _describe_growth(found: Stability) -> str:
    if found.floquet is None:
        return f"not looked at: {found.why_not}"
    largest, moving = abs(complex(found.floquet.multipliers[0])), ", ".join(found.floquet.moving())
    if found.is_chattering:
        events = found.floquet.events
        return f"chatters: with {events} openings and closings small differences grow by {largest:.3g} ({moving})"
    return f"largest multiplier {largest:.6g}, growth {found.floquet.growth:.4g} 1/s ({moving})"


def stability_json(found: Stability, scale: float) -> dict[str, object]:
    """Return the stability for ``--json``."""
    multipliers = [] if found.floquet is None else [[one.real, one.imag] for one in found.floquet.multipliers.tolist()]
    return {
        "shaft": shaft_name(scale),
        "rpm": scale * found.rpm,
        "run": str(found.status.cause),
        "spectral_radius": found.discrete.radius,
        "endangered_mode_hz": found.discrete.frequency,
        "endangered_moves": list(found.discrete.moving),
        "critical_step_s": found.discrete.critical_step if math.isfinite(found.discrete.critical_step) else None,
        "multipliers": multipliers,
        "growth": None if found.floquet is None else found.floquet.growth,
        "chatters": found.is_chattering,
        "note": found.why_not,
        "open_on_the_lift_deg": math.degrees(found.open_on_the_lift),
        "resonances": [
            {
                "contact": one.contact,
                "rpm": scale * one.rpm,
                "harmonic": one.harmonic,
                "amplitude_m": one.amplitude,
                "load_n": one.load,
                "frequency_hz": one.frequency,
                "moves": one.words,
            }
            for one in found.within[: 4 * _SHOWN]
        ],
        "resonances_up_to_rpm": scale * found.highest_listed_rpm,
        "resonances_within": len(found.within),
        "resonances_above": len(found.higher_resonances),
        "next_resonance_rpm": scale * found.higher_resonances[0].rpm if found.higher_resonances else None,
        "verdict": list(found.causes),
    }


def growth_table(found: Sequence[Stability], scale: float) -> Table:
    """Return the table of the stability at several speeds."""
    heads = (f"{shaft_name(scale)} rpm", "spectral radius", "multiplier", "growth, 1/s", "off the cam, deg", "verdict")
    return plain_table("Stability over speed", heads, (_row(one, scale) for one in found))


def _row(one: Stability, scale: float) -> list[str]:
    largest = "" if one.floquet is None else f"{abs(complex(one.floquet.multipliers[0])):.6g}"
    growth = "" if one.floquet is None else f"{one.floquet.growth:.4g}"
    opened = f"{math.degrees(one.open_on_the_lift):.3g}"
    words = ", ".join([*one.causes, *(["chatter"] if one.is_chattering else [])]) or "-"
    return [f"{scale * one.rpm:.6g}", f"{one.discrete.radius:.9g}", largest, growth, opened, words]


def growth_rates(found: Sequence[Stability]) -> FloatArray:
    """Return the growth rates at several speeds."""
    return np.array([math.nan if one.floquet is None else one.floquet.growth for one in found])


def causes_by_speed(found: Sequence[Stability]) -> dict[str, NDArray[np.bool_]]:
    """Return the speeds at which each cause of instability occurs."""
    named = {cause: np.array([cause in one.causes for one in found]) for cause in _WORDS}
    return {**named, "chatter": np.array([one.is_chattering for one in found])}


_PAIRS = (("rigid", "bilateral"), ("bilateral", "unilateral"))


def divergence_table(found: Sequence[SpeedResult], scale: float, tolerance: float) -> Table:
    """Return the table of minimum and maximum contact force on the main lift by model."""
    rows = [(f"{scale * one.rpm:.6g}", *(_format_forces(one.forces[name]) for name in MODELS)) for one in found]
    head = (f"{shaft_name(scale)} rpm", *(f"{name}, N" for name in MODELS))
    return plain_table(f"Contact force on the main lift; {_describe_divergence(found, scale, tolerance)}", head, rows)


def _format_forces(forces: ForceRange | None) -> str:
    return (
        "did not finish"
        if forces is None
        else f"{format_decimals(forces.least, 0)} to {format_decimals(forces.largest, 0)}"
    )


def _describe_divergence(found: Sequence[SpeedResult], scale: float, tolerance: float) -> str:
    words: list[str] = []
    for first, second in _PAIRS:
        rpm = divergence_speed(found, first, second, tolerance)
        there = "do not part" if rpm is None else f"part at {scale * rpm:.6g} {shaft_name(scale)} rpm"
        words.append(f"{first} and {second} {there}")
    return ", ".join(words) + f" ({tolerance:.0%})"


def divergence_json(found: Sequence[SpeedResult], scale: float, tolerance: float) -> dict[str, object]:
    """Return the contact forces by model for ``--json``."""
    part: dict[str, object] = {}
    for first, second in _PAIRS:
        rpm = divergence_speed(found, first, second, tolerance)
        part[f"{first}_{second}_part_rpm"] = None if rpm is None else scale * rpm
    forces = {
        name: [None if (one := speed.forces[name]) is None else [one.least, one.largest] for speed in found]
        for name in MODELS
    }
    return {
        "shaft": shaft_name(scale),
        "rpm": [scale * one.rpm for one in found],
        "forces_n": forces,
        **part,
        "tolerance": tolerance,
    }


def force_ranges(found: Sequence[SpeedResult]) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Return minimum and maximum forces by model for a figure."""
    nothing = ForceRange(float("nan"), float("nan"))
    each = {name: [speed.forces[name] or nothing for speed in found] for name in MODELS}
    return {
        name: (np.array([one.least for one in forces]), np.array([one.largest for one in forces]))
        for name, forces in each.items()
    }


@app.command(
    help_prologue="""\
flexcam limits cases/pushrod-engine/intake.toml
flexcam limits case.toml --lowest 2000rpm --highest 9000rpm --tolerance 5rpm --json
flexcam limits case.toml --over springs.valve.stiffness=40:70:5kN/m --and masses.valve.mass=80:110:10g --plot map.svg
"""
)
def limits(
    case: CaseFile, *,
    lowest: Annotated[str | None, Parameter(help="Speed to look from; half the case's by default.")] = None,
    highest: Annotated[str | None, Parameter(help="Speed to look up to; twice the case's by default.")] = None,
    tolerance: Annotated[str, Parameter(help="Width of the bracket.")] = "10 rpm",
    bounce_height: Annotated[
        str | None, Parameter(help="Height from which a closed valve counts as bouncing; 0.1 mm, 2 % of a small lift.")
    ] = None,
    over: Annotated[str | None, Parameter("--over", help="Map over KEY=SPEC as of flexcam sweep; with --and.")] = None,
    beside: Annotated[str | None, Parameter("--and", help="The other number of the map: KEY=SPEC.")] = None,
    which: Annotated[
        list[Literal["loss_of_contact", "bounce", "coil_clash", "buckling"]] | None,
        Parameter("--limit", negative=(), help="Limit of the map; loss_of_contact by default. May be repeated."),
    ] = None,
    workers: Annotated[int | None, Parameter("--workers", help="Processes for the map; one by default.")] = None,
    csv: Annotated[Path | None, Parameter("--csv", help="Also write the map here.")] = None,
    plot: Picture = None, overrides: Overrides = None, overwrite: Overwrite = False, as_json: Json = False,
) -> Status:  # fmt: skip
    """Find the speeds at which a train loses contact, bounces, closes its coils and buckles, and which comes first.

    With --over and --and they are mapped over two numbers of the case. Speeds are those of the crankshaft where the
    case gives crank_speed, else those of the camshaft.
    """
    read = load_beams(case, overrides)
    scale = read.turns
    low, high = speed_range(lowest, highest, 2, read.speed, scale, most=2.0)
    width = parse_speed_tolerance("--tolerance", tolerance, scale)
    height = None if bounce_height is None else parse_quantity("--bounce-height", bounce_height, "length", "mm")
    if height is not None:
        positive("--bounce-height", height, "m", zero=True)
    if any(one is not None for one in (over, beside, which, workers, csv, plot)):
        from flexcam.cli.studies import map_limits

        search, names = Search(low, high, width, height), which or ["loss_of_contact"]
        settings, count = (over, beside), 1 if workers is None else workers
        return map_limits(
            case, overrides, settings, names, search, count, csv, plot, overwrite=overwrite, as_json=as_json
        )
    with show_count(None, "runs") as shown:
        found = find_limits(read, lowest=low, highest=high, tolerance=width, bounce_height=height, advance=shown)
    if as_json:
        print_json({"status": "ok", **limits_json(found, scale)})
    else:
        result_console().print(limits_table(found, scale))
    return Status()


@app.command(
    help_prologue="""\
flexcam parting cases/pushrod-engine/intake.toml
flexcam parting case.toml --lowest 2000rpm --highest 7000rpm --count 6 --plot parting.svg --json
"""
)
def parting(
    case: CaseFile, *,
    lowest: Annotated[str | None, Parameter(help="Lowest speed; half the case's by default.")] = None,
    highest: Annotated[str | None, Parameter(help="Highest speed; one and a half of the case's by default.")] = None,
    count: Annotated[int, Parameter(help="Speeds, evenly between both.")] = 8,
    tolerance: Annotated[str, Parameter(help="Part of the force from which on models differ.")] = "5 %",
    contact: Annotated[str | None, Parameter(help="Contact, where a case has several.")] = None,
    plot: Annotated[Path | None, Parameter(help="Also draw the forces: .svg, .png or .pdf.")] = None,
    overrides: Overrides = None, overwrite: Overwrite = False, as_json: Json = False,
) -> None:  # fmt: skip
    """Compare a rigid train, one held to its cam and one that may leave it over speed: where they part.

    Speeds are those of the crankshaft where the case gives crank_speed, else those of the camshaft.
    """
    read = load_beams(case, overrides)
    scale = read.turns
    low, high = speed_range(lowest, highest, count, read.speed, scale)
    part = positive("--tolerance", parse(tolerance, "number", "--tolerance"), "1", zero=True)
    check_figure_path(plot, overwrite)
    with show_count(count, "speeds") as shown:
        found = compare_models(read, np.linspace(low, high, count).tolist(), contact=contact, advance=shown)
    shaft = shaft_name(scale)
    if plot is not None:
        from flexcam.plotting.figures import add_title, save_figure
        from flexcam.plotting.spectra import force_figure

        rpm = np.array([scale * one.rpm for one in found])
        figure = force_figure(rpm, force_ranges(found), shaft)
        save_figure(add_title(figure, read.title), plot, overwrite=overwrite)
    if as_json:
        files = [] if plot is None else [str(plot)]
        print_json({"status": "ok", **divergence_json(found, scale, part), "shaft": shaft, "files": files})
    else:
        result_console().print(divergence_table(found, scale, part))


@app.command(
    help_prologue="""\
flexcam stability cases/tayeb/model-3-shm.toml --set run.speed=4000rpm
flexcam stability case.toml --lowest 1000rpm --highest 6000rpm --count 11 --plot growth.svg
"""
)
def stability(
    case: CaseFile, *,
    lowest: Annotated[str | None, Parameter(help="Lowest speed of a map; that of the case alone by default.")] = None,
    highest: Annotated[str | None, Parameter(help="Highest speed of a map.")] = None,
    count: Annotated[int | None, Parameter(help="Speeds of the map, evenly between both; 11 by default.")] = None,
    plot: Annotated[Path | None, Parameter(help="Also draw the map: .svg, .png or .pdf.")] = None,
    overrides: Overrides = None, overwrite: Overwrite = False, as_json: Json = False,
) -> None:  # fmt: skip
    """Tell what endangers a case at its speed, or over a range: the step, parametric growth, resonance, lost contact.

    Speeds are those of the crankshaft where the case gives crank_speed, else those of the camshaft.
    """
    read = load_beams(case, overrides)
    scale = read.turns
    if lowest is None and highest is None and plot is None:
        if count is not None:
            why, remedy = "the case's speed alone is looked at", "add a range, or leave it out"
            raise refuse("--count", count, "--count with --lowest, --highest or --plot only", why, remedy)
        found = find_causes(read)
        if as_json:
            print_json({"status": "ok", **stability_json(found, scale)})
        else:
            result_console().print(stability_table(found, scale))
        return
    number = 11 if count is None else count
    low, high = speed_range(lowest, highest, number, read.speed, scale)
    check_figure_path(plot, overwrite)
    with show_count(number, "speeds") as shown:
        every = stability_over_speeds(read, np.linspace(low, high, number).tolist(), advance=shown)
    if plot is not None:
        from flexcam.plotting.figures import add_title, save_figure
        from flexcam.plotting.spectra import growth_figure

        rpm = np.array([scale * one.rpm for one in every])
        shaft = shaft_name(scale)
        figure = growth_figure(rpm, growth_rates(every), causes_by_speed(every), shaft)
        save_figure(add_title(figure, read.title), plot, overwrite=overwrite)
    if as_json:
        files = [] if plot is None else [str(plot)]
        print_json({"status": "ok", "speeds": [stability_json(one, scale) for one in every], "files": files})
    else:
        result_console().print(growth_table(every, scale))
