"""Command about the installation: selftest."""

from __future__ import annotations

from flexcam.commands.app import Json, app
from flexcam.console.selftest import check_table, installed_table, selftest_json
from flexcam.response import Cause, Status
from flexcam.selftest import checks, installed
from flexcam.terminal import out, print_json


@app.command(
    help_prologue="""\
flexcam selftest
flexcam selftest --json
"""
)
def selftest(*, as_json: Json = False) -> Status:
    """Check that this installation computes what it must: closed forms, published digits, and itself.

    It takes some seconds, and half a minute where machine code is compiled for the first time. Exit code 3 if a check
    fails.
    """
    found = list(checks())
    failed = [one.quantity for one in found if not one.passed]
    status = Status()
    if failed:
        text = f"{len(failed)} of {len(found)} checks are beyond their tolerance: {'; '.join(failed)}"
        status = Status(
            Cause.FAULT, text, "install again, in a new environment; if that does not help, please report it"
        )
    if as_json:
        print_json(selftest_json(found, installed(), status))
        return status
    out().print(check_table(found))
    out().print()
    out().print(installed_table(installed()))
    if status.ok:
        out().print(f"\nAll {len(found)} checks passed")
    return status
