"""
A measured lift
===============

A gauge measures the lift at every half degree with a noise of one micrometre, which dominates the second differences. A
smoothing spline by generalized cross-validation recovers the acceleration and reports the changes of the points.
"""

import numpy as np
from matplotlib.figure import Figure

from flexcam import LAWS, LiftEvent
from flexcam.cams import lift_table

true = LiftEvent(LAWS["4-5-6-7"], lift=9e-3, rise=1.2, fall=1.2, phase=1.0)
angle = np.radians(np.arange(0.0, 360.0, 0.5))
measured = true(angle) + 1e-6 * np.random.default_rng(1).standard_normal(len(angle))
event, report = lift_table(angle, np.maximum(measured, 0.0))

rms, maximum = 1e6 * report.rms_change, 1e6 * report.largest_change
print(f"{report.points} points, changed by {rms:.2f} um (rms), {maximum:.1f} um at most")
assert 0.4e-6 < report.rms_change < 1.2e-6  # about the noise
assert not report.remarks

# %%
# Grey points are second differences of the measured lift.
fine = np.linspace(0.9, 3.5, 1200)
raw = np.diff(measured, 2) / (angle[1] - angle[0]) ** 2
figure = Figure(figsize=(7.0, 5.0), layout="constrained")
lift, acceleration = figure.subplots(2, sharex=True)
lift.plot(np.degrees(fine), 1e3 * event(fine))
lift.plot(np.degrees(angle), 1e3 * measured, ".", color="0.6", markersize=3)
acceleration.plot(np.degrees(angle[1:-1]), 1e3 * raw, ".", color="0.6", markersize=3, label="differences of the points")
acceleration.plot(np.degrees(fine), 1e3 * event(fine, 2), label="smoothed")
acceleration.plot(np.degrees(fine), 1e3 * true(fine, 2), "--", color="black", linewidth=0.9, label="true")
lift.set(ylabel="lift, mm", xlim=np.degrees(fine[[0, -1]]))
acceleration.set(ylabel="mm/rad²", xlabel="cam angle, deg")
acceleration.legend()

# %%
# The smoothed acceleration is within a few percent of the true one.
error = np.abs(event(fine, 2) - true(fine, 2)).max() / np.abs(true(fine, 2)).max()
noise = np.abs(raw - true(angle[1:-1], 2)).max() / np.abs(true(fine, 2)).max()
print(f"acceleration: error {error:.1%} of the spline, {noise:.0%} of the differences")
assert error < 0.06 < noise
