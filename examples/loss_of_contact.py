"""
A tappet that leaves its cam
============================

The intake train of a pushrod engine with unilateral contact, at its rated speed and above the 5611 rpm at which
``flexcam limits`` predicts that the tappet loses contact.
"""

import numpy as np

import flexcam
from flexcam.plotting.histories import motion_figure

CASE = "../cases/pushrod-engine/intake.toml"

responses = {f"{rpm} rpm": flexcam.run(flexcam.read_case(CASE, [f"run.crank_speed={rpm}rpm"])) for rpm in (5000, 7500)}
figure = motion_figure(responses, "valve", ["contacts.intake.force"])

# %%
# At 5000 rpm the tappet stays on the cam between the ramps. At 7500 rpm it loses contact over the nose and hits the cam
# later. While the gap is open, the contact force is zero.
open_angles = {}
for name, response in responses.items():
    gap, force = response.channels["contacts.intake.gap"], response.channels["contacts.intake.force"]
    on_lift = np.abs(np.degrees(response.angle) % 360.0 - 180.0) < 70.0
    open_angles[name] = 360.0 / len(gap) * np.count_nonzero(gap[on_lift] > 0.0)  # deg, mean over the revolutions
    print(
        f"{name}: {open_angles[name]:.0f} deg/rev without contact during the lift, up to {force[on_lift].max():.0f} N"
    )
    assert not force[gap > 0.0].any()

assert open_angles["5000 rpm"] == 0.0
assert open_angles["7500 rpm"] > 50.0
