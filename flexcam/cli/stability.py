"""Command that assesses the stability of a case: stability."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter
from rich.table import Table

from flexcam import plotting
from flexcam.analysis.run_checks import describe_change
from flexcam.analysis.stability import Resonance, Stability, StepAmplification, assess_stability, stability_over_speeds
from flexcam.cli import app as cli
from flexcam.core.errors import refuse
from flexcam.core.units import RPM, shaft_name, shaft_speed
from flexcam.report.terminal import facts_table, finite_or_none, plain_table, show_count

_SHOWN = 5

_HARMLESS = "chatter (harmless)"
_WORDS = {
    "broken off": "the run at this speed ended early; its contacts are assessed up to there",
    "numerical": "the time integration is unstable: use a smaller step or an unconditionally stable integrator",
    "parametric": "disturbances of the periodic motion grow from revolution to revolution",
    "resonance": "a harmonic of the cam excites a mode, with more than 5 % of the maximum contact force",
    "contact loss": "the follower leaves its cam during the lift, or the contact would have to pull it",
    "chatter": "impacts change the motion or the force from revolution to revolution",
    _HARMLESS: "differences of rounding size grow at impacts, but two revolutions hardly differ",
}


def _stability_table(found: Stability, scale: float, *, has_contact: bool) -> Table:
    skipped = [] if found.discrete.is_available else ["the integrator"]
    skipped += ["the growth of disturbances"] if found.floquet is None else []
    stable = "none: no cause of instability found"
    stable += f"; {' and '.join(skipped)} could not be assessed" if skipped else ""
    several = len({one.contact for one in found.resonances}) > 1
    opened = f"{math.degrees(found.open_on_the_lift):.3g} deg of cam angle on the lift"
    rows = [
        ("integrator", _describe_amplification(found.discrete)),
        ("periodic motion", _describe_growth(found)),
        ("loss of contact", opened if has_contact else "not assessed: a load drives the follower, without a contact"),
        ("resonances", _count_resonances(found, scale)),
        *((f"harmonic {one.harmonic}" + (f", {one.contact}" if several else ""), _format_resonance(one, scale))
          for one in found.within[:_SHOWN]),
        ("verdict", "; ".join(f"{one}: {_WORDS[one]}" for one in _verdict(found)) or stable),
    ]  # fmt: skip
    return facts_table(f"Stability at {shaft_speed(found.rpm * RPM, scale)}", rows)


def _verdict(found: Stability) -> list[str]:
    chatter = ["chatter" if found.is_scattering else _HARMLESS] if found.is_chattering else []
    return [*found.causes, *chatter]


def _describe_amplification(found: StepAmplification) -> str:
    if not found.is_available:
        return "not assessed"
    words = f"spectral radius {found.radius:.9g}, at {found.frequency:.5g} Hz ({', '.join(found.moving)})"
    return words + (f"; max stable step {found.critical_step:.4g} s" if math.isfinite(found.critical_step) else "")


def _format_resonance(one: Resonance, scale: float) -> str:
    sizes = f"lift {1e3 * one.amplitude:.3g} mm, contact force {one.load:.3g} N, {one.share:.1%} of its maximum"
    mode = f"mode {one.frequency:.5g} Hz ({one.words})"
    return f"{mode} at {scale * one.rpm:.5g} {shaft_name(scale)} rpm; amplitudes: {sizes}"


def _count_resonances(found: Stability, scale: float) -> str:
    """Return the number of resonances below and above the highest listed speed."""
    count = len(found.within)
    rpm = f"{shaft_name(scale)} rpm"
    words = f"{count or 'none'} at or below {scale * found.highest_listed_rpm:.5g} {rpm}"
    if count > _SHOWN:
        words += f", of which the nearest {_SHOWN} are listed"
    if not found.higher_resonances:
        return words
    lowest = found.higher_resonances[0].rpm
    return f"{words}; {len(found.higher_resonances)} above, the lowest at {scale * lowest:.6g} {rpm}"


def _describe_growth(found: Stability) -> str:
    if found.floquet is None:
        return f"not assessed: {found.why_not}"
    largest, moving = abs(complex(found.floquet.multipliers[0])), ", ".join(found.floquet.moving())
    if found.is_chattering:
        events = found.floquet.events
        words = f"chatters: differences of rounding size grow by {largest:.3g} over {events} impacts ({moving})"
        change = "" if found.change is None else describe_change(found.change)
        return f"{words}; difference between two revolutions: {change}" if change else words
    return f"max multiplier {largest:.6g}, growth {found.floquet.growth:.4g} 1/s ({moving})"


def _stability_json(found: Stability, scale: float) -> dict[str, object]:
    discrete, floquet = found.discrete, found.floquet
    return {
        "shaft": shaft_name(scale), "rpm": scale * found.rpm, "run": str(found.status.cause),
        "spectral_radius": discrete.radius, "endangered_mode_hz": discrete.frequency,
        "endangered_moves": list(discrete.moving), "critical_step_s": finite_or_none(discrete.critical_step),
        "multipliers": [] if floquet is None else [[one.real, one.imag] for one in floquet.multipliers.tolist()],
        "growth": None if floquet is None else floquet.growth, "chatters": found.is_chattering,
        "revolution_change": None if found.change is None else asdict(found.change), "note": found.why_not,
        "open_on_the_lift_deg": math.degrees(found.open_on_the_lift),
        "resonances": [
            {
                "contact": one.contact, "rpm": scale * one.rpm, "harmonic": one.harmonic, "amplitude_m": one.amplitude,
                "load_n": one.load, "load_share": one.share, "frequency_hz": one.frequency, "moves": one.words,
            }
            for one in found.within[: 4 * _SHOWN]
        ],
        "resonances_up_to_rpm": scale * found.highest_listed_rpm, "resonances_within": len(found.within),
        "resonances_above": len(found.higher_resonances),
        "next_resonance_rpm": scale * found.higher_resonances[0].rpm if found.higher_resonances else None,
        "verdict": list(found.causes),
    }  # fmt: skip


def _growth_table(found: Sequence[Stability], scale: float, *, has_contact: bool) -> Table:
    rows: list[tuple[str, ...]] = []
    for one in found:
        largest = "not assessed" if one.floquet is None else f"{abs(complex(one.floquet.multipliers[0])):.6g}"
        growth = "" if one.floquet is None else f"{one.floquet.growth:.4g}"
        opened = f"{math.degrees(one.open_on_the_lift):.3g}" if has_contact else "not assessed"
        words = ", ".join(_verdict(one)) or "none"
        rows.append((f"{scale * one.rpm:.6g}", f"{one.discrete.radius:.9g}", largest, growth, opened, words))
    heads = (f"{shaft_name(scale)} rpm", "spectral radius", "multiplier", "growth, 1/s", "contact loss, deg", "verdict")
    return plain_table("Stability over speed", heads, rows)


@cli.command("""\
flexcam stability cases/tayeb/model-3-shm.toml --set run.speed=4000rpm
flexcam stability case.toml --lowest 1000rpm --highest 6000rpm --count 11 --plot growth.svg
""")
def stability(
    case: cli.CaseFile, *,
    lowest: Annotated[str | None, Parameter(
        help="Lowest speed of a range; without a range, only the speed of the case is assessed.")] = None,
    highest: Annotated[str | None, Parameter(help="Highest speed; 1.5 times the speed of the case by default.")] = None,
    count: Annotated[int | None, Parameter(help="Number of speeds, evenly spaced; 11 by default.")] = None,
    plot: Annotated[Path | None, Parameter(
        help="Also draw the growth rate over speed to this file (.svg, .png or .pdf).")] = None,
    overrides: cli.Overrides = None, overwrite: cli.Overwrite = False, as_json: cli.Json = False,
) -> cli.CommandOutput:  # fmt: skip
    """Assess stability at one speed or over a range: time step, parametric growth, resonance, contact loss.

    Use it to see whether disturbances of the periodic motion grow (Floquet multipliers), and why. Speeds are those of
    the crankshaft if the case gives crank_speed, otherwise those of the camshaft.
    """
    read = cli.load_beams(case, overrides)
    scale = read.turns
    has_contact = any(one.model != "published-load" for one in read.record.contacts.values())
    if lowest is None and highest is None and plot is None:
        if count is not None:
            why, remedy = "without a range, only the speed of the case is assessed", "add a range, or leave --count out"
            raise refuse("--count", count, "--count with --lowest, --highest or --plot", why, remedy)
        found = assess_stability(read)
        return cli.CommandOutput(
            [_stability_table(found, scale, has_contact=has_contact)], _stability_json(found, scale)
        )
    speeds = cli.spaced_speeds(lowest, highest, 11 if count is None else count, read)
    cli.check_targets(None, plot, overwrite=overwrite)
    with show_count(len(speeds), "speeds") as shown:
        every = stability_over_speeds(read, speeds, advance=shown)
    rpm = np.array([scale * one.rpm for one in every])
    growth = np.array([math.nan if one.floquet is None else one.floquet.growth for one in every])
    causes = {cause: np.array([cause in _verdict(one) for one in every]) for cause in _WORDS if cause != _HARMLESS}
    return cli.CommandOutput(
        [_growth_table(every, scale, has_contact=has_contact)],
        {"speeds": [_stability_json(one, scale) for one in every]}, title=read.title,
        draw=lambda: plotting.spectra.growth_figure(rpm, growth, causes, shaft_name(scale)),
    )  # fmt: skip
