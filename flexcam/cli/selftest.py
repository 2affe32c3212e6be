"""Command that checks an installation: selftest."""

from __future__ import annotations

from dataclasses import asdict

from flexcam.analysis.selftest import all_checks, installation_info
from flexcam.cli import app as cli
from flexcam.dynamics import Cause, Status
from flexcam.report.terminal import facts_table, plain_table


@cli.command("""\
flexcam selftest
flexcam selftest --json
""")
def selftest(*, as_json: cli.Json = False) -> cli.CommandOutput:
    """Check this installation: closed-form solutions, published values, and a comparison of the solver engines.

    It takes some seconds, or half a minute when code is compiled for the first time. The exit code is 3 if a check
    fails.
    """
    found = list(all_checks())
    failed = [one.quantity for one in found if not one.passed]
    status = Status()
    if failed:
        text = f"{len(failed)} of {len(found)} checks exceed their tolerance: {'; '.join(failed)}"
        remedy = "install flexcam again in a new environment; if that does not help, please report it"
        status = Status(Cause.FAULT, text, remedy)
    rows = [
        (one.quantity, f"{one.reference:.8g} {one.unit}".removesuffix(" 1"), f"{one.computed:.8g}", f"{one.error:.1e}",
         f"{one.tolerance:.1e}", "passed" if one.passed else "FAILED", one.source)
        for one in found
    ]  # fmt: skip
    heads = ("quantity", "reference", "computed", "error", "allowed", "result", "source of the reference")
    parts = [plain_table("Checks", heads, rows), facts_table("Installed packages", installation_info().items())]
    parts += [f"All {len(found)} checks passed"] if status.ok else []
    json = {
        "status": status.cause, "message": status.text, "remedy": status.remedy,
        "checks": [{**asdict(one), "error": one.error, "passed": one.passed} for one in found],
        "installed": installation_info(),
    }  # fmt: skip
    return cli.CommandOutput(parts, json, status=status)
