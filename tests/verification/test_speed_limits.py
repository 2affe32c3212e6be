"""Speed of contact loss: closed contact at 0.99 of it, loss at 1.01, and the rigid condition for a stiff train."""

import math

import pytest

import flexcam
from flexcam.analysis.comparison import compare_models_over_speed, divergence_speed
from flexcam.analysis.limits import Search, find_limits
from flexcam.analysis.run_metrics import compute_margins
from flexcam.valvetrain import separation

RPM = math.pi / 30.0

STIFF_CASE = """
format = 1
title = "Stiff follower on a stiff shaft"
[nodes]
drive = ["0 mm", "0 mm", "0 mm"]
cam = ["20 mm", "0 mm", "0 mm"]
rear = ["40 mm", "0 mm", "0 mm"]
foot = ["20 mm", "40 mm", "0 mm"]
head = ["20 mm", "60 mm", "0 mm"]
[materials.steel]
E = "207 GPa"
nu = 0.29
density = "7800 kg/m^3"
[sections]
thick = { shape = "circle", diameter = "40 mm" }
[members]
shaft = { nodes = ["drive", "cam", "rear"], material = "steel", section = "thick" }
rod = { nodes = ["foot", "head"], material = "steel", section = "thick" }
[supports]
drive = ["ux", "uy", "uz", "rx", "ry", "rz"]
rear = ["uy", "uz"]
foot = ["ux", "uz", "rx", "ry", "rz"]
head = ["ux", "uz", "rx", "ry", "rz"]
[springs]
main = { at = "head", direction = "uy", stiffness = "20 kN/m", installed_force = "200 N" }
[cams.one]
at = "cam"
law = "cycloidal"
lift = "6 mm"
rise = "120 deg"
return = "120 deg"
phase = "60 deg"
[contacts]
one = { cam = "one", follower = "foot", model = "unilateral", stiffness = "100 MN/m", dissipation = "0.5 s/m" }
[run]
speed = "2500 rpm"
steps_per_revolution = 3600
start = "equilibrium"
damping = { beta = "2e-7 s" }
"""


def loses_contact(case, rpm):
    """Return whether the follower separates during the lift in the third revolution at a camshaft speed."""
    ready = flexcam.prepare(flexcam.read_case(case.path, [f'run.speed="{rpm} rpm"', "run.revolutions=3"]))
    response = flexcam.solve(ready.problem, ready.scheme, save=ready.save)
    last = response.time > response.time[-1] - ready.revolution
    return separation(ready.model, response, next(iter(ready.model.cam_contacts)), last) > math.radians(0.5)


@pytest.mark.slow
def test_contact_loss_speed_of_stiff_follower(tmp_path):
    """The condition of the rigid train is inertia = spring force at the worst angle, from law and mass alone."""
    path = tmp_path / "stiff.toml"
    path.write_text(STIFF_CASE, encoding="utf-8")
    case = flexcam.read_case(path)
    found = find_limits(case, Search(3000 * RPM, 6000 * RPM, tolerance=6 * RPM))
    rpm = found.limits["loss_of_contact"].rpm
    assert found.limits["loss_of_contact"].words.endswith("(one, nose)")
    assert found.first == "loss_of_contact"
    assert not loses_contact(case, 0.99 * rpm)
    assert loses_contact(case, 1.01 * rpm)
    # m s'' w^2 + k s + F0 = 0, with s = h (z - sin(2 pi z)/(2 pi)) on a rise of 120 deg
    mass = 7800.0 * math.pi / 4.0 * 0.04**2 * 0.02
    beta, h = math.radians(120.0), 6e-3
    worst = min(
        math.sqrt((200.0 + 20e3 * h * (z - math.sin(2 * math.pi * z) / (2 * math.pi)))
                  / (-mass * h * 2 * math.pi / beta**2 * math.sin(2 * math.pi * z)))
        for z in (0.5 + i / 20000 for i in range(1, 10000))
    )  # fmt: skip
    assert compute_margins(case).rigid_rpm == pytest.approx(worst / RPM, rel=1e-5)  # the angle is searched in steps
    # 100 MN/m and the rod stiffness leave a small elastic vibration, and contact must be open for 0.5 deg.
    assert rpm == pytest.approx(worst / RPM, rel=0.06)


@pytest.mark.slow
def test_models_diverge_above_contact_loss_speed(tmp_path):
    path = tmp_path / "stiff.toml"
    path.write_text(STIFF_CASE, encoding="utf-8")
    case = flexcam.read_case(path)
    found = compare_models_over_speed(case, [1000 * RPM, 2000 * RPM, 5500 * RPM])
    assert divergence_speed(found, "bilateral", "unilateral", 0.03) == pytest.approx(5500.0)
    slow = found[0].forces
    assert slow["rigid"].largest == pytest.approx(slow["unilateral"].largest, rel=0.02)
    held = found[-1].forces
    assert held["bilateral"].least < 0.0 <= held["unilateral"].least
