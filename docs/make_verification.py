"""Make the verification manual, ``docs/verification/``, from ``docs/verification/rows.csv``.

``python docs/make_verification.py`` writes pages and figures. With ``--take`` it first updates the rows from the last
test run, ``build/verification.json``: rows of tests that did not run remain, and rows of tests that no longer exist are
removed. ``--check`` writes nothing and fails if the last test run differs from the manual.
"""

from __future__ import annotations

import sys
from pathlib import Path

from manual.rows import RECORDED, Row, differences, merge_rows, read, read_recorded, sort_rows, write

FOLDER = Path(__file__).parent / "verification"


def update_rows() -> None:
    """Update the rows from the last test run."""
    recorded = read_recorded(RECORDED)
    if names := [row["test"] for row in recorded if not row["passed"]]:
        message = f"these tests failed; the manual shows assertions that hold: {names}"
        raise SystemExit(message)
    write(sort_rows(merge_rows(read(), recorded)))


def check_rows() -> None:
    """Fail if the last test run differs from the manual."""
    recorded = read_recorded(RECORDED)
    if not recorded:
        message = f"{RECORDED} has no rows: run the tests first"
        raise SystemExit(message)
    if found := differences(read(), recorded):
        message = "\n".join([*found, "the manual is not that of this test run: run `make verification`"])
        raise SystemExit(message)


def write_manual(rows: list[Row], folder: Path = FOLDER) -> None:
    """Write all pages and figures."""
    from manual.figures import FIGURES, figure_text
    from manual.pages import pages

    (folder / "figures").mkdir(parents=True, exist_ok=True)
    for name, text in pages(rows).items():
        (folder / name).write_text(text, encoding="utf-8")
    for name, draw in FIGURES.items():
        (folder / "figures" / f"{name}.svg").write_text(figure_text(draw), encoding="utf-8")


if __name__ == "__main__":
    if "--check" in sys.argv[1:]:
        check_rows()
    else:
        if "--take" in sys.argv[1:]:
            update_rows()
        write_manual(read())
