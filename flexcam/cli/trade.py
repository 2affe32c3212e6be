"""Command that evaluates error versus cost of models: trade."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from flexcam.analysis.model_choice import evaluate_ladder as fidelity_trade
from flexcam.analysis.preparation import prepare, scalar_probe
from flexcam.cli.app import CaseFile, Json, Overrides, Overwrite, app, check_positive, load_case
from flexcam.cli.arguments import check_targets
from flexcam.core.errors import collect_errors
from flexcam.io import write_text
from flexcam.report.fidelity_tables import TRADE_LEGEND, trade_csv, trade_json, trade_table, trade_warnings
from flexcam.report.terminal import print_json, result_console, show_count


@app.command(
    help_prologue="""\
flexcam trade cases/tayeb/model-3-shm.toml
flexcam trade case.toml --csv trade.csv --plot trade.svg --repeats 5
"""
)
def trade(
    case: CaseFile, *,
    probe: Annotated[str | None, Parameter(help="Whose motion counts; the valve by default.")] = None,
    repeats: Annotated[int, Parameter(help="Runs of every model; the median of their times counts.")] = 3,
    csv: Annotated[Path | None, Parameter(help="Also write the table here.")] = None,
    plot: Annotated[Path | None, Parameter(help="Also draw error over work: .svg, .png or .pdf.")] = None,
    overrides: Overrides = None, overwrite: Overwrite = False, as_json: Json = False,
) -> None:  # fmt: skip
    """Run the models of a case against a converged one: what each costs, and by how much it errs."""
    read = collect_errors(
        lambda: load_case(case, overrides),
        lambda: check_positive("--repeats", repeats),
        lambda: check_targets(csv, plot, case, overwrite=overwrite),
    )
    at = probe or scalar_probe(prepare(read))
    with show_count(None, "models") as shown:
        against, found = fidelity_trade(read, at, repeats=repeats, advance=shown)
    if csv is not None:
        write_text(csv, trade_csv(against, found), overwrite=overwrite)
    if plot is not None:
        from flexcam.plotting.figures import add_title, save_figure
        from flexcam.plotting.study_curves import work_precision_figure

        figure = work_precision_figure(found)
        save_figure(add_title(figure, read.title), plot, overwrite=overwrite)
    files = [str(path) for path in (csv, plot) if path is not None]
    if as_json:
        print_json({"status": "ok", **trade_json(against, found), "files": files})
    else:
        result_console().print(trade_table(against, found))
        result_console().print(TRADE_LEGEND)
        for sentence in trade_warnings(against, found):
            result_console().print("\n" + sentence)
        for path in files:
            result_console().print(path)
