"""Make ``docs/verification.md`` from the rows that the tests recorded: ``python docs/make_verification.py``."""

from __future__ import annotations

import itertools
import json
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
RECORDED = ROOT / "build/verification.json"
PAGE = ROOT / "docs/verification.md"

HEAD = """# Verification

Made from the last full test run by `make verification`; every row is an assertion of the test named above its table.
Deviations are relative unless a unit stands with the tolerance. The reason of every tolerance stands in the test.
"""


def rounded(row: dict) -> str:
    """Return the deviation to one digit, as its last digits differ between machines."""
    difference = abs(row["computed"] - row["reference"])
    if not row["absolute"] and row["reference"]:
        difference /= abs(row["reference"])
    return "< 1e-9" if difference < 1e-9 else f"{difference:.0e}"


def cells(row: dict) -> list[str]:
    unit = "" if row["unit"] == "1" else row["unit"]
    tolerance = f"{row['tolerance']:.2g}" + (f" {unit}".rstrip() if row["absolute"] else "")
    figures = [f"{row['reference']:.8g}", f"{row['computed']:.8g}"]
    return [row["case"], row["quantity"], unit, *figures, rounded(row), tolerance]


def tables(rows: list[dict]) -> list[str]:
    parts = [HEAD]
    for (source, file), group in itertools.groupby(rows, key=lambda r: (r["source"], r["test"].partition("::")[0])):
        head = "| case | quantity | unit | reference | computed | deviation | tolerance |"
        parts += [f"## {source}", "", f"`{file}`", "", head, "|---|---|---|---|---|---|---|"]
        parts += ["| " + " | ".join(cell.replace("|", "\\|") for cell in cells(row)) + " |" for row in group]
        parts.append("")
    return parts


if __name__ == "__main__":
    recorded = json.loads(RECORDED.read_text(encoding="utf-8"))
    if failed := [row["test"] for row in recorded if not row["passed"]]:
        message = f"these tests failed; the page shows assertions that hold: {failed}"
        raise SystemExit(message)
    recorded.sort(key=lambda r: (r["source"], r["test"].partition("::")[0]))
    PAGE.write_text("\n".join(tables(recorded)), encoding="utf-8")
