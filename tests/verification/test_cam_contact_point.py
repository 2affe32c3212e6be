"""Contact point of cam and follower, and the contact force on shaft and follower: closed forms.

A shaft on two supports, its drive end fixed in rotation, carries a cam at mid-span; the force F at the follower is that
of the spring, F0 + k u. In the plane of the cam (lift upwards, the cam turning counterclockwise) a flat follower
touches the cam s' to the right of its axis; the normal of a roller passes through the instant centre, s' to the right
of the cam axis, so that the cam is pushed to the right by F (s' - e)/H, with the offset e and the height H of the
roller centre. F. Y. Chen, Mechanics and Design of Cam Mechanisms (1982), ch. 4 (pressure angle); K. L. Johnson, Contact
Mechanics (1985), sec. 4.2 (line contact); S. P. Timoshenko, Strength of Materials I (1955) for shafts and beams.
"""

import math

import numpy as np
import pytest

from flexcam import InputError, build_model, prepare, read_case, run
from flexcam.dynamics import ConstantSpeed, equilibrium
from flexcam.valvetrain.modes import modes_on_the_lift
from tests.thinning import mostly_slow

SOURCE = "Point of contact of a cam"
E, NU, SPAN, REACH = 207e9, 0.29, 0.12, 0.25
SHAFT_I, SHAFT_J = math.pi * 0.02**4 / 64.0, math.pi * 0.02**4 / 32.0
ROD_I = math.pi * (0.008**4 - 0.005**4) / 64.0
G = E / (2.0 * (1.0 + NU))
SPRING, INSTALLED, CONTACT, BASE, ROLLER, WIDTH = 100e3, 900.0, 2e8, 0.024, 0.010, 0.012
SIDEWAYS = SPAN**3 / (48.0 * E * SHAFT_I)
"""Deflection of the shaft at the cam per unit force."""

CASE = """
format = 1
[nodes]
drive = [0.0, 0.0, 0.0]
cam = [0.06, 0.0, 0.0]
rear = [0.12, 0.0, 0.0]
tappet = [0.06, 0.024, 0.0]
top = [0.06, 0.274, 0.0]
[materials.steel]
E = "207 GPa"
nu = 0.29
density = "7800 kg/m^3"
[sections]
shaft = {{ shape = "circle", diameter = "20 mm" }}
tube = {{ shape = "tube", outer_diameter = "8 mm", inner_diameter = "5 mm" }}
[members]
camshaft = {{ nodes = ["drive", "cam", "rear"], material = "steel", section = "shaft" }}
pushrod = {{ nodes = ["tappet", "top"], material = "steel", section = "tube" }}
[supports]
drive = ["ux", "uy", "uz", "rx"]
rear = ["uy", "uz"]
tappet = {held}
top = ["ux", "uz", "ry"]
[springs]
valve = {{ at = "top", direction = "uy", stiffness = "100 kN/m", installed_force = "900 N" }}
{springs}
[cams.intake]
at = "cam"
law = "4-5-6-7"
lift = "6 mm"
rise = "90 deg"
return = "90 deg"
phase = "90 deg"
base_radius = "24 mm"
width = "12 mm"
follower = {follower}
{cam}
[contacts]
intake = {{ cam = "intake", follower = "tappet", {contact} }}
[run]
speed = "600 rpm"
{run}
[output]
probes = ["cam", "tappet", "top"]
"""
GUIDED, TILTING = '["ux", "uz", "ry", "rx"]', '["ux", "uz", "ry"]'
FLAT, ROUND = '{ type = "flat" }', '{{ type = "roller", radius = "10 mm", offset = {} }}'
LINEAR, HERTZ = 'model = "bilateral", stiffness = "200 MN/m"', 'model = "unilateral", stiffness = "hertz"'
RISING, FALLING, TOP, BOTTOM = (math.radians(a) for a in (130.0, 230.0, 180.0, 20.0))


class StaticTrain:
    """Static equilibrium of the train at a cam angle."""

    def __init__(self, case, angle):
        problem = prepare(case).problem
        self.state = equilibrium(problem.system, ConstantSpeed(1.0, angle))
        self.names = problem.system.names
        event = build_model(case).cams["intake"].event
        self.s, self.slope, self.bend = (float(event(np.array([angle]), order)[0]) for order in range(3))
        self.force = INSTALLED + SPRING * self["top.uy"]

    def __getitem__(self, name):
        return float(self.state.displacement[self.names.index(name)]) if name in self.names else 0.0


@pytest.fixture
def case(tmp_path):
    """Return a function that builds the case from its variable parts."""

    def make(follower=FLAT, contact=LINEAR, *, held=GUIDED, cam="", springs="", lines=""):
        text = CASE.format(follower=follower, contact=contact, held=held, cam=cam, springs=springs, run=lines)
        text = text if follower else text.replace("follower = \n", "")
        path = tmp_path / "cam.toml"
        path.write_text(text, encoding="utf-8")
        return read_case(path)

    return make


REVERSED = "axis = [-1.0, 0.0, 0.0]"
ANGLES = [RISING, FALLING, TOP, BOTTOM]


@pytest.mark.parametrize("angle", ANGLES)
@pytest.mark.parametrize(("cam", "sense"), [("", 1.0), (REVERSED, -1.0), ('rotation = "clockwise"', 1.0)])
def test_flat_follower_twists_shaft(record, case, angle, cam, sense):
    """The torque F s' acts against the rotation, about -x for an axis along +x, whichever way the cam is drawn."""
    found = StaticTrain(case(cam=cam), angle)
    twist = -sense * found.force * found.slope * 0.5 * SPAN / (G * SHAFT_J)
    assert found.force > 0.9 * INSTALLED
    record(source=SOURCE, case=f"flat, {math.degrees(angle):.0f} deg, {cam or 'as given'}", quantity="twist at the cam",
           unit="rad", reference=twist, computed=found["cam.rx"], tolerance=1e-9 * abs(twist) + 1e-15, absolute=True,
           reason="rounding of the balance")  # fmt: skip
    # The penetration is what the contact stiffness requires: the twist lowers the follower on the rise.
    depth = found.s + found.slope * sense * found["cam.rx"] + found["cam.uy"] - found["tappet.uy"]
    assert depth == pytest.approx(found.force / CONTACT, rel=1e-6)
    assert found["cam.uy"] == pytest.approx(-found.force * SIDEWAYS, rel=1e-9)
    assert found["cam.uz"] == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize("angle", [RISING, FALLING])
@pytest.mark.parametrize(("cam", "sense"), [("", 1.0), (REVERSED, -1.0)])
def test_flat_follower_tilts(record, case, angle, cam, sense):
    """The force at the distance s' from the axis tilts the follower by F s' L/(3 E I) and lowers it by s' of that."""
    found = StaticTrain(case(held=TILTING, cam=cam), angle)
    tilt = sense * found.force * found.slope * REACH / (3.0 * E * ROD_I)
    record(source=SOURCE, case=f"flat, tilting, {math.degrees(angle):.0f} deg, {cam or 'as given'}", quantity="tilt",
           unit="rad", reference=tilt, computed=found["tappet.rx"], tolerance=1e-8, reason="rounding")  # fmt: skip
    turned = sense * (found["cam.rx"] - found["tappet.rx"])
    depth = found.s + found.slope * turned + found["cam.uy"] - found["tappet.uy"]
    assert depth == pytest.approx(found.force / CONTACT, rel=1e-6)


def test_follower_without_shape_does_not_tilt(case):
    """The force along the lift has no moment about the node of a foot that can rotate."""
    found = StaticTrain(case(follower="", held=TILTING), RISING)
    assert found.force > 0.9 * INSTALLED
    assert found["tappet.rx"] == pytest.approx(0.0, abs=1e-15)
    assert found["cam.rx"] == pytest.approx(-found.force * found.slope * 0.5 * SPAN / (G * SHAFT_J), rel=1e-9)


def tangent_of_pressure_angle(found, offset, base=BASE, roller=ROLLER):
    """Return the tangent of the pressure angle, s' - e over the height of the roller centre."""
    return (found.slope - offset) / (math.sqrt((base + roller) ** 2 - offset**2) + found.s)


@pytest.mark.parametrize("angle", ANGLES)
@pytest.mark.parametrize("offset", mostly_slow([0.0, 0.004, -0.004]))
@pytest.mark.parametrize("contact", [LINEAR, HERTZ])
def test_roller_deflects_shaft_sideways(record, case, angle, offset, contact):
    """The shaft moves to the right in the drawing, which is -z for an upright axis +x."""
    found = StaticTrain(case(ROUND.format(offset), contact), angle)
    aside = found.force * tangent_of_pressure_angle(found, offset) * SIDEWAYS
    record(source=SOURCE, case=f"roller, e = {offset:g} m, {math.degrees(angle):.0f} deg, {contact[9:17]}",
           quantity="sideways deflection", unit="m", reference=-aside, computed=found["cam.uz"],
           tolerance=1e-8 * abs(aside) + 1e-15, absolute=True, reason="rounding of the balance")  # fmt: skip
    twist = -found.force * found.slope * 0.5 * SPAN / (G * SHAFT_J)
    assert found["cam.rx"] == pytest.approx(twist, rel=1e-8, abs=1e-15)


@pytest.mark.parametrize("angle", [RISING, FALLING])
def test_reversed_axis_mirrors_result(case, angle):
    """A reversed axis reverses z and the rotation about x. A cam drawn clockwise has the offset on the other side."""
    one = StaticTrain(case(ROUND.format(0.004)), angle)
    mirrored = StaticTrain(case(ROUND.format(0.004), cam=REVERSED), angle)
    redrawn = StaticTrain(case(ROUND.format(-0.004), cam=REVERSED + '\nrotation = "clockwise"'), angle)
    other = StaticTrain(case(ROUND.format(-0.004), cam='rotation = "clockwise"'), angle)
    for name in ("cam.uy", "cam.uz", "cam.rx", "cam.ry", "cam.rz", "tappet.uy"):
        sign = -1.0 if name in ("cam.uz", "cam.rx", "cam.ry") else 1.0
        assert mirrored[name] == pytest.approx(sign * one[name], rel=1e-9, abs=1e-16)
        assert redrawn[name] == pytest.approx(mirrored[name], rel=1e-9, abs=1e-16)
        assert other[name] == pytest.approx(one[name], rel=1e-9, abs=1e-16)


AT_ANGLE = 'revolutions = 1e-4\nsteps_per_revolution = 36000\nstart = "equilibrium"'


@pytest.mark.parametrize("degrees", [40.0, 80.0, 135.0])
def test_hertz_pressure_of_flat_face(record, case, degrees):
    """The pressure is sqrt(p E*/(pi R)), with R = rb + s + s'' of the cam and E* = E/(2 (1 - nu^2))."""
    made = case(FLAT, HERTZ, lines=AT_ANGLE)
    made = read_case(made.path, [f"cams.intake.phase={-degrees} deg"])
    response = run(made)
    event = build_model(made).cams["intake"].event
    s, bend = (float(event(np.zeros(1), order)[0]) for order in (0, 2))
    force = INSTALLED + SPRING * response["top.uy"].displacement[0]
    assert response.channels["contacts.intake.force"][0] == pytest.approx(force, rel=1e-8)
    modulus = E / (2.0 * (1.0 - NU**2))
    radius = BASE + s + bend
    pressure = math.sqrt(force / WIDTH * modulus / (math.pi * radius))
    record(source=SOURCE, case=f"flat face, {degrees:g} deg into the rise", quantity="largest Hertz pressure",
           unit="Pa", reference=pressure, computed=float(response.channels["contacts.intake.pressure"][0]),
           tolerance=1e-6, reason="curvature tabled every 0.05 deg")  # fmt: skip
    # Approach: eqs. 5.57 and 5.58 of Johnson, cam as a cylinder, face as a body as deep as the base circle.
    half = math.sqrt(4.0 * force / WIDTH * radius / (math.pi * modulus))
    terms = 2.0 * math.log(4.0 * radius / half) - 1.0 + 2.0 * math.log(2.0 * BASE / half) - NU / (1.0 - NU)
    approach = force / WIDTH * (1.0 - NU**2) / (math.pi * E) * terms
    assert -response.channels["contacts.intake.gap"][0] == pytest.approx(approach, rel=1e-5)


@pytest.mark.parametrize("degrees", [40.0, 80.0, 135.0])
@pytest.mark.parametrize("installed", [INSTALLED, -2000.0])
def test_hertz_pressure_of_roller(record, case, degrees, installed):
    """The force along the normal is F/cos(alpha); 1/R = 1/rho + 1/rr, with rho of the pitch curve less rr.

    A force that pulls presses the roller against the outer flank of a groove, whose radius is that of the pitch curve
    plus rr, concave.
    """
    pulls = installed < 0.0
    made = case(ROUND.format(0.0), LINEAR if pulls else HERTZ, lines=AT_ANGLE)
    spring = ["springs.valve.direction=-uy", f"springs.valve.installed_force={-installed} N"] if pulls else []
    made = read_case(made.path, [f"cams.intake.phase={-degrees} deg", *spring])
    response = run(made)
    event = build_model(made).cams["intake"].event
    s, slope, bend = (float(event(np.zeros(1), order)[0]) for order in range(3))
    force = installed + SPRING * response["top.uy"].displacement[0]
    H = BASE + ROLLER + s
    pitch = (H**2 + slope**2) ** 1.5 / (H**2 + 2.0 * slope**2 - H * bend)
    curvature = 1.0 / ROLLER - 1.0 / (pitch + ROLLER) if pulls else 1.0 / (pitch - ROLLER) + 1.0 / ROLLER
    normal = abs(force) * math.hypot(1.0, slope / H)
    assert (force < 0.0) == pulls
    pressure = math.sqrt(normal / WIDTH * E / (2.0 * (1.0 - NU**2)) / math.pi * curvature)
    where = f"roller{' in a groove' * pulls}, {degrees:g} deg into the rise"
    record(source=SOURCE, case=where, quantity="largest Hertz pressure", unit="Pa",
           reference=pressure, computed=float(response.channels["contacts.intake.pressure"][0]),
           tolerance=1e-6, reason="curvature tabled every 0.05 deg")  # fmt: skip


FRICTION = 0.1
HERTZ_FRICTION = HERTZ + ", friction = 0.1, dissipation = 0.5"
SLOW_DAMPED_RUN = 'revolutions = 0.8\nsteps_per_revolution = 900\nstart = "equilibrium"\ndamping = { beta = "2e-5 s" }'


RUNS = {}


@pytest.fixture
def run_with_friction(case):
    """Return a function that runs a flat follower with friction over rise and return, slow and damped."""

    def make(cam="", **given):
        made = case(FLAT, HERTZ_FRICTION, cam=cam, lines=SLOW_DAMPED_RUN, **given)
        key = made.text
        if key not in RUNS:
            RUNS[key] = run(read_case(made.path, ["run.speed=60 rpm"]))
        return RUNS[key], build_model(made).cams["intake"].event

    return make


def after_start(response):
    return response.angle > math.radians(60.0)  # friction sets in with the first step and excites the shaft slightly


@pytest.mark.parametrize(("cam", "sense"), [("", 1.0), (REVERSED, -1.0), ('rotation = "clockwise"', 1.0)])
def test_friction_torque_on_shaft(record, run_with_friction, cam, sense):
    """The torque of friction is mu F (rb + s), against the rotation on rise, return and dwell."""
    response, event = run_with_friction(cam)
    on = after_start(response)
    force, torque = (response.channels[f"contacts.intake.{one}"][on] for one in ("force", "torque"))
    s, slope = (event(response.angle[on], order) for order in (0, 1))
    expected = force * (slope + FRICTION * (BASE + s))
    record(source=SOURCE, case=f"flat with friction, {cam or 'as given'}", quantity="largest error of the cam's torque",
           unit="N m", reference=0.0, computed=np.abs(torque - expected).max(), tolerance=1e-9 * expected.max(),
           absolute=True, reason="sliding is 15 times the speed over which friction turns over")  # fmt: skip
    twist = response["cam.rx"].displacement[on]
    exact = -sense * expected * 0.5 * SPAN / (G * SHAFT_J)
    record(source=SOURCE, case=f"flat with friction, {cam or 'as given'}", quantity="largest error of the twist",
           unit="rad", reference=0.0, computed=np.abs(twist - exact).max(), tolerance=3e-3 * np.abs(exact).max(),
           absolute=True, reason="slow, but damping follows: beta times its rate")  # fmt: skip
    held = response.channels["supports.drive.torque"][on]
    held, expected = 0.5 * (held[1:] + held[:-1]), 0.5 * (expected[1:] + expected[:-1])  # velocities oscillate
    assert np.abs(held - expected).max() <= 1e-2 * expected.max()  # torque of the drive


@pytest.mark.parametrize(("cam", "sense"), [("", 1.0), (REVERSED, -1.0)])
def test_friction_deflects_follower_and_shaft(record, run_with_friction, cam, sense):
    """The upper side of a cam that turns about +x moves to +z and drags the follower; the shaft is pushed back."""
    stiff = 1e6
    side = f'guide = {{ at = "tappet", direction = "uz", stiffness = {stiff}, damping = 500.0 }}'
    response, _ = run_with_friction(cam, held='["ux", "ry", "rx"]', springs=side)
    on = after_start(response)
    force = response.channels["contacts.intake.force"][on]
    dragged = response["tappet.uz"].displacement[on] * sense
    # The pushrod, clamped against rotation at the tappet and hinged at the top, adds the stiffness 3 E I/L^3.
    expected = FRICTION * force / (stiff + 3.0 * E * ROD_I / REACH**3)
    record(source=SOURCE, case=f"flat with friction, {cam or 'as given'}", quantity="largest error of the drag",
           unit="m", reference=0.0, computed=np.abs(dragged - expected).max(), tolerance=5e-3 * expected.max(),
           absolute=True, reason="slow, damped")  # fmt: skip
    pushed = response["cam.uz"].displacement[on] * sense
    assert np.abs(pushed + FRICTION * force * SIDEWAYS).max() <= 5e-3 * np.abs(pushed).max()


def test_energy_dissipated_by_friction(run_with_friction):
    """The loss is the integral of mu F v, v = (rb + s) omega; contact and structural damping add 1e-4 of it."""
    response, event = run_with_friction()
    channels = response.channels
    power = FRICTION * channels["contacts.intake.force"] * (BASE + event(response.angle, 0)) * 2.0 * math.pi
    lost = float(np.sum(0.5 * (power[1:] + power[:-1]) * np.diff(response.time)))
    assert channels["energy.dissipated"][-1] == pytest.approx(lost, rel=5e-3)


def test_sliding_and_friction_channels(run_with_friction):
    response, event = run_with_friction()
    on = after_start(response)
    channels = {name: values[on] for name, values in response.channels.items()}
    speed = (BASE + event(response.angle[on], 0)) * 2.0 * math.pi
    np.testing.assert_allclose(np.abs(channels["contacts.intake.sliding"]), speed, rtol=1e-9)
    np.testing.assert_allclose(
        np.abs(channels["contacts.intake.friction"]), FRICTION * channels["contacts.intake.force"], rtol=1e-9
    )


FINGER = """
format = 1
nodes = {{ cam = [0.0, 0.0, 0.0] }}
supports = {{ cam = ["ux"] }}
masses.valve = {{ at = "valve", mass = "0.05 kg" }}
[rockers.finger]
model = "lever"
from = "pad"
to = "valve"
direction = "-uz"
arms = ["24 mm", "36 mm"]
inertia = "1e-5 kg m^2"
stiffness = "100 MN/m"
[springs]
valve = {{ at = "valve", direction = "-uz", stiffness = "30 kN/m", installed_force = "300 N" }}
across = {{ at = "cam", direction = "uy", stiffness = "20 MN/m" }}
upright = {{ at = "cam", direction = "uz", stiffness = "30 MN/m" }}
twist = {{ at = "cam", direction = "rx", stiffness = "50 kN m/rad" }}
[cams.intake]
at = "cam"
axis = [1, 0, 0]
law = "4-5-6-7"
lift = "6 deg"
rise = 1.4
return = 1.4
phase = -0.8
base_radius = "24 mm"
rotation = "{turn}"
follower = {{ type = "swing", arm = "24 mm", distance = "40 mm", rotation = "{side}", {pad} }}
[contacts]
intake = {{ cam = "intake", follower = "pad", direction = "-uz", model = "unilateral", stiffness = "1 GN/m" }}
[run]
speed = "60 rpm"
step = "1 us"
revolutions = 1e-6
start = "equilibrium"
[output]
probes = ["cam"]
"""


@pytest.mark.parametrize("pad", mostly_slow(['radius = "8 mm"', 'face = "0 mm"', 'face = "3 mm"'], 2))
@pytest.mark.parametrize("turn", ["clockwise", "counterclockwise"])
@pytest.mark.parametrize("side", ["clockwise", "counterclockwise"])
def test_cam_force_of_finger_follower(tmp_path, pad, turn, side):
    """The force across the line of centres is F (turn s' + side arm)/D, independent of the contact point.

    The moments are F times the arm about the pivot and F s' about the cam; both points are a distance D apart on the
    real axis.
    """
    path = tmp_path / "finger.toml"
    path.write_text(FINGER.format(turn=turn, side=side, pad=pad), encoding="utf-8")
    case = read_case(path)
    response = run(case)
    arm, D, ways = 0.024, 0.04, {"clockwise": -1, "counterclockwise": 1}
    turned, rising = ways[turn], -ways[side]  # the fingers' drawing counts a clockwise rise positive
    pitch = 0.032
    psi = math.acos((arm**2 + D**2 - pitch**2) / (2.0 * arm * D)) if "radius" in pad else None
    psi = math.asin((0.024 - float(pad[8]) * 1e-3) / D) if psi is None else psi
    begin = 1j * rising * np.exp(-1j * rising * psi)  # start of the lift in the drawing; -uz in space
    across, upright = response["cam"].displacement[0, 1:3] * [20e6, 30e6]
    # To the right of the lift: turn (-uz) x ux = -turn uy. The force on the follower is the reversed force on the cam.
    felt = -(-upright * begin + -turned * across * -1j * begin)
    force = response.channels["contacts.intake.force"][0]
    slope = float(build_model(case).cams["intake"].event(np.zeros(1), 1)[0])
    assert abs(slope) > 1e-3
    assert felt.imag == pytest.approx(force * (turned * slope + rising * arm) / D, rel=2e-4)


def cross_product(one, other):
    return one[0] * other[1] - one[1] * other[0]


def face_contact(face, side, turn, psi, rate, distance=0.04):
    """Return contact point from cam and from pivot, normal and relative velocity in the drawing, shape (2, m).

    The cam is at the origin, the pivot at D on the x-axis; cam and face have the same velocity along the normal, which
    is linear in the distance of the point along the face.
    """
    away = np.array([-np.cos(psi), side * np.sin(psi)])  # `side` is 1 if the finger is above the line of centres
    normal = np.array([np.sin(psi), side * np.cos(psi)])

    def contact_at(q):
        reach = q * away + face * normal
        point = reach + np.array([[distance], [0.0]])
        relative_velocity = turn * np.array([-point[1], point[0]]) + side * rate * np.array([-reach[1], reach[0]])
        return point, reach, relative_velocity

    ends = [np.sum(contact_at(q)[2] * normal, axis=0) for q in (0.0, 1.0)]
    point, reach, relative_velocity = contact_at(ends[0] / (ends[0] - ends[1]))
    return point, reach, normal, relative_velocity


FRICTION_CHANGES = {
    "phase = -0.8": "phase = 0.2",
    '"50 kN m/rad"': '"50 MN m/rad"',  # friction acts at the cam angle without the twist
    '"1 GN/m"': '"1 GN/m", friction = 0.1, dissipation = "0.5 s/m"',
    'step = "1 us"\nrevolutions = 1e-6': """steps_per_revolution = 900
revolutions = 0.4
integrator = { method = "generalized-alpha", rho_inf = 0.0 }
damping = { beta = "2e-5 s" }""",
    'probes = ["cam"]': 'probes = ["pad", "valve"]',
}


class FrictionMoments:
    """Moments of N and mu N at the contact point of a finger face, by plane vectors, after the start of friction."""

    def __init__(self, case, response, face, turn, side):
        on = response.angle > 0.4  # friction sets in with the first step and excites the shaft slightly
        self.force, self.torque, self.friction = (
            response.channels[f"contacts.intake.{one}"][on] for one in ("force", "torque", "friction")
        )
        event, arm = build_model(case).cams["intake"].event, 0.024
        s, slope = (event(response.angle[on], order) for order in (0, 1))
        ways = {"clockwise": 1, "counterclockwise": -1}
        psi = math.asin((0.024 - face) / 0.04) + s / arm
        point, reach, normal, self.relative_velocity = face_contact(face, ways[side], -ways[turn], psi, slope / arm)
        self.N = self.force * arm / np.abs(cross_product(reach, normal))
        along = np.sign(np.sum(self.relative_velocity * np.array([normal[1], -normal[0]]), axis=0))
        felt = self.N * normal + FRICTION * self.N * along * np.array([normal[1], -normal[0]])
        self.about_pivot = -ways[side] * cross_product(reach, felt)
        self.about_cam = -ways[turn] * cross_product(point, felt)
        valve, pad = (response[one].displacement[on] for one in ("valve", "pad"))
        self.load_moment = (300.0 + 30e3 * valve) * 0.036 * np.cos(pad / arm)
        self.on = on


@pytest.fixture
def finger_with_friction(tmp_path):
    def make(face, turn, side, *more):
        text = FINGER.format(turn=turn, side=side, pad=f"face = {face}")
        for given, wanted in FRICTION_CHANGES.items():
            assert text.count(given) == 1
            text = text.replace(given, wanted)
        path = tmp_path / "finger.toml"
        path.write_text(text, encoding="utf-8")
        return read_case(path, list(more))

    return make


@pytest.mark.parametrize("face", [0.003, -0.004])
@pytest.mark.parametrize("turn", ["clockwise", "counterclockwise"])
@pytest.mark.parametrize("side", ["clockwise", "counterclockwise"])
def test_friction_moment_about_finger_pivot(record, finger_with_friction, face, turn, side):
    """N and mu N act at the contact point; the reference are moments of plane vectors: valve about pivot, cam torque.

    For a face at a distance from the pivot, the moment of friction is mu e/q of that of N: 1 to 2 % here.
    """
    case = finger_with_friction(face, turn, side)
    response = run(case)
    found = FrictionMoments(case, response, face, turn, side)
    name = f"finger, face at {1e3 * face:g} mm, {turn} cam, {side} finger"
    record(source=SOURCE, case=name, quantity="largest error of the moment about the pivot", unit="N m", reference=0.0,
           computed=float(np.abs(found.about_pivot - found.load_moment).max()),
           tolerance=2e-4 * float(found.load_moment.max()),
           absolute=True, reason="slow, but valve and damping follow; the moment of friction is 1 to 2 %")  # fmt: skip
    record(source=SOURCE, case=name, quantity="largest error of the cam's torque", unit="N m", reference=0.0,
           computed=float(np.abs(found.torque - found.about_cam).max()),
           tolerance=1e-6 * float(np.abs(found.torque).max()), absolute=True,
           reason="rounding; sliding is ten times the speed over which friction turns over")  # fmt: skip
    np.testing.assert_allclose(np.abs(found.friction), FRICTION * found.N, rtol=1e-6)
    sliding = response.channels["contacts.intake.sliding"][found.on]
    np.testing.assert_allclose(np.abs(sliding), np.hypot(*found.relative_velocity) * 2.0 * math.pi, rtol=1e-9)


WEIGHTLESS = ["masses.valve.mass=1e-9", "rockers.finger.inertia=1e-15", "run.damping={ beta = 0.0 }"]


@pytest.mark.parametrize("face", [0.003, -0.004])
@pytest.mark.parametrize("turn", ["clockwise", "counterclockwise"])
@pytest.mark.parametrize("side", ["clockwise", "counterclockwise"])
def test_friction_moment_on_rigid_finger(finger_with_friction, face, turn, side):
    """The balance is exact in the rigid model: contact force and friction share the load of the valve."""
    case = finger_with_friction(face, turn, side, *WEIGHTLESS)
    found = FrictionMoments(case, run(case, rigid=True), face, turn, side)
    np.testing.assert_allclose(found.about_pivot, found.load_moment, rtol=1e-6)  # a valve of 1 mg needs less than 1 uN
    # Sliding is ten times the speed over which friction changes sign: 1 - tanh(10) is 4e-9.
    np.testing.assert_allclose(found.torque, found.about_cam, atol=1e-7 * np.abs(found.torque).max())
    np.testing.assert_allclose(np.abs(found.friction), FRICTION * found.N, rtol=1e-7)


@pytest.mark.parametrize("cam", ["", REVERSED, 'rotation = "clockwise"'])
def test_friction_torque_of_rigid_train(case, run_with_friction, cam):
    """Friction does not change the force on a face guided along the lift; the torque increases by mu F (rb + s)."""
    flexible, event = run_with_friction(cam)
    made = case(FLAT, HERTZ_FRICTION, cam=cam, lines=SLOW_DAMPED_RUN)
    found = run(read_case(made.path, ["run.speed=60 rpm"]), rigid=True)
    force, torque, friction = (found.channels[f"contacts.intake.{one}"] for one in ("force", "torque", "friction"))
    s, slope = (event(found.angle, order) for order in (0, 1))
    expected = force * (slope + FRICTION * (BASE + s))
    np.testing.assert_allclose(torque, expected, atol=1e-9 * expected.max())  # v is 15 v0: 1 - tanh(15) is 2e-13
    on = after_start(flexible)
    for name, own in (("force", force), ("torque", torque), ("friction", friction)):
        other = flexible.channels[f"contacts.intake.{name}"]
        # A rod of 8 mm and a spring of 100 kN/m: elasticity accounts for 0.3 %, and damping for as much again.
        np.testing.assert_allclose(own[on], other[on], atol=1e-2 * np.abs(other).max())
    without = case(FLAT, HERTZ, cam=cam, lines=SLOW_DAMPED_RUN)
    smooth = run(read_case(without.path, ["run.speed=60 rpm"]), rigid=True)
    np.testing.assert_array_equal(force, smooth.channels["contacts.intake.force"])


MEMBER = """
format = 1
[nodes]
drive = [0.0, 0.0, 0.0]
cam = [0.06, 0.0, 0.0]
rear = [0.12, 0.0, 0.0]
pivot = [0.06, -0.024, 0.04]
pad = [0.06, -0.024, 0.0]
[materials.stiff]
E = "2e4 GPa"
nu = 0.29
density = "7800 kg/m^3"
[sections]
bar = {{ shape = "circle", diameter = "20 mm" }}
[members]
camshaft = {{ nodes = ["drive", "cam", "rear"], material = "stiff", section = "bar" }}
finger = {{ nodes = ["pivot", "pad"], material = "stiff", section = "bar" }}
[supports]
drive = ["ux", "uy", "uz", "rx"]
rear = ["uy", "uz"]
pivot = ["ux", "uy", "uz", "ry", "rz"]
[springs]
valve = {{ at = "pad", direction = "-uy", stiffness = "1 kN/m", installed_force = "10 N" }}
[cams.intake]
at = "cam"
law = "4-5-6-7"
lift = "6 mm"
rise = 1.2
return = 1.2
phase = -0.6
base_radius = "24 mm"
follower = {{ type = "swing", arm = "40 mm", distance = "46 mm", {pad} }}
[contacts]
intake = {{ cam = "intake", follower = "pad", direction = "-uy", model = "unilateral", stiffness = "1 GN/m" }}
[run]
speed = "60 rpm"
step = "1 us"
revolutions = 1e-6
start = "equilibrium"
[output]
probes = ["pad"]
"""


@pytest.mark.parametrize("pad", ['radius = "8 mm"', 'face = "0 mm"', 'face = "3 mm"'])
def test_finger_member_follows_lift(tmp_path, pad):
    """The rotation lift/arm of the finger is no additional tilt: at half lift s' would take a third of it away."""
    path = tmp_path / "finger.toml"
    path.write_text(MEMBER.format(pad=pad), encoding="utf-8")
    response = run(read_case(path))
    assert -response["pad"].displacement[0, 1] == pytest.approx(0.003, rel=1e-4)  # members and contact deform by 2e-5


PIVOT_STIFFNESS = 1e8
"""Stiffness of the pivot, N/m."""
SLOW_RUN = """revolutions = 0.35
steps_per_revolution = 900
integrator = { method = "generalized-alpha", rho_inf = 0.0 }
damping = { beta = "2e-5 s" }"""


def run_finger(path, pad, height, right, turn, side, contact=""):
    """Return lift and s' of a finger member, the valve force on it, and the pivot force upwards and outwards.

    The finger is 60 mm long. `height` and `right` locate the pivot, m, in a drawing in which lifts go up.
    """
    sign = turn * side
    changes = {
        "pivot = [0.06, -0.024, 0.04]": f"pivot = [0.06, {-height}, {sign * right}]",
        "pad = [0.06, -0.024, 0.0]": f"pad = [0.06, {-height}, {sign * (right - 0.04)}]\n"
        f"tip = [0.06, {-height}, {sign * (right - 0.06)}]",
        '["pivot", "pad"]': '["pivot", "pad", "tip"]',
        'pivot = ["ux", "uy", "uz", "ry", "rz"]': 'pivot = ["ux", "ry", "rz"]',
        'at = "pad", direction = "-uy", stiffness = "1 kN/m", installed_force = "10 N" }':
            'at = "tip", direction = "-uy", stiffness = "1 kN/m", installed_force = "300 N" }\n'
            f'up = {{ at = "pivot", direction = "-uy", stiffness = {PIVOT_STIFFNESS} }}\n'
            f'aside = {{ at = "pivot", direction = "uz", stiffness = {PIVOT_STIFFNESS} }}',
        "phase = -0.6": "phase = 0.2",
        '"1 GN/m"': f'"1 GN/m", dissipation = "0.5 s/m"{contact}',
        'step = "1 us"\nrevolutions = 1e-6': SLOW_RUN,
        'probes = ["pad"]': 'probes = ["pivot", "tip"]',
        'base_radius = "24 mm"': f'base_radius = "24 mm"\nrotation = "{ROTATIONS[-turn]}"',
        'distance = "46 mm"': f'distance = "46 mm", rotation = "{ROTATIONS[side]}"',
    }  # fmt: skip
    text = MEMBER.format(pad=pad)
    for given, wanted in changes.items():
        assert text.count(given) == 1, given
        text = text.replace(given, wanted)
    path.write_text(text, encoding="utf-8")
    case = read_case(path)
    response = run(case)
    on = response.angle > 0.4
    pivot, tip = (response[one].displacement[on] for one in ("pivot", "tip"))
    event = build_model(case).cams["intake"].event
    s, slope = (event(response.angle[on], order) for order in (0, 1))
    pushed = 300.0 - 1e3 * tip[:, 1]
    return s, slope, pushed, -PIVOT_STIFFNESS * pivot[:, 1], sign * PIVOT_STIFFNESS * pivot[:, 2]


ROTATIONS = {1: "clockwise", -1: "counterclockwise"}
SENSES = [(1, 1), (-1, 1), (1, -1), (-1, -1)]


@pytest.mark.parametrize("friction", mostly_slow([0.0, FRICTION]))
@pytest.mark.parametrize("face", [0.0, 0.003])
@pytest.mark.parametrize(("turn", "side"), SENSES)
def test_pivot_force_of_finger_member_with_face(record, tmp_path, turn, side, face, friction):
    """Valve F at L, cam N and mu N at q and e: about the pivot N q + T e = F L, and the pivot force is N - F and T.

    With the contact force at the arm's length the pivot force would be F (L/arm - 1): up to a fifth off.
    """
    height, contact = 0.024 - face, f", friction = {friction}" if friction else ""
    right = math.sqrt(0.046**2 - height**2)
    path = tmp_path / "finger.toml"
    s, slope, F, up, aside = run_finger(path, f"face = {face}", height, right, turn, side, contact)
    psi = math.asin(height / 0.046) + s / 0.04
    _, reach, normal, relative_velocity = face_contact(face, side, turn, psi, slope / 0.04, distance=0.046)
    along = np.array([normal[1], -normal[0]])
    along *= np.sign(np.sum(relative_velocity * along, axis=0))
    N = F * 0.06 / -(side * cross_product(reach, normal + friction * along))
    name = f"finger as a member, face at {1e3 * face:g} mm, friction {friction}, turn {turn}, side {side}"
    record(source=SOURCE, case=name, quantity="largest error of the force on the pivot", unit="N", reference=0.0,
           computed=float(np.abs(up - (N - F)).max()), tolerance=1e-3 * float(N.max()), absolute=True,
           reason="slow, but masses and damping follow")  # fmt: skip
    # Direction of the arm towards the pivot.
    inward = -np.array([-np.cos(psi), side * np.sin(psi)])
    drawn = friction * N * np.sum(along * inward, axis=0)
    np.testing.assert_allclose(aside, drawn, atol=1e-3 * float(N.max()))
    assert np.abs(up - F * (0.06 / 0.04 - 1.0)).max() > 0.1 * N.max()


@pytest.mark.parametrize(("turn", "side"), SENSES)
def test_axial_force_of_finger_member_with_roller(record, tmp_path, turn, side):
    """The axial force follows from the pressure angle: cam and roller centre have equal velocities along the normal."""
    begin = math.acos((0.04**2 + 0.046**2 - 0.032**2) / (2.0 * 0.04 * 0.046))
    height, right = 0.046 * math.sin(begin), 0.046 * math.cos(begin)
    path = tmp_path / "finger.toml"
    s, slope, F, up, aside = run_finger(path, 'radius = "8 mm"', height, right, turn, side)
    psi, rate = begin + s / 0.04, slope / 0.04
    inward = np.array([np.cos(psi), -side * np.sin(psi)])
    centre = np.array([[0.046], [0.0]]) - 0.04 * inward
    onward = side * np.array([-inward[1], inward[0]])
    relative_velocity = turn * np.array([-centre[1], centre[0]]) - 0.04 * rate * onward
    normal = np.array([-relative_velocity[1], relative_velocity[0]])
    force = F * 0.06 / 0.04
    expected = force * np.sum(normal * inward, axis=0) / np.sum(normal * onward, axis=0)
    record(source=SOURCE, case=f"finger as a member under a roller, turn {turn}, side {side}",
           quantity="largest error of the force along it", unit="N", reference=0.0,
           computed=float(np.abs(aside - expected).max()), tolerance=1e-3 * float(force.max()), absolute=True,
           reason="slow, but masses and damping follow")  # fmt: skip
    np.testing.assert_allclose(up, force - F, atol=1e-3 * float(force.max()))


@pytest.mark.parametrize(
    ("given", "wanted", "where", "message"),
    [
        ('arm = "40 mm"', 'arm = "41 mm"', "cams.intake.follower.arm", "40 mm, from pivot to pad"),
        ('distance = "46 mm"', 'distance = "46 mm", rotation = "counterclockwise"', "follower.rotation", "clockwise"),
        ('base_radius = "24 mm"', 'base_radius = "24 mm"\nrotation = "clockwise"', "follower.rotation", "other side"),
    ],
)
@pytest.mark.parametrize("pad", ['radius = "8 mm"', 'face = "0 mm"'])
def test_follower_inconsistent_with_member_raises_error(tmp_path, pad, given, wanted, where, message):
    """The arm is the length of the member from the pivot to the node, and the pivot is at the origin of the arm."""
    path, text = tmp_path / "finger.toml", MEMBER.format(pad=pad)
    assert text.count(given) == 1
    path.write_text(text.replace(given, wanted), encoding="utf-8")
    with pytest.raises(InputError) as refused:
        prepare(read_case(path))
    assert where in str(refused.value)
    assert message in str(refused.value)


@pytest.mark.parametrize(
    ("given", "wanted"),
    [
        ('arm = "40 mm"', 'arm = "40.3 mm"'),  # as drawn
        ('pivot = ["ux", "uy", "uz", "ry", "rz"]', 'pivot = ["ux", "uy", "uz", "rx", "ry", "rz"]'),  # a leaf spring
        ("pad = [0.06, -0.024, 0.0]", "pad = [0.06, -0.027, 0.0]"),  # 40.1 mm away, 40 mm along the face
    ],
)
def test_follower_within_tolerance_of_member_is_accepted(tmp_path, given, wanted):
    path, text = tmp_path / "finger.toml", MEMBER.format(pad='face = "0 mm"')
    assert text.count(given) == 1
    path.write_text(text.replace(given, wanted), encoding="utf-8")
    prepare(read_case(path))


@pytest.mark.parametrize("pad", ['radius = "8 mm"', 'face = "0 mm"'])
def test_rigid_finger_member_rotates_about_pivot(record, tmp_path, pad):
    """The end at 60 mm moves 1.5 times as far as the node at 40 mm: F L/arm, inertia rho (A L^3/3 + I L)/arm^2."""
    changes = {
        "pad = [0.06, -0.024, 0.0]": "pad = [0.06, -0.024, 0.0]\ntip = [0.06, -0.024, -0.02]",
        '["pivot", "pad"]': '["pivot", "pad", "tip"]',
        'at = "pad", direction = "-uy", stiffness = "1 kN/m", installed_force = "10 N"':
            'at = "tip", direction = "-uy", stiffness = "1 kN/m", installed_force = "300 N"',
        'step = "1 us"\nrevolutions = 1e-6': "steps_per_revolution = 360\nrevolutions = 1",
        'speed = "60 rpm"': 'speed = "1200 rpm"',
        'probes = ["pad"]': 'probes = ["pad", "tip"]',
        '"1 GN/m"': '"1 GN/m", dissipation = "0.5 s/m"',
    }  # fmt: skip
    text = MEMBER.format(pad=pad)
    for given, wanted in changes.items():
        assert text.count(given) == 1
        text = text.replace(given, wanted)
    path = tmp_path / "finger.toml"
    path.write_text(text, encoding="utf-8")
    case = read_case(path)
    response, speed = run(case, rigid=True), 40.0 * math.pi
    event = build_model(case).cams["intake"].event
    s, bend = (event(response.angle, order) for order in (0, 2))
    np.testing.assert_allclose(-response["tip"].displacement[:, 1], 1.5 * s, atol=1e-15)
    np.testing.assert_allclose(-response["pad"].displacement[:, 1], s, atol=1e-15)
    inertia = 7800.0 * math.pi * (0.02**2 / 4.0 * 0.06**3 / 3.0 + 0.02**4 / 64.0 * 0.06) / 0.04**2
    expected = inertia * bend * speed**2 + 1.5 * (300.0 + 1e3 * 1.5 * s)
    record(source=SOURCE, case=f"rigid finger as a member, {pad}", quantity="largest error of the contact force",
           unit="N", reference=0.0, computed=float(np.abs(response.channels["contacts.intake.force"] - expected).max()),
           tolerance=1e-9 * float(expected.max()), absolute=True, reason="rounding")  # fmt: skip


@pytest.mark.parametrize("base_circle", [False, True])
def test_friction_does_not_change_natural_frequencies(case, base_circle):
    """The stiffness of the contact acts on the twist by friction, but the twist does not act on the contact.

    The coupling in one direction leaves the eigenvalues as they are; the drive is soft, so that half of it in a
    symmetric matrix would change the torsion by 5 %. Tolerance 1e-3: friction moves the equilibrium.
    """
    soft = 'belt = { at = "drive", direction = "rx", stiffness = "500 N m/rad" }'
    frequencies = []
    for friction in ("", ", friction = 0.12"):
        contact = f'model = "unilateral", stiffness = "200 MN/m"{friction}'
        made = case(FLAT, contact, springs=soft)
        made.path.write_text(made.path.read_text().replace('"uz", "rx"]\nrear', '"uz"]\nrear'), encoding="utf-8")
        model = build_model(read_case(made.path))
        found = modes_on_the_lift(model, "intake", 60.0, base_circle=base_circle)
        frequencies.append(found.model_modes.modes.frequencies[:8])
    assert frequencies[1] == pytest.approx(frequencies[0], rel=1e-3)
