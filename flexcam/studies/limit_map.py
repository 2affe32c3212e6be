"""Speeds at which a train gives way, over a grid of two numbers of its case."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from flexcam.case.case import Case
from flexcam.case.fault_report import own_unit
from flexcam.core import FloatArray
from flexcam.core.errors import refuse
from flexcam.dynamics import Cause, Status
from flexcam.studies.axes import Axis, Value
from flexcam.studies.evaluators import Runs, column
from flexcam.studies.plan import Plan, made_plan
from flexcam.studies.quantities import complete

LIMIT = "limits."


@dataclass(frozen=True, eq=False)
class LimitMap:
    """Limits over two numbers.

    Parameters
    ----------
    axes
        What varies: down the rows, and along the columns.
    rpm
        By limit, such as ``loss_of_contact``: speed, shape (rows, columns), of the crankshaft where the case gives
        ``crank_speed``, else of the camshaft; NaN where it is not met in the range looked at, or a run failed.
    statuses
        How every variant ended, row by row.
    """

    axes: tuple[Axis, Axis]
    rpm: Mapping[str, FloatArray]
    statuses: tuple[Status, ...]

    def told_in(self, case: Case) -> LimitMap:
        """Return the same with the units of numbers that were given without one: those the case takes them in."""
        first, second = (_with_unit(one, case) for one in self.axes)
        return replace(self, axes=(first, second))


def _with_unit(axis: Axis, case: Case) -> Axis:
    return axis if axis.unit else replace(axis, unit=own_unit(case.record, axis.key.split(".")) or "")


def grid_plan(first: Axis, second: Axis, fixed: Sequence[str] = ()) -> Plan:
    """Return the grid of two axes."""
    for one in (first, second):
        if not one.varies or not one.numeric:
            raise refuse(one.where, f"{len(one.values)} values", "several numbers", "a map is drawn over them")
    if first.key == second.key:
        raise refuse("--and", second.key, "another key than that of --over", "a map is over two")
    pairs = [one.partition("=") for one in fixed]
    laid = [Axis(key.strip(), f"--set {key}={text}", (Value(text.strip(), None),)) for key, _, text in pairs]
    return made_plan([*laid, first, second])


def limit_map(plan: Plan, names: Sequence[str], runs: Runs) -> LimitMap:
    """Return limits over a grid."""
    rows = list(runs(plan.variants))
    if all(row.status.cause is Cause.REFUSED for row in rows):
        complete(rows[0])
    first, second = plan.varied
    rpm = {name: column(rows, LIMIT + name).reshape(plan.shape) for name in names}
    return LimitMap((first, second), rpm, tuple(row.status for row in rows))
