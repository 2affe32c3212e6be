"""Rows as tables in Markdown."""

from __future__ import annotations

import itertools

from manual.rows import Row, file

HEAD = "| case | quantity | unit | reference | computed | error | tolerance |\n|---|---|---|---|---|---|---|"


def error(row: Row) -> float:
    """Return how far the computed number is off, relative unless the tolerance is absolute."""
    difference = abs(row["computed"] - row["reference"])
    return difference if row["absolute"] or not row["reference"] else difference / abs(row["reference"])


def rounded(row: Row) -> str:
    """Return the error to one digit, as its last digits differ between machines."""
    if not row["tolerance"]:
        return "0"
    return "< 1e-9" if error(row) < 1e-9 else f"{error(row):.0e}"


def unit(row: Row) -> str:
    return "" if row["unit"] == "1" else row["unit"]


def cells(row: Row) -> list[str]:
    tolerance = f"{row['tolerance']:.2g}" + (f" {unit(row)}".rstrip() if row["absolute"] else "")
    figures = [f"{row['reference'] + 0.0:.8g}", f"{row['computed'] + 0.0:.8g}"]  # + 0.0: no zero has a sign
    return [row["case"], row["quantity"], unit(row), *figures, rounded(row), tolerance]


def escaped(text: str) -> str:
    return text.replace("|", "\\|").replace("<", "&lt;").replace("*", "\\*").replace("$", "\\$")


def table(rows: list[Row]) -> str:
    lines = ["| " + " | ".join(escaped(cell) for cell in cells(row)) + " |" for row in rows]
    return "\n".join([HEAD, *lines])


def compared(rows: list[Row], origins: dict[str, str]) -> str:
    """Return rows with their sources, and what their references are: a closed form where nothing else is known."""
    head = "| case | source | reference is | quantity | unit | reference | flexcam | error |\n|" + 8 * "---|"
    lines: list[str] = []
    for row in rows:
        case, quantity, unit_of, reference, computed, *_ = cells(row)
        origin = origins.get(row["source"], "closed form")
        shown = [case, row["source"], origin, quantity, unit_of, reference, computed, rounded(row)]
        lines.append("| " + " | ".join(escaped(cell) for cell in shown) + " |")
    return "\n".join([head, *lines])


def reasons(rows: list[Row]) -> str:
    """Return why the tolerances are what they are, each reason once."""
    said = dict.fromkeys(row["reason"] for row in rows)
    return "Why these tolerances:\n\n" + "\n".join(f"- {escaped(reason)}" for reason in said)


def by_source(rows: list[Row]) -> list[tuple[str, str, list[Row]]]:
    """Return the rows by source and file of their tests."""
    grouped = itertools.groupby(rows, key=lambda row: (row["source"], file(row)))
    return [(source, path, list(group)) for (source, path), group in grouped]


def sections(rows: list[Row]) -> str:
    """Return a section per source and file: what asserts it, its table, and the reasons of the tolerances."""
    parts = [
        f"## {escaped(source)}\n\n`{path}`\n\n{table(group)}\n\n{reasons(group)}"
        for source, path, group in by_source(rows)
    ]
    return "\n\n".join(parts)
