"""
A Campbell diagram
==================

Natural frequencies of the valve train of three masses of :cite:t:`li2014` over speed, with the harmonics of its cam
as rays. Where a harmonic meets a mode that is felt at the contact it rings; the larger the circle, the larger its
share of the contact force.
"""

import numpy as np

import flexcam
from flexcam.analysis.natural_modes import campbell
from flexcam.plotting.spectra import campbell_figure

case = flexcam.read_case("../cases/li/valve-train.toml")
speeds = np.radians(6.0 * np.linspace(1000.0, 3000.0, 5))  # rpm to rad/s
found = campbell(case, list(speeds), orders=range(1, 20))
figure = campbell_figure(found, 1.0, "camshaft")

# %%
# At a crossing, so many turns of the camshaft take a second as the mode has swings per order.
for one in found.crossings:
    print(f"{one.rpm:6.0f} rpm: order {one.harmonic:2d} meets {one.frequency:.1f} Hz, {one.load:6.1f} N")
    np.testing.assert_allclose(one.harmonic * one.rpm / 60.0, one.frequency, rtol=1e-9)

# %%
# At the 1500 rpm of the case twelve harmonics lie below the first mode.
assert 12 * 1500.0 / 60.0 < found.frequencies[0, 0] < 13 * 1500.0 / 60.0
