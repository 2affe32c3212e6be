"""Whether there is room for a sweep: looked at for its first variant, before any of them runs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from flexcam.budget import affordable
from flexcam.case import Case
from flexcam.checks import InputError
from flexcam.response import RunFailedError
from flexcam.runner import budget_of, prepare
from flexcam.sweep.bundle import opened
from flexcam.sweep.study import Study


def afford(asked: Study, folder: Path | None = None, *, together: int = 1) -> None:
    """Refuse a sweep for whose first variants there is no room."""
    first = opened(asked.bundle).read(asked.plan.variants[0])
    afford_case(first, folder, runs=len(asked.plan), together=min(together, len(asked.plan)))


def afford_case(case: Case, folder: Path | None = None, *, runs: int = 1, together: int = 1) -> None:
    """Refuse many runs of a case for which there is no room."""
    periodic = case.record.run.start == "periodic"  # that state takes many revolutions to find
    try:
        ready = prepare(case.with_run({"start": "equilibrium"}) if periodic else case)
    except (InputError, RunFailedError):  # its own row will say so
        return
    needs = budget_of(ready)
    affordable(replace(needs, file=runs * needs.file), folder, together=together)
