"""The list of starter cases."""

from __future__ import annotations

from collections.abc import Mapping

from rich.table import Table

from flexcam.terminal import table


def template_table(templates: Mapping[str, str]) -> Table:
    """Return the starter cases."""
    made = table("Starter cases", ("flexcam new",), ())
    made.add_column("what it is", justify="left")
    for name, words in templates.items():
        made.add_row(name, words)
    return made
