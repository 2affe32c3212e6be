"""Make ``docs/verification.md`` from the rows that the verification tests recorded: ``python docs/make_verification.py``."""

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
    tolerance = f"{row['tolerance']:.2g}" + (f" {row['unit']}" if row["absolute"] else "")
    return [row["case"], row["quantity"], row["unit"], f"{row['reference']:.6g}", f"{row['computed']:.6g}", rounded(row), tolerance]


def tables(rows: list[dict]) -> list[str]:
    parts = [HEAD]
    for (source, file), group in itertools.groupby(rows, key=lambda r: (r["source"], r["test"].partition("::")[0])):
        parts += [f"## {source}", "", f"`{file}`", "", "| case | quantity | unit | reference | computed | deviation | tolerance |"]
        parts += ["|---|---|---|---|---|---|---|"]
        parts += ["| " + " | ".join(cell.replace("|", "\\|") for cell in cells(row)) + " |" for row in group]
        parts.append("")
    return parts


if __name__ == "__main__":
    recorded = json.loads(RECORDED.read_text(encoding="utf-8"))
    recorded.sort(key=lambda r: (r["source"], r["test"].partition("::")[0]))
    PAGE.write_text("\n".join(tables(recorded)), encoding="utf-8")
