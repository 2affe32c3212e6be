"""Rows of the verification manual: cells of their tables and sections of their pages."""

from __future__ import annotations

import itertools

from manual.rows import Row

HEAD = ("case", "quantity", "unit", "reference", "computed", "error", "tolerance")


def error(row: Row) -> float:
    """Return the error of the computed number, relative unless the tolerance is absolute."""
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
    """Return the cells of a row under `HEAD`."""
    tolerance = f"{row['tolerance']:.2g}" + (f" {unit(row)}".rstrip() if row["absolute"] else "")
    figures = [f"{row['reference'] + 0.0:.8g}", f"{row['computed'] + 0.0:.8g}"]  # + 0.0: no zero has a sign
    return [row["case"], row["quantity"], unit(row), *figures, rounded(row), tolerance]


def largest_error(rows: list[Row]) -> str:
    """Return the largest error as a percentage of its tolerance."""
    part = 100.0 * max(error(row) / row["tolerance"] if row["tolerance"] else 0.0 for row in rows)
    return "< 1 %" if part < 1.0 else f"{part:.0f} %"


def by_source(rows: list[Row]) -> list[tuple[str, list[Row]]]:
    """Return the rows by source."""
    return [(source, list(group)) for source, group in itertools.groupby(rows, key=lambda row: row["source"])]


def sections(rows: list[Row]) -> str:
    """Return a section per source; the directive shows the rows (`extensions/verification.py`)."""
    return "\n\n".join(f"## {source}\n\n```{{verification}}\n```" for source, _ in by_source(rows))
