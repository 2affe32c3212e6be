"""Derivatives of results by numbers of a case, exact through the time integration.

Results of a run are derived along its motion (`flexcam.dynamics.tangent`), all others, such as natural frequencies and
properties of a cam, by central differences: they are smooth functions without noise.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain

from flexcam.analysis.initial_state import steps_per_revolution
from flexcam.analysis.preparation import PreparedRun, prepare, prepare_without_periodic_search
from flexcam.case.case import Case
from flexcam.case.reader import CaseFile
from flexcam.core import FloatArray
from flexcam.core.errors import InputError, refuse
from flexcam.dynamics import RunFailedError, Scheme, System, Variation, tangent_run
from flexcam.dynamics.massless import FORCE_TOLERANCE, MasslessMotions
from flexcam.studies.evaluation import compute_scalars
from flexcam.studies.evaluators import PointEvaluator, WorstCase
from flexcam.studies.quantities import Number, compute_quantities, get_number, is_run_scalar, make_overrides
from flexcam.valvetrain import Metric

RELATIVE_WIDTH = 1e-6
"""Half the difference of a number, relative to its size: a compromise of rounding, and of contacts that it switches."""

CHAOTIC_GROWTH = 1e3
"""Growth of a small disturbance over a run above which derivatives say nothing about changes of practical size."""

_PERIODIC = 1e-6
"""Relative residual of a periodic start above which its derivative does not exist."""

_SIMILAR_RUNS = 10
"""Number of runs whose time the derivatives of a run take, for the selection of the engine."""

COUNTED = (".bounces", ".open_on_the_lift")
"""Ends of the names of results that count instants or events, and have no derivative."""

_RATES = (".velocity.largest", ".acceleration.largest")
"""Ends of the names of results that need the rates of a point, which one without mass does not have."""


@dataclass(frozen=True, eq=False)
class Gradient:
    """Results of a case and their derivatives.

    Parameters
    ----------
    values, units
        Value and SI unit by name of the result.
    derivatives
        By name of the result and key of the number, SI; NaN for a result that a neighbouring case lacks.
    growth
        Growth of a small disturbance over the run, see `flexcam.dynamics.tangent.TangentRun`; 1 without a run.
    warning
        Why the derivatives of the run say nothing; empty if they are sound.
    """

    values: Mapping[str, float]
    units: Mapping[str, str]
    derivatives: Mapping[tuple[str, str], float]
    growth: float
    warning: str = ""


def exact_refusal(case: Case) -> str:
    """Return why the runs of a case cannot be derived; empty if they can."""
    fidelity, scheme = case.record.fidelity, case.record.run.integrator.part
    if fidelity.model != "beams" or fidelity.modes is not None or fidelity.tolerances:
        return "the model is reduced (fidelity)"
    if not isinstance(scheme, Scheme) or not scheme.average:
        return "the integrator is not newmark with beta 1/4 and gamma 1/2"
    return "the steps are adaptive" if case.record.run.adaptive else ""


def compute_gradient(
    file: CaseFile, overrides: Sequence[str], names: Sequence[str], numbers: Sequence[Number],
    sizes: Sequence[float] | None = None,
) -> Gradient:  # fmt: skip
    """Return results of a case and their derivatives by some of its numbers.

    Parameters
    ----------
    file, overrides
        The case.
    names
        Results: scalars of a run, natural frequencies, properties of cams, or keys; no speed limits.
    numbers
        Numbers of the case.
    sizes
        Usual size of each number, SI; None for its value, which then must not be zero.

    Returns
    -------
    Gradient
        Values and derivatives, SI.

    Raises
    ------
    InputError
        If the runs of the case cannot be derived, or a number changes the structure of the equations.
    RunFailedError
        If the run fails.

    Examples
    --------
    ``compute_gradient(file, (), ["springs.valve.force.largest"], get_numbers(case, ["springs.valve.stiffness"]))``
    """
    case = file.read(overrides)
    steps = [RELATIVE_WIDTH * abs(size) for size in sizes or [number.value for number in numbers]]
    pairs, widths = list[tuple[Case, ...]](), list[float]()
    for number, step in zip(numbers, steps, strict=True):
        below, above = ((*overrides, *one) for one in make_neighbours(case, number, step))
        sides = [_read(file, below), _read(file, above)]
        if sides == [None, None]:
            file.read(above)  # raises the reason
        pairs.append(tuple(case if side is None else side for side in sides))
        widths.append(step * (2 - sides.count(None)))  # one side alone at the end of the permitted values
    of_runs = [name for name in names if is_run_scalar(case, name)]
    others = [name for name in names if name not in of_runs]
    rows: list[dict[str, Metric]] = [{} for _ in range(1 + 2 * len(numbers))]
    growth, warning = 1.0, ""
    if of_runs:
        found, growth, warning = _run_scalars(case, pairs, widths, of_runs)
        for row, metrics in zip(rows, found, strict=True):
            row |= {one.name: one for one in metrics if one.name in of_runs}
    if others:
        for row, one in zip(rows, (case, *chain.from_iterable(pairs)), strict=True):
            row |= {name: Metric(name, q.value, q.unit) for name, q in compute_quantities(one, others).items()}
    derivatives = {
        (name, number.key): _difference(rows[1 + 2 * i], rows[2 + 2 * i], name) / width
        for name in rows[0]
        for i, (number, width) in enumerate(zip(numbers, widths, strict=True))
    }
    values, units = ({name: getattr(one, kind) for name, one in rows[0].items()} for kind in ("value", "unit"))
    return Gradient(values, units, derivatives, growth, warning)


def _read(file: CaseFile, overrides: Sequence[str]) -> Case | None:
    """Return a case, or None if its values are not permitted."""
    try:
        return file.read(overrides)
    except InputError:
        return None


def _difference(below: Mapping[str, Metric], above: Mapping[str, Metric], name: str) -> float:
    if name not in below or name not in above or name.endswith(COUNTED):
        return math.nan
    return above[name].value - below[name].value


def gradient_function(
    file: CaseFile, fixed: Sequence[str], points: PointEvaluator, sizes: FloatArray, names: Sequence[str],
    worst: WorstCase | None = None,
) -> Callable[[FloatArray], Gradient]:  # fmt: skip
    """Return the function from a point of some variables to the gradient of quantities by them.

    `sizes` are those of the variables, SI. With conditions, every quantity is that of its worst one.
    """

    def derive(point: FloatArray) -> Gradient:
        found = list[Gradient]()
        for condition in worst.conditions if worst else ((),):
            overrides = (*fixed, *points.overrides(point), *condition)
            case = file.read(overrides)
            numbers = [get_number(case, one.key, "--vary") for one in points.variables]
            found.append(compute_gradient(file, overrides, names, numbers, sizes.tolist()))
        return found[0] if worst is None else _worst_gradient(found, worst)

    return derive


def _worst_gradient(found: Sequence[Gradient], worst: WorstCase) -> Gradient:
    names = [name for name in found[0].values if all(name in one.values for one in found)]
    at = {name: found[worst.worst(name, [one.values[name] for one in found])] for name in names}
    derivatives = {(name, key): at[name].derivatives[name, key] for name, key in found[0].derivatives if name in at}
    values = {name: one.values[name] for name, one in at.items()}
    warning = next((one.warning for one in found if one.warning), "")
    return Gradient(values, found[0].units, derivatives, max(one.growth for one in found), warning)


def make_neighbours(case: Case, number: Number, step: float) -> list[tuple[str, ...]]:
    """Return the overrides of two cases with a number a step below and above its value."""
    return [make_overrides(case, {number.key: repr(number.value + sign * step)}) for sign in (-1.0, 1.0)]


def _run_scalars(
    case: Case, pairs: Sequence[tuple[Case, ...]], widths: Sequence[float], names: Sequence[str]
) -> tuple[list[list[Metric]], float, str]:
    """Return the scalars of a run, those of its neighbours in pairs, the growth of disturbances, and a warning."""
    if why := exact_refusal(case):
        raise refuse("--method", "exact", "differences", why)
    kinds = {name.partition(".")[0] for name in names}
    ready = _with_channels(prepare(case, runs=_SIMILAR_RUNS), kinds)
    beside = [tuple(_with_channels(prepare_without_periodic_search(one), kinds) for one in pair) for pair in pairs]
    variations = [
        Variation(low.problem, high.problem, width) for (low, high), width in zip(beside, widths, strict=True)
    ]
    periodic = case.record.run.start == "periodic"
    period = steps_per_revolution(case, ready.problem) if periodic else None
    found = tangent_run(ready.problem, ready.scheme, variations, period=period)
    if not found.response.status.ok:
        raise RunFailedError(found.response.status)
    rows = [compute_scalars(ready, found.response, names)]
    for pair, responses in zip(beside, found.neighbours, strict=True):
        rows += [compute_scalars(one, response, names) for one, response in zip(pair, responses, strict=True)]
    light = _massless_probes(ready.problem.system)
    rows[1:] = [
        [one for one in row if not (one.name.endswith(_RATES) and one.name.startswith(light))] for row in rows[1:]
    ]
    if found.growth > CHAOTIC_GROWTH:
        return rows, found.growth, f"the motion is chaotic: a small disturbance grows {found.growth:.1g} times"
    residual = (ready.problem.start.periodicity or 0.0) if periodic and ready.problem.start else 0.0
    return rows, found.growth, f"the periodic start repeats to {residual:.1g} only" if residual > _PERIODIC else ""


def _massless_probes(system: System) -> tuple[str, ...]:
    """Return the beginnings of the names of results of points without mass."""
    light = MasslessMotions(system)
    return tuple(
        f"probes.{probe.name}." + (f"{component}." if len(probe.components) > 1 else "")
        for probe in system.probes
        for component, row in zip(probe.components, probe.rows, strict=True)
        if (light.force_on_massless(row[None]) > FORCE_TOLERANCE).any()
    )


def _with_channels(ready: PreparedRun, kinds: set[str]) -> PreparedRun:
    """Return a run with the channels of some kinds alone; metrics of all parts need those of the contacts."""
    system = ready.problem.system
    needed = set[str]() if kinds <= _PROBE_KINDS else {*kinds, "contacts"}
    channels = tuple(one for one in system.channels if one.name.partition(".")[0] in needed)
    return replace(ready, problem=replace(ready.problem, system=replace(system, channels=channels)))


_PROBE_KINDS = {"probes", "deviation"}
"""First parts of the names of scalars that need no channels."""
