"""Many runs of one case: plans of variants, on one machine or a cluster, one table.

May import `fidelity` and its neighbours, `runner` and everything below; owns pandas, xarray and dask.
"""

from flexcam.sweep.evaluate import Row, evaluate, row_of
from flexcam.sweep.scalars import scalars_of

__all__ = ["Row", "evaluate", "row_of", "scalars_of"]
