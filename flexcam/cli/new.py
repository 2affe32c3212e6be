"""Command that writes starter cases: new."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.table import Table

from flexcam.case.starters import new_case, templates
from flexcam.cli.app import Json, Overwrite, app
from flexcam.report.terminal import plain_table, print_json, result_console


def template_table(templates: Mapping[str, str]) -> Table:
    """Return the table of starter cases."""
    made = plain_table("Starter cases", ("flexcam new",), ())
    made.add_column("what it is", justify="left")
    for name, words in templates.items():
        made.add_row(name, words)
    return made


@app.command(
    help_prologue="""\
flexcam new
flexcam new pushrod-engine
flexcam new measured-lift -o engine/intake.toml
"""
)
def new(
    template: Annotated[str | None, Parameter(help="What to start from; without it, all are listed.")] = None, *,
    target: Annotated[Path | None, Parameter(["-o", "--output"], help="Case file; TEMPLATE.toml by default.")] = None,
    overwrite: Overwrite = False, as_json: Json = False,
) -> None:  # fmt: skip
    """Write a commented starter case."""
    if template is None:
        known = templates()
        if as_json:
            print_json({"status": "ok", "templates": known})
        else:
            result_console().print(template_table(known))
        return
    files = new_case(template, target, overwrite=overwrite)
    if as_json:
        print_json({"status": "ok", "files": [str(path) for path in files]})
        return
    for path in files:
        result_console().print(str(path))
    result_console().print(f"\nNext: flexcam check {files[0]}, flexcam run {files[0]}, flexcam view {files[0]}")
