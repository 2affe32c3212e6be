"""Commands about motion laws: law, laws."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from flexcam import console
from flexcam.checks import did_you_mean, refuse
from flexcam.commands.app import Json, app
from flexcam.motion import LAWS, criteria
from flexcam.terminal import out, print_json


@app.command(help_prologue="flexcam law 4-5-6-7\nflexcam law modified-sine --json\n")
def law(name: Annotated[str, Parameter(help="Name of a motion law.")], *, as_json: Json = False) -> None:
    """Say what a motion law does: its criteria, extremes, ends and symmetry, normalized to lift 1 over angle 1."""
    if name not in LAWS:
        raise refuse("law", repr(name), ", ".join(LAWS), remedy=did_you_mean(name, LAWS))
    found = criteria(LAWS[name])
    if as_json:
        print_json({"status": "ok", "law": name, **console.law_json(found)})
    else:
        out().print(console.law_facts(name, found))


@app.command(help_prologue="flexcam laws\n")
def laws(*, as_json: Json = False) -> None:
    """List all motion laws with their criteria side by side."""
    found = {name: criteria(one) for name, one in LAWS.items()}
    if as_json:
        print_json({"status": "ok", "laws": {name: console.law_json(one) for name, one in found.items()}})
    else:
        out().print(console.laws_table(found))
