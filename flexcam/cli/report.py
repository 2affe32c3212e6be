"""Command that writes a report on results: report."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from flexcam.cli.app import Json, Overwrite, app
from flexcam.core.errors import refuse
from flexcam.io import check_writable, write_text
from flexcam.report.terminal import print_json, result_console


@app.command(
    help_prologue="""\
flexcam report results/case.vtkhdf
flexcam report slow.vtkhdf fast.vtkhdf --probe valve -o both.html
flexcam report results/case.vtkhdf --errors --limits --trade --overwrite
"""
)
def report(
    results: Annotated[list[Path], Parameter(help="Result files (.vtkhdf), also of runs that ended early.")], *,
    output: Annotated[
        Path | None, Parameter(["-o", "--output"], help="The page (.html); beside the first result by default.")
    ] = None,
    probe: Annotated[str | None, Parameter(help="Whose motion comes first; the valve by default.")] = None,
    errors: Annotated[bool, Parameter(negative=(), help="Also run the case for the errors of its numbers.")] = False,
    limits: Annotated[bool, Parameter(negative=(), help="Also find the speeds at which the train gives way.")] = False,
    trade: Annotated[bool, Parameter(negative=(), help="Also run cheaper models: what each costs in error.")] = False,
    overwrite: Overwrite = False, as_json: Json = False,
) -> None:  # fmt: skip
    """Write a page about results: what was modelled, verdict, curves, modes, tables, case. It needs no network."""
    from flexcam.report.content import ReportOptions, load_subject
    from flexcam.report.page import build_report, render_page

    target = output or results[0].parent / f"{results[0].stem}.html"
    if target.suffix != ".html":
        raise refuse("-o", str(target), "a name that ends in .html")
    check_writable("report", target, overwrite=overwrite)
    found = build_report(
        [load_subject(one) for one in results], probe=probe, asked=ReportOptions(errors, limits, trade)
    )
    write_text(target, render_page(found), overwrite=overwrite)
    if as_json:
        warnings = {str(path): list(chapter.warnings) for path, chapter in zip(results, found.chapters, strict=True)}
        print_json({"status": "ok", "file": str(target), "title": found.title, "warnings": warnings})
    else:
        result_console().print(str(target))
