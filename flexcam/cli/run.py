"""Command that runs a case: run, with its tables, sentences and JSON."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.table import Table

from flexcam.analysis.error_estimate import Error, estimate
from flexcam.analysis.model_choice import Choice, chosen
from flexcam.analysis.preparation import Prepared, figures_of, prepare, scalar_probe, standing
from flexcam.analysis.resources import affordable
from flexcam.analysis.run import budget_of, recent, result_file, unfinished
from flexcam.case.case import Case
from flexcam.cli.app import AllowLarge, CaseFile, Folder, Json, Overrides, Overwrite, app, load, running
from flexcam.cli.arguments import duration
from flexcam.core.errors import InputError, together
from flexcam.dynamics import Cause, Response, RunFailedError, Stats, Status, solve
from flexcam.io import free_to_write, named_as_folder, takes_files
from flexcam.report.fidelity_tables import choice_json, choice_words, error_table
from flexcam.report.model_tables import couplings
from flexcam.report.result_tables import imbalance, operation_table, periodicity, run_table, strength_table, unknowns
from flexcam.report.run_checks import Watched, balances, lost_energy, numerical_energy, run_doubts
from flexcam.report.terminal import out, print_json, progress
from flexcam.valvetrain import MemberStrength, Metric, StrengthSink, build_structure


@dataclass(frozen=True, eq=False)
class Ran:
    """Finished run.

    Parameters
    ----------
    ready, response
        Prepared run and its response in memory.
    watched
        Data collected during the run for checks.
    result
        Path of the result file.
    figures
        Metrics of the train.
    stressed
        Stresses by member, if they were computed.
    errors
        Estimated errors, if they were requested.
    warnings
        Warnings.
    choice
        Choice of the model, if a tolerance was given.
    """

    ready: Prepared
    response: Response
    watched: Watched
    result: Path
    figures: Sequence[Metric]
    stressed: Mapping[str, MemberStrength]
    errors: Sequence[Error]
    warnings: Sequence[str]
    choice: Choice | None


def ran_json(ran: Ran) -> dict[str, object]:
    """Return a run for ``--json``."""
    response, status = ran.response, ran.response.status
    return {
        "status": str(status.cause), "message": status.text, "remedy": status.remedy,
        "result": str(ran.result), "steps": response.stats.steps, "dof": ran.ready.problem.system.size,
        "integrated": response.stats.unknowns, "seconds": response.stats.seconds,
        "events": response.stats.events, "periodicity": periodicity(response),
        "energy_lost": lost_energy(ran.watched.extremes), "energy_numerical": numerical_energy(ran.watched.extremes),
        "imbalance": imbalance(response),
        "warnings": list(ran.warnings),
        "train": {figure.name: figure.value for figure in ran.figures},
        "errors": [asdict(one) for one in ran.errors],
        "choice": None if ran.choice is None else choice_json(ran.choice),
        "strength": {name: asdict(member) for name, member in ran.stressed.items()},
    }  # fmt: skip


def ran_parts(ran: Ran) -> Iterator[Table | str]:
    """Yield the printed tables and sentences of a run."""
    yield run_table(ran.ready.case, ran.watched.extremes)
    for table in _tables(ran):
        yield ""
        yield table
    chosen = choice_words(ran.choice) if ran.choice else []
    yield from ("\n" + sentence for sentence in (*chosen, *couplings(ran.ready.case, ran.figures), *ran.warnings))
    stats = ran.response.stats
    if stats.periodicity >= 0.0:
        yield f"\nThe start returns after a revolution within {stats.periodicity:.3g} of the motion"
    if told := balances(ran.watched.extremes, stats):
        yield f"\nEnergy balance: {told}"
    yield f"\n{stats.steps} steps of {unknowns(ran.response)}; result: {ran.result}"
    yield f"Open it in ParaView 5.12 or newer; for older ones: flexcam export {ran.result} --format pvd"


def _tables(ran: Ran) -> Iterator[Table]:
    if ran.stressed:
        yield strength_table(ran.stressed)
    if ran.figures:
        yield operation_table(ran.figures)
    if ran.errors:
        yield error_table(ran.errors)


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
    if not resume:  # before the model is chosen, which requires computations
        free_to_write("result", folder / f"{given.name}.vtkhdf", overwrite=overwrite)
    read, choice = chosen(given, until)
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
) -> tuple[tuple[Error, ...], tuple[str, ...]]:  # fmt: skip
    """Return the estimated errors, or a sentence with the reason why there are none; the run itself is complete."""
    try:
        return tuple(estimate(case, probe, until)), ()
    except RunFailedError as failure:
        late = failure.status.cause is Cause.TIME_LIMIT
        why = failure.status.text if not late else "the time given to the command was over"
        return (), (f"Warning: no error is estimated, as a run with other steps or elements ended: {why}",)
    except InputError as refusal:  # a method, engine or initial state that does not accept other steps or elements
        told = "; ".join(str(fault) for fault in refusal.faults)
        return (), (f"Warning: no error is estimated, as a run with other steps or elements is refused: {told}",)
    except KeyboardInterrupt:
        return (), ("Warning: no error is estimated, as that was interrupted",)
