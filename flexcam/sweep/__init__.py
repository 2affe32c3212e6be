"""Many runs of one case: plans of variants, on one machine or a cluster, one table.

May import `fidelity` and its neighbours, `runner` and everything below; owns pandas, xarray and dask.
A new kind of scalar is a line in `scalars`; a new way of sampling one in `plan`; what runs chunks is in `workers`.
"""

from flexcam.sweep.affording import afford, afford_case
from flexcam.sweep.axis import LIMIT, Axis, Value, axes, axis
from flexcam.sweep.cluster import LOCAL, Cluster
from flexcam.sweep.evaluate import Row, evaluate, row_of
from flexcam.sweep.files import csv_text, write_table
from flexcam.sweep.frames import history_dataset, history_frame, table_dataset, table_frame
from flexcam.sweep.hdf5 import read_table
from flexcam.sweep.plan import Plan, Sample, checked_seed, made_plan, sample
from flexcam.sweep.scalars import scalars_of
from flexcam.sweep.study import Study, study
from flexcam.sweep.swept import Target, sweep_files, swept
from flexcam.sweep.table import Column, Table, tabulated
from flexcam.sweep.workers import Here, Processes, Workers

__all__ = [
    "LIMIT",
    "LOCAL",
    "Axis",
    "Cluster",
    "Column",
    "Here",
    "Plan",
    "Processes",
    "Row",
    "Sample",
    "Study",
    "Table",
    "Target",
    "Value",
    "Workers",
    "afford",
    "afford_case",
    "axes",
    "axis",
    "checked_seed",
    "csv_text",
    "evaluate",
    "history_dataset",
    "history_frame",
    "made_plan",
    "read_table",
    "row_of",
    "sample",
    "scalars_of",
    "study",
    "sweep_files",
    "swept",
    "table_dataset",
    "table_frame",
    "tabulated",
    "write_table",
]
