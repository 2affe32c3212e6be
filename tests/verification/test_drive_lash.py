"""Rotational lash between a gear and a shaft, against closed forms.

Within the lash 2 g a shaft without torque turns uniformly; on a flank of rotational stiffness k it reverses after half
a period of sqrt(k/J). Under the torque T its equilibrium is g + T/k.
"""

import math
from functools import partial

import numpy as np
import pytest

from flexcam import InputError, build_model, prepare, read_case, run, solve
from flexcam.analysis.run_metrics import compute_metrics
from flexcam.case.case import find_unit
from flexcam.case.reader import complete_case_tables
from flexcam.report.tables import model_table
from flexcam.valvetrain import build_structure, largest_lashes, model_modes

SOURCE = "Lash of a camshaft drive"
J, STIFFNESS, GAP, OMEGA = 1e-3, 20e3, math.radians(0.1), 20.0 * math.pi
RATE_TIME = math.sqrt(J / STIFFNESS)  # s
CASE = """
format = 1
[nodes]
shaft = [0, 0, 0]
gear = [0, 0, "10 mm"]
mass = [0, "40 mm", 0]
[supports]
shaft = ["ux", "uy", "uz", "rx", "ry"]
mass = ["ux", "uz"]
gear = ["rz"]
[masses]
shaft = { at = "shaft", mass = "2 kg", inertia = [1e-3, 1e-3, 1e-3] }
mass = { at = "mass", mass = "0.1 kg" }
[springs]
one = { at = "mass", direction = "uy", stiffness = "40 kN/m", installed_force = "300 N" }
[cams]
c = { at = "shaft", axis = [0, 0, 1], law = "4-5-6-7", lift = "6 mm", rise = "70 deg", return = "70 deg" }
[contacts]
k = { cam = "c", follower = "mass", direction = "uy", model = "unilateral", stiffness = "50 MN/m" }
driving = { from = "gear", to = "shaft", direction = "rz", model = "lash", gap = "0.1 deg", stiffness = "20 kN m/rad" }
coasting = { from = "shaft", to = "gear", direction = "rz", model = "lash", gap = "0.1 deg", stiffness = "20 kN m/rad" }
[run]
speed = "600 rpm"
revolutions = 1
steps_per_revolution = 20000
start = "equilibrium"
[output]
probes = ["mass", "shaft", "gear"]
"""
BASE_CIRCLE = ("cams.c.phase=90deg", "run.revolutions=0.2")
"""The cam is on its base circle and exerts no torque."""
DAMPED = [f"contacts.{one}.{key}" for one in ("driving", "coasting") for key in ("damping=0.5", "damping_depth=2e-4")]


@pytest.fixture
def case(case_of):
    return partial(case_of, CASE)


def solve_case(made):
    ready = prepare(made)
    found = solve(ready.problem, ready.scheme)
    assert found.status.ok
    return found


@pytest.mark.parametrize("engine", [pytest.param("direct", marks=pytest.mark.slow), "kernel"])
def test_free_flight_between_flanks(record, case, engine):
    """From the middle at 2 rad/s, the shaft crosses the middle again after 2 g/w and half a period on a flank."""
    found = solve_case(case(*BASE_CIRCLE, f"run.engine={engine}", "run.integrator.method=newmark",
                        'run.start={ velocity = { "shaft.rz" = 2.0 } }'))  # fmt: skip
    angle, rate = found["shaft"].displacement[:, 5], found["shaft"].velocity[:, 5]
    after = np.flatnonzero(angle[:-1] * angle[1:] < 0.0)
    times = found.time[after] - angle[after] / rate[after]
    assert len(times) == 8
    record(source=SOURCE, case=f"shaft that flies from flank to flank, {engine} engine", quantity="time of a crossing",
           unit="s", reference=2.0 * GAP / 2.0 + math.pi * RATE_TIME, computed=np.diff(times).mean(), tolerance=1e-4,
           reason="steps of 1/280 of the period on a flank")  # fmt: skip
    free = np.abs(angle) < GAP
    np.testing.assert_allclose(np.abs(rate[free]), 2.0, rtol=2e-5)  # 1/280 of a period, squared
    record(source=SOURCE, case=f"shaft that flies from flank to flank, {engine} engine", quantity="largest angle",
           unit="rad", reference=GAP + 2.0 * RATE_TIME, computed=np.abs(angle).max(), tolerance=1e-4,
           reason="steps of 1/280 of the period on a flank")  # fmt: skip
    pressed = found.channels["contacts.coasting.force"] - found.channels["contacts.driving.force"]
    outside = np.sign(angle) * np.maximum(np.abs(angle) - GAP, 0.0)
    np.testing.assert_allclose(pressed, STIFFNESS * outside, atol=1e-9 * pressed.max())
    assert np.abs(found.channels["energy.residual"]).max() < 1e-9  # of 2 mJ


@pytest.mark.slow
def test_engines_agree(case):
    fewer = ("run.revolutions=0.3", "run.steps_per_revolution=5000", "run.integrator.method=newmark", *DAMPED)
    one, other = (solve_case(case(*fewer, f"run.engine={name}")) for name in ("direct", "kernel"))
    angle = [found["shaft"].displacement[:, 5] for found in (one, other)]
    assert np.ptp(angle[0]) > 2.0 * GAP
    np.testing.assert_allclose(angle[1], angle[0], atol=1e-9 * GAP)


@pytest.mark.parametrize(("torque", "flank"), [(-3.0, "driving"), (3.0, "coasting")])
def test_static_angle_under_torque(record, case, torque, flank):
    brake = f'loads.brake={{ at = "shaft", direction = "rz", force = {torque} }}'
    found = solve_case(case(*BASE_CIRCLE, brake, "run.revolutions=0.001"))
    record(source=SOURCE, case=f"torque of {torque:g} N m", quantity="angle at rest", unit="rad",
           reference=math.copysign(GAP + 3.0 / STIFFNESS, torque), computed=found["shaft"].displacement[0, 5],
           tolerance=1e-9, reason="rounding")  # fmt: skip
    assert found.channels[f"contacts.{flank}.force"][0] == pytest.approx(3.0, rel=1e-7)  # 1e-9 of 300 N
    assert found.channels["supports.gear.torque"][0] == pytest.approx(-torque, rel=1e-7)


def test_lash_crossing_after_torque_reversal(record, case):
    """From rest at g + T/k under -T: a sixth of a period on the flank, then uniform acceleration over 2 g."""
    T = 3.0
    start = f'run.start={{ displacement = {{ "shaft.rz" = {GAP + T / STIFFNESS} }} }}'
    found = solve_case(case(*BASE_CIRCLE, f'loads.brake={{ at = "shaft", direction = "rz", force = {-T} }}', start))
    left = math.sqrt(3.0) * T / STIFFNESS / RATE_TIME
    arrival_speed = math.sqrt(left**2 + 4.0 * GAP * T / J)
    at = int(np.argmax(found["shaft"].displacement[:, 5] < -GAP))
    x, v = (getattr(found["shaft"], one)[at - 1, 5] for one in ("displacement", "velocity"))
    time = found.time[at - 1] - (x + GAP) / v
    record(source=SOURCE, case="torque that reverses", quantity="time until the other flank", unit="s",
           reference=RATE_TIME * math.pi / 3.0 + (arrival_speed - left) * J / T, computed=time, tolerance=1e-4,
           reason="steps of 5 us")  # fmt: skip
    record(source=SOURCE, case="torque that reverses", quantity="speed at the other flank", unit="rad/s",
           reference=-arrival_speed, computed=v, tolerance=2e-3, reason="within a step of 5 us")  # fmt: skip


@pytest.mark.slow
def test_lash_with_reversing_cam_torque(case):
    """The returning follower makes the cam drive the shaft off its flank; the flanks transmit the cam torque."""
    drag = 0.5  # N m s/rad; without it the shaft tips chaotically from flank to flank near the nose
    ready = prepare(
        case('run.start="periodic"', "run.steps_per_revolution=5000", "run.integrator.method=newmark", *DAMPED,
             f"springs.drag={{ at = 'shaft', direction = 'rz', stiffness = 0, damping = {drag} }}")
    )  # fmt: skip
    found = solve(ready.problem, ready.scheme)
    channels, angle = found.channels, found["shaft"].displacement[:, 5]
    assert min(channels[f"contacts.{flank}.force"].max() for flank in ("driving", "coasting")) > 4.0
    drive = channels["contacts.driving.force"] - channels["contacts.coasting.force"]
    np.testing.assert_allclose(channels["supports.gear.torque"], drive, atol=1e-12)
    required = J * found["shaft"].acceleration[:, 5] + channels["contacts.k.torque"]
    required += drag * found["shaft"].velocity[:, 5]
    np.testing.assert_allclose(drive, required, atol=1e-9 * np.abs(required).max())
    free = np.abs(angle) < GAP
    assert 0.1 < free.mean() < 0.9
    assert not drive[free].any()
    lost = channels["energy.dissipated"][-1]
    assert np.abs(channels["energy.residual"]).max() < 1e-6 * lost
    assert channels["energy.work"][-1] == pytest.approx(lost, rel=2e-5)  # steps of 0.07 deg
    assert lost > 1e-3
    metrics = {one.name: one for one in compute_metrics(ready, found)}
    assert metrics["contacts.driving.gap.largest"].unit == "rad"


CHAIN = (
    "supports.gear=['ux', 'uy', 'uz', 'rx', 'ry']",
    "masses.gear={ at = 'gear', mass = 1, inertia = [3e-3, 3e-3, 3e-3] }",
    "springs.chain={ at = 'gear', direction = 'rz', stiffness = '5 kN m/rad', damping = '2 N m s/rad' }",
)  # fmt: skip


def test_gear_inertia_acts_at_variable_speed(case):
    """At variable speed the gear inertia acts, too, and the chain transmits the torque of all rotating parts."""
    swing = "run.fluctuation={ orders = [2], amplitudes = [0.1], phases = [0.4] }"
    found = solve_case(made := case(*CHAIN, *DAMPED, swing))
    rate = prepare(made).problem.drive.at(found.time).rate
    turned = [found[name].acceleration[:, 5] + rate for name in ("shaft", "gear")]
    required = J * turned[0] + 3.0 * J * turned[1] + found.channels["contacts.k.torque"]
    assert np.abs(rate).max() * J > 0.7
    np.testing.assert_allclose(found.channels["springs.chain.torque"], required, atol=1e-9 * np.abs(required).max())


@pytest.mark.parametrize("law", ["shm", "cycloidal", "4-5-6-7"])
def test_initial_state_is_within_lash(case, law):
    """At the start of lift the equilibrium jumps to a flank: by g per thousandth of a radian, 55 rad/s."""
    found = solve_case(case(f"cams.c.law={law}", "run.revolutions=0.001"))
    assert abs(found["shaft"].displacement[0, 5]) <= GAP + 1e-6
    assert abs(found["shaft"].velocity[0, 5]) < 0.02  # the flank deforms by N s''/k at 62.8 rad/s


def test_rigid_model_ignores_drive_lash(case):
    found = run(made := case("fidelity.model=rigid", "run.steps_per_revolution=360"))
    assert not any("driving" in name for name in found.channels)
    lines = [line for line in CASE.splitlines() if not line.startswith(("driving", "coasting"))]
    made.path.write_text("\n".join(lines).replace('"rx", "ry"]', '"rx", "ry", "rz"]'), encoding="utf-8")
    bare = run(read_case(made.path, ["fidelity.model=rigid", "run.steps_per_revolution=360"]))
    np.testing.assert_allclose(found.channels["contacts.k.force"], bare.channels["contacts.k.force"], rtol=1e-12)
    assert largest_lashes(build_model(made))["c"] == 0.0  # no delay of the valve
    assert model_modes(build_structure(build_model(made))).modes.rigid == 1
    table = model_table(prepare(made), model_modes(build_structure(build_model(made))))
    assert "lash of 0.1 deg from gear to shaft, 20000 N m/rad" in [cell for one in table.columns for cell in one.cells]


INVALID = {
    "no stiffness": ('contacts.driving={ from = "gear", to = "shaft", direction = "rz", model = "lash", gap = 0.01 }',
                     "No member defines the stiffness of a lash about an axis"),
    "a gap in mm": ('contacts.driving.gap="0.1 mm"', "an angle"),
    "an adjuster": ("contacts.driving={ from = 'gear', to = 'shaft', direction = 'rz', model = 'lash-adjuster' }",
                    "motion along a line"),
}  # fmt: skip


@pytest.mark.parametrize("change", INVALID)
def test_invalid_lash_raises_error(case, change):
    setting, why = INVALID[change]
    with pytest.raises(InputError, match=why):
        prepare(case(setting))


def test_lash_at_fixed_shaft_raises_error(case):
    with pytest.raises(InputError, match="a lash between fixed points"):
        prepare(case("supports.shaft=['ux', 'uy', 'uz', 'rx', 'ry', 'rz']"))


def test_units_of_rotational_lash(case):
    """Written cases and studies use the units of a rotation, and of a line for other contacts."""
    made = case()
    tables = complete_case_tables(made)
    lash = tables["contacts"]["driving"]
    assert (lash["damping"], lash["damping_depth"]) == ("0.0 N m s/rad", "1e-05 rad")
    units = {key: find_unit(made.record, ("contacts", "driving", key)) for key in ("gap", "stiffness", "damping")}
    assert units == {"gap": "rad", "stiffness": "N m/rad", "damping": "N m s/rad"}
    assert find_unit(made.record, ("contacts", "k", "stiffness")) == "N/m"
