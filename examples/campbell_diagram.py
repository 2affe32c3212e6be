"""
A Campbell diagram
==================

Natural frequencies over speed of the valve train of three masses of :cite:t:`li2014`, with the harmonics of its cam as
rays. A circle marks a harmonic that excites a mode at the contact; its size is its share of the contact force.
"""

import numpy as np

import flexcam
from flexcam.analysis.natural_modes import campbell
from flexcam.plotting.spectra import campbell_figure

case = flexcam.read_case("../cases/li/valve-train.toml")
speeds = np.radians(6.0 * np.linspace(1000.0, 3000.0, 5))  # rpm to rad/s
diagram = campbell(case, list(speeds), orders=range(1, 20))
figure = campbell_figure(diagram, 1.0, "camshaft")

# %%
# At a crossing, the natural frequency is the order times the speed in revolutions per second.
for crossing in diagram.crossings:
    order, rpm, frequency = crossing.harmonic, crossing.rpm, crossing.frequency
    print(f"{rpm:6.0f} rpm: order {order:2d} excites {frequency:.1f} Hz, {crossing.load:6.1f} N")
    np.testing.assert_allclose(order * rpm / 60.0, frequency, rtol=1e-9)

# %%
# At 1500 rpm, the speed of the case, twelve harmonics have frequencies below the first mode.
assert 12 * 1500.0 / 60.0 < diagram.frequencies[0, 0] < 13 * 1500.0 / 60.0
