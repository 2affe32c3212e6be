"""What commands of studies give back: tables, words, one JSON object, a CSV file, a picture."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from flexcam.console.told import Told
from flexcam.io import write_text
from flexcam.response import Status
from flexcam.terminal import out, print_json

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Answer = tuple[Told, Callable[[], "Figure"]]
"""What is told, and what draws it."""


def write_answer(
    answer: Answer, csv: Path | None, plot: Path | None, ended: Status, *, overwrite: bool, as_json: bool,
    written: Sequence[Path] = (),
) -> None:  # fmt: skip
    """Print what is told, and write its table and its picture, also of a study that was stopped; name every file."""
    told, draw = answer
    if csv is not None:
        write_text(csv, told.csv, overwrite=overwrite)
    if plot is not None:
        from flexcam.view import save_figure

        save_figure(draw(), plot, overwrite=overwrite)
    files = [str(path) for path in (csv, plot, *written) if path is not None]
    if as_json:
        print_json({"status": "ok" if ended.ok else str(ended.cause), **told.json, "files": files})
        return
    for i, table in enumerate(told.tables):
        out().print(*([""] if i else []), table, sep="\n")
    for sentence in told.words:
        out().print("\n" + sentence)
    for path in files:
        out().print(path)
