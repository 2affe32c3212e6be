"""Rigid model: power balance of the cam, and separate lifts of several cams on one train."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flexcam import InputError, build_model, prepare, read_case, run
from flexcam.analysis.preparation import scalar_probe
from flexcam.dynamics import ConstantSpeed, solve
from flexcam.plotting.scene.motion import rigid_motion as rigid_motion_of
from flexcam.valvetrain import build_structure, pulling_contacts, rigid_motion

MODELS = Path(__file__).parents[1] / "golden" / "models"


@pytest.mark.parametrize(
    "name",
    [
        "hertz-train",
        "massless",
        pytest.param("lever-rocker", marks=pytest.mark.slow),
        pytest.param("adjuster", marks=pytest.mark.slow),
        pytest.param("linear-train", marks=pytest.mark.slow),
    ],
)
def test_cam_power_equals_power_of_train(name):
    """Torque times speed is the rate of kinetic and elastic energy plus damping power, by differences."""
    case = read_case(MODELS / f"{name}.toml", {"run.steps_per_revolution": 7200, "run.revolutions": 1})
    ready = prepare(case, rigid=True)
    system, response = ready.problem.system, solve(ready.problem, ready.scheme)
    motion = ready.problem.drive.at(response.time)
    u, v, _ = system.prescribed_motion.at(motion)
    M, C, K = (one.dense() for one in (system.mass, system.damping, system.stiffness))
    energy = 0.5 * np.einsum("mi,ij,mj->m", v, M, v) + 0.5 * np.einsum("mi,ij,mj->m", u, K, u)
    energy -= np.einsum("mi,mi->m", system.load_vector(motion), u)  # all loads are constant
    power = np.gradient(energy, response.time) + np.einsum("mi,ij,mj->m", v, C, v)
    torque = sum(values for channel, values in response.channels.items() if channel.endswith(".torque"))
    smooth = np.ones(len(power), dtype=bool)
    for train in system.prescribed_motion.trains:  # a closing lash and a seat cause velocity jumps
        for _, rows in train.solve(motion.cam).branches:
            smooth[rows[np.diff(rows, prepend=-9) > 1]] = smooth[rows[np.diff(rows, append=10**9) > 1]] = False
    worst = np.abs(power - torque * case.speed)[smooth].max()
    assert worst < 2e-3 * np.abs(power[smooth]).max()  # differences over 0.05 deg at jerk discontinuities of the cam


def test_desmodromic_followers_have_lift_of_their_cams():
    """The lash of the closing cam has 10 um left, so that neither cam moves the follower of the other one."""
    case = read_case(MODELS / "desmodromic.toml")
    ready = prepare(case, rigid=True)
    motion = ConstantSpeed(1.0).at(np.linspace(0.0, 2.0 * np.pi, 361))
    moved = rigid_motion(ready.model).at(motion)[0]
    cams, names = ready.model.cams, ready.problem.system.names
    opened, closed = (moved[:, names.index(name)] for name in ("lower.uy", "closer.uy"))
    np.testing.assert_allclose(opened, cams["opening"].event(motion.angle, 0), atol=1e-15)
    np.testing.assert_allclose(closed, -cams["closing"].event(motion.angle, 0), atol=1e-15)


IDLE_VALVE = """
format = 1
nodes = { valve = [0.0, 0.0, 0.0], other = [0.1, 0.0, 0.0], cam = [0.0, -0.1, 0.0] }
supports = { valve = ["ux", "uz"], other = ["ux", "uz"] }
masses = { valve = { at = "valve", mass = 0.1 }, other = { at = "other", mass = 0.1 } }
[springs]
valve = { at = "valve", direction = "uy", stiffness = 2e4, installed_force = 200 }
other = { at = "other", direction = "uy", stiffness = 2e4, installed_force = 250 }
[cams.intake]
at = "cam"
axis = [1, 0, 0]
law = "4-5-6-7"
lift = 0.01
rise = 1.2
return = 1.2
[contacts]
intake = { cam = "intake", follower = "valve", direction = "uy", model = "unilateral", stiffness = 1e7 }
seat = { at = "other", direction = "uy", model = "seat", stiffness = 1e7 }
[run]
speed = 30
steps_per_revolution = 90
"""


def test_seat_of_idle_valve_carries_spring_force(tmp_path):
    path = tmp_path / "idle.toml"
    path.write_text(IDLE_VALVE, encoding="utf-8")
    response = run(read_case(path), rigid=True)
    np.testing.assert_allclose(response.channels["contacts.seat.force"], 250.0, rtol=1e-12)


def test_pulling_contacts_with_nonlinear_spring(tmp_path):
    """The spring between follower and valve, soft as installed, would open the seat before full lift."""
    path = tmp_path / "inner.toml"
    inner = 'inner = { at = "valve", to = "other", direction = "uy", force_table = TABLE, installed_force = 10 }'
    bent, straight = "[[0, 0], [0.001, 20], [0.02, 4000]]", "[[0, 0], [0.02, 400]]"
    pulls: list[dict[str, float]] = []
    for table in (bent, straight):
        path.write_text(
            IDLE_VALVE.replace("[cams.intake]", f"{inner.replace('TABLE', table)}\n[cams.intake]"), encoding="utf-8"
        )
        pulls.append(pulling_contacts(build_model(read_case(path))))
    (pull,) = pulls[0].values()
    # The spring is compressed by 0.5 mm as installed and by 10 mm more; the other spring loads the seat with 250 N.
    assert pull == pytest.approx(np.interp(0.0105, [0.001, 0.02], [20.0, 4000.0]) - 10.0 - 240.0, rel=1e-3)
    assert pulls[1] == {}


LEAF_FOLLOWER = """
format = 1
nodes = { cam = [0.0, 0.0, 0.0], pivot = [-0.04, 0.02, 0.0], pad = [0.0, 0.02, 0.0] }
materials.steel = { E = 207e9, nu = 0.29, density = 7800 }
sections.leaf = { shape = "circle", diameter = 0.003 }
members.leaf = { nodes = ["pivot", "pad"], material = "steel", section = "leaf" }
supports.pivot = ["ux", "uy", "uz", "rx", "ry", "rz"]
output.probes = ["pad"]
[cams.intake]
at = "cam"
axis = [0, 0, 1]
law = "4-5-6-7"
lift = 0.001
rise = 1.2
return = 1.2
[contacts.intake]
cam = "intake"
follower = "pad"
direction = "uy"
model = "bilateral"
stiffness = 1e7
[run]
speed = 30
steps_per_revolution = 90
"""


def test_bending_follower_has_no_rigid_model(tmp_path):
    """Its flexible run still has a default probe and a picture."""
    path = tmp_path / "leaf.toml"
    path.write_text(LEAF_FOLLOWER, encoding="utf-8")
    case = read_case(path)
    with pytest.raises(InputError, match=r"contacts\.intake\.follower.*without bending.*fidelity\.model = beams"):
        run(case, rigid=True)
    ready = prepare(case)
    assert run(case)["pad.uy"].displacement.max() == pytest.approx(1e-3, rel=0.01)
    assert scalar_probe(ready).startswith("pad.")
    assert not rigid_motion_of(build_structure(ready.model), np.linspace(0.0, 6.0, 5), 30.0)[0].any()
