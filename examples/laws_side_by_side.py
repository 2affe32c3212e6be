"""
Motion laws side by side
========================

Lift, velocity, acceleration and jerk of four laws from rest to rest over the same rise. No law has the smallest values
of all: the parabolic law has the minimum possible acceleration and infinite jerk.
"""

import math

from flexcam import LAWS
from flexcam.cams import criteria
from flexcam.plotting.curves import law_figure

laws = {name: LAWS[name] for name in ("parabolic", "shm", "cycloidal", "4-5-6-7")}
figure = law_figure(laws)

# %%
# The maximum accelerations for unit lift and rise angle have closed forms. ``criteria`` finds the extremes of every
# derivative, also at its jumps.
peaks = {}
for name, law in laws.items():
    found = criteria(law)
    peaks[name], jerk = (
        max(abs(extreme.value) for extreme in extremes) for extremes in (found.acceleration, found.jerk)
    )
    steps = ", its acceleration steps in the middle" if 2 in found.jumps else ""
    print(f"{name:10s} acceleration up to {peaks[name]:.4f}, jerk between steps up to {jerk:.2f}{steps}")

for name, exact in {"parabolic": 4.0, "shm": 0.5 * math.pi**2, "cycloidal": 2.0 * math.pi}.items():
    assert math.isclose(peaks[name], exact, rel_tol=1e-9)
