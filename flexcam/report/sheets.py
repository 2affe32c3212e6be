"""Tables of a report: those of the commands, as values."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from rich.table import Table

from flexcam.console.cases import comparison_table, mode_table, model_table
from flexcam.console.results import info_table, operation_table, run_table, strength_table
from flexcam.fidelity import Comparison
from flexcam.memory import Extremes
from flexcam.reopened import strength_of
from flexcam.report.content import Sheet
from flexcam.report.subject import Subject
from flexcam.response import Response
from flexcam.train import Figure

_NUMBER = 24
"""Letters of the longest cell that may be a number."""


def sheet(table: Table) -> Sheet:
    """Return a table of the terminal as a value."""
    heads = tuple(str(column.header) for column in table.columns) if table.show_header else ()
    columns = [[str(cell) for cell in column.cells] for column in table.columns]
    cells = tuple(zip(*columns, strict=True))
    words = (
        i
        for i, of in enumerate(columns)
        if table.columns[i].justify == "left" or max(map(len, of), default=0) > _NUMBER
    )
    return Sheet(str(table.title or ""), heads, cells, tuple(words))


def sheets(about: Subject, compared: Comparison | None, figures: list[Figure]) -> list[Sheet]:
    """Return the tables about a result."""
    response, known = about.result.response, about.known
    turns = 1.0 if known is None else known.case.turns
    found = [sheet(comparison_table(compared, turns))] if compared is not None else []
    found += [sheet(operation_table(figures))] if figures else []
    if known is not None:
        stressed = strength_of(known.ready, known.response)
        found += [sheet(strength_table(stressed))] if stressed else []
        found.append(replace(sheet(run_table(known.case, Extremes.of(response))), title="Range of the probes"))
    found += [energy_sheet(response)] if len(response.time) else []
    found += [sheet(mode_table(about.modes))] if about.modes is not None else []
    if known is not None and about.modes is not None:
        found.append(replace(sheet(model_table(known.ready, about.modes)), title="The model"))
    return found


def energy_sheet(response: Response) -> Sheet:
    """Return the energies of a run."""
    parts = {name.removeprefix("energy."): v for name, v in response.channels.items() if name.startswith("energy.")}
    rows = [
        (name, *(f"{value:.4g}" for value in (values.min(), values.max(), values[-1])))
        for name, values in parts.items()
        if np.any(values)
    ]
    return Sheet("Energy over the run", ("J", "least", "largest", "at the end"), tuple(rows))


def origin(about: Subject) -> Sheet:
    """Return where a result comes from."""
    result = about.result if about.known is None else replace(about.result, response=about.known.response)
    return replace(sheet(info_table(result)), title="The result file")
