"""The command that solves a case in time: run."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from flexcam import fidelity
from flexcam.budget import affordable
from flexcam.case import Case
from flexcam.checks import InputError, together
from flexcam.commands.app import (
    AllowLarge,
    CaseFile,
    Folder,
    Json,
    Overrides,
    Overwrite,
    app,
    load,
    running,
)
from flexcam.commands.duration import duration
from flexcam.console.doubts import run_doubts
from flexcam.console.ran import Ran, ran_json, ran_parts
from flexcam.console.watched import Watched
from flexcam.integrate import solve
from flexcam.io import free_to_write, named_as_folder, takes_files
from flexcam.response import Cause, RunFailedError, Stats, Status
from flexcam.runner import (
    budget_of,
    figures_of,
    prepare,
    recent,
    result_file,
    scalar_probe,
    standing,
    unfinished,
)
from flexcam.terminal import out, print_json, progress
from flexcam.train import StrengthSink, build_structure

Resume = Annotated[
    bool, Parameter("--resume", negative=(), help="Go on with the run that left a partial result in the folder.")
]
TimeLimit = Annotated[
    str | None,
    Parameter(
        "--time-limit", help="End the command after so long, such as 30s, 5min30s or 2h; what is done of the run stays."
    ),
]


@app.command(
    help_prologue="""\
flexcam run case.toml
flexcam run case.toml -o results --set run.revolutions=4 --overwrite
flexcam run case.toml -o results --resume
flexcam run case.toml --time-limit 5min
"""
)
def run(
    case: CaseFile, *, folder: Folder = Path("results"), overrides: Overrides = None, overwrite: Overwrite = False,
    time_limit: TimeLimit = None, resume: Resume = False, allow_large: AllowLarge = False, as_json: Json = False,
) -> Status:  # fmt: skip
    """Solve a case in time and write its result file."""
    begun = time.monotonic()
    given = together(
        lambda: load(case, overrides),
        lambda: takes_files(named_as_folder(folder)),
        lambda: None if time_limit is None else duration("--time-limit", time_limit),
    )
    until = None if time_limit is None else begun + duration("--time-limit", time_limit)
    if not resume:  # before anything is computed to choose a model
        free_to_write("result", folder / f"{given.name}.vtkhdf", overwrite=overwrite)
    read, choice = fidelity.chosen(given, until)
    probe = scalar_probe(standing(read)) if read.record.fidelity.estimate else ""
    ready = prepare(read, until=until, allow_large=allow_large)
    if not allow_large:
        affordable(budget_of(ready, "revolution"), folder)
    earlier = unfinished(ready, folder) if resume else None
    strength, kept, watched = StrengthSink(build_structure(ready.model)), recent(ready), Watched.of(ready)

    def doubtful(stats: Stats) -> list[str]:
        return run_doubts(ready, watched, figures_of(ready, kept.response()), stats)

    sink = result_file(ready, folder, overwrite=overwrite, resume=earlier, warnings=doubtful)
    running.solving = True
    with progress(ready.problem.steps) as bar:
        response = solve(
            ready.problem, ready.scheme, save=ready.save, sinks=[strength, *watched.sinks, sink, *bar],
            stop=running.stopped, until=until, memory=kept, resume=earlier,
        )  # fmt: skip
    running.solving = False
    estimated = _estimated(read, probe, until) if probe and response.status.ok else ((), ())
    ran = Ran(
        ready, response, watched, sink.path if response.status.ok else sink.partial,
        figures=tuple(figures_of(ready, response)),
        stressed=strength.members() if read.record.fidelity.model == "beams" else {},
        errors=estimated[0], warnings=(*doubtful(response.stats), *estimated[1]), choice=choice,
    )  # fmt: skip
    if as_json:
        print_json(ran_json(ran))
    else:
        for part in ran_parts(ran):
            out().print(part)
    if response.status.ok and choice is not None and not choice.met:
        return Status(Cause.TOLERANCE, f"the tolerance is not met: {choice.why}", "allow more, or refine the case")
    return response.status


def _estimated(
    case: Case, probe: str, until: float | None
) -> tuple[tuple[fidelity.Error, ...], tuple[str, ...]]:  # fmt: skip
    """Return how far the numbers may be off, or a sentence why that is not known; the run itself is complete."""
    try:
        return tuple(fidelity.estimate(case, probe, until)), ()
    except RunFailedError as failure:
        late = failure.status.cause is Cause.TIME_LIMIT
        why = failure.status.text if not late else "the time given to the command was over"
        return (), (f"Warning: no error is estimated, as a run with other steps or elements ended: {why}",)
    except InputError as refusal:  # a method, a path or a start that does not take other steps or elements
        told = "; ".join(str(fault) for fault in refusal.faults)
        return (), (f"Warning: no error is estimated, as a run with other steps or elements is refused: {told}",)
    except KeyboardInterrupt:
        return (), ("Warning: no error is estimated, as that was interrupted",)
