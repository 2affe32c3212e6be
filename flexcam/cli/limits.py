"""Commands that find the limits of a train: limits, with maps over parameters of a case, and stability."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import Group, Parameter
from rich.table import Table

from flexcam import plotting
from flexcam.analysis.limits import LIMITS, Search, find_limits
from flexcam.analysis.run_checks import describe_change
from flexcam.analysis.run_metrics import compute_margins
from flexcam.analysis.stability import (
    MIN_FORCE_RATIO,
    RESONANCE_WIDTH,
    Resonance,
    Stability,
    assess_stability,
    stability_over_speeds,
)
from flexcam.case.builder import build_model
from flexcam.case.reader import CaseFile as OpenCase
from flexcam.cli import app as cli
from flexcam.core.errors import positive, refuse
from flexcam.core.units import RPM, shaft_name, shaft_speed
from flexcam.report.tables import limits_legend, limits_table
from flexcam.report.terminal import facts_table, format_csv, format_number, plain_table, show_count, with_unit
from flexcam.studies.executors import count_cores
from flexcam.studies.plan import Axis, parse_axis
from flexcam.studies.quantities import LimitMap, create_evaluator, grid_plan, limit_map, open_speed_runs
from flexcam.studies.sweep import validate_plan
from flexcam.studies.variables import InterruptibleRuns, require_units
from flexcam.valvetrain import opposed_contacts

_MAP = Group("Map over one parameter or two", sort_key=1)

_AHEAD = 2  # runs begun per process: none waits for the next one


@cli.command("""\
flexcam limits cases/pushrod-engine/intake.toml
flexcam limits case.toml --lowest 2000rpm --highest 9000rpm --accuracy 5rpm --json
flexcam limits case.toml --over springs.valve.stiffness=40:70:5kN/m --and masses.valve.mass=80:110:10g --plot map.svg
""")
def limits(
    case: cli.CaseFile, *,
    lowest: cli.Lowest = None, highest: cli.HighestOfSearch = None, accuracy: cli.Accuracy = "10 rpm",
    bounce_height: Annotated[str | None, Parameter(
        help="Minimum height of a bounce; by default the smaller of 0.1 mm and 2 % of the lift.")] = None,
    lift_deviation: Annotated[str | None, Parameter(
        help="Also find the speed at which the valve loft over the nose exceeds this.")] = None,
    low_pass: Annotated[str | None, Parameter(
        help="Also find contact loss in the cam force after a low-pass filter, such as 5kHz.")] = None,
    over: Annotated[str | None, Parameter(
        "--over", group=_MAP, help="First parameter and its values: KEY=START:STOP:STEPunit, a list "
        "(40,50,60kN/m), or a range with the number of its values (40:70#4kN/m).")] = None,
    beside: Annotated[str | None, Parameter("--and", group=_MAP, help="Second parameter and its values.")] = None,
    which: Annotated[list[Literal["loss_of_contact", "float", "bounce", "coil_clash", "buckling"]] | None, Parameter(
        "--limit", group=_MAP, help="Speed limit that the map shows; loss_of_contact by default. Repeatable.")] = None,
    workers: Annotated[int | None, Parameter(
        "--workers", help="Number of processes; by default one per core, or only one for a map.")] = None,
    csv: Annotated[cli.Csv, Parameter(group=_MAP)] = None,
    plot: Annotated[cli.Picture, Parameter(group=_MAP)] = None,
    overrides: cli.Overrides = None, units: cli.Units = None, overwrite: cli.Overwrite = False,
    as_json: cli.Json = False,
) -> cli.CommandOutput:  # fmt: skip
    """Find the speed limits of a valve train: contact loss, valve float, valve bounce, coil clash, buckling.

    It runs six revolutions of the case at --lowest, at --highest and at speeds 5 % apart between them. For
    each limit it bisects between the first speed at which the event occurs and the speed before. It then checks
    whether the event also occurs at the next three speeds, even above --highest, and at four speeds within 0.7 % of
    the limit. With --over it maps the limits over a parameter of the case, with --and over two. Valve float is contact
    loss over the nose; valve loft is valve lift above that of the rigid train. Speeds are those of the crankshaft if
    the case gives crank_speed, otherwise those of the camshaft.
    """
    read = cli.load_beams(case, overrides)
    scale, search = read.turns, Search(*cli.search_range(lowest, highest, accuracy, read))
    height = cli.parse_optional("--bounce-height", bounce_height, "length", "mm")
    if height is not None:
        positive("--bounce-height", height, "m", zero=True)
    deviation = cli.parse_optional("--lift-deviation", lift_deviation, "length", "mm")
    cutoff = cli.parse_optional("--low-pass", low_pass, "frequency", "Hz")
    search = replace(search, bounce_height=height, lift_deviation=deviation, low_pass=cutoff)
    cli.check_number("--workers", workers)
    cli.warn_input(read)
    of_map = {"--over": over, "--and": beside, "--limit": which, "--csv": csv, "--plot": plot}
    if options := [name for name, value in of_map.items() if value is not None]:
        if over is None:
            given = " and ".join(options)
            raise refuse(given, "no map", "--over KEY=START:STOP:STEPunit", "", f"add it, or leave {given} out")
        if deviation is not None or cutoff is not None:
            text = "--lift-deviation or --low-pass with --over"
            raise refuse("limits", text, "one of them", "a map has only the other limits")
        cli.check_targets(csv, plot, case, overwrite=overwrite)
        names = which or ["loss_of_contact"]
        axes = [_axis("--over", over), *([] if beside is None else [_axis("--and", beside)])]
        return _map_limits(case, overrides, axes, names, search, 1 if workers is None else workers)
    count = count_cores() if workers is None else workers
    with show_count(None, "runs") as advance, open_speed_runs(read, search, count) as runs:
        result = find_limits(read, replace(search, nearby=True), start=runs, ahead=_AHEAD * count, advance=advance)
    margins, model = compute_margins(read), build_model(read)
    parts: list[Table | str] = [limits_table(result, margins, scale)]
    if any(limit.rpm is not None for limit in result.limits.values()):
        parts.append(limits_legend(result))
    if "loss_of_contact" not in result.limits:
        why = 'it needs a contact with model = "unilateral", which can separate'
        if opposed_contacts(model):
            why = "opposed cams hold the follower between them, and one of the two contacts is always open"
        parts.append(f"Contact loss is not assessed: {why}.")
    rpm = {**dict.fromkeys(LIMITS), **{name: limit.rpm for name, limit in result.limits.items()}}
    json = {
        **{f"{name}_rpm": speed and scale * speed for name, speed in rpm.items()},
        **{f"{name}_bands_rpm": [[end and scale * end for end in band] for band in limit.bands_rpm]
           for name, limit in result.limits.items()},
        **{f"{name}_scatter_rpm": limit.scatter_rpm and [scale * rpm for rpm in limit.scatter_rpm]
           for name, limit in result.limits.items()},
        "first": result.first, "shaft": shaft_name(scale),
        "tolerance_rpm": scale * max(limit.tolerance_rpm for limit in result.limits.values()),  # null if infinite
        "rigid_loss_of_contact_rpm": margins.rigid_rpm and scale * margins.rigid_rpm,
        "spring_margin": margins.spring_margin, "buckling_margins": dict(margins.buckling_margins),
        "lowest_rpm": scale * result.lowest_rpm, "highest_rpm": scale * result.highest_rpm,
    }  # fmt: skip
    return cli.CommandOutput(parts, json)


def _map_limits(
    path: Path, overrides: cli.Overrides, axes: Sequence[Axis], kinds: Sequence[str], search: Search, workers: int
) -> cli.CommandOutput:
    file = OpenCase.open(path)
    plan = grid_plan(axes, overrides or ())
    case = validate_plan(file, plan)
    require_units(case, plan.varied_axes)
    names = [f"limits.{kind}" for kind in kinds]
    with (
        show_count(len(plan), "variants") as advance,
        create_evaluator(file, (), names, search, plan=plan, workers=workers, runs=len(plan), advance=advance) as runs,
    ):
        interruptible = InterruptibleRuns(runs)
        result = limit_map(plan, kinds, interruptible)
    return replace(limit_map_output(result, shaft_name(case.turns)), status=interruptible.status)


def _axis(option: str, setting: str) -> Axis:
    key, equals, spec = setting.partition("=")
    if not equals:
        raise refuse(option, repr(setting), f"{option} KEY=SPEC, such as springs.valve.stiffness=40:70:5kN/m")
    if key.strip() in ("run.speed", "run.crank_speed"):
        why = "a limit is a speed, searched from --lowest to --highest; the case's speed has no effect on it"
        raise refuse(option, key.strip(), "another value of the case", why, "vary a part")
    return parse_axis(key.strip(), spec, where=f"{option} {setting}")


def limit_map_output(found: LimitMap, shaft: str) -> cli.CommandOutput:
    """Return the output of a map of limits."""
    labels = [with_unit(axis.key, axis.unit) for axis in found.axes]
    places = [[value.number or 0.0 for value in axis.values] for axis in found.axes]
    head, columns = (labels[0], f"{shaft} rpm"), ""
    if len(places) > 1:
        head, columns = (labels[0], *map(format_number, places[1])), f"; columns: {labels[1]}"
    tables = [
        plain_table(f"{name.replace('_', ' ')}, {shaft} rpm{columns}", head, np.c_[places[0], rpm].tolist())
        for name, rpm in found.rpm.items()
    ]
    words: list[str] = []
    if any(np.isnan(rpm).any() for rpm in found.rpm.values()):
        words.append("A dash: no limit in the range of the search.")
    if failed := [status for status in found.statuses if not status.ok]:
        words.append(f"{len(failed)} variants failed; the first: {failed[0]}")
    head = (*labels, *(f"{name} [{shaft} rpm]" for name in found.rpm), "status")
    speeds = zip(*(rpm.ravel().tolist() for rpm in found.rpm.values()), strict=True)
    variants = zip(product(*places), speeds, found.statuses, strict=True)
    rows = [(*place, *rpm, status.cause) for place, rpm, status in variants]
    axes = zip(("over", "and"), found.axes, places, strict=False)
    json = {
        "shaft": shaft,
        **{option: {"key": axis.key, "unit": axis.unit, "values": values} for option, axis, values in axes},
        "limits_rpm": found.rpm,
        "statuses": [status.cause for status in found.statuses],
    }
    rpm = {f"{name.replace('_', ' ')}\n{shaft} speed, rpm": speeds for name, speeds in found.rpm.items()}
    return cli.CommandOutput(
        [*tables, *words], json, format_csv(head, rows),
        draw=lambda: plotting.histories.limits_figure([np.array(values) for values in places], rpm, labels),
    )  # fmt: skip


_SHOWN = 5
_HARMLESS = "chatter (harmless)"
_NEAR = f"within {100.0 * RESONANCE_WIDTH:g} % of this speed"
_STRONG_HARMONIC = f"cam harmonic with at least {100.0 * MIN_FORCE_RATIO:g} % of the maximum cam force"
_NO_CONTACT = 'no cam contact with model = "unilateral" or "bilateral" (a published-load is a force and cannot open)'
_WORDS = {
    "broken off": "the run at this speed ended early; its contacts are assessed up to there",
    "numerical": "the time integration is unstable: use a smaller step or an unconditionally stable integrator",
    "parametric": "a disturbance of the periodic motion grows by the multiplier in each revolution",
    "resonance": f"{_NEAR}, a {_STRONG_HARMONIC} coincides with a natural frequency",
    "contact loss": "the follower leaves its cam during the lift",
    "chatter": "impacts change the motion, the force or a stress from revolution to revolution",
    _HARMLESS: "rounding errors grow at impacts, but the motion hardly changes between revolutions",
}


def _stability_table(result: Stability, scale: float, contacts: set[str]) -> Table:
    skipped = [] if result.discrete.is_available else ["the integrator"]
    skipped += ["the growth of disturbances"] if result.floquet is None else []
    skipped += ["resonances"] if result.why_no_modes else []
    stable = "no cause of instability found"
    stable += f"; {' and '.join(skipped)} could not be assessed" if skipped else ""
    stable += f"; {_NEAR}, no {_STRONG_HARMONIC} coincides with a natural frequency" if result.within else ""
    several = len({r.contact for r in result.resonances}) > 1
    pulled = {"contact loss": "the contact would have to pull the follower"} if contacts == {"bilateral"} else {}
    words = {**_WORDS, **pulled}
    opened = f"{math.degrees(result.open_on_the_lift):.3g} deg of cam angle during the lift"
    rows = [
        ("integrator", _describe_amplification(result)),
        ("periodic motion", _describe_growth(result)),
        ("loss of contact", opened if contacts else f"not assessed: {_NO_CONTACT}"),
        ("resonances", _count_resonances(result, scale)),
        *((f"harmonic {r.harmonic}" + (f", {r.contact}" if several else ""), _format_resonance(r, scale))
          for r in result.within[:_SHOWN]),
        ("verdict", "; ".join(f"{cause}: {words[cause]}" for cause in _verdict(result)) or stable),
    ]  # fmt: skip
    return facts_table(f"Stability at {shaft_speed(result.rpm * RPM, scale)}", rows)


def _verdict(result: Stability) -> list[str]:
    harmless = result.is_chattering and not result.is_scattering
    return [*result.causes, *([_HARMLESS] if harmless else [])]


def _describe_amplification(result: Stability) -> str:
    worst = result.discrete
    if not worst.is_available:
        return "not assessed"
    stable = "unstable" if "numerical" in result.causes else "stable"
    words = (
        f"{stable}: spectral radius {worst.radius:.9g} at {worst.frequency:.5g} Hz; "
        f"this mode moves mainly {', '.join(worst.moving)}"
    )
    return words + (f"; max stable step {worst.critical_step:.4g} s" if math.isfinite(worst.critical_step) else "")


def _format_resonance(r: Resonance, scale: float) -> str:
    sizes = f"lift {1e3 * r.amplitude:.3g} mm, cam force {r.load:.3g} N, {r.share:.1%} of its maximum"
    mode = f"mode {r.frequency:.5g} Hz ({r.words})"
    return f"{mode} at {scale * r.rpm:.5g} {shaft_name(scale)} rpm; amplitudes at the assessed speed: {sizes}"


def _count_resonances(result: Stability, scale: float) -> str:
    if result.why_no_modes:
        return f"not assessed: {result.why_no_modes}"
    count = len(result.within)
    rpm = f"{shaft_name(scale)} rpm"
    words = f"{count or 'none'} at or below {scale * result.highest_listed_rpm:.5g} {rpm}"
    if count > _SHOWN:
        words += f", of which the nearest {_SHOWN} are listed"
    if above := result.higher_resonances:
        words += f"; {len(above)} above, the lowest at {scale * above[0].rpm:.6g} {rpm}"
    return words


def _describe_growth(result: Stability) -> str:
    if result.floquet is None:
        return f"not assessed: {result.why_not}"
    largest, moving = abs(complex(result.floquet.multipliers[0])), ", ".join(result.floquet.moving())
    if result.is_chattering:
        events = result.floquet.events
        grows = f"a revolution has {events} impacts, which amplify small disturbances {largest:.3g} times ({moving})"
        change = "" if result.change is None else describe_change(result.change)
        return f"chatters: {grows}" + (f". Difference between the last two revolutions: {change}" if change else "")
    growth = f"growth rate {result.floquet.growth:.4g} 1/s"
    multiplier = f"largest Floquet multiplier {largest:.6g} (above 1 a disturbance grows)"
    return f"{multiplier}, {growth}; the disturbance moves mainly {moving}"


def _stability_json(result: Stability, scale: float) -> dict[str, object]:
    discrete, floquet = result.discrete, result.floquet
    return {
        "shaft": shaft_name(scale), "rpm": scale * result.rpm, "run": result.status.cause,
        "spectral_radius": discrete.radius, "endangered_mode_hz": discrete.frequency,
        "endangered_moves": list(discrete.moving), "critical_step_s": discrete.critical_step,
        "multipliers": [] if floquet is None else [[z.real, z.imag] for z in floquet.multipliers.tolist()],
        "growth": None if floquet is None else floquet.growth, "chatters": result.is_chattering,
        "revolution_change": result.change, "note": "; ".join(filter(None, (result.why_not, result.why_no_modes))),
        "open_on_the_lift_deg": math.degrees(result.open_on_the_lift),
        "resonances": [
            {
                "contact": r.contact, "rpm": scale * r.rpm, "harmonic": r.harmonic, "amplitude_m": r.amplitude,
                "load_n": r.load, "load_share": r.share, "frequency_hz": r.frequency, "moves": r.words,
            }
            for r in result.within[: 4 * _SHOWN]
        ],
        "resonances_up_to_rpm": scale * result.highest_listed_rpm, "resonances_within": len(result.within),
        "resonances_above": len(result.higher_resonances),
        "next_resonance_rpm": scale * result.higher_resonances[0].rpm if result.higher_resonances else None,
        "verdict": list(result.causes),
    }  # fmt: skip


def _growth_table(results: Sequence[Stability], scale: float, contacts: set[str]) -> Table:
    rows = [
        (f"{scale * result.rpm:.6g}", f"{result.discrete.radius:.9g}",
         "not assessed" if result.floquet is None else f"{abs(complex(result.floquet.multipliers[0])):.6g}",
         "" if result.floquet is None else f"{result.floquet.growth:.4g}",
         f"{math.degrees(result.open_on_the_lift):.3g}" if contacts else "not assessed",
         ", ".join(_verdict(result)) or ("not assessed" if result.floquet is None else "no cause found"))
        for result in results
    ]  # fmt: skip
    what = ("spectral radius of integrator", "max Floquet multiplier", "growth, 1/s", "contact loss, deg", "verdict")
    return plain_table("Stability over speed", (f"{shaft_name(scale)} rpm", *what), rows)


@cli.command("""\
flexcam stability cases/tayeb/model-3-shm.toml --set run.speed=4000rpm
flexcam stability case.toml --lowest 1000rpm --highest 6000rpm --count 11 --plot growth.svg
""")
def stability(
    case: cli.CaseFile, *,
    lowest: Annotated[str | None, Parameter(
        help="Lowest speed of a range; without a range or --plot, only the speed of the case is assessed.")] = None,
    highest: cli.Highest = None,
    count: Annotated[int | None, Parameter(help="Number of speeds, evenly spaced; 11 by default.")] = None,
    plot: Annotated[Path | None, Parameter(
        help="Also draw the growth rate over speed to this file (.svg, .png or .pdf).")] = None,
    overrides: cli.Overrides = None, overwrite: cli.Overwrite = False, as_json: cli.Json = False,
) -> cli.CommandOutput:  # fmt: skip
    """Assess stability at one speed or over a range: time step, parametric instability, resonance, contact loss.

    Use it to see whether disturbances of the periodic motion grow (Floquet multipliers), and why. Speeds are those of
    the crankshaft if the case gives crank_speed, otherwise those of the camshaft.
    """
    read = cli.load_beams(case, overrides)
    cli.warn_input(read)
    scale = read.turns
    contacts = {contact.model for contact in read.record.contacts.values()} & {"unilateral", "bilateral"}
    if lowest is None and highest is None and plot is None:
        cli.refuse_without("--lowest, --highest or --plot", {"--count": count}, present=False)
        result = assess_stability(read)
        return cli.CommandOutput([_stability_table(result, scale, contacts)], _stability_json(result, scale))
    speeds = cli.spaced_speeds(lowest, highest, 11 if count is None else count, read)
    cli.check_targets(None, plot, overwrite=overwrite)
    with show_count(len(speeds), "speeds") as advance:
        runs = stability_over_speeds(read, speeds, advance=advance)
    rpm = np.array([scale * result.rpm for result in runs])
    growth = np.array([math.nan if result.floquet is None else result.floquet.growth for result in runs])
    causes = {cause: np.array([cause in _verdict(result) for result in runs]) for cause in _WORDS if cause != _HARMLESS}
    missing = [(scale * result.rpm, result.why_not.rstrip(".")) for result in runs if result.floquet is None]
    words = [
        f"Not assessed at {', '.join(f'{speed:.6g}' for speed, other in missing if other == why)} rpm: {why}."
        for why in dict.fromkeys(why for _, why in missing)
    ]
    verdicts = dict.fromkeys(verdict for result in runs for verdict in _verdict(result))
    words += [f"{verdict}: {_WORDS[verdict]}." for verdict in verdicts]
    return cli.CommandOutput(
        [_growth_table(runs, scale, contacts), *words],
        {"speeds": [_stability_json(result, scale) for result in runs]}, title=read.title,
        draw=lambda: plotting.spectra.growth_figure(rpm, growth, causes, shaft_name(scale)),
    )  # fmt: skip
