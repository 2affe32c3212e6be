"""`energy.work` is the work of the cam torque and of the installed force of the spring."""

import numpy as np
import pytest

from flexcam import read_case, run

CASE = """
format = 1
[nodes]
shaft = [0, 0, 0]
mass = [0, "50 mm", 0]
[supports]
mass = ["ux", "uz"]
[masses]
mass = { at = "mass", mass = "0.1 kg" }
[springs]
held = { at = "mass", direction = "uy", stiffness = "40 kN/m", installed_force = "300 N", damping = "5 N s/m" }
[cams]
one = { at = "shaft", axis = [1, 0, 0], law = "cycloidal", lift = "6 mm", rise = 1.1, return = 1.3, phase = 0.6 }
[contacts]
one = { cam = "one", follower = "mass", model = "unilateral", stiffness = "2 MN/m" }
[run]
speed = 120.0
revolutions = 0.35
steps_per_revolution = 7200
fluctuation = { orders = [2.0], amplitudes = [0.15], phases = [0.3] }
[output]
probes = ["mass"]
"""


def test_work_of_torque_and_installed_force(tmp_path):
    (tmp_path / "one.toml").write_text(CASE, encoding="utf-8")
    response = run(read_case(tmp_path / "one.toml"))
    torque, moved = response.channels["contacts.one.torque"], response["mass.uy"].displacement
    steps = 0.5 * (torque[1:] + torque[:-1]) * np.diff(response.angle)
    wanted = np.append(0.0, np.cumsum(steps)) - 300.0 * (moved - moved[0])
    assert response.channels["energy.work"] == pytest.approx(
        wanted, abs=1e-5 * np.abs(wanted).max()
    )  # error of the trapezoidal rule
