"""Many runs of one case: sweeps, sensitivity, tolerances, optimization and fits, local or on a Dask cluster.

May import `analysis` and everything below it. A new scalar of a run is a row in `evaluation`; a new study is a file
that gets its values from `quantities` and searches over `variables`.
"""
