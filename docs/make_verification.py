"""Make the verification manual, ``docs/verification/``, from the rows kept in ``docs/verification/rows.csv``.

``python docs/make_verification.py`` writes pages and figures; ``--take`` first takes in the rows of the last test run
(``build/verification.json``; rows of tests that did not run are kept, those of tests that no longer exist dropped);
``--check`` writes nothing and fails if that test run differs from the manual.
"""

from __future__ import annotations

import sys
from pathlib import Path

from manual.rows import RECORDED, Row, differences, merge_rows, read, read_recorded, sort_rows, write

FOLDER = Path(__file__).parent / "verification"


def take() -> None:
    """Bring the kept rows up to date from the last test run."""
    recorded = read_recorded(RECORDED)
    if names := [row["test"] for row in recorded if not row["passed"]]:
        message = f"these tests failed; the manual shows assertions that hold: {names}"
        raise SystemExit(message)
    write(sort_rows(merge_rows(read(), recorded)))


def check() -> None:
    """Fail if the last test run differs from the manual."""
    recorded = read_recorded(RECORDED)
    if not recorded:
        message = f"{RECORDED} has no rows: run the tests first"
        raise SystemExit(message)
    if found := differences(read(), recorded):
        message = "\n".join([*found, "the manual is not that of this test run: run `make verification`"])
        raise SystemExit(message)


def make(rows: list[Row], folder: Path = FOLDER) -> None:
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
        check()
    else:
        if "--take" in sys.argv[1:]:
            take()
        make(read())
