"""Drives of the camshaft: fluctuating speed, speed by angle, a free-running cam; and the resulting forces.

For a shaft of reduced inertia J(theta) without drive torque, J w^2 is constant and w' = -w^2 J'/(2 J). With w' the
acceleration of the follower is s'' w^2 + s' w': F. Y. Chen, Mechanics and Design of Cam Mechanisms (1982), ch. 2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from flexcam import InputError, build_model, prepare, read_case, run, solve
from flexcam.analysis.run import open_result_file
from flexcam.analysis.run_metrics import compute_metrics
from flexcam.dynamics import CamMotion, ConstantSpeed, FluctuatingSpeed, Phaser, SpeedByAngle
from flexcam.valvetrain import free_running
from tests.thinning import slow_if

SOURCE = "Drives of the camshaft"
INLINE = Path(__file__).parents[1] / "data/inline.toml"
TEMPLATES = Path(__file__).parents[2] / "flexcam/templates"
FLUCTUATION = FluctuatingSpeed(120.0, (1.0, 2.0, 0.5), (0.05, 0.1, 0.02), (0.3, -1.0, 2.0), start=0.7)
TIMES = np.linspace(0.0, 0.21, 41)


def test_fluctuating_speed(record):
    """The angle is the integral of the speed by quadrature, the rate its slope by differences."""
    motion = FLUCTUATION.at(TIMES)
    stated = sum(
        a * np.cos(k * 120.0 * TIMES + p)
        for k, a, p in zip(FLUCTUATION.orders, FLUCTUATION.amplitudes, FLUCTUATION.phases, strict=True)
    )  # fmt: skip
    np.testing.assert_allclose(motion.speed, 120.0 * (1.0 + stated), rtol=1e-13)
    np.testing.assert_array_equal(motion.time, TIMES)
    angle = [
        0.7 + quad(lambda t: float(FLUCTUATION.at(np.array(t)).speed), 0.0, t, epsrel=1e-12, limit=200)[0]
        for t in TIMES
    ]
    record(source=SOURCE, case="swinging speed", quantity="largest error of the angle", unit="rad", reference=0.0,
           computed=np.abs(motion.angle - angle).max(), tolerance=1e-11, absolute=True,
           reason="quadrature")  # fmt: skip
    h = 1e-6
    slope = (FLUCTUATION.at(TIMES + h).speed - FLUCTUATION.at(TIMES - h).speed) / (2.0 * h)
    np.testing.assert_allclose(motion.rate, slope, atol=1e-6 * np.abs(slope).max())


def speed_of_angle(angle, order):
    """Return 100 (1 + 0.4 cos(2 a) + 0.1 sin(a)) or its first derivative."""
    if order == 0:
        return 100.0 * (1.0 + 0.4 * np.cos(2.0 * angle) + 0.1 * np.sin(angle))
    return 100.0 * (-0.8 * np.sin(2.0 * angle) + 0.1 * np.cos(angle))


@pytest.mark.parametrize("start", [0.0, 1.3, -0.4, 9.0])
def test_speed_as_function_of_angle(record, start):
    """The reference is theta' = w(theta) by scipy to 1e-12, over several revolutions and from any angle."""
    drive = SpeedByAngle(speed_of_angle, start)
    times = np.linspace(0.0, 0.3, 61)
    exact = solve_ivp(lambda t, a: speed_of_angle(a, 0), (0.0, 0.3), [start], t_eval=times, method="DOP853", rtol=1e-13,
                      atol=1e-13).y[0]  # fmt: skip
    motion = drive.at(times)
    record(source=SOURCE, case=f"speed by angle, from {start:g} rad", quantity="largest error of the angle",
           unit="rad", reference=0.0, computed=np.abs(motion.angle - exact).max(), tolerance=1e-10, absolute=True,
           reason="the reference itself, 1e-13 per step over 30 rad")  # fmt: skip
    np.testing.assert_allclose(motion.speed, speed_of_angle(exact, 0), rtol=1e-10)
    np.testing.assert_array_equal(motion.time, times)
    np.testing.assert_allclose(motion.rate, speed_of_angle(exact, 1) * speed_of_angle(exact, 0), atol=1e-6)
    period = quad(lambda a: 1.0 / speed_of_angle(a, 0), 0.0, 2.0 * math.pi, epsrel=1e-13)[0]
    assert drive.period == pytest.approx(period, rel=1e-12)
    np.testing.assert_allclose(drive.at(times + period).angle - motion.angle, 2.0 * math.pi, rtol=1e-11)


CASE = """
format = 1
[nodes]
drive = [0.0, 0.0, 0.0]
cam = [0.05, 0.0, 0.0]
tappet = [0.05, 0.03, 0.0]
top = [0.05, 0.08, 0.0]
[materials.stiff]
E = "2000 GPa"
nu = 0.3
density = "1 kg/m^3"
[sections]
thick = {{ shape = "circle", diameter = "{diameter} mm" }}
[members]
camshaft = {{ nodes = ["drive", "cam"], material = "stiff", section = "thick" }}
pushrod = {{ nodes = ["tappet", "top"], material = "stiff", section = "thick" }}
[supports]
drive = ["ux", "uy", "uz", "rx", "ry", "rz"]
tappet = ["ux", "uz", "ry", "rx", "rz"]
top = ["ux", "uz", "ry", "rx", "rz"]
[masses]
follower = {{ at = "tappet", mass = "0.5 kg" }}
{masses}
[springs]
valve = {{ at = "tappet", direction = "uy", stiffness = "20 kN/m", installed_force = "300 N" }}
[cams.intake]
at = "cam"
law = "4-5-6-7"
lift = "8 mm"
rise = "120 deg"
return = "120 deg"
phase = "20 deg"
base_radius = "30 mm"
follower = {{ type = "flat" }}
[contacts]
intake = {{ cam = "intake", follower = "tappet", model = "bilateral", stiffness = "1 GN/m" }}
[run]
speed = "900 rpm"
revolutions = 1
steps_per_revolution = 1800
start = "equilibrium"
{lines}
[output]
probes = ["tappet", "cam"]
"""
OMEGA = 900.0 * math.pi / 30.0
FLUCTUATION_KEY = "fluctuation = { orders = [2, 4], amplitudes = [0.1, 0.05], phases = [0.5, 0.0] }"
FREE_RUNNING_KEY = 'free_running = { cam = "intake", cam_mass = "0.8 kg", follower_mass = "0.5 kg" }'


@pytest.fixture
def case(tmp_path):
    def make(lines, masses="", diameter=40.0):
        path = tmp_path / "drive.toml"
        path.write_text(CASE.format(lines=lines, masses=masses, diameter=diameter), encoding="utf-8")
        return read_case(path)

    return make


def rigid_follower_force(case, motion):
    """Return contact force of the rigid follower and slope of the lift for a motion of the cam."""
    event = build_model(case).cams["intake"].event
    s, slope, bend = (event(motion.angle, order) for order in range(3))
    mass = 0.5 + math.pi * 0.02**2 * 0.05
    return mass * (bend * motion.speed**2 + slope * motion.rate) + 20e3 * s + 300.0, slope


@pytest.mark.parametrize("lines", [FLUCTUATION_KEY, FREE_RUNNING_KEY])
def test_contact_force_at_variable_speed(record, case, lines):
    """The inertia s' w' contributes to the force, in the rigid model and in the flexible one."""
    made = case(lines)
    ready = prepare(made)
    name = lines.split()[0]
    times = np.linspace(0.0, ready.problem.step * ready.problem.steps, ready.problem.steps + 1)
    force, slope = rigid_follower_force(made, ready.problem.drive.at(times))
    assert np.abs(ready.problem.drive.at(times).rate).max() > 0.05 * OMEGA**2 * (
        0.1 if lines is FREE_RUNNING_KEY else 1.0
    )
    rigid, flexible = run(made, rigid=True), run(made)
    np.testing.assert_allclose(rigid.channels["contacts.intake.force"], force, atol=1e-9 * force.max())
    np.testing.assert_allclose(rigid.channels["contacts.intake.torque"], force * slope, atol=1e-11 * force.max())
    for quantity, exact in (("force", force), ("torque", force * slope)):
        found = flexible.channels[f"contacts.intake.{quantity}"]
        record(source=SOURCE, case=f"stiff train, {name}", quantity=f"largest error of the {quantity}", unit="1",
               reference=0.0, computed=np.abs(found - exact).max() / np.abs(exact).max(), tolerance=3e-3,
               absolute=True, reason="follower on its contact: rings of the starts of s'''")  # fmt: skip
    acceleration = rigid["tappet.uy"].acceleration
    event = build_model(made).cams["intake"].event
    motion = ready.problem.drive.at(rigid.time)
    expected = event(motion.angle, 2) * motion.speed**2 + event(motion.angle, 1) * motion.rate
    np.testing.assert_allclose(acceleration, expected, atol=1e-9 * np.abs(expected).max())


def test_energy_balance_at_fluctuating_speed(record, case):
    channels = run(case(FLUCTUATION_KEY)).channels
    most = np.abs(channels["energy.work"]).max()
    record(source=SOURCE, case="stiff train, swinging speed", quantity="energy residual over work", unit="1",
           reference=0.0, computed=np.abs(channels["energy.residual"]).max() / most, tolerance=1e-9, absolute=True,
           reason="linear contact: rounding")  # fmt: skip


def test_energy_of_free_running_cam(record, case):
    """The cam is a disc, the follower a mass: J w^2 is constant, with w' = -w^2 J'/(2 J)."""
    made = case(FREE_RUNNING_KEY)
    model = build_model(made)
    drive = free_running(model, OMEGA, "intake", 0.8, 0.5)
    event, r0 = model.cams["intake"].event, 0.03
    motion = drive.at(np.linspace(0.0, 0.07, 500))
    s, slope, bend = (event(motion.angle, order) for order in range(3))
    J = 0.4 * (r0**2 + 4.0 * r0 * s + 2.0 * s**2) + 0.5 * slope**2
    turned = 0.4 * (4.0 * r0 + 4.0 * s) * slope + slope * bend
    energy = J * motion.speed**2
    mean = 0.4 * (r0 + 0.008) ** 2 * OMEGA**2
    record(source=SOURCE, case="cam that runs freely", quantity="largest error of J w^2", unit="1", reference=0.0,
           computed=np.abs(energy / mean - 1.0).max(), tolerance=1e-12, absolute=True, reason="rounding")  # fmt: skip
    rate = -0.5 * motion.speed**2 * turned / J
    record(source=SOURCE, case="cam that runs freely", quantity="largest error of w'", unit="1", reference=0.0,
           computed=np.abs(motion.rate - rate).max() / np.abs(rate).max(), tolerance=1e-12, absolute=True,
           reason="rounding")  # fmt: skip
    assert np.ptp(motion.speed) > 0.02 * OMEGA


def test_flywheel_torque_at_fluctuating_speed(case):
    """A disc at the cam node lags by I w'/(G J/L) and needs the torque I w', far below its natural frequency."""
    inertia = 2e-3
    masses = f"disc = {{ at = 'cam', mass = 0.1, inertia = [{inertia}, 1e-3, 1e-3] }}"
    made = case(FLUCTUATION_KEY + '\ndamping = { beta = "1e-5 s" }', masses=masses.replace("'", '"'), diameter=30.0)
    response = run(made)
    motion = prepare(made).problem.drive.at(response.time)
    behind = slice(200, None)
    torque = response.channels["supports.drive.torque"] - response.channels["contacts.intake.torque"]
    np.testing.assert_allclose(
        torque[behind], inertia * motion.rate[behind], atol=0.1 * inertia * np.abs(motion.rate).max()
    )


@pytest.mark.parametrize("felt", [True, False])
def test_cam_torque_at_driven_end(felt):
    """The drive carries the cam torque, unless the published load does not twist the shaft."""
    end = ["cams.intake.at=drive", "nodes.tappet=[0, 0.018, 0]", "nodes.pushrod-top=[0, 0.268, 0]"]
    response = run(read_case(INLINE, [*end, f"contacts.intake.cam_torque={str(felt).lower()}"]))
    required, given = response.channels["contacts.intake.torque"], response.channels["supports.drive.torque"]
    assert np.abs(required).max() > 0.5
    np.testing.assert_allclose(given, required if felt else 0.0, atol=1e-9 * np.abs(required).max())


def test_contact_torque_at_driven_end(case):
    """The drive carries the torque of the contact; the inertia of the bare shaft is negligible."""
    made = case(FLUCTUATION_KEY)
    end = ["cams.intake.at=drive", "nodes.tappet=[0, 0.03, 0]", "nodes.top=[0, 0.08, 0]"]
    response = run(read_case(made.path, [*end, "contacts.intake.model=unilateral", "contacts.intake.friction=0.1"]))
    required, given = response.channels["contacts.intake.torque"], response.channels["supports.drive.torque"]
    assert np.abs(required).max() > 3.0
    np.testing.assert_allclose(given, required, atol=1e-4 * np.abs(required).max())


def test_drive_torque_balances_all_moments(case):
    """The moments about the shaft are those of springs, dampers, loads, eccentric bodies and the cam."""
    bodies = """
disc = { at = "drive", mass = 0.3, inertia = [2e-3, 1e-3, 1e-3], offset = [0.0, 0.02, -0.03] }
gear = { at = "cam", mass = 0.2, inertia = [1e-3, 1e-3, 1e-3], offset = [0.01, -0.04, 0.05] }
[loads]
brake = { at = "drive", direction = "rx", force = 7.0 }
pump = { at = "cam", direction = "-rx", force = 3.0 }
"""
    made = case(
        FLUCTUATION_KEY + "\ndamping = { alpha = 40.0, beta = 1e-6 }\ngravity = [0.0, -9.81, 3.0]", masses=bodies
    )
    text = made.path.read_text(encoding="utf-8").replace(
        "[springs]",
        """[springs]
coupling = { at = "drive", to = "cam", direction = "rx", stiffness = 4e4, damping = 2.0 }
askew = { at = "drive", to = "cam", direction = [0.0, 0.0, 0.0, 0.6, 0.8, 0.0], stiffness = 3e4 }
ground = { at = "cam", direction = "rx", stiffness = 900.0, damping = 0.05 }""",
    )
    made.path.write_text(text, encoding="utf-8")
    response = run(read_case(made.path))
    rate = prepare(made).problem.drive.at(response.time).rate
    d, v, a = (getattr(response["cam"], one) for one in ("displacement", "velocity", "acceleration"))
    still = np.zeros_like(d)

    def momentum(unknown, turned):
        """Return angular momentum about the shaft, or its rate, of disc, gear and shaft."""
        total = 1.0 * math.pi / 32.0 * 0.04**4 * 0.05 * 0.5 * (unknown[:, 3] + 2.0 * turned)
        disc, gear = (0.3, 2e-3, (0.0, 0.02, -0.03), still), (0.2, 1e-3, (0.01, -0.04, 0.05), unknown)
        for mass, own, (x, y, z), at in (disc, gear):
            turning = at[:, 3] + turned
            sidewise = at[:, 1] - turning * z + at[:, 5] * x
            upwards = at[:, 2] + turning * y - at[:, 4] * x
            total = total + own * turning + mass * (y * upwards - z * sidewise)
        return total

    weight = sum(mass * (y * 3.0 + z * 9.81) for mass, y, z in ((0.3, 0.02, -0.03), (0.2, -0.04, 0.05)))
    balance = momentum(a, rate) + 40.0 * momentum(v, 0.0) + 900.0 * d[:, 3] + (0.05 + 1e-6 * 900.0) * v[:, 3]
    balance += response.channels["contacts.intake.torque"] - weight + (3.0 - 7.0)
    given = response.channels["supports.drive.torque"]
    assert np.abs(given).max() > 10.0
    np.testing.assert_allclose(given, balance, atol=1e-8 * np.abs(given).max())


def restart_angles(case, tmp_path, lines, *, speed):
    """Return the end angle of a run and the start angle of a restart from its result at another speed."""
    made = read_case(case(lines).path, ["run.revolutions=0.3"])
    first = prepare(made)
    solve(first.problem, first.scheme, save=first.save, sinks=[open_result_file(first, tmp_path)])
    text = made.path.read_text(encoding="utf-8").replace('start = "equilibrium"', 'start = { result = "drive.vtkhdf" }')
    made.path.write_text(text, encoding="utf-8")
    end = float(first.problem.drive.at(np.array([first.problem.step * first.problem.steps])).angle[0])
    second = prepare(read_case(made.path, [f"run.speed={speed} rpm"])).problem
    return end, float(second.drive.at(np.array([second.start.time])).angle[0])


@pytest.mark.parametrize("lines", [FLUCTUATION_KEY, pytest.param(FREE_RUNNING_KEY, marks=pytest.mark.slow)])
def test_restart_continues_at_same_angle(case, tmp_path, lines):
    end, begins = restart_angles(case, tmp_path, lines, speed=900)
    assert begins == pytest.approx(end, abs=1e-9)


@pytest.mark.parametrize("lines", [FLUCTUATION_KEY, pytest.param(FREE_RUNNING_KEY, marks=pytest.mark.slow)])
def test_restart_at_another_speed_continues_at_same_angle(case, tmp_path, lines):
    end, begins = restart_angles(case, tmp_path, lines, speed=1100)
    assert begins == pytest.approx(end, abs=1e-9)


SHIFT_TABLE = (math.radians(60.0), math.radians(300.0)), (0.0, math.radians(12.0))
PHASER = 'phasers.{0}={{ cams = ["{0}"], shift = [["60 deg", "0 deg"], ["300 deg", "12 deg"]] }}'


def test_moving_phaser(record):
    """Speed and rate are the derivatives of the angle, which passes the rows and is constant before and after them."""
    phaser, drive = Phaser((5.0, 10.0, 12.0), (0.0, 0.35, 0.30)), ConstantSpeed(100.0, 0.4)
    shift = phaser(angle := 0.4 + 100.0 * TIMES) - angle
    assert shift[angle < 5.0] == pytest.approx(0.0, abs=1e-15)
    assert shift[angle > 12.0] == pytest.approx(0.30, abs=1e-13)
    assert phaser(np.array([10.0])) == pytest.approx([10.35], rel=1e-13)
    h, times = 1e-6, np.linspace(0.051, 0.095, 25)
    sides = [phaser.motion(drive.at(times + side)) for side in (h, -h)]
    slopes = [(one - other) / (2.0 * h) for one, other in
              zip((sides[0].angle, sides[0].speed), (sides[1].angle, sides[1].speed), strict=True)]  # fmt: skip
    motion = phaser.motion(drive.at(times))
    record(source=SOURCE, case="phaser", quantity="largest error of the speed", unit="rad/s", reference=0.0,
           computed=np.abs(motion.speed - slopes[0]).max(), tolerance=1e-6, absolute=True,
           reason="differences")  # fmt: skip
    assert motion.rate == pytest.approx(slopes[1], abs=1e-2)
    assert phaser.drive_angle(8.1 + float(phaser(np.array([8.1]))[0]) - 8.1) == pytest.approx(8.1, rel=1e-12)


def test_second_derivative_of_phaser_ignores_rounding():
    """The derivative jumps at a row; derivatives by the speed would otherwise compare values of both sides."""
    phaser, row = Phaser((5.0, 10.0, 12.0), (0.0, 0.35, 0.30)), 10.0
    neighbours = phaser(np.array([np.nextafter(row, 0.0), row, np.nextafter(row, 20.0)]), 2)
    assert neighbours == pytest.approx(neighbours[1], rel=1e-6)
    assert abs(float(phaser(np.array([row - 1e-6]), 2)[0]) - neighbours[1]) > 0.005


def test_steep_phaser_is_inverted():
    phaser = Phaser((0.0, 1.0, 1.5, 6.0), (0.0, -0.5, 0.9, 0.0))
    for angle in np.linspace(-1.0, 7.0, 33):
        assert float(phaser(np.array([phaser.drive_angle(angle)]))[0]) == pytest.approx(angle, abs=1e-12)


def test_mean_power_with_moving_phaser():
    """The cam turns 60 deg more than the drive in a revolution: its work is the torque over its own angle."""
    rows = '[["0 deg", "0 deg"], ["360 deg", "60 deg"]]'
    case = read_case(
        TEMPLATES / "direct-acting.toml",
        [
            "run.revolutions=1",
            "run.steps_per_revolution=1440",
            f'phasers.intake={{ cams = ["intake"], shift = {rows} }}',
        ],
    )
    ready = prepare(case)
    response = solve(ready.problem, ready.scheme, save=ready.save)
    turned = ready.model.cams["intake"].angle(response.angle)
    work = float(np.trapezoid(response.channels["contacts.intake.torque"], turned))
    found = {one.name: one.value for one in compute_metrics(ready, response)}
    duration = response.time[-1] - response.time[0]
    assert found["contacts.intake.power.mean"] == pytest.approx(work / duration, rel=1e-9)  # the same sum
    assert work != pytest.approx(
        float(np.trapezoid(response.channels["contacts.intake.torque"], response.angle)), rel=0.1
    )


def test_phaser_with_free_running_cam_raises_error():
    change = "phasers.free={ cams = ['valve'], shift = [['0 deg', '0 deg'], ['90 deg', '5 deg']] }"
    with pytest.raises(InputError, match=r"no phaser with run\.free_running"):
        read_case("cases/petrescu/valve-spring.toml", [change])


@dataclass(frozen=True)
class DriveWithPhaserMotion:
    """Drive with the motion of a shaft behind a phaser."""

    speed: float

    def at(self, time):
        theta = self.speed * np.asarray(time, dtype=float)
        moved = [Phaser(*SHIFT_TABLE)(theta, order) for order in range(3)]
        return CamMotion(moved[0], self.speed * moved[1], self.speed**2 * moved[2], time)


PHASER_CASES = {
    "flat face with friction, elastic shaft": (TEMPLATES / "direct-acting.toml", "intake", ()),
    "direct engine": (TEMPLATES / "direct-acting.toml", "intake",
                      ("run.engine=direct", "run.integrator.method=newmark", "run.steps_per_revolution=900")),
    "rigid": (TEMPLATES / "direct-acting.toml", "intake", ("fidelity.model=rigid",)),
    "roller": (TEMPLATES / "roller-tappet.toml", "intake", ()),
    "finger": (TEMPLATES / "finger-follower.toml", "intake", ()),
    "published load": (INLINE, "intake", ()),
    "rigid published load": (INLINE, "intake", ("fidelity.model=rigid",)),
}  # fmt: skip


@pytest.mark.parametrize("kind", slow_if(lambda one: one == "direct engine", PHASER_CASES))
def test_common_phaser_is_equivalent_to_moved_drive(record, kind):
    """Motion, contact force, torque and energy of all cams are those of a drive with the motion of the shaft."""
    case, name, options = PHASER_CASES[kind]
    options = (*options, "run.revolutions=1", "run.start=rest")
    ready = prepare(read_case(case, options))
    speed = float(ready.problem.drive.at(np.zeros(1)).speed[0])
    drive = solve(replace(ready.problem, drive=DriveWithPhaserMotion(speed)), ready.scheme)
    found = run(read_case(case, (*options, PHASER.format(name))))
    largest = 0.0
    for channel, other in drive.channels.items():
        if channel not in ("energy.residual", "energy.numerical"):  # sums of rounding
            scale = max(float(np.abs(other).max()), 1e-12)
            largest = max(largest, float(np.abs(found.channels[channel] - other).max()) / scale)
    record(source=SOURCE, case=f"phaser, {kind}", quantity="difference from a moved drive", unit="1", reference=0.0,
           computed=largest, tolerance=1e-6, absolute=True, reason="tolerance of the Newton iteration")  # fmt: skip
    assert found.angle == pytest.approx(speed * found.time, rel=1e-12, abs=1e-12)  # of the drive
    still = run(read_case(case, options)).channels
    force = next(name for name in still if name.startswith("contacts.") and name.endswith(".force"))
    assert np.abs(found.channels[force] - still[force]).max() > 1e-3 * np.abs(still[force]).max()


@pytest.mark.slow
def test_phaser_affects_only_its_shaft():
    """Each shaft of a head with two has its own schedule: the cams of the other shaft do not change.

    Steps in which an intake contact opens or closes are divided for all contacts, which changes the error of the steps.
    """
    case, options = TEMPLATES / "dohc-16-valve.toml", ("repeat.cylinder={ names = ['1'] }", "run.revolutions=0.5")
    rows = '[["30 deg", "0 deg"], ["150 deg", "10 deg"]]'
    intake = f'phasers.intake={{ cams = ["intake-1a", "intake-1b"], shift = {rows} }}'
    still, moved = run(read_case(case, options)), run(read_case(case, (*options, intake)))
    same, other = (f"contacts.{kind}-1a.force" for kind in ("exhaust", "intake"))
    scale = np.abs(still.channels[same]).max()
    assert np.abs(moved.channels[same] - still.channels[same]).max() < 1e-4 * scale
    assert np.abs(moved.channels[other] - still.channels[other]).max() > 0.1 * scale


def test_locked_phaser_is_equivalent_to_cam_phase():
    """Cams with an advance of 25 deg lift 25 deg earlier: the histories are those of a cam with that phase."""
    options = ("run.revolutions=1", 'run.start="rest"')
    case = read_case(INLINE, options)
    name = next(iter(case.record.cams))
    phase = case.record.cams[name].phase - math.radians(25.0)
    locked = f'phasers.intake={{ cams = ["{name}"], shift = [["0 deg", "25 deg"], ["360 deg", "25 deg"]] }}'
    ahead = run(read_case(INLINE, (*options, locked)))
    other = run(read_case(INLINE, (*options, f"cams.{name}.phase={phase!r}")))
    probe = next(iter(dict(ahead.outline.probes)))
    scale = np.abs(other[probe].displacement).max()
    assert np.abs(ahead[probe].displacement - other[probe].displacement).max() <= 1e-9 * scale  # rounding of the angle
    assert ahead.angle == pytest.approx(other.angle, abs=1e-12)
    metrics = [compute_metrics(prepare(read_case(INLINE, (*options, one))), response)
               for one, response in ((locked, ahead), (f"cams.{name}.phase={phase!r}", other))]  # fmt: skip
    assert [one.name for one in metrics[0]] == [one.name for one in metrics[1]]
    assert [one.value for one in metrics[0]] == pytest.approx([one.value for one in metrics[1]], rel=1e-6, abs=1e-9)


@pytest.mark.parametrize(
    ("rows", "options", "message"),
    [
        ('[["0 deg", "0 deg"], ["10 deg", "-60 deg"]]', (), "must keep turning"),
        ('[[0, 0], ["900 deg", 0], ["901 deg", "-60 deg"], ["2000 deg", 0]]', (), "keep turning"),
        ('[["10 deg", "0 deg"], ["10 deg", "5 deg"]]', (), "increasing angle"),
        ('[["0 deg", "0 deg"], ["90 deg", "5 deg"]]', ("run.start=periodic",), "repeats each revolution"),
        ('[["0 deg", "0 deg"], ["90 deg", "5 deg"]]', ('phasers.intake.cams=["intak"]',), "Did you mean 'intake'"),
        ('[["0 deg", "0 deg"], ["90 deg", "5 deg"]]',
         ('phasers.other={ cams = ["intake"], shift = [["0 deg", "0 deg"], ["90 deg", "5 deg"]] }',),
         "phasers.intake turns it"),
    ],
)  # fmt: skip
def test_invalid_phasers_raise_error(rows, options, message):
    with pytest.raises(InputError, match=message):
        prepare(read_case(INLINE, (f'phasers.intake={{ cams = ["intake"], shift = {rows} }}', *options)))


def test_different_phasers_on_one_shaft_raise_error():
    case, rows = TEMPLATES / "dohc-16-valve.toml", '[["0 deg", "0 deg"], ["90 deg", "5 deg"]]'
    with pytest.raises(InputError, match="one phaser for all cams of a shaft") as caught:
        build_model(read_case(case, (f'phasers.intake={{ cams = ["intake-1a"], shift = {rows} }}',)))
    assert len(caught.value.faults) == 1
