"""Lash between nodes and hydraulic lash adjusters, against closed forms and an independent integration.

Oil of stiffness k that leaks with c is a Maxwell element: under a constant force it sinks at F/c; after a step against
a spring K the oil force decays as exp(-t/T), T = c (1/k + 1/K). W. N. Findley, J. S. Lai, K. Onaran, Creep and
Relaxation of Nonlinear Viscoelastic Materials (1976), sec. 5.2. Under tension the check valve opens and the adjuster
refills with c0/k.
"""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from flexcam import InputError, build_model, prepare, read_case, run, solve
from flexcam.analysis.run import open_result_file
from flexcam.dynamics import ConstantSpeed, equilibrium
from flexcam.valvetrain import largest_lashes
from tests.thinning import mostly_slow

SOURCE = "Lash and hydraulic adjusters"
CASE = """
format = 1
[nodes]
drive = [0.0, 0.0, 0.0]
cam = [0.02, 0.0, 0.0]
tappet = [0.02, 0.03, 0.0]
top = [0.02, 0.08, 0.0]
bottom = [0.02, 0.09, 0.0]
end = [0.02, 0.12, 0.0]
[materials.stiff]
E = "500 GPa"
nu = 0.3
density = "1 kg/m^3"
[sections]
thick = {{ shape = "circle", diameter = "40 mm" }}
[members]
camshaft = {{ nodes = ["drive", "cam"], material = "stiff", section = "thick" }}
lower = {{ nodes = ["tappet", "top"], material = "stiff", section = "thick" }}
upper = {{ nodes = ["bottom", "end"], material = "stiff", section = "thick" }}
[supports]
drive = ["ux", "uy", "uz", "rx", "ry", "rz"]
tappet = ["ux", "uz", "ry", "rx", "rz"]
top = ["ux", "uz", "ry", "rx", "rz"]
bottom = ["ux", "uz", "ry", "rx", "rz"]
end = ["ux", "uz", "ry", "rx", "rz"]
[masses]
weight = {{ at = "end", mass = {mass} }}
[springs]
valve = {{ at = "end", direction = "uy", stiffness = {spring}, damping = {damping}{installed} }}
[cams.intake]
at = "cam"
law = "4-5-6-7"
lift = "2 mm"
rise = "90 deg"
return = "90 deg"
phase = "{phase} deg"
[contacts]
intake = {{ cam = "intake", follower = "tappet", model = "bilateral", stiffness = "1 GN/m" }}
play = {{ from = "top", to = "bottom", direction = "uy", {play} }}
{contacts}
{loads}
[run]
speed = "{speed} rpm"
revolutions = {revolutions}
steps_per_revolution = {steps}
start = "equilibrium"
[output]
probes = ["top", "bottom", "end"]
field_every = 10
"""
LASH = 'model = "lash", gap = "0.5 mm", stiffness = "50 MN/m"'
OIL, LEAK, REFILL, PLUNGER = 20e6, 4e5, 500.0, 20.0
ADJUSTER = (
    'model = "lash-adjuster", stiffness = "20 MN/m", leak = "400 kN s/m", refill = "500 N s/m", plunger_force = 20'
)


@pytest.fixture
def case(tmp_path):
    def make(play, **changes):
        given = {"mass": 0.1, "spring": 30e3, "damping": 0.0, "installed": "", "phase": 10.0, "contacts": "",
                 "loads": "", "speed": 60.0, "revolutions": 0.01, "steps": 3600}  # fmt: skip
        path = tmp_path / "play.toml"
        path.write_text(CASE.format(play=play, **(given | changes)), encoding="utf-8")
        return read_case(path)

    return make


@pytest.mark.parametrize("degrees", [5.0, 40.0, 70.0, 100.0, 140.0])
def test_lash_between_nodes_delays_motion(record, case, degrees):
    """The upper rod is at rest until the lower one closes the gap; then both move, with the lash stiffness between."""
    made = case(LASH)
    system = prepare(made).problem.system
    state = equilibrium(system, ConstantSpeed(1.0, math.radians(degrees)))
    up, on = (float(state.displacement[system.names.index(name)]) for name in ("top.uy", "end.uy"))
    lift = float(build_model(made).cams["intake"].event(np.array([math.radians(degrees)]), 0)[0])
    assert up == pytest.approx(lift, abs=1e-7)
    expected = max(lift - 0.5e-3, 0.0) * 50e6 / (50e6 + 30e3)
    record(source=SOURCE, case=f"play of 0.5 mm at a lift of {1e3 * lift:.3f} mm", quantity="motion behind it",
           unit="m", reference=expected, computed=on, tolerance=2e-7, absolute=True,
           reason="rods and contact give 0.1 um under 45 N")  # fmt: skip


def test_lash_force_never_pulls(case):
    made = case(LASH, revolutions=0.55, speed=600.0, steps=1800)
    response = run(made)
    force = response.channels["contacts.play.force"]
    depth = response["top.uy"].displacement - response["bottom.uy"].displacement - 0.5e-3
    np.testing.assert_allclose(force, np.maximum(50e6 * depth, 0.0), atol=1e-6 * force.max())
    assert force.max() > 10.0
    assert force.min() == 0.0


LOAD = '[loads.push]\nat = "end"\ndirection = "-uy"\nforce = {}'


def test_leak_down_under_constant_force(record, case):
    """The oil carries the force less that of the plunger spring: it sinks by force/k at once and then at force/c."""
    force = 500.0
    made = case(ADJUSTER, spring=0.0, loads=LOAD.format(force), phase=170.0, revolutions=0.3)
    response = run(made)
    oil = force - PLUNGER
    sunk = response["top.uy"].displacement - response["end.uy"].displacement
    record(source=SOURCE, case="adjuster under 500 N", quantity="sinking of the oil column at once", unit="m",
           reference=oil / OIL, computed=sunk[0], tolerance=1e-3, reason="the rods give as well")  # fmt: skip
    record(source=SOURCE, case="adjuster under 500 N", quantity="velocity of leak-down", unit="m/s",
           reference=oil / LEAK, computed=(sunk[-1] - sunk[0]) / response.time[-1], tolerance=1e-3,
           reason="the mass is set going at the start: it swings by (v/w) about the steady sinking")  # fmt: skip
    assert response.channels["contacts.play.leak_down"][-1] == pytest.approx(oil / LEAK * response.time[-1], rel=1e-3)
    assert np.abs(response.channels["energy.residual"]).max() < 1e-6 * response.channels["energy.dissipated"][-1]
    assert response.channels["energy.dissipated"][-1] == pytest.approx(oil**2 / LEAK * response.time[-1], rel=2e-3)


CHAMBER = (
    '{ viscosity = "20 mPa s", bulk_modulus = "1.5 GPa", plunger_diameter = "11 mm", clearance = "6 um", '
    'land_length = "8 mm", chamber_height = "5 mm"'
)


@pytest.mark.parametrize(("air", "modulus"), [("", 1.5e9), (', air = "5 %", pressure = "2 MPa" }', 5.4064e7)])
def test_leak_down_of_oil_chamber(air, modulus, record, case):
    """The standard test of adjusters loads the plunger; its velocity is that of the flow through the annular gap.

    Flow pi d c^3 p/(12 mu L) at p = F/A; air is a gas spring of 1.4 p in series.
    """
    made = case(f'model = "lash-adjuster", refill = 500, plunger_force = 0, oil = {CHAMBER}{air or " }"}', spring=0.0,
                loads=LOAD.format(300.0), phase=170.0, revolutions=0.3)  # fmt: skip
    response = run(made)
    area = 0.25 * math.pi * 0.011**2
    flow = math.pi * 0.011 * (6e-6) ** 3 * (300.0 / area) / (12.0 * 0.02 * 0.008)
    sunk = response["top.uy"].displacement - response["end.uy"].displacement
    record(source=SOURCE, case=f"oil chamber under 300 N{', with air' * bool(air)}", unit="m",
           quantity="sinking of the plunger at once", reference=300.0 * 0.005 / (modulus * area), computed=sunk[0],
           tolerance=2e-3, reason="the rods give as well; five digits of the modulus")  # fmt: skip
    record(source=SOURCE, case=f"oil chamber under 300 N{', with air' * bool(air)}", unit="m/s",
           quantity="velocity of leak-down", reference=flow / area,
           computed=response.channels["contacts.play.leak_down"][-1] / response.time[-1], tolerance=2e-3,
           reason="the mass swings about the steady sinking")  # fmt: skip


def test_chamber_with_stiffness_and_leak_raises_error(case):
    with pytest.raises(InputError, match="either oil, or stiffness and leak"):
        case(f"{ADJUSTER}, oil = {CHAMBER} }}")


def test_maxwell_relaxation(record, case):
    """The adjuster is in equilibrium at the start, with z = 0; then the parallel spring takes over the load."""
    force, spring = 500.0, 5e5
    made = case(ADJUSTER, mass=1e-3, spring=spring, damping=50.0, loads=LOAD.format(force), phase=170.0,
                revolutions=0.4, speed=30.0)  # fmt: skip
    response = run(made)
    T = LEAK * (1.0 / OIL + 1.0 / spring)
    oil = (force - PLUNGER) * OIL / (OIL + spring) * np.exp(-response.time / T)
    found = response.channels["contacts.play.force"] - PLUNGER
    record(source=SOURCE, case="step against a spring", quantity="largest error of the oil's force", unit="N",
           reference=0.0, computed=np.abs(found - oil).max(), tolerance=2e-3 * oil[0], absolute=True,
           reason="rods and contact are a part of the oil's compliance, damper and mass of the spring")  # fmt: skip


def integrate_leak_down(time, depth):
    """Return the leak-down for a history of depth, by an independent integration."""
    at = CubicSpline(time, depth)

    def rate(t, z):
        pressed = at(t) - z
        return OIL * pressed / np.where(pressed > 0.0, LEAK, REFILL)

    return solve_ivp(rate, (time[0], time[-1]), [0.0], t_eval=time, method="LSODA", rtol=1e-9, atol=1e-14,
                     max_step=5.0 * (time[1] - time[0])).y[0]  # fmt: skip


SEAT = 'seat = { at = "end", direction = "uy", model = "seat", stiffness = "40 MN/m", damping = 500 }'
SEAT_CHANGES = {"installed": ", installed_force = 300", "speed": 300.0, "revolutions": 1.0, "contacts": SEAT}


@pytest.mark.slow
def test_leak_down_and_refill_over_revolution(record, case):
    """The adjuster leaks during the lift and refills on the seat in tens of microseconds, which removes the lash."""
    response = run(case(ADJUSTER, **SEAT_CHANGES))
    channels = response.channels
    depth = response["top.uy"].displacement - response["bottom.uy"].displacement
    z = channels["contacts.play.leak_down"]
    exact = integrate_leak_down(response.time, depth)
    assert exact.max() > 5e-5
    record(source=SOURCE, case="a revolution with a seat", quantity="largest error of the leak-down", unit="m",
           reference=0.0, computed=np.abs(z - exact).max(), tolerance=2e-3 * exact.max(), absolute=True,
           reason="the trapezoidal rule on steps of 55 us, three times the time of refill")  # fmt: skip
    force = PLUNGER + OIL * np.maximum(depth - z, 0.0)
    np.testing.assert_allclose(channels["contacts.play.force"], force, atol=1e-6 * force.max())
    assert channels["contacts.play.force"].min() >= PLUNGER * (1.0 - 1e-9)
    # Refilled: at the end of the revolution the oil force is zero, and the plunger touches: z is the depth.
    assert depth[-1] - z[-1] == pytest.approx(0.0, abs=2e-7)
    most = np.abs(channels["energy.work"]).max()
    record(source=SOURCE, case="a revolution with a seat", quantity="energy residual over work", unit="1",
           reference=0.0, computed=np.abs(channels["energy.residual"]).max() / most, tolerance=1e-3, absolute=True,
           reason="the check valve opens within steps")  # fmt: skip


def test_refill_lag(record, case):
    """In extension the oil lags by c0/k times the rate: z is the depth plus that lag."""
    response = run(case(ADJUSTER, **SEAT_CHANGES))
    depth = response["top.uy"].displacement - response["bottom.uy"].displacement
    rate = response["top.uy"].velocity - response["bottom.uy"].velocity
    z = response.channels["contacts.play.leak_down"]
    drawn = (rate < -1e-4) & (depth < z) & (response.angle > math.radians(150.0))
    drawn &= np.concatenate([np.zeros(12, bool), drawn[:-12]])  # twelve steps in a row: the transient has decayed
    assert drawn.sum() > 20
    lag = depth[drawn] - z[drawn]
    worst = np.abs(lag - REFILL / OIL * rate[drawn]).max()
    record(source=SOURCE, case="refill behind the lift", quantity="largest error of the lag", unit="m", reference=0.0,
           computed=worst, tolerance=0.2 * np.abs(lag).max(), absolute=True,
           reason="quasi-steady: the rate changes within c0/k = 25 us, the rods ring")  # fmt: skip


@pytest.mark.slow
def test_restart_continues_leak_down(case, tmp_path):
    """A run over most of the lift and its continuation from the result equal a single run, with the leak-down."""
    single_run = run(case(ADJUSTER, **(SEAT_CHANGES | {"revolutions": 0.5})))
    first = prepare(case(ADJUSTER, **(SEAT_CHANGES | {"revolutions": 0.3})))
    solve(first.problem, first.scheme, save=first.save, sinks=[open_result_file(first, tmp_path)])
    path = case(ADJUSTER, **(SEAT_CHANGES | {"revolutions": 0.2})).path
    text = path.read_text(encoding="utf-8").replace('start = "equilibrium"', 'start = { result = "play.vtkhdf" }')
    path.write_text(text, encoding="utf-8")
    second = run(read_case(path))
    at = len(single_run.time) - len(second.time)
    assert second.angle[0] == pytest.approx(single_run.angle[at], abs=1e-9)
    for name in ("contacts.play.leak_down", "contacts.play.force", "contacts.seat.force"):
        most = np.abs(single_run.channels[name]).max()
        np.testing.assert_allclose(second.channels[name], single_run.channels[name][at:], atol=1e-6 * most)
    assert second.channels["contacts.play.leak_down"][0] > 1e-5


ENGINE = """contacts.lash={ at = "rocker", model = "lash-adjuster", stiffness = "20 MN/m", leak = "400 kN s/m", \
refill = "500 N s/m", plunger_force = "20 N" }"""


def test_adjuster_at_rocker(record):
    """The pushrod engine with an adjuster in place of the lash has the same law, and the adjuster closes the valve."""
    probes = "output.probes=['valve', 'pushrod-top']"
    run_ = (
        "run.crank_speed=2000 rpm",
        "run.revolutions=0.7",
        "springs.valve.elements=2",
        "run.steps_per_revolution=1800",
    )
    case = read_case("cases/pushrod-engine/intake.toml", [ENGINE, probes, *run_])
    response = run(case)
    channels = response.channels
    depth = 1.6 * response["pushrod-top.uy"].displacement - response["valve"].displacement
    exact = integrate_leak_down(response.time, depth)
    z = channels["contacts.lash.leak_down"]
    record(source=SOURCE, case="pushrod engine with an adjuster", quantity="largest error of the leak-down", unit="m",
           reference=0.0, computed=np.abs(z - exact).max(), tolerance=1e-2 * np.abs(exact).max(), absolute=True,
           reason="the trapezoidal rule on steps of 33 us")  # fmt: skip
    assert channels["contacts.seat.force"][0] > 300.0
    most = np.abs(channels["energy.work"]).max()
    assert np.abs(channels["energy.residual"]).max() < 1e-3 * most


@pytest.mark.parametrize(("play", "gap"), [(LASH, 0.5e-3), (ADJUSTER, 0.0)])
def test_rigid_model_with_lash_between_nodes(case, play, gap):
    made = case(play, contacts=UNDAMPED_SEAT, installed=", installed_force = 100", revolutions=0.3, steps=720)
    response = run(made, rigid=True)
    lift = build_model(made).cams["intake"].event(response.angle, 0)
    np.testing.assert_allclose(response["end.uy"].displacement, np.maximum(lift - gap, 0.0), atol=1e-9)
    behind = response.channels["contacts.intake.force"][lift > 1.5e-3]
    np.testing.assert_allclose(behind, 100.0 + 30e3 * (lift[lift > 1.5e-3] - gap), rtol=0.02)


def test_rigid_force_with_lash_at_rocker():
    gap = "contacts.lash={ at = 'rocker', model = 'lash', gap = '1 mm', stiffness = '20 MN/m' }"
    case = read_case("cases/pushrod-engine/intake.toml", [gap, "run.crank_speed=20 rpm", "run.revolutions=0.5",
                                                          "run.steps_per_revolution=360"])  # fmt: skip
    response = run(case, rigid=True)
    lift = response["tappet.uy"].displacement
    valve = np.maximum(1.6 * lift - 1e-3, 0.0)
    np.testing.assert_allclose(response["valve"].displacement, valve, atol=1e-12)
    force = 10.0 + 500.0 * lift + np.where(valve > 0.0, 1.6 * (400.0 + 50e3 * valve), 0.0)
    np.testing.assert_allclose(response.channels["contacts.intake.force"], force, rtol=0.01)


UNDAMPED_SEAT = 'seat = { at = "end", direction = "uy", model = "seat", stiffness = "60 MN/m" }'
NO_GAP = LASH.replace("0.5 mm", "0 mm")
FINGER, PUSHRODS = "cases/direct-acting/finger.toml", "cases/pushrod-engine/intake.toml"
CLOSED_VALVE = {
    "adjuster under a finger": (FINGER, [], 40.0 * 35.0 / 20.0 * math.cos(math.radians(7.5))),
    "adjuster at a rocker": (PUSHRODS, [ENGINE.replace("400 kN", "4 kN")], 10.0 + 1.6 * PLUNGER),
    "lash at a rocker": (PUSHRODS, [], 10.0),
}


def base_circle_force(made, *, rigid):
    """Return the cam force 12 ms after the start, with the cam on its base circle."""
    slow = "run.crank_speed=100 rpm", "run.revolutions=0.01", "run.steps_per_revolution=36000"
    response = run(read_case(made.path, [*made.overrides, *slow]), rigid=rigid)
    assert float(build_model(made).cams["intake"].event(response.angle, 0).max()) == 0.0
    return float(response.channels["contacts.intake.force"][-1])


@pytest.mark.parametrize("name", CLOSED_VALVE)
def test_cam_force_of_closed_valve_on_base_circle(record, name):
    """The cam force is that of the parts in front of the lash and of the plunger, in the rigid and flexible models."""
    path, more, expected = CLOSED_VALVE[name]
    made = read_case(path, more)
    for kind in ("rigid", "flexible"):
        found = base_circle_force(made, rigid=kind == "rigid")
        record(source=SOURCE, case=f"{name}, {kind}", quantity="force of the cam while the valve is shut", unit="N",
               reference=expected, computed=found, tolerance=1e-9 if kind == "rigid" else 5e-3,
               reason="balance; flexible: what levers and springs have given way")  # fmt: skip


@pytest.mark.parametrize(("play", "push"), [(LASH, 0.0), (NO_GAP, 0.0), (ADJUSTER, PLUNGER)])
@pytest.mark.parametrize("seat", [UNDAMPED_SEAT, ""], ids=["seat", "no seat"])
def test_rigid_cam_force_with_and_without_seat(case, play, push, seat):
    """With a seat, the seat carries the spring behind a lash; without one the cam does: the spring closes the lash."""
    made = case(play, contacts=seat, installed=", installed_force = 100", revolutions=0.3, steps=720)
    response = run(made, rigid=True)
    lift = build_model(made).cams["intake"].event(response.angle, 0)
    force = response.channels["contacts.intake.force"]
    gap = 0.5e-3 if play == LASH else 0.0
    shut = push if seat == UNDAMPED_SEAT else 100.0 - 30e3 * gap
    np.testing.assert_allclose(force[lift == 0.0], shut, rtol=1e-12, atol=1e-10)  # of 100 N
    on = lift > 1.5e-3
    np.testing.assert_allclose(force[on], 100.0 + 30e3 * (lift[on] - gap), rtol=0.02)


def test_stop_that_blocks_lift_raises_error(case):
    """Between a cam and a stop above the closed valve, no rigid part can yield."""
    made = case(NO_GAP, contacts=UNDAMPED_SEAT.replace('"uy"', '"-uy"'), installed=", installed_force = 100", steps=720)
    with pytest.raises(InputError, match=r"contacts\.intake.*no position of the rigid train"):
        run(made, rigid=True)


@pytest.mark.parametrize("rigid", [False, True], ids=["stiff", "rigid"])
def test_adjuster_pump_up_opens_valve(case, rigid):
    """A plunger of 20 N against a spring of 15 N pumps up by 5 N over 30 kN/m and keeps the valve open by that."""
    made = case(ADJUSTER, contacts=UNDAMPED_SEAT, installed=", installed_force = 15", speed=600.0, revolutions=0.3)
    response = run(made, rigid=rigid)
    lift = build_model(made).cams["intake"].event(response.angle, 0)
    # A stiff train leaks by 60 N over 400 kN s/m in the 20 ms of its lift, 3 um, and the oil deforms by 3 um.
    np.testing.assert_allclose(response["end.uy"].displacement, lift + 5.0 / 30e3, atol=1e-12 if rigid else 8e-6)
    force = response.channels["contacts.intake.force"]
    np.testing.assert_allclose(force[lift == 0.0], 20.0, rtol=1e-9 if rigid else 1e-3)


NODE = 'valve = ["170 mm", "274 mm", "0 mm"]\n\n[materials.steel]'
"""A node in place of the rocker point, without a member: the same unknown."""


def write_case_with_lash_at_tip(path, tmp_path):
    """Write a case with the lash from the rocker point, `tip`, to a node, the valve, and return its path."""
    text = Path(path).read_text(encoding="utf-8")
    changes = {
        "\n[materials.steel]": NODE, 'to = "valve"': 'to = "tip"', "[supports]": '[supports]\nvalve = ["ux", "uz"]',
        'seat = { at = "valve"': 'seat = { at = "valve", direction = "uy"',
        'lash = { at = "rocker"': 'lash = { from = "tip", to = "valve", direction = "uy"',
    }  # fmt: skip
    for old, new in changes.items():
        assert text.count(old) == 1
        text = text.replace(old, new)
    made = tmp_path / Path(path).name
    made.write_text(text, encoding="utf-8")
    return made


@pytest.mark.parametrize("model", ["beams", "rigid"])
@pytest.mark.parametrize(
    "path", mostly_slow([PUSHRODS, "cases/pushrod-engine/lever.toml"], 2), ids=["lumped rocker", "lever"]
)
def test_lash_from_rocker_tip_matches_lash_at_rocker(record, tmp_path, path, model):
    words = "run.revolutions=0.5", "run.steps_per_revolution=3600", f"fidelity.model={model}"
    usual, other = (read_case(one, words) for one in (path, write_case_with_lash_at_tip(path, tmp_path)))
    first, second = run(usual), run(other)
    lashes = [largest_lashes(build_model(one))["intake"] for one in (usual, other)]
    assert lashes[0] == pytest.approx(lashes[1], rel=1e-12)
    scale = float(np.abs(first.channels["contacts.intake.force"]).max())
    off = np.abs(first.channels["contacts.intake.force"] - second.channels["contacts.intake.force"]).max()
    record(source=SOURCE, case=f"lash from the point of a rocker, {model}", quantity="force of the cam", unit="1",
           reference=0.0, computed=float(off) / scale, tolerance=1e-6, absolute=True,
           reason="the same equations: the point without mass follows the rocker")  # fmt: skip
    lift = first["valve"].displacement, second["valve.uy"].displacement
    np.testing.assert_allclose(lift[1], lift[0], atol=1e-9)
    assert lift[0].max() > 8e-3
