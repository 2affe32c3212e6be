"""Command that finds what gives way first: limits."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from flexcam import console
from flexcam.commands.app import CaseFile, Json, Overrides, app, load, quantity
from flexcam.limits import find_limits
from flexcam.terminal import out, print_json


@app.command(
    help_prologue="""\
flexcam limits cases/pushrod-engine/intake.toml
flexcam limits case.toml --lowest 2000rpm --highest 9000rpm --tolerance 5rpm --json
"""
)
def limits(
    case: CaseFile, *,
    lowest: Annotated[str | None, Parameter(help="Speed to look from; half the case's by default.")] = None,
    highest: Annotated[str | None, Parameter(help="Speed to look up to; twice the case's by default.")] = None,
    tolerance: Annotated[str, Parameter(help="Width of the bracket.")] = "10 rpm",
    bounce_height: Annotated[str, Parameter(help="Height from which a closed valve counts as bouncing.")] = "0.1 mm",
    overrides: Overrides = None, as_json: Json = False,
) -> None:  # fmt: skip
    """Find the speeds at which a train loses contact, bounces, closes its coils and buckles, and which comes first.

    Speeds are those of the shaft the case gives its own of: the crankshaft (crank_speed) or the camshaft (speed).
    """
    read = load(case, overrides)
    scale = 2.0 if read.record.run.speed is None else 1.0
    low = 0.5 * read.speed if lowest is None else quantity("--lowest", lowest, "speed", "rpm") / scale
    high = 2.0 * read.speed if highest is None else quantity("--highest", highest, "speed", "rpm") / scale
    width = quantity("--tolerance", tolerance, "speed", "rpm") / scale
    height = quantity("--bounce-height", bounce_height, "length", "mm")
    found = find_limits(read, lowest=low, highest=high, tolerance=width, bounce_height=height)
    if as_json:
        print_json({"status": "ok", **console.limits_json(found, scale)})
    else:
        out().print(console.limits_table(found, scale))
