"""What `flexcam run` tells of a run that is over: tables and sentences, or JSON."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from rich.table import Table

from flexcam.console.cases import couplings
from flexcam.console.doubts import balances, lost_energy, numerical_energy
from flexcam.console.fidelity import choice_json, choice_words, error_table
from flexcam.console.results import imbalance, operation_table, periodicity, run_table, strength_table, unknowns
from flexcam.console.watched import Watched
from flexcam.fidelity import Choice, Error
from flexcam.response import Response
from flexcam.runner import Prepared
from flexcam.train import Figure, MemberStrength


@dataclass(frozen=True, eq=False)
class Ran:
    """A run that is over.

    Parameters
    ----------
    ready, response
        What was run, and what is in memory of it.
    watched
        What was watched on the way.
    result
        Its file.
    figures
        How the train worked.
    stressed
        Members by name, where they were computed.
    errors
        How far the numbers may be off, where that was asked.
    warnings
        Sentences.
    choice
        Why this model was run, where a tolerance was given.
    """

    ready: Prepared
    response: Response
    watched: Watched
    result: Path
    figures: Sequence[Figure]
    stressed: Mapping[str, MemberStrength]
    errors: Sequence[Error]
    warnings: Sequence[str]
    choice: Choice | None


def ran_json(ran: Ran) -> dict[str, object]:
    """Return a run as JSON takes it."""
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
    """Yield what is printed of a run, part by part."""
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
