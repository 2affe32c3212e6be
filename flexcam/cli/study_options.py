"""Options of the commands that run a case many times, and the case that they vary."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Annotated

from cyclopts import Group, Parameter

from flexcam.analysis.limits import Search
from flexcam.analysis.run import check_case_resources
from flexcam.case.reader import CaseFile as OpenCase
from flexcam.case.variants import case_text
from flexcam.cli import app as cli
from flexcam.dynamics import RunFailedError, reraise_interrupt
from flexcam.io import write_text
from flexcam.report.terminal import show_count
from flexcam.studies.gradients import gradient_evaluator
from flexcam.studies.quantities import check_names, compute_quantities, create_evaluator, frequency_number
from flexcam.studies.variables import Runs, Variable, WorstCase
from flexcam.valvetrain import Metric

_LIMITS = Group("Speed range (only for results that are speed limits, such as limits.bounce)", sort_key=2)

WorkerCount = Annotated[int, Parameter("--workers", help="Number of processes that evaluate variants.")]
Lowest = Annotated[cli.Lowest, Parameter(group=_LIMITS)]
Highest = Annotated[cli.HighestOfSearch, Parameter(group=_LIMITS)]
LimitAccuracy = Annotated[cli.Accuracy, Parameter(group=_LIMITS)]


class StudyOptions:
    """Case and options of a study."""

    def __init__(
        self, path: Path, overrides: Sequence[str] | None, names: Sequence[str],
        lowest: str | None, highest: str | None, accuracy: str, *, option: str, workers: int, allow_large: bool,
    ) -> None:  # fmt: skip
        self.file, self.fixed = OpenCase.open(path), tuple(overrides or ())
        self.case = self.file.read(self.fixed)
        cli.warn_ignored_keys(self.fixed, self.case)
        self.names, self.workers = tuple(dict.fromkeys(names)), workers
        of_limits = any(name.startswith("limits.") for name in names)
        cli.refuse_without("limits.NAME", {"--lowest": lowest, "--highest": highest}, present=of_limits)
        self.search = Search(*cli.search_range(lowest, highest, accuracy, self.case))
        check_names(self.case, self.names, option)
        if not allow_large and any(frequency_number(name) is None for name in names):
            check_case_resources(self.case, together=workers)
        cli.warn_input(self.case)

    def initial_quantities(self, count: int) -> dict[str, Metric]:
        """Return the requested quantities of the unchanged case; unknown names raise an error."""
        try:
            return compute_quantities(self.case, self.names, self.search, count)
        except RunFailedError as failure:
            reraise_interrupt(failure.status)
            raise

    @contextmanager
    def evaluators(
        self, count: int, names: Sequence[str] | None = None, variables: Sequence[Variable] = (),
        worst: WorstCase | None = None,
    ) -> Generator[Runs]:  # fmt: skip
        """Yield the function that evaluates variants, with derivatives by some variables, and show the progress."""
        scalars = self.names if names is None else names
        with show_count(count if scalars else 0, "variants") as advance:
            evaluator = partial(create_evaluator, search=self.search, runs=count)
            if variables:
                evaluator = partial(gradient_evaluator, variables=variables, worst=worst)
            with evaluator(self.file, self.fixed, scalars, workers=self.workers, advance=advance) as runs:
                yield worst.over(runs) if worst and not variables else runs


Vary = Annotated[
    list[str], Parameter("--vary", help="Value of the case and its interval: KEY=LOW:HIGHunit. Repeatable.")
]
NewCase = Annotated[Path | None, Parameter(["-o", "--output"], help="Also write the best variant to this case file.")]


def write_variant(file: OpenCase, overrides: Sequence[str], target: Path, title: str, *, overwrite: bool) -> list[Path]:
    """Write a variant of a case as a case file, and return its path."""
    head = (title, *(f"  --set {override}" for override in overrides))
    write_text(target, case_text(file.read(overrides), target, head), overwrite=overwrite)
    return [target]
