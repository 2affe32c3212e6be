"""
Motion laws side by side
========================

Lift, velocity, acceleration and jerk of four laws from rest to rest, over the same rise. What is gained in one of
them is paid for in another: the parabolic law has the least acceleration there can be, and infinite jerk.
"""

import math

from flexcam import LAWS
from flexcam.cams import criteria
from flexcam.plotting.curves import law_figure

chosen = {name: LAWS[name] for name in ("parabolic", "shm", "cycloidal", "4-5-6-7")}
figure = law_figure(chosen)

# %%
# The largest accelerations, by lift and rise angle, are closed forms. ``criteria`` finds the extremes of every
# derivative piece by piece, also where it steps.
peaks = {}
for name, law in chosen.items():
    found = criteria(law)
    peaks[name], jerk = (max(abs(one.value) for one in ends) for ends in (found.acceleration, found.jerk))
    steps = ", its acceleration steps in the middle" if 2 in found.jumps else ""
    print(f"{name:10s} acceleration up to {peaks[name]:.4f}, jerk between steps up to {jerk:.2f}{steps}")

for name, known in {"parabolic": 4.0, "shm": 0.5 * math.pi**2, "cycloidal": 2.0 * math.pi}.items():
    assert math.isclose(peaks[name], known, rel_tol=1e-9)
