"""Many runs: sweeps, sensitivity, tolerances, optimization, on local processes or a Dask cluster.

May import `analysis` and everything below it. A new quantity is a row in `quantities`.
"""
