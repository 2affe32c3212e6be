"""Command about the valve spring: settings."""

from __future__ import annotations

from flexcam.commands.app import CaseFile, Json, Overrides, app, load
from flexcam.console.settings import settings_json, settings_table, settings_words
from flexcam.fidelity import settings_of
from flexcam.terminal import out, print_json


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
    read = load(case, overrides)
    scale = read.turns
    found = settings_of(read)
    if as_json:
        print_json({"status": "ok", **settings_json(found, scale)})
        return
    out().print(settings_table(found, scale))
    for sentence in settings_words(found):
        out().print("\n" + sentence)
