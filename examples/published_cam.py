"""The published cam mechanism over speed: how far the flexible valve leaves the rigid one.

Run it with ``python examples/published_cam.py`` from anywhere; it prints a table and checks its first row.
"""

import math
from pathlib import Path

import flexcam

CASE = Path("..") / "cases/tayeb/model-1-shm.toml"

deviations = {}
for rpm in (1000, 2000, 3000):
    case = flexcam.read_case(CASE, [f"run.speed={rpm}rpm"])
    flexible, rigid = flexcam.run(case), flexcam.run(case, rigid=True)
    deviations[rpm] = flexcam.compare(flexible, rigid, "valve", rpm).peak_deviation
    print(f"{rpm} rpm: the valve deviates by {deviations[rpm]:.3f} of its lift")

assert math.isclose(deviations[1000], 0.0615, abs_tol=5e-5)
