"""Command that runs a case: run."""

from __future__ import annotations

import re
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.table import Table

from flexcam.analysis import run_checks, run_metrics
from flexcam.analysis.model_choice import Choice, Error, estimate_errors, select_case
from flexcam.analysis.preparation import PreparedRun, prepare, prepare_without_periodic_search, scalar_probe
from flexcam.analysis.resources import check_resources
from flexcam.analysis.run import (
    estimate_case_resources,
    open_partial_result,
    open_result_file,
    strength_sink,
    summary_sink,
)
from flexcam.case.case import Case
from flexcam.case.problem_builder import excitation_without_period
from flexcam.cli import app as cli
from flexcam.core.errors import NAME, NAMES, InputError, collect_errors, refuse
from flexcam.dynamics import Cause, Response, RunFailedError, Stats, Status, solve
from flexcam.io import check_folder, check_folder_name, check_writable
from flexcam.report import tables
from flexcam.report.fidelity_tables import choice_json, describe_choice, error_table
from flexcam.report.terminal import show_progress
from flexcam.valvetrain import CamContact, Metric, StrengthSink


@cli.command("""\
flexcam run case.toml
flexcam run case.toml -o results --set run.revolutions=4 --overwrite
flexcam run case.toml --set run.speed=4000rpm --name fast
flexcam run case.toml --units imperial
flexcam run case.toml -o results --resume
flexcam run case.toml --time-limit 5min
""")
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
) -> cli.CommandOutput:  # fmt: skip
    """Run a case and write its result file: motion, forces, stresses and energy over time.

    It prints the metrics of the valve train and warnings; ParaView 5.12 or newer opens the result. Ctrl-C ends the run
    at its next step and keeps a partial result, which --resume continues from its last checkpoint, if there is one.
    """
    start = time.monotonic()
    loaded, duration = collect_errors(
        lambda: cli.load_case(case, overrides),
        lambda: None if time_limit is None else cli.parse_duration("--time-limit", time_limit),
        lambda: check_folder(check_folder_name(folder)),
    )
    if name is not None:
        if not re.match(NAME, name):
            raise refuse("--name", repr(name), NAMES, "it is the name of a file")
        loaded = replace(loaded, result_name=name)
    until = None if duration is None else start + duration
    if not resume:  # before the model is chosen, which requires computations
        remedy = "use --overwrite, or give another --name or folder (-o)"
        check_writable("result", folder / f"{loaded.name}.vtkhdf", overwrite=overwrite, remedy=remedy)
    read, choice = select_case(loaded, until)
    probe = scalar_probe(prepare_without_periodic_search(read)) if read.record.fidelity.estimate else ""
    ready = prepare(read, until=until, allow_large=allow_large)
    if not allow_large:
        check_resources(estimate_case_resources(ready, "revolution"), folder)
    earlier = open_partial_result(ready, folder) if resume else None
    strength, memory = strength_sink(ready), summary_sink(ready, 2.0)
    monitor = run_checks.RunMonitor.of(ready)

    @cache
    def metrics(_: int) -> list[Metric]:
        return run_metrics.compute_metrics(ready, memory.response())

    def doubtful(stats: Stats) -> list[str]:
        recent = memory.response()
        sentences = run_checks.check_run(ready, monitor, metrics(stats.steps), stats)
        if stats.steps == ready.problem.steps:
            sentences += run_checks.check_transient(ready, run_metrics.revolution_change(ready, recent))
        return sentences

    sink = open_result_file(ready, folder, overwrite=overwrite, resume=earlier, warnings=doubtful)
    cli.run_state.solving = True
    with show_progress(ready.problem.steps) as bar:
        response = solve(
            ready.problem, ready.scheme, save=ready.save, sinks=[strength, *monitor.sinks, sink, *bar],
            stop=lambda: bool(cli.run_state.signals), until=until, memory=memory, resume=earlier,
        )  # fmt: skip
    cli.run_state.solving = False
    errors, notes = _estimate_errors(read, probe, until) if probe and response.status.ok else ((), ())
    path, warnings = sink.path if response.status.ok else sink.partial, [*doubtful(response.stats), *notes]
    figures = metrics(response.stats.steps)
    output = _describe_run(ready, response, figures, monitor, path, strength, errors, warnings, choice)
    if response.status.ok and choice is not None and not choice.is_met:
        why, remedy = f"the tolerance is not met: {choice.why}", "allow more, or refine the case"
        return replace(output, status=Status(Cause.TOLERANCE, why, remedy))
    return output


def _describe_run(
    ready: PreparedRun, response: Response, figures: Sequence[Metric], monitor: run_checks.RunMonitor, path: Path,
    strength: StrengthSink, errors: Sequence[Error], warnings: Sequence[str], choice: Choice | None,
) -> cli.CommandOutput:  # fmt: skip
    case, stats, status, extremes = ready.case, response.stats, response.status, monitor.extremes
    stressed = strength.members() if case.record.fidelity.model == "beams" else {}
    change = run_metrics.revolution_change(ready, response, strength if stressed else None)
    merit = run_metrics.figures_of_merit(case, figures) if figures else ()
    remaining = [figure for figure in figures if not run_metrics.usual_name(figure)]
    span = run_metrics.describe_span(ready, stats.steps)
    parts: list[Table | str] = [
        tables.run_table(case, extremes),
        *([tables.strength_table(strength)] if stressed else []),
        *([tables.merit_table(ready.model, merit, span)] if merit else []),
        *([tables.metrics_table(ready.model, remaining, span)] if remaining else []),
        *([error_table(errors)] if errors else []),
        *(describe_choice(choice) if choice else []),
        *tables.describe_contacts(case, figures),
        *warnings,
    ]
    if 0.0 <= stats.periodicity <= run_checks.MAX_PERIODICITY_ERROR:
        error = f"{100.0 * stats.periodicity:.2g} % of the amplitude"
        parts.append(f"Periodic start: the state after one revolution differs from that at its start by {error}")
    if change:
        hint, grows = "", change.stress_change > run_metrics.GROWTH
        if grows or (change.force > run_metrics.CHATTER and not excitation_without_period(case)):
            slow, decays = run_checks.describe_decay(ready, change.member) if grows else ("", True)
            hint = ". Run more revolutions until the values repeat" if decays else ""
            pair = ready.model.cam_contacts.get(change.contact)
            if decays and isinstance(pair, CamContact) and pair.unilateral:
                never = "If they never do, contacts chatter (see flexcam stability)"
                hint += f". {never}: use the largest value of several revolutions"
            hint += f". {slow}" if slow else ""
        parts.append(f"Difference between the last two revolutions: {run_checks.describe_change(change)}{hint}")
    elif status.ok and ready.model.cam_contacts and stats.unknowns and stats.periodicity < 0.0:
        hint = "with run.revolutions = 2, flexcam prints the difference between the two revolutions"
        parts.append(f"Fewer than two revolutions: the start may affect the results; {hint}")
    parts += run_checks.describe_method(ready, monitor)
    if balance := run_checks.describe_balance(extremes, stats):
        parts.append(f"Energy balance: {balance}")
    opening = f"\nOpen it in ParaView 5.12 or newer; for older versions: flexcam export {path} --format pvd"
    opening = opening if len(response.time) else ""
    parts.append(f"{stats.steps} steps of {tables.describe_dofs(response)}; result: {path}{opening}")
    json = {
        "status": status.cause, "message": status.text, "remedy": status.remedy, "result": path,
        "steps": stats.steps, "dof": ready.problem.system.size, "integrated": stats.unknowns,
        "seconds": stats.seconds, "events": stats.events,
        "periodicity": stats.periodicity if stats.periodicity >= 0.0 else None,
        **({"revolution_change": change} if change else {}),
        "energy_lost": abs(run_checks.energy_share(extremes, "residual")),
        "energy_numerical": run_checks.energy_share(extremes, "numerical"),
        "imbalance": stats.imbalance if stats.imbalance >= 0.0 else None, "warnings": list(warnings),
        "metrics_of": span, "train": {figure.name: figure.value for figure in figures},
        "figures_of_merit": merit, "errors": errors, "choice": choice and choice_json(choice), "strength": stressed,
    }  # fmt: skip
    return cli.CommandOutput(parts, json, status=status)


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
