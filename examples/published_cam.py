"""
The published cam mechanism
===========================

The camshaft, pushrod, rocker and valve of :cite:t:`tayeb` with flexible and with rigid members. The published load is a
force on the follower, so the train is a mass on a spring: the deviation of the flexible from the rigid motion increases
with speed.
"""

import math

import flexcam
from flexcam.plotting.histories import motion_figure

CASE = "../cases/tayeb/model-1-shm.toml"

responses, rigid, deviations = {}, {}, {}
for rpm in (1000, 2000, 3000):
    case, name = flexcam.read_case(CASE, [f"run.speed={rpm}rpm"]), f"{rpm} rpm"
    responses[name], rigid[name] = flexcam.run(case), flexcam.run(case, rigid=True)
    deviations[rpm] = flexcam.compare(responses[name], rigid[name], "valve", rpm).peak_deviation
    print(f"{name}: peak deviation of the valve from the rigid motion {deviations[rpm]:.3f} times the lift")

assert math.isclose(deviations[1000], 0.0615, abs_tol=5e-5)
assert deviations[1000] < deviations[2000] < deviations[3000]

# %%
# Dashed curves are the rigid mechanism.
figure = motion_figure({"3000 rpm": responses["3000 rpm"]}, "valve", rigid={"3000 rpm": rigid["3000 rpm"]})
