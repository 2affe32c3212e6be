"""Commands over speed: limits, parting, stability."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter

from flexcam.checks import positive, refuse
from flexcam.commands.app import (
    CaseFile,
    Json,
    Overrides,
    Overwrite,
    Picture,
    app,
    bracket,
    free_picture,
    load_beams,
    quantity,
    speed_range,
)
from flexcam.console.limits import limits_json, limits_table
from flexcam.console.parting import force_bands, parting_json, parting_table
from flexcam.console.stability import dangers, growth_table, growths, stability_json, stability_table
from flexcam.limits import Search, find_limits
from flexcam.parting import parting as compare_models
from flexcam.response import Status
from flexcam.stability import over_speeds
from flexcam.stability import stability as find_causes
from flexcam.terminal import counting, out, print_json
from flexcam.units import parse, shaft_name


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
    width = bracket("--tolerance", tolerance, scale)
    height = None if bounce_height is None else quantity("--bounce-height", bounce_height, "length", "mm")
    if height is not None:
        positive("--bounce-height", height, "m", zero=True)
    if any(one is not None for one in (over, beside, which, workers, csv, plot)):
        from flexcam.commands.limit_map import map_limits

        search, names = Search(low, high, width, height), which or ["loss_of_contact"]
        settings, count = (over, beside), 1 if workers is None else workers
        return map_limits(
            case, overrides, settings, names, search, count, csv, plot, overwrite=overwrite, as_json=as_json
        )
    with counting(None, "runs") as shown:
        found = find_limits(read, lowest=low, highest=high, tolerance=width, bounce_height=height, advance=shown)
    if as_json:
        print_json({"status": "ok", **limits_json(found, scale)})
    else:
        out().print(limits_table(found, scale))
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
    free_picture(plot, overwrite)
    with counting(count, "speeds") as shown:
        found = compare_models(read, np.linspace(low, high, count).tolist(), contact=contact, advance=shown)
    shaft = shaft_name(scale)
    if plot is not None:
        from flexcam.view import force_figure, save_figure, titled

        rpm = np.array([scale * one.rpm for one in found])
        figure = force_figure(rpm, force_bands(found), shaft)
        save_figure(titled(figure, read.title), plot, overwrite=overwrite)
    if as_json:
        files = [] if plot is None else [str(plot)]
        print_json({"status": "ok", **parting_json(found, scale, part), "shaft": shaft, "files": files})
    else:
        out().print(parting_table(found, scale, part))


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
            out().print(stability_table(found, scale))
        return
    number = 11 if count is None else count
    low, high = speed_range(lowest, highest, number, read.speed, scale)
    free_picture(plot, overwrite)
    with counting(number, "speeds") as shown:
        every = over_speeds(read, np.linspace(low, high, number).tolist(), advance=shown)
    if plot is not None:
        from flexcam.view import growth_figure, save_figure, titled

        rpm = np.array([scale * one.rpm for one in every])
        shaft = shaft_name(scale)
        figure = growth_figure(rpm, growths(every), dangers(every), shaft)
        save_figure(titled(figure, read.title), plot, overwrite=overwrite)
    if as_json:
        files = [] if plot is None else [str(plot)]
        print_json({"status": "ok", "speeds": [stability_json(one, scale) for one in every], "files": files})
    else:
        out().print(growth_table(every, scale))
