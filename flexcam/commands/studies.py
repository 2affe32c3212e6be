"""Commands of design studies: sensitivity, optimize."""

from __future__ import annotations

import math
from collections.abc import Generator, Sequence
from contextlib import contextmanager, suppress
from itertools import compress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
from cyclopts import Parameter

from flexcam import study
from flexcam.case import Case, CaseFile
from flexcam.checks import refuse
from flexcam.commands.answers import Answer, write_answer
from flexcam.commands.app import (
    AllowLarge,
    Json,
    Overrides,
    Overwrite,
    Picture,
    app,
    bracket,
    free_picture,
    speed_range,
    tell_unused,
)
from flexcam.commands.app import CaseFile as CasePath
from flexcam.commands.targets import apart, free_targets
from flexcam.console.optimum import goal_history, told_front, told_optimum
from flexcam.console.sensitivity import told_derivatives, told_scatter, told_shares
from flexcam.io import free_to_write, write_text
from flexcam.limits import Search
from flexcam.linalg import FloatArray
from flexcam.response import Cause, RunFailedError, Status, heed
from flexcam.study.differences import STEPS
from flexcam.sweep import afford_case
from flexcam.terminal import counting

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Names = Annotated[
    list[str],
    Parameter("--of", negative=(), help="What is asked for: a scalar of a run, frequency.1, limits.loss_of_contact."),
]
Csv = Annotated[Path | None, Parameter("--csv", help="Also write the table here.")]
Seed = Annotated[int, Parameter("--seed", help="Of what is sampled: the same seed gives the same points.")]
WorkerCount = Annotated[int, Parameter("--workers", help="Processes that evaluate variants.")]
Lowest = Annotated[str | None, Parameter("--lowest", help="Speed from which limits are looked for.")]
Highest = Annotated[str | None, Parameter("--highest", help="Speed up to which limits are looked for.")]
Within = Annotated[str, Parameter("--within", help="Width of the bracket of limits.")]


@app.command(
    help_prologue="""\
flexcam sensitivity case.toml --of frequency.1 --to springs.valve.stiffness --to masses.valve.mass
flexcam sensitivity case.toml --of contacts.intake.force.largest --to springs.valve.stiffness --relative-step 0.02
flexcam sensitivity case.toml --of frequency.1 --to springs.valve.stiffness=30:60kN/m --to masses.valve.mass=80:100g --sobol 256
flexcam sensitivity case.toml --of limits.loss_of_contact --tolerance springs.valve.stiffness=±5% --count 100 --plot scatter.svg
"""  # noqa: E501 - a command to a line
)
def sensitivity(
    case: CasePath, *,
    names: Names,
    keys: Annotated[
        list[str] | None, Parameter("--to", negative=(), help="Key of a number; with --sobol KEY=LOW:HIGHunit.")
    ] = None,
    relative_step: Annotated[
        float | None, Parameter(help="Part of each number by which responses are differenced; 0.01 by default.")
    ] = None,
    sobol: Annotated[int | None, Parameter("--sobol", help="Sobol indices; base points, a power of 2.")] = None,
    tolerances: Annotated[
        list[str] | None,
        Parameter("--tolerance", negative=(), help="Scatter of parts: KEY=±2%, KEY=±0.05mm, KEY=normal:±2%."),
    ] = None,
    count: Annotated[int | None, Parameter("--count", help="Sets of scattered parts; 100 by default.")] = None,
    seed: Annotated[int | None, Parameter(help="Of --sobol and --tolerance; 0 by default.")] = None,
    workers: WorkerCount = 1,
    lowest: Lowest = None, highest: Highest = None, within: Within = "10 rpm",
    csv: Csv = None, plot: Picture = None,
    overrides: Overrides = None, allow_large: AllowLarge = False, overwrite: Overwrite = False, as_json: Json = False,
) -> Status:  # fmt: skip
    """Tell how scalars follow the numbers of a case: derivatives, shares of their variance, or the scatter of parts."""
    free_targets(csv, plot, case, overwrite=overwrite)
    if (sobol is not None) + (tolerances is not None) > 1:
        raise refuse("--sobol", "--sobol and --tolerance", "one of them", "they are two questions")
    if (tolerances is not None) == (keys is not None):
        given = "both --to and --tolerance" if keys else "neither --to nor --tolerance"
        raise refuse("sensitivity", given, "--to KEY, or --tolerance KEY=±SPEC")
    _ignored("--count", count, "--tolerance", wanted=tolerances is not None)
    _ignored("--seed", seed, "--sobol or --tolerance", wanted=tolerances is not None or sobol is not None)
    _ignored("--relative-step", relative_step, "derivatives", wanted=tolerances is None and sobol is None)
    asked = _Asked(
        case, overrides, names, lowest, highest, within, option="--of", workers=workers, allow_large=allow_large
    )
    if tolerances is not None:
        answer, ended = _scatter(asked, tolerances, 100 if count is None else count, seed or 0, workers)
    elif sobol is not None:
        answer, ended = _shares(asked, keys or [], sobol, seed or 0, workers)
    else:
        answer, ended = _derivatives(asked, keys or [], 0.01 if relative_step is None else relative_step, workers)
    write_answer(answer, csv, plot, ended, overwrite=overwrite, as_json=as_json)
    return ended


def _ignored(option: str, given: object, belongs: str, *, wanted: bool) -> None:
    """Refuse an option that would change nothing."""
    if given is not None and not wanted:
        raise refuse(option, str(given), f"{option} with {belongs} only", "it would be ignored", "leave it out")


class _Asked:
    """A case and what is asked of it, as the options say."""

    def __init__(
        self, path: Path, overrides: Sequence[str] | None, names: Sequence[str],
        lowest: str | None, highest: str | None, within: str, *, option: str, workers: int, allow_large: bool,
    ) -> None:  # fmt: skip
        self.file, self.fixed = CaseFile.opened(path), tuple(overrides or ())
        self.case = self.file.read(self.fixed)
        tell_unused(self.fixed, self.case)
        self.names = tuple(dict.fromkeys(names))
        of_limits = any(name.startswith("limits.") for name in names)
        for end, given in (("--lowest", lowest), ("--highest", highest)):
            _ignored(end, given, "limits.NAME", wanted=of_limits)
        self.search = search_of(self.case, lowest, highest, within)
        study.check_names(self.case, self.names, option)
        if not allow_large and any(study.frequency_number(name) is None for name in names):
            afford_case(self.case, together=workers)

    def checked(self, count: int) -> dict[str, study.Quantity]:
        """Return what is asked of the case as it stands, one of so many variants; unknown names are refused."""
        try:
            return study.measured(self.case, self.names, self.search, count)
        except RunFailedError as failure:
            heed(failure.status)
            raise

    @contextmanager
    def evaluators(self, count: int, workers: int, names: Sequence[str] | None = None) -> Generator[study.Runs]:
        """Give what evaluates about so many variants, and show how many are finished."""
        asked = self.names if names is None else names
        with (
            counting(count if asked else 0, "variants") as shown,
            study.evaluators(
                self.file, self.fixed, asked, self.search, workers=workers, runs=count, advance=shown
            ) as runs,
        ):
            yield runs


def search_of(case: Case, lowest: str | None, highest: str | None, within: str) -> Search:
    """Return where limits are looked for; from half to twice the case's speed by default."""
    low, high = speed_range(lowest, highest, 2, case.speed, case.turns, most=2.0)
    return Search(low, high, bracket("--within", within, case.turns))


def _derivatives(asked: _Asked, keys: list[str], relative_step: float, workers: int) -> tuple[Answer, Status]:
    responses = [name for name in asked.names if not study.frequency_number(name)]
    study.numbers_of(asked.case, keys)
    count = 1 + len(STEPS) * len(keys)
    asked.checked(count)
    with asked.evaluators(count, workers, responses) as runs:
        kept = study.Kept(runs)
        found = study.sensitivities(asked.file, asked.fixed, asked.names, keys, kept, relative_step=relative_step)

    def draw() -> Figure:
        from flexcam.view import bars_figure

        known = [one for one in found if not math.isnan(one.logarithmic)]
        groups = {name: {one.by.key: one.logarithmic for one in known if one.scalar == name} for name in asked.names}
        return bars_figure(groups, "percent per percent")

    return (told_derivatives(found), draw), kept.status


def _shares(asked: _Asked, keys: list[str], count: int, seed: int, workers: int) -> tuple[Answer, Status]:
    variables = study.variables_of(asked.case, keys, "--to")
    study.checked_count(count)
    asked.checked(count)
    low, high = (np.array([getattr(one, end) for one in variables]) for end in ("low", "high"))
    with asked.evaluators(count * (len(variables) + 2), workers) as runs:
        kept = study.Kept(runs)
        points = study.Points(asked.case, variables, kept)

        def values(parts: FloatArray) -> FloatArray:
            rows = points.rows(low + parts * (high - low))
            if kept.stopped and kept.done < _FEWEST * (len(variables) + 2):
                raise KeyboardInterrupt  # of one base point there are no shares
            return np.column_stack([study.column(rows, name) for name in asked.names])

        found = study.sobol_indices(values, len(variables), count, seed=seed)

    def draw() -> Figure:
        from flexcam.view import bars_figure

        keyed = [one.key for one in variables]
        pairs = list(zip(asked.names, found, strict=True))
        groups = {name: dict(zip(keyed, one.total.tolist(), strict=True)) for name, one in pairs}
        return bars_figure(
            groups, "share of the variance, with others", {name: one.total_interval for name, one in pairs}
        )

    return (told_shares(asked.names, variables, found), draw), kept.status


_FEWEST = 2
"""Base points that shares of a variance ask for."""


def _scatter(asked: _Asked, tolerances: list[str], count: int, seed: int, workers: int) -> tuple[Answer, Status]:
    scatters = study.scatters_of(asked.case, tolerances)
    parts = study.sampled(scatters, count, seed)
    middle = asked.checked(count)
    variables = tuple(study.Variable(one.key, one.middle - one.half, one.middle + one.half) for one in scatters)
    with asked.evaluators(count, workers) as runs:
        kept = study.Kept(runs)
        every = study.Points(asked.case, variables, kept).rows(parts)
    run = [row.status.cause is not Cause.INTERRUPTED for row in every]
    rows, parts = list(compress(every, run)), parts[run]

    def draw() -> Figure:
        from flexcam.view import scatter_figure

        values = {name: study.column(rows, name) for name in asked.names}
        units = {name: row.units[name] for row in rows for name in row.units}
        known = {name: one[~np.isnan(one)] for name, one in values.items()}
        return scatter_figure(known, units, {name: one.value for name, one in middle.items()})

    return (told_scatter(asked.names, scatters, parts, rows, middle), draw), kept.status


@app.command(
    help_prologue="""\
flexcam optimize case.toml --vary springs.valve.stiffness=30:90kN/m --vary springs.valve.installed_force=300:900N \\
    --least springs.valve.force.largest --subject 'contacts.intake.open_on_the_lift <= 0' --set run.crank_speed=6500rpm
flexcam optimize case.toml --vary cams.intake.rise=60:90deg --least cams.intake.deceleration --most cams.intake.area
"""
)
def optimize(
    case: CasePath, *,
    vary: Annotated[list[str], Parameter("--vary", negative=(), help="A number and its interval: KEY=LOW:HIGHunit.")],
    least: Annotated[list[str] | None, Parameter("--least", negative=(), help="What is to be small.")] = None,
    most: Annotated[list[str] | None, Parameter("--most", negative=(), help="What is to be large.")] = None,
    subject: Annotated[
        list[str] | None, Parameter("--subject", negative=(), help="A bound: 'NAME <= VALUE' or 'NAME >= VALUE'.")
    ] = None,
    evaluations: Annotated[int, Parameter(help="About how many variants may be run.")] = 200,
    seed: Seed = 0, workers: WorkerCount = 1,
    lowest: Lowest = None, highest: Highest = None, within: Within = "10 rpm",
    target: Annotated[Path | None, Parameter(["-o", "--output"], help="Case file (.toml) of the best variant.")] = None,
    csv: Csv = None, plot: Picture = None,
    overrides: Overrides = None, allow_large: AllowLarge = False, overwrite: Overwrite = False, as_json: Json = False,
) -> Status:  # fmt: skip
    """Find the best variant of a case within bounds; of two goals, those of which none is better in both."""
    apart({"--output": target, "--csv": csv, "--plot": plot}, [case])
    free_picture(plot, overwrite)
    for path in (csv, target):
        if path is not None:
            free_to_write("output", path, overwrite=overwrite)
    if target is not None and target.suffix != ".toml":
        raise refuse("--output", str(target), "a name that ends in .toml", "it is a case file")
    goals = (*(study.Goal(name) for name in least or ()), *(study.Goal(name, most=True) for name in most or ()))
    if len(goals) not in (1, 2):
        raise refuse("goals", f"{len(goals)} of --least and --most", "one, or two for a front")
    if len({goal.name for goal in goals}) < len(goals):
        why = "of one quantity there is no front: every variant would be on it"
        raise refuse("--least, --most", f"{goals[0].name} twice", "two different quantities", why, "leave one out")
    bounds = study.constraints_of(subject or ())
    names = [*(goal.name for goal in goals), *(bound.name for bound in bounds)]
    options = "--least, --most or --subject"
    asked = _Asked(
        case, overrides, names, lowest, highest, within, option=options, workers=workers, allow_large=allow_large
    )
    variables = study.variables_of(asked.case, vary, "--vary")
    with suppress(RunFailedError):  # a case that fails as it stands may have better variants
        asked.checked(evaluations)
    with asked.evaluators(evaluations, workers) as runs:
        points = study.Points(asked.case, variables, runs)
        search = study.optimize if len(goals) == 1 else study.pareto
        design = study.Design(points, goals, bounds)
        found = search(design, evaluations=evaluations, seed=seed)
    best = found.best
    written: list[Path] = []
    if target is not None and best is not None:
        _write_best(asked, points.overrides(found.points[best]), target, overwrite=overwrite)
        written.append(target)
    one = len(goals) == 1
    told = told_optimum(design, found) if one else told_front(design, found)
    ended = _stopped(len(found.rows), evaluations) if found.stopped else Status()
    drawn = told, lambda: _drawn(design, found)
    write_answer(drawn, csv, plot, ended, overwrite=overwrite, as_json=as_json, written=written)
    if not ended.ok:
        return ended
    return ended if best is not None else _NOTHING


def _stopped(done: int, evaluations: int) -> Status:
    """Return how a search ended that was stopped: what it had found is told and written."""
    text = f"stopped by the user after {done} of about {evaluations} variants; what is told is the best of these"
    return Status(Cause.INTERRUPTED, text, "the same command with the same --seed finds these again, and goes on")


def _drawn(design: study.Design, found: study.Evaluations) -> Figure:
    """Return the picture of a search: progress of one goal, or the front of two."""
    from flexcam.view import front_figure, progress_figure

    inside = study.feasible(found.violations)
    signs = np.array([-1.0 if goal.most else 1.0 for goal in design.goals])
    labels = [f"{goal.name}, {design.unit(goal.name, found.rows)}".rstrip(", ") for goal in design.goals]
    if len(design.goals) == 1:
        best = np.array(goal_history(found))
        return progress_figure(signs[0] * found.costs[:, 0], inside, signs[0] * best, labels[0])
    return front_figure(found.costs * signs, inside, study.front(found), (labels[0], labels[1]))


_NOTHING = Status(
    Cause.TOLERANCE, "no variant that was evaluated is within all bounds", "widen the intervals, or loosen a bound"
)


def _write_best(asked: _Asked, best: Sequence[str], target: Path, *, overwrite: bool) -> None:
    case = asked.file.read((*asked.fixed, *best))
    told = (f"The best variant of {asked.file.path.name}:", *(f"  --set {one}" for one in (*asked.fixed, *best)))
    write_text(target, study.case_text(case, target, told), overwrite=overwrite)
