"""Rockers as levers and finger followers, against the kinematics of two arms and virtual work.

A lever turns by phi: its ends move by a1 (sin(b1 + phi) - sin b1) and a2 (sin(b2 + phi) - sin b2). With T the torque of
valve, spring and lever inertia about its axis, the force on the driven end is T/(a1 cos(b1 + phi)). The lift of a
finger follower is along the path a1 phi of the contact. R. L. Norton, Cam Design and Manufacturing Handbook, 2nd ed.
(2009), ch. 8 and 17 (lever ratios, equivalent systems).
"""

import math

import numpy as np
import pytest

from flexcam import build_model, prepare, read_case, run
from flexcam.core import Triplets
from flexcam.core.errors import InputError
from flexcam.dynamics import RunFailedError
from flexcam.valvetrain import build_structure, model_modes

SOURCE = "Levers and finger followers"
CASE = """
format = 1
[nodes]
drive = [0.0, 0.0, 0.0]
cam = [0.02, 0.0, 0.0]
tappet = [0.02, 0.03, 0.0]
top = [0.02, 0.08, 0.0]
[materials.stiff]
E = "20000 GPa"
nu = 0.3
density = "1 kg/m^3"
[sections]
thick = {{ shape = "circle", diameter = "40 mm" }}
[members]
camshaft = {{ nodes = ["drive", "cam"], material = "stiff", section = "thick" }}
{rod}
[supports]
drive = ["ux", "uy", "uz", "rx", "ry", "rz"]
{guides}
[masses]
{tappet}
valve = {{ at = "valve", mass = "0.1 kg" }}
[springs]
valve = {{ at = "valve", direction = "{way}", stiffness = "40 kN/m", installed_force = "400 N" }}
[rockers.rocker]
{rocker}
to = "valve"
arms = ["30 mm", "45 mm"]
inertia = "2e-5 kg m^2"
[cams.intake]
at = "cam"
law = "4-5-6-7"
lift = "8 mm"
rise = "90 deg"
return = "90 deg"
phase = "10 deg"
{cam}
[contacts]
intake = {{ cam = "intake", follower = "{follower}", model = "bilateral", stiffness = "500 MN/m" }}
[run]
speed = "600 rpm"
revolutions = 0.5
steps_per_revolution = 1800
start = "equilibrium"
{lines}
[output]
probes = [{probes}]
"""
ROD = 'pushrod = { nodes = ["tappet", "top"], material = "stiff", section = "thick" }'
GUIDES = 'tappet = ["ux", "uz", "ry", "rx", "rz"]\ntop = ["ux", "uz", "ry", "rx", "rz"]'
LUMPED, LEVER = 'model = "lumped"\nfrom = "top"', 'model = "lever"\nfrom = "top"\nstiffness = "500 MN/m"\nangles = {}'
FINGER = 'model = "lever"\nfrom = "pad"\ndirection = "{}"\nstiffness = "500 MN/m"\nangles = {}'
ARMS, INERTIA, VALVE, TAPPET = (0.03, 0.045), 2e-5, 0.1, 0.06
ROD_MASS = math.pi * 0.02**2 * 0.05
SPRING, INSTALLED = 40e3, 400.0


@pytest.fixture
def pushrod_case(tmp_path):
    """Return a function that builds the case of a train with a pushrod."""

    def make(rocker, *, cam="", lines="", speed=600.0, tappet=0.06):
        text = CASE.format(
            rod=ROD, guides=GUIDES, tappet=f'follower = {{ at = "tappet", mass = {tappet} }}', way="uy", rocker=rocker,
            cam=cam, follower="tappet", lines=lines, probes='"tappet", "top", "valve"',
        )  # fmt: skip
        path = tmp_path / "pushed.toml"
        path.write_text(text, encoding="utf-8")
        return read_case(path, [f"run.speed={speed} rpm"])

    return make


@pytest.fixture
def finger_case(tmp_path):
    """Return a function that builds the case of a finger follower."""

    def make(angles=(0.0, 0.0), *, way="uy", cam="", lines="", speed=600.0):
        text = CASE.format(
            rod="", guides="", tappet="", way=way, rocker=FINGER.format(way, list(angles)), cam=cam, follower="pad",
            lines=lines, probes='"valve", "pad"',
        )  # fmt: skip
        text = "\n".join(line for line in text.splitlines() if not line.startswith(("tappet =", "top =")))
        path = tmp_path / "finger.toml"
        path.write_text(text, encoding="utf-8")
        return read_case(path, [f"run.speed={speed} rpm"])

    return make


class RigidLever:
    """Closed forms of a rigid lever over a lift: angle, rates, torque and force."""

    def __init__(self, case, angle, angles, *, finger):
        event = build_model(case).cams["intake"].event
        w = case.speed
        s, v, a = (event(angle, order) * w**order for order in range(3))
        (a1, a2), (b1, b2) = ARMS, angles
        if finger:
            self.turn, rate, bend = s / a1, v / a1, a / a1
        else:
            self.turn = np.arcsin(np.sin(b1) + s / a1) - b1
            c, sine = np.cos(b1 + self.turn), np.sin(b1 + self.turn)
            rate = v / (a1 * c)
            bend = (a / a1 + sine * rate**2) / c
        self.valve = a2 * (np.sin(b2 + self.turn) - math.sin(b2))
        arm = a2 * np.cos(b2 + self.turn)
        self.velocity = arm * rate
        self.acceleration = arm * bend - a2 * np.sin(b2 + self.turn) * rate**2
        torque = INERTIA * bend + arm * (VALVE * self.acceleration + INSTALLED + SPRING * self.valve)
        if finger:
            self.force = torque / a1
        else:
            self.force = torque / (a1 * c) + (TAPPET + ROD_MASS) * a


def record_errors(record, response, exact, case, force, motion, reason):
    """Record the maximum errors of valve lift and contact force."""
    lift, found = response["valve"].displacement, response.channels["contacts.intake.force"]
    record(source=SOURCE, case=case, quantity="largest error of the valve's lift", unit="m", reference=0.0,
           computed=np.abs(lift - exact.valve).max(), tolerance=motion, absolute=True, reason=reason)  # fmt: skip
    record(source=SOURCE, case=case, quantity="largest error of the contact force", unit="N", reference=0.0,
           computed=np.abs(found - exact.force).max(), tolerance=force * np.abs(exact.force).max(), absolute=True,
           reason=reason)  # fmt: skip


ANGLES = [(0.0, 0.0), (-0.2, 0.15), (-0.13, -0.3)]


@pytest.mark.parametrize("angles", ANGLES)
@pytest.mark.parametrize("speed", [60.0, 1200.0])
def test_rigid_lever_matches_closed_form(record, pushrod_case, angles, speed):
    case = pushrod_case(LEVER.format(list(angles)), speed=speed)
    response = run(case, rigid=True)
    exact = RigidLever(case, response.angle, angles, finger=False)
    record_errors(record, response, exact, f"rigid lever {angles}, {speed:g} rpm", 1e-12, 1e-15, "rounding")
    np.testing.assert_allclose(response["valve"].velocity, exact.velocity, atol=1e-11)
    most = np.abs(exact.acceleration).max()
    np.testing.assert_allclose(response["valve"].acceleration, exact.acceleration, atol=1e-10 * most)


@pytest.mark.parametrize("angles", ANGLES)
def test_stiff_lever_matches_rigid_lever(record, pushrod_case, angles):
    """The flexible train with stiff parts approximates the motion of the rigid lever."""
    case = pushrod_case(LEVER.format(list(angles)), lines='damping = { beta = "1e-7 s" }')
    response = run(case)
    exact = RigidLever(case, response.angle, angles, finger=False)
    # Springs of 500 MN/m deform by 3 um under 1 kN, at three places and times the ratio.
    record_errors(record, response, exact, f"stiff lever {angles}", 5e-3, 2e-5, "contact and arms give 2 to 4 um each")


def test_lumped_and_lever_agree(record, pushrod_case):
    """At a small lift the rotation of square arms is so small that a lever equals the lumped rocker."""
    responses = []
    for rocker in (LUMPED, LEVER.format([0.0, 0.0])):
        case = pushrod_case(rocker, lines='damping = { beta = "1e-7 s" }')
        responses.append(run(read_case(case.path, ["cams.intake.lift=0.4 mm", "run.speed=600 rpm"])))
    lumped, lever = responses
    record(source=SOURCE, case="lift of 0.4 mm", quantity="valve of the lever against that of the lumped rocker",
           unit="m", reference=0.0, computed=np.abs(lever["valve"].displacement - lumped["valve"].displacement).max(),
           tolerance=4e-6, absolute=True, reason="arms give 2.5/500 MN/m of 600 N; phi^2/6 = 3e-5 of it")  # fmt: skip
    force = [one.channels["contacts.intake.force"] for one in responses]
    record(source=SOURCE, case="lift of 0.4 mm", quantity="largest difference of the contact force", unit="N",
           reference=0.0, computed=np.abs(force[1] - force[0]).max(), tolerance=1e-3 * force[0].max(), absolute=True,
           reason="phi^2/2 = 9e-5 of it, and what the arms give")  # fmt: skip


def test_equal_arm_angles_give_constant_ratio(pushrod_case):
    """With equal angles sin(b + phi) - sin b has the same proportion at both ends."""
    case = pushrod_case(LEVER.format([-0.2, -0.2]))
    response = run(case, rigid=True)
    lift = response["top.uy"].displacement
    np.testing.assert_allclose(response["valve"].displacement, 1.5 * lift, atol=1e-15)


FINGER_ANGLES = [(0.0, 0.0), (0.1, -0.15)]


@pytest.mark.parametrize("angles", FINGER_ANGLES)
@pytest.mark.parametrize("speed", [60.0, 1200.0])
def test_rigid_finger_matches_closed_form(record, finger_case, angles, speed):
    """The lift is along the arc of the pad, independent of the angle of the arm."""
    case = finger_case(angles, speed=speed)
    response = run(case, rigid=True)
    exact = RigidLever(case, response.angle, angles, finger=True)
    record_errors(record, response, exact, f"rigid finger {angles}, {speed:g} rpm", 1e-12, 1e-15, "rounding")
    np.testing.assert_allclose(response["pad"].displacement, ARMS[0] * exact.turn, atol=1e-15)


@pytest.mark.parametrize("angles", FINGER_ANGLES)
@pytest.mark.parametrize("direction", ["uy", "-uy"])
def test_stiff_finger_matches_rigid_finger(record, finger_case, angles, direction):
    case = finger_case(angles, way=direction, lines='damping = { beta = "1e-7 s" }')
    response = run(case)
    exact = RigidLever(case, response.angle, angles, finger=True)
    record_errors(
        record, response, exact, f"stiff finger {angles}, {direction}", 5e-3, 2e-5, "contact and arm give 2 to 4 um"
    )


SWINGING_ROLLER = """base_radius = "20 mm"
width = "12 mm"
follower = { type = "swing", arm = "30 mm", distance = "45 mm", radius = "9 mm" }"""


def test_finger_with_swinging_roller(record, finger_case):
    """With a roller the lift is that of its centre along the arc, and the cam torque is F s' by virtual work."""
    case = finger_case((0.1, -0.15), cam=SWINGING_ROLLER, lines='damping = { beta = "1e-7 s" }')
    response = run(case)
    exact = RigidLever(case, response.angle, (0.1, -0.15), finger=True)
    record_errors(record, response, exact, "swinging roller", 5e-3, 2e-5, "contact and arm give 2 to 4 um")
    slope = build_model(case).cams["intake"].event(response.angle, 1)
    np.testing.assert_allclose(
        response.channels["contacts.intake.torque"], response.channels["contacts.intake.force"] * slope, atol=1e-9
    )


@pytest.mark.parametrize("angles", ANGLES[1:])
def test_energy_conservation_without_damping(record, pushrod_case, finger_case, angles):
    """The runs have no dissipation and 1800 steps per revolution."""
    for case in (pushrod_case(LEVER.format(list(angles))), finger_case(angles)):
        channels = run(case).channels
        most = np.abs(channels["energy.work"]).max()
        for part in ("residual", "dissipated", "numerical"):
            record(source=SOURCE, case=f"{case.name}, {angles}", quantity=f"{part} energy over work", unit="1",
                   reference=0.0, computed=np.abs(channels[f"energy.{part}"]).max() / most, tolerance=1e-6,
                   absolute=True, reason="curvature of the force within a step")  # fmt: skip


def test_damping_of_arms_is_in_energy_balance(record, pushrod_case):
    """The dissipated energy includes the dampers of the arms: work less stored energy."""
    rocker = LEVER.format([-0.2, 0.15]) + '\ndamping = "2 kN s/m"\ndrive_damping = "1 kN s/m"'
    channels = run(pushrod_case(rocker, speed=1200.0)).channels
    most = np.abs(channels["energy.work"]).max()
    assert channels["energy.dissipated"][-1] > 1e-9 * most
    assert (np.diff(channels["energy.dissipated"]) > -1e-9 * most).all()
    record(source=SOURCE, case="damped arms", quantity="residual energy over work", unit="1", reference=0.0,
           computed=np.abs(channels["energy.residual"]).max() / most, tolerance=1e-6, absolute=True,
           reason="curvature of the force within a step")  # fmt: skip


def test_profile_for_another_arm_raises_error(finger_case):
    with pytest.raises(InputError, match="that of rockers"):
        run(finger_case((0.1, -0.15), cam=SWINGING_ROLLER.replace('arm = "30 mm"', 'arm = "28 mm"')))


@pytest.mark.parametrize(("angle", "folds"), [(1.2, True), (-1.2, False)])
def test_error_names_unstable_lever(finger_case, angle, folds):
    """A valve force F on an arm at angle b reduces the rotational stiffness by F a sin b, or increases it."""
    case = finger_case((0.0, angle))
    force, spring, contact = 4e3, 40e3, 5e3
    turning = spring * (ARMS[1] * math.cos(angle)) ** 2 + contact * ARMS[0] ** 2 - force * ARMS[1] * math.sin(angle)
    assert (turning < 0.0) == folds
    soft = [f"contacts.intake.stiffness={contact}", f"springs.valve.installed_force={force}", "cams.intake.lift=1e-3"]
    soft = read_case(case.path, soft)
    if not folds:
        assert prepare(soft).problem.start.displacement.any()
        return
    with pytest.raises(RunFailedError) as refusal:
        prepare(soft)
    told = refusal.value.status
    cause = "rockers.rocker.to buckles or folds over under load; largest motion: valve, pad"
    assert told.text.startswith(f"the stiffness is not positive: {cause}")


def test_error_of_modes_names_destabilizing_force(finger_case):
    """The message names the closed force that reduces the stiffness, not one that increases it."""
    case = finger_case()
    structure = build_structure(build_model(case))
    turn = structure.row("pad", np.zeros(6))
    held = [(name, Triplets.outer(turn, turn, size)) for name, size in (("seat", 1e5), ("arm", -1e9), ("tip", -1e7))]
    with pytest.raises(RunFailedError, match="arm buckles or folds over"):
        model_modes(structure, held=held)
    assert model_modes(structure, held=held[:1]).modes.omegas[0] > 0.0
