"""Command that evaluates valve spring settings: settings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict

from rich.table import Table

from flexcam.analysis.measures import compute_settings
from flexcam.analysis.petrescu import Setting
from flexcam.cli.app import CaseFile, Json, Overrides, app, load_case
from flexcam.core.units import RPM, shaft_name
from flexcam.report.formatting import format_mm
from flexcam.report.terminal import plain_table, print_json, result_console

_HEAD = ("k, kN/m", "x0, mm", "spp max", "spp min", "xpp max", "xpp min", "opens, mm", "lift lost")


def settings_table(found: Sequence[Setting], scale: float) -> Table:
    """Return the table of the closed-form results, one row per setting."""
    rows = [
        (
            one.name,
            f"{scale * one.speed / RPM:.6g}",
            f"{one.stiffness / 1e3:.4g}",
            format_mm(one.compression, 4),
            *(f"{value:.0f}" for value in (*one.kinematic, *one.dynamic)),
            format_mm(one.opening, 3),
            f"{one.lift_loss:.1%}",
        )
        for one in found
    ]
    title = f"Acceleration of the lift (spp) and of the valve (xpp), m/s^2; lift {format_mm(found[0].lift, 4)} mm"
    return plain_table(title, ("setting", f"{shaft_name(scale)} rpm", *_HEAD), rows)


def describe_settings(found: Sequence[Setting]) -> list[str]:
    """Return sentences about the lift lost with the accelerations."""
    worst = max(found, key=lambda one: one.lift_loss)
    limited = worst.dynamic[0] / worst.kinematic[0]
    bought = (
        "In this closed form what limits the acceleration is lost lift: the train yields to the spring, and the valve "
        f"does not open. With {worst.name} the valve's largest acceleration is {limited:.1%} of the lift's, and it "
        f"opens {format_mm(worst.opening, 3)} of {format_mm(worst.lift, 4)} mm: "
        f"{worst.lift_loss:.1%} of the lift is lost."
    )
    words = [bought]
    if shut := [one for one in found if not one.lifts_off]:
        named = ", ".join(f"{one.name} ({one.preload / 1e3:.4g} kN)" for one in shut)
        words.append(
            f"A valve on a seat would not open at all: the preload is more than the train gives at full lift: {named}."
        )
    words.append(
        "x, x' and x'' are the paper's closed form, with the speed held in its derivatives; flexcam run solves the "
        "same mass in time, and need not agree."
    )
    return words


def settings_json(found: Sequence[Setting], scale: float) -> dict[str, object]:
    """Return the results of settings for ``--json``, SI."""
    rows = [{**asdict(one), "rpm": scale * one.speed / RPM, "lost": one.lift_loss} for one in found]
    shaft = shaft_name(scale)
    return {"shaft": shaft, "settings": rows, "words": describe_settings(found)}


@app.command(
    help_prologue="""\
flexcam settings cases/petrescu/valve-spring.toml
flexcam settings case.toml --set run.crank_speed=10000rpm --set springs.valve.stiffness=80kN/m --json
"""
)
def settings(case: CaseFile, *, overrides: Overrides = None, as_json: Json = False) -> None:
    """Tell what speed, stiffness and preload of a valve spring make of a lift: accelerations, and the lift lost.

    The closed form of Petrescu and Petrescu (2013) for one mass between a cam and one spring, for the case as it stands
    and for every table under [settings].
    """
    read = load_case(case, overrides)
    scale = read.turns
    found = compute_settings(read)
    if as_json:
        print_json({"status": "ok", **settings_json(found, scale)})
        return
    result_console().print(settings_table(found, scale))
    for sentence in describe_settings(found):
        result_console().print("\n" + sentence)
