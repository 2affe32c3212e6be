"""Friction of guides, seals and pivots, against closed forms.

A mass on a spring under Coulomb friction F loses the amplitude 2 F/k in each half period, and its period is that
without friction: J. P. Den Hartog, Mechanical Vibrations, 4th ed., sec. 8.2. A guide dissipates 2 F h for a valve that
opens by h and closes once.
"""

import math
from pathlib import Path

import numpy as np
import pytest

from flexcam import InputError, build_model, prepare, read_case, solve
from flexcam.analysis.run_metrics import compute_metrics

SOURCE = "Friction of slides"
OSCILLATOR = """
format = 1
nodes = { mass = [0, 0, 0] }
masses = { one = { at = "mass", mass = "1 kg", inertia = [1, 1, 1] } }
springs = { one = { at = "mass", direction = "ux", stiffness = "10 kN/m" } }
friction = { slide = { at = "mass", direction = "ux", force = "5 N", friction_speed = "0.1 mm/s" } }
[run]
speed = "600 rpm"
steps_per_revolution = 2000
revolutions = 2
start = { displacement = { "mass.ux" = "10 mm" } }
[output]
probes = ["mass"]
"""
FOLLOWER = (
    (Path(__file__).parent / "cam-follower.toml").read_text(encoding="utf-8")
    + """
[friction]
guide = { at = "mass", direction = "uy", force = "20 N", breakaway_force = "30 N", damping = "5 N s/m" }
"""
)


def solve_case(folder, text, *overrides):
    (folder / "one.toml").write_text(text)
    ready = prepare(read_case(folder / "one.toml", overrides))
    found = solve(ready.problem, ready.scheme)
    assert found.status.ok
    return found


@pytest.mark.parametrize("engine", [pytest.param("direct", marks=pytest.mark.slow), "kernel"])
def test_amplitudes_with_coulomb_friction(engine, record, tmp_path):
    """The closed form covers six half periods; at their ends the sliding velocity is zero."""
    found = solve_case(tmp_path, OSCILLATOR, f"run.engine={engine}")
    x = found["mass"].displacement[:, 0]
    ends = np.interp(np.arange(1, 7) * math.pi / 100.0, found.time, x)
    sides = np.array([-1, 1, -1, 1, -1, 1]) * (0.01 - 2.0 * 5.0 / 1e4 * np.arange(1, 7))
    record(source=SOURCE, case=f"mass on a spring, {engine} engine", quantity="largest error of six amplitudes",
           unit="m", reference=0.0, computed=np.abs(ends - sides).max(), tolerance=2e-6, absolute=True,
           reason="reversal over 0.1 mm/s instead of a jump, 7 um of 1 mm per half period")  # fmt: skip
    assert np.abs(found.channels["energy.residual"]).max() < 1e-9  # of 0.5 J


def test_cam_force_of_rigid_follower_with_guide_friction(record, tmp_path):
    """The cam force increases by the friction on the rise and decreases by it on the return."""
    overrides = ("fidelity.model=rigid",)
    found = solve_case(tmp_path, FOLLOWER, *overrides)
    event = build_model(read_case(tmp_path / "one.toml")).cams["c"].event
    omega = 20.0 * math.pi
    v = event(found.angle, 1) * omega
    friction = (20.0 + 10.0 * np.exp(-((v / 0.1) ** 2))) * np.tanh(v / 0.01) + 5.0 * v
    force = 0.1 * event(found.angle, 2) * omega**2 + 4e4 * event(found.angle, 0) + 300.0 + friction
    record(source=SOURCE, case="rigid follower in a guide", quantity="largest error of the cam force", unit="N",
           reference=0.0, computed=np.abs(found.channels["contacts.k.force"] - force).max(), tolerance=1e-9,
           absolute=True, reason="rounding of 600 N")  # fmt: skip


def test_work_of_guide_friction(record, tmp_path):
    """The work is 2 F h per revolution of 0.1 s, from the mean power."""
    found = solve_case(tmp_path, FOLLOWER, "friction.guide.breakaway_force=20 N", "friction.guide.damping=0",
                   'friction.guide.friction_speed="1 mm/s"')  # fmt: skip
    metrics = {one.name: one for one in compute_metrics(prepare(read_case(tmp_path / "one.toml")), found)}
    work = metrics["friction.guide.friction_power.mean"].value * 0.1
    record(source=SOURCE, case="stiff follower in a guide", quantity="work of friction per revolution", unit="J",
           reference=2.0 * 20.0 * 0.006, computed=work, tolerance=3e-3,
           reason="reversal over 1 mm/s at the ends of the lift")  # fmt: skip


def test_pivot_friction_moment(tmp_path):
    """The friction is a moment about an axis, with the units of a rotation."""
    text = OSCILLATOR.replace('direction = "ux", force = "5 N", friction_speed = "0.1 mm/s"',
                              'direction = "rz", force = "2 N m", friction_speed = "1 rad/s"')  # fmt: skip
    text = text.replace('displacement = { "mass.ux" = "10 mm" }', 'velocity = { "mass.rz" = 20.0 }')
    found = solve_case(tmp_path, text, "run.revolutions=0.5")
    spin = found["mass"].velocity[:, 5]
    np.testing.assert_allclose(spin, 20.0 - 2.0 * found.time, atol=1e-6)


def test_viscous_seal_power(tmp_path):
    """Without Coulomb friction the seal is a damper with the power c v^2."""
    found = solve_case(tmp_path, FOLLOWER, "friction.guide.force=0", "friction.guide.breakaway_force=0")
    v = found["mass"].velocity[:, 1]
    power = found.channels["friction.guide.power"]
    np.testing.assert_allclose(power, 5.0 * v**2, atol=1e-12 * power.max())
    assert np.abs(found.channels["energy.residual"]).max() < 1e-6 * found.channels["energy.dissipated"][-1]


def test_breakaway_force_below_friction_raises_error(tmp_path):
    with pytest.raises(InputError, match="at least `force`, 20 N"):
        solve_case(tmp_path, FOLLOWER, 'friction.guide.breakaway_force="10 N"')


def test_friction_in_fixed_direction_raises_error(tmp_path):
    with pytest.raises(InputError, match="It cannot move that way"):
        solve_case(tmp_path, FOLLOWER, 'friction.guide.direction="ux"')
