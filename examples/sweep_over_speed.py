"""
Many speeds, one table
======================

A sweep varies any key of a case and returns a table with a row per variant. Here the published mechanism runs at
thirteen speeds. Its deviation from the rigid mechanism decreases with the distance from the resonance at 4027 rpm.
"""

import numpy as np
from matplotlib.figure import Figure

from flexcam.studies.sweep import make_sweep, run_sweep

table = run_sweep(make_sweep("../cases/tayeb/model-1-shm.toml", ["run.speed=500:3500:250rpm"]))
rpm = np.arange(500.0, 3501.0, 250.0)
deviation = table["deviation.peak"]
assert not table.failed
assert len(table) == len(rpm)

figure = Figure(figsize=(7.0, 4.0), layout="constrained")
axes = figure.add_subplot()
axes.semilogy(rpm, deviation, marker="o", label="flexible against rigid")
ratio = (rpm / 4027.0) ** 2
axes.semilogy(rpm, ratio / (1.0 - ratio), color="0.6", linestyle="--", label="steady state of one mass, r²/(1 - r²)")
axes.set(xlabel="camshaft speed, rpm", ylabel="peak deviation from the rigid valve / lift")
axes.legend()

# %%
# Far below the resonance the deviation agrees within 10 % with the steady state of one mass. Near the resonance, two
# revolutions from rest are not enough to reach the steady state.
np.testing.assert_allclose(deviation[rpm <= 2000.0], (ratio / (1.0 - ratio))[rpm <= 2000.0], rtol=0.1)
assert deviation[-1] < 0.9 * (ratio / (1.0 - ratio))[-1]
