"""Many runs of one case: plans of variants, on one machine or a cluster, one table.

May import `fidelity` and its neighbours, `runner` and everything below; owns pandas, xarray and dask.
A new kind of scalar is a line in `scalars`; a new way of sampling one in `plan`; what runs chunks is in `workers`.
"""

from flexcam.sweep.axis import Axis, Value, axes, axis
from flexcam.sweep.evaluate import Row, evaluate, row_of
from flexcam.sweep.plan import Plan, Sample, made_plan, sample
from flexcam.sweep.scalars import scalars_of

__all__ = [
    "Axis",
    "Plan",
    "Row",
    "Sample",
    "Value",
    "axes",
    "axis",
    "evaluate",
    "made_plan",
    "row_of",
    "sample",
    "scalars_of",
]
