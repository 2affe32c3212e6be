"""Map of speed limits over two numbers of a case."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from flexcam.case.case import Case
from flexcam.case.records import find_unit
from flexcam.core import FloatArray
from flexcam.core.errors import refuse
from flexcam.dynamics import Cause, Status
from flexcam.studies.axes import Axis, Value
from flexcam.studies.evaluators import Runs, column
from flexcam.studies.plan import Plan, make_plan
from flexcam.studies.quantities import require_complete

LIMIT = "limits."


@dataclass(frozen=True, eq=False)
class LimitMap:
    """Speed limits over two numbers.

    Parameters
    ----------
    axes
        Axes of the rows and of the columns.
    rpm
        Speed by limit, such as ``loss_of_contact``, shape (rows, columns), of the crankshaft if the case gives
        ``crank_speed``, else of the camshaft; NaN if the limit is not met in the search range, or a run failed.
    statuses
        Status of every variant, row by row.
    """

    axes: tuple[Axis, Axis]
    rpm: Mapping[str, FloatArray]
    statuses: tuple[Status, ...]

    def with_units(self, case: Case) -> LimitMap:
        """Return the same map with units for numbers given without one: those of the case."""
        first, second = (_with_unit(one, case) for one in self.axes)
        return replace(self, axes=(first, second))


def _with_unit(axis: Axis, case: Case) -> Axis:
    return axis if axis.unit else replace(axis, unit=find_unit(case.record, axis.key.split(".")) or "")


def grid_plan(first: Axis, second: Axis, fixed: Sequence[str] = ()) -> Plan:
    """Return the grid plan of two axes."""
    for one in (first, second):
        if not one.is_varied or not one.is_numeric:
            raise refuse(one.where, f"{len(one.values)} values", "several numbers", "a map is drawn over them")
    if first.key == second.key:
        raise refuse("--and", second.key, "another key than that of --over", "a map is over two")
    pairs = [one.partition("=") for one in fixed]
    laid = [Axis(key.strip(), f"--set {key}={text}", (Value(text.strip(), None),)) for key, _, text in pairs]
    return make_plan([*laid, first, second])


def limit_map(plan: Plan, names: Sequence[str], runs: Runs) -> LimitMap:
    """Return the map of limits over a grid."""
    rows = list(runs(plan.variants))
    if all(row.status.cause is Cause.REFUSED for row in rows):
        require_complete(rows[0])
    first, second = plan.varied_axes
    rpm = {name: column(rows, LIMIT + name).reshape(plan.shape) for name in names}
    return LimitMap((first, second), rpm, tuple(row.status for row in rows))
