"""
A tappet that leaves its cam
============================

The intake train of a pushrod engine in true contact, at its own speed and beyond the 5611 rpm at which ``flexcam
limits`` finds its tappet in the air.
"""

import numpy as np

import flexcam
from flexcam.plotting.histories import motion_figure

CASE = "../cases/pushrod-engine/intake.toml"

responses = {f"{rpm} rpm": flexcam.run(flexcam.read_case(CASE, [f"run.crank_speed={rpm}rpm"])) for rpm in (5000, 7500)}
figure = motion_figure(responses, "valve", ["contacts.intake.force"])

# %%
# Between the ramps the slow train stays on its cam. The fast one flies over the nose, and lands hard. Where there is
# a gap there is no force.
open_for = {}
for name, response in responses.items():
    gap, force = response.channels["contacts.intake.gap"], response.channels["contacts.intake.force"]
    lifted = np.abs(np.degrees(response.angle) % 360.0 - 180.0) < 70.0
    open_for[name] = 360.0 / len(gap) * np.count_nonzero(gap[lifted] > 0.0)  # deg, on average over the revolutions
    print(f"{name}: {open_for[name]:.0f} deg of a revolution in the air on the lift, up to {force[lifted].max():.0f} N")
    assert not force[gap > 0.0].any()

assert open_for["5000 rpm"] == 0.0
assert open_for["7500 rpm"] > 50.0
