"""Tables that notebooks show for an object."""

from collections.abc import Mapping
from html import escape


def html_table(title: str, rows: Mapping[str, str]) -> str:
    """Return an HTML table of names and values without empty values."""
    cells = "".join(
        f"<tr><th style='text-align:left'>{escape(name)}</th><td style='text-align:left'>{escape(value)}</td></tr>"
        for name, value in rows.items() if value
    )  # fmt: skip
    return f"<table><caption>{escape(title)}</caption>{cells}</table>"
