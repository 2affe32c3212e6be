"""Command that runs a case: run."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.table import Table

from flexcam.analysis.model_choice import Choice, Error, estimate_errors, select_case
from flexcam.analysis.preparation import PreparedRun, prepare, prepare_without_periodic_search, scalar_probe
from flexcam.analysis.resources import check_resources
from flexcam.analysis.run import estimate_case_resources, open_partial_result, open_result_file, summary_sink
from flexcam.analysis.run_checks import (
    MAX_PERIODICITY_ERROR,
    RunMonitor,
    check_run,
    check_transient,
    describe_balance,
    describe_change,
    energy_residual,
    numerical_dissipation,
)
from flexcam.analysis.run_metrics import FigureOfMerit, compute_metrics, figures_of_merit, revolution_change, usual_name
from flexcam.case.case import Case
from flexcam.cli import app as cli
from flexcam.core.errors import NAME, NAMES, InputError, collect_errors, refuse
from flexcam.core.units import set_unit_system
from flexcam.dynamics import Cause, Response, RunFailedError, Stats, Status, solve
from flexcam.io import check_folder, check_folder_name, check_writable
from flexcam.report import tables
from flexcam.report.fidelity_tables import choice_json, describe_choice, error_table
from flexcam.report.terminal import show_progress
from flexcam.valvetrain import MemberStrength, Metric, StrengthSink, build_structure

_CHATTER = 0.1
"""Change of a contact force from one revolution to the next, rms, above which the run reports chatter."""


@dataclass(frozen=True, eq=False)
class FinishedRun:
    """Finished run."""

    ready: PreparedRun
    response: Response
    watched: RunMonitor
    result: Path
    figures: Sequence[Metric]
    merit: Sequence[FigureOfMerit]
    stressed: Mapping[str, MemberStrength]
    errors: Sequence[Error]
    warnings: Sequence[str]
    choice: Choice | None


def _run_json(ran: FinishedRun) -> dict[str, object]:
    response, status = ran.response, ran.response.status
    change = revolution_change(ran.ready, response)
    return {
        "status": str(status.cause), "message": status.text, "remedy": status.remedy, "result": str(ran.result),
        "steps": response.stats.steps, "dof": ran.ready.problem.system.size, "integrated": response.stats.unknowns,
        "seconds": response.stats.seconds, "events": response.stats.events,
        "periodicity": tables.periodicity_error(response),
        **({} if change is None else {"revolution_change": asdict(change)}),
        "energy_lost": energy_residual(ran.watched.extremes),
        "energy_numerical": numerical_dissipation(ran.watched.extremes),
        "imbalance": tables.equilibrium_residual(response), "warnings": list(ran.warnings),
        "train": {figure.name: figure.value for figure in ran.figures},
        "figures_of_merit": [asdict(one) for one in ran.merit],
        "errors": [asdict(one) for one in ran.errors],
        "choice": None if ran.choice is None else choice_json(ran.choice),
        "strength": {name: asdict(member) for name, member in ran.stressed.items()},
    }  # fmt: skip


def _run_output(ran: FinishedRun) -> Iterator[Table | str]:
    """Yield the printed tables and sentences of a run."""
    yield tables.run_table(ran.ready.case, ran.watched.extremes)
    if ran.stressed:
        yield tables.strength_table(ran.stressed)
    if ran.merit:
        yield tables.merit_table(ran.ready.model, ran.merit)
    if others := [figure for figure in ran.figures if not usual_name(figure)]:
        yield tables.metrics_table(ran.ready.model, others)
    if ran.errors:
        yield error_table(ran.errors)
    yield from describe_choice(ran.choice) if ran.choice else ()
    yield from (*tables.describe_contacts(ran.ready.case, ran.figures), *ran.warnings)
    stats = ran.response.stats
    if 0.0 <= stats.periodicity <= MAX_PERIODICITY_ERROR:
        yield f"Periodic start: after a revolution the state differs by {stats.periodicity:.3g} of the motion"
    if change := revolution_change(ran.ready, ran.response):
        impacts = "; this contact chatters: its impacts differ from revolution to revolution"
        chatter = impacts if change.force > _CHATTER else ""
        yield f"The last two revolutions differ by {describe_change(change)}{chatter}"
    if balance := describe_balance(ran.watched.extremes, stats):
        yield f"Energy balance: {balance}"
    yield (
        f"{stats.steps} steps of {tables.describe_dofs(ran.response)}; result: {ran.result}\n"
        f"Open it in ParaView 5.12 or newer; for older versions: flexcam export {ran.result} --format pvd"
    )


@cli.app.command(
    help_prologue="""\
flexcam run case.toml
flexcam run case.toml -o results --set run.revolutions=4 --overwrite
flexcam run case.toml --set run.speed=4000rpm --name fast
flexcam run case.toml --units imperial
flexcam run case.toml -o results --resume
flexcam run case.toml --time-limit 5min
"""
)
def run(
    case: cli.CaseFile, *,
    folder: cli.Folder = Path("results"),
    name: Annotated[str | None, Parameter(help="Name of the result; that of the case file by default.")] = None,
    overrides: cli.Overrides = None,
    time_limit: Annotated[str | None, Parameter(
        help="End the command after this time, such as 30s, 5min30s or 2h; a partial result stays.")] = None,
    resume: Annotated[bool, Parameter(help="Continue the run that left a partial result in the folder.")] = False,
    units: cli.Units = None, allow_large: cli.AllowLarge = False, overwrite: cli.Overwrite = False,
    as_json: cli.Json = False,
) -> Status:  # fmt: skip
    """Run a case and write its result file: motion, forces, stresses and energy over time.

    It prints the metrics of the valve train and warnings; ParaView 5.12 or newer opens the result. Ctrl-C ends the run
    at its next step and keeps a partial result, which --resume continues from its last checkpoint, if there is one.
    """
    begun = time.monotonic()
    set_unit_system(units or "metric")
    given, duration = collect_errors(
        lambda: cli.load_case(case, overrides),
        lambda: None if time_limit is None else cli.parse_duration("--time-limit", time_limit),
        lambda: check_folder(check_folder_name(folder)),
    )
    if name is not None:
        if not re.match(NAME, name):
            raise refuse("--name", repr(name), NAMES, "it is the name of a file")
        given = replace(given, result_name=name)
    until = None if duration is None else begun + duration
    if not resume:  # before the model is chosen, which requires computations
        check_writable("result", folder / f"{given.name}.vtkhdf", overwrite=overwrite)
    read, choice = select_case(given, until)
    probe = scalar_probe(prepare_without_periodic_search(read)) if read.record.fidelity.estimate else ""
    ready = prepare(read, until=until, allow_large=allow_large)
    if not allow_large:
        check_resources(estimate_case_resources(ready, "revolution"), folder)
    earlier = open_partial_result(ready, folder) if resume else None
    strength, kept, watched = StrengthSink(build_structure(ready.model)), summary_sink(ready, 2.0), RunMonitor.of(ready)

    def doubtful(stats: Stats) -> list[str]:
        recent = kept.response()
        transient = (
            check_transient(ready, revolution_change(ready, recent)) if stats.steps == ready.problem.steps else []
        )
        return [*check_run(ready, watched, compute_metrics(ready, recent), stats), *transient]

    sink = open_result_file(ready, folder, overwrite=overwrite, resume=earlier, warnings=doubtful)
    cli.run_state.solving = True
    with show_progress(ready.problem.steps) as bar:
        response = solve(
            ready.problem, ready.scheme, save=ready.save, sinks=[strength, *watched.sinks, sink, *bar],
            stop=cli.run_state.should_stop, until=until, memory=kept, resume=earlier,
        )  # fmt: skip
    cli.run_state.solving = False
    estimated = _estimate_errors(read, probe, until) if probe and response.status.ok else ((), ())
    figures = tuple(compute_metrics(ready, response))
    ran = FinishedRun(
        ready, response, watched, sink.path if response.status.ok else sink.partial,
        figures=figures, merit=figures_of_merit(ready.case, figures) if figures else (),
        stressed=strength.members() if read.record.fidelity.model == "beams" else {},
        errors=estimated[0], warnings=(*doubtful(response.stats), *estimated[1]), choice=choice,
    )  # fmt: skip
    cli.write_output(cli.CommandOutput(list(_run_output(ran)), _run_json(ran)), as_json=as_json)
    if response.status.ok and choice is not None and not choice.met:
        return Status(Cause.TOLERANCE, f"the tolerance is not met: {choice.why}", "allow more, or refine the case")
    return response.status


def _estimate_errors(case: Case, probe: str, until: float | None) -> tuple[tuple[Error, ...], tuple[str, ...]]:
    """Return the estimated errors, or a sentence with the reason why there are none; the run itself is complete."""
    try:
        return tuple(estimate_errors(case, probe, until)), ()
    except RunFailedError as failure:
        late = failure.status.cause is Cause.TIME_LIMIT
        why = "the time limit was reached" if late else failure.status.text
        why = f"a run with other steps or elements ended: {why}"
    except InputError as refusal:  # a method, engine or initial state that does not accept other steps or elements
        faults = "; ".join(str(fault) for fault in refusal.faults)
        why = f"a run with other steps or elements is refused: {faults}"
    except KeyboardInterrupt:
        why = "the estimate was interrupted"
    return (), (f"Warning: no errors are estimated, because {why}",)
