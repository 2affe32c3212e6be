"""Studies of many runs: sweeps, sensitivity, tolerances, optimization, on local processes or a Dask cluster.

May import `analysis` and everything below it. Add a new quantity as a row in `quantities`.
"""
