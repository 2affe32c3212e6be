"""Rigid links and joints between members, against closed forms and the same mechanisms without links.

A rigid body moves its points by ``u + theta x r`` (H. Goldstein, Classical Mechanics, 3rd ed., sec. 4.8, small angles).
"""

import numpy as np
import pytest

from flexcam import InputError, build_model, read_case, run
from flexcam.valvetrain import build_structure
from flexcam.valvetrain.modes import model_modes

SOURCE = "Rigid links and joints"
STEEL = 'materials = { steel = { E = "200 GPa", nu = 0.3, density = 7800 } }\n'
ALL = '["ux", "uy", "uz", "rx", "ry", "rz"]'


def write_and_read_case(tmp_path, text, name="case"):
    path = tmp_path / f"{name}.toml"
    path.write_text("format = 1\n" + text)
    return read_case(path)


ARM, REACH, INERTIA, PUSHED, VALVE = 0.030, 0.045, 4e-5, 2e5, 3e4
ROCKER = f"""
nodes = {{ shaft = [0, 0, 0], push = [{-ARM}, "10 mm", 0], valve = [{REACH}, 0, "5 mm"] }}
supports = {{ shaft = ["ux", "uy", "uz", "rx", "ry"] }}
rigid_links = {{ rocker = {{ from = "shaft", to = ["push", "valve"] }} }}
masses = {{ body = {{ at = "shaft", mass = "300 g", inertia = [{INERTIA}, {INERTIA}, {INERTIA}] }} }}
springs.push = {{ at = "push", direction = "uy", stiffness = {PUSHED} }}
springs.valve = {{ at = "valve", direction = "uy", stiffness = {VALVE} }}
run = {{ speed = "3000 rpm", steps_per_revolution = 720, revolutions = 1, start = "equilibrium" }}
output = {{ probes = ["push", "valve"] }}
"""


def test_frequency_of_rigid_rocker(tmp_path, record):
    model = build_model(write_and_read_case(tmp_path, ROCKER))
    found = model_modes(build_structure(model)).modes.frequencies
    wanted = np.sqrt((PUSHED * ARM**2 + VALVE * REACH**2) / INERTIA) / (2.0 * np.pi)
    record(source=SOURCE, case="rocker on two springs", quantity="frequency", unit="Hz", reference=wanted,
           computed=found[0], tolerance=1e-12, reason="exact")  # fmt: skip
    assert found == pytest.approx([wanted], rel=1e-12)


def test_rigid_rocker_under_static_force(tmp_path):
    """The push node is 10 mm above the shaft, so that a rotation moves it sideways too."""
    text = ROCKER + 'loads = { push = { at = "push", direction = "uy", force = "50 N" } }\n'
    response = run(write_and_read_case(tmp_path, text))
    turn = -50.0 * ARM / (PUSHED * ARM**2 + VALVE * REACH**2)
    assert response["push"].displacement[-1] == pytest.approx(np.array([-0.01 * turn, -ARM * turn, 0, 0, 0, turn]))
    assert response["valve"].displacement[-1] == pytest.approx(np.array([0, REACH * turn, 0, 0, 0, turn]))


CANTILEVER = f"""
{STEEL}
sections = {{ rod = {{ shape = "rectangle", width_y = "6 mm", width_z = "9 mm" }} }}
members = {{ arm = {{ nodes = ["foot", "tip"], elements = 4, material = "steel", section = "rod", GS }} }}
supports = {{ foot = {ALL} }}
loads = {{ push = {{ at = "AT", direction = [1, 2, -3], force = "20 N" }} }}
run = {{ speed = "3000 rpm", steps_per_revolution = 720, revolutions = 0.2, gravity = [0, -9.81, 0] }}
output = {{ probes = ["tip"] }}
"""
OFFSET = [0.02, -0.03, 0.01]
CENTRE = [0.12 + OFFSET[0], 0.04 + OFFSET[1], OFFSET[2]]
WITH_OFFSET = f"""
nodes = {{ foot = [0, 0, 0], tip = ["120 mm", "40 mm", 0] }}
masses = {{ head = {{ at = "tip", mass = "80 g", inertia = [2e-5, 3e-5, 4e-5], offset = {OFFSET} }} }}
"""
WITH_LINK = f"""
nodes = {{ foot = [0, 0, 0], tip = ["120 mm", "40 mm", 0], body = {CENTRE} }}
masses = {{ head = {{ at = "body", mass = "80 g", inertia = [2e-5, 3e-5, 4e-5] }} }}
rigid_links = {{ head = {{ from = "body", to = ["tip"] }} }}
"""


@pytest.mark.parametrize("bent", ["false", "true"])
def test_member_end_on_rigid_body_matches_offset_mass(tmp_path, record, bent):
    """Frequencies, motion and section forces equal those of a beam with the body as a mass with an offset."""
    text = CANTILEVER.replace("GS", f"geometric_stiffness = {bent}").replace("AT", "tip")
    one, other = (
        write_and_read_case(tmp_path, WITH_OFFSET + text, "offset"),
        write_and_read_case(tmp_path, WITH_LINK + text, "link"),
    )
    frequencies = [model_modes(build_structure(build_model(given))).modes.frequencies[:8] for given in (one, other)]
    assert frequencies[0] == pytest.approx(frequencies[1], rel=1e-9)
    moved = [run(given) for given in (one, other)]
    scale = np.abs(moved[0]["tip"].displacement).max(axis=0)
    assert (np.abs(moved[0]["tip"].displacement - moved[1]["tip"].displacement) <= 1e-8 * scale).all()
    assert moved[1].channels["members.arm.compression"] == pytest.approx(
        moved[0].channels["members.arm.compression"], abs=1e-5
    )
    record(source=SOURCE, case="beam that ends on a body", quantity="frequency 1", unit="Hz",
           reference=frequencies[0][0], computed=frequencies[1][0], tolerance=1e-9, reason="rounding")  # fmt: skip


HALF = 0.1
HINGED_BEAMS = f"""
{STEEL}
nodes = {{ left = [0, 0, 0], a = [{HALF}, 0, 0], b = [{HALF}, 0, 0], right = [{2 * HALF}, 0, 0] }}
sections = {{ rod = {{ shape = "circle", diameter = "8 mm" }} }}
supports = {{ left = {ALL}, right = {ALL} }}
rigid_links = {{ hinge = {{ from = "a", to = ["b"], components = COMPONENTS }} }}
loads = {{ middle = {{ at = "b", direction = "uy", force = "100 N" }} }}
run = {{ speed = "3000 rpm", steps_per_revolution = 720, revolutions = 0.1, start = "equilibrium" }}
output = {{ probes = ["a", "b"] }}
[members]
first = {{ nodes = ["left", "a"], material = "steel", section = "rod" }}
second = {{ nodes = ["b", "right"], material = "steel", section = "rod" }}
"""


@pytest.mark.parametrize(("components", "share"), [('["ux", "uy", "uz"]', 6.0), (ALL, 24.0)])
def test_deflection_of_two_beams_with_joint(tmp_path, components, share):
    """A ball joint leaves two cantilevers, F L^3/(6 E I), all components a clamped beam, F L^3/(24 E I)."""
    response = run(write_and_read_case(tmp_path, HINGED_BEAMS.replace("COMPONENTS", components)))
    wanted = 100.0 * HALF**3 / (share * 2e11 * np.pi * 0.008**4 / 64.0)
    for point in ("a", "b"):
        assert response[point].displacement[-1, 1] == pytest.approx(wanted, rel=1e-9)
    turns = response["a"].displacement[-1, 5], response["b"].displacement[-1, 5]
    assert turns[0] == pytest.approx(-turns[1], abs=1e-12)


LOADED_ARM = f"""
{STEEL}
nodes = {{ foot = [0, 0, 0], tip = [{HALF}, 0, 0] }}
sections = {{ rod = {{ shape = "circle", diameter = "8 mm" }} }}
members = {{ arm = {{ nodes = ["foot", "tip"], material = "steel", section = "rod" }} }}
supports = {{ foot = {ALL} }}
masses = {{ body = {{ at = "tip", mass = "0.5 kg" }} }}
run = {{ speed = "3000 rpm", steps_per_revolution = 720, revolutions = 0.1 }}
output = {{ probes = ["tip"] }}
"""


def test_mass_on_ball_joint_has_no_rotations(tmp_path):
    """The rotations of the mass have no effect and are no unknowns: the modes are those of the mass at the tip."""
    joint = 'rigid_links = { ball = { from = "hub", to = ["tip"], components = ["ux", "uy", "uz"] } }\n'
    linked = (
        LOADED_ARM.replace("tip = [", f"hub = [{HALF}, 0, 0], tip = [", 1).replace('at = "tip"', 'at = "hub"') + joint
    )
    direct, linked_structure = (
        build_structure(build_model(write_and_read_case(tmp_path, text))) for text in (LOADED_ARM, linked)
    )
    assert linked_structure.dofs.size == direct.dofs.size
    found, wanted = (model_modes(one).modes.frequencies for one in (linked_structure, direct))
    assert found == pytest.approx(wanted, rel=1e-10)


def test_deflection_of_three_beams_at_one_joint(tmp_path):
    """A ball joint connects the ends of three cantilevers: F L^3/(9 E I)."""
    text = HINGED_BEAMS.replace(
        'to = ["b"], components = COMPONENTS', 'to = ["b", "c"], components = ["ux", "uy", "uz"]'
    )
    text = text.replace("right = [", f"c = [{HALF}, 0, 0], top = [{HALF}, 0, {HALF}], right = [", 1)
    text = text.replace(f"right = {ALL}", f"right = {ALL}, top = {ALL}")
    response = run(
        write_and_read_case(tmp_path, text + 'third = { nodes = ["c", "top"], material = "steel", section = "rod" }\n')
    )
    wanted = 100.0 * HALF**3 / (9.0 * 2e11 * np.pi * 0.008**4 / 64.0)
    assert response["a"].displacement[-1, 1] == pytest.approx(wanted, rel=1e-9)


DRIVEN_ROCKER = """
nodes = { cam = [0, 0, 0], push = [0, "30 mm", 0], shaft = ["30 mm", "30 mm", 0], valve = ["75 mm", "30 mm", 0] }
supports = { shaft = ["ux", "uy", "uz", "rx", "ry"] }
rigid_links = { rocker = { from = "shaft", to = ["push", "valve"] } }
masses.body = { at = "shaft", mass = "300 g", inertia = [4e-5, 4e-5, 4e-5] }
masses.valve = { at = "valve", mass = "60 g" }
springs = { valve = { at = "valve", direction = "-uy", stiffness = "30 kN/m", installed_force = "250 N" } }
cams.one = { at = "cam", law = "cycloidal", lift = "6 mm", rise = "60 deg", return = "60 deg", axis = [0, 0, 1] }
contacts = { one = { model = "bilateral", cam = "one", follower = "push", stiffness = "20 MN/m", direction = "uy" } }
run = { speed = "1000 rpm", steps_per_revolution = 720, damping = { beta = 1e-6 } }
output = { probes = ["valve"] }
fidelity = { model = "MODEL" }
"""


def test_cam_drives_rigid_rocker(tmp_path):
    """The valve moves against the cam by the ratio of the arms, 1.5, in the rigid and in the flexible model."""
    moved = {}
    for model in ("rigid", "beams"):
        response = run(write_and_read_case(tmp_path, DRIVEN_ROCKER.replace("MODEL", model), model))
        moved[model] = response["valve"].displacement[:, 1]
        forces = response.channels["contacts.one.force"]
    assert moved["rigid"].min() == pytest.approx(-9e-3, rel=1e-9)
    # the deformation of the contact is the force, about 1 kN, over 20 MN/m, times the ratio
    assert moved["beams"] == pytest.approx(moved["rigid"], abs=1.5 * np.abs(forces).max() / 2e7 * 1.5)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (('to = ["push", "valve"]', 'to = ["push", "valv"]'), "valve"),
        (('to = ["push", "valve"]', 'to = ["push", "shaft"]'), "leads"),
        (("supports = { shaft", 'supports = { push = ["ux"], shaft'), "supports.push holds ux"),
        (("] } }\nmasses", '] }, more = { from = "push", to = ["valve"] } }\nmasses'), "follows in rigid_links.rocker"),
    ],
)
def test_invalid_rigid_links_raise_error(tmp_path, change, message):
    with pytest.raises(InputError) as refused:
        build_model(write_and_read_case(tmp_path, ROCKER.replace(*change)))
    assert message in str(refused.value)


SHAFT = f"""
{STEEL}
nodes = {{ drive = [0, 0, 0], cam = ["60 mm", 0, 0], end = ["120 mm", 0, 0], tappet = ["60 mm", "20 mm", 0] }}
sections = {{ shaft = {{ shape = "circle", diameter = "20 mm" }} }}
supports = {{ drive = ["ux", "uy", "uz", "rx"], end = ["uy", "uz"] }}
cams = {{ one = {{ at = "cam", law = "cycloidal", lift = "4 mm", rise = "60 deg", return = "60 deg" }} }}
contacts.one = {{ model = "bilateral", cam = "one", follower = "tappet", stiffness = "20 MN/m", direction = "uy" }}
springs = {{ tappet = {{ at = "tappet", direction = "-uy", stiffness = "20 kN/m", installed_force = "200 N" }} }}
masses = {{ tappet = {{ at = "tappet", mass = "80 g" }}, arm = {{ at = "end", mass = "2 kg", offset = [0, 0.05, 0] }} }}
output = {{ probes = ["cam"] }}
[members]
shaft = {{ nodes = ["drive", "cam", "end"], material = "steel", section = "shaft" }}
[run]
speed = "1000 rpm"
revolutions = 0.5
steps_per_revolution = 720
fluctuation = {{ orders = [2], amplitudes = [0.1] }}
"""


def test_linked_eccentric_mass_turns_with_shaft(tmp_path):
    """Under a fluctuating speed a mass on a link has the inertia torque of a mass with an offset, m r^2 alpha."""
    linked = SHAFT.replace('at = "end", mass = "2 kg", offset = [0, 0.05, 0]', 'at = "arm", mass = "2 kg"')
    linked = linked.replace("tappet = [", 'arm = ["120 mm", "50 mm", 0], tappet = [', 1)
    linked = linked.replace("[run]", '[rigid_links]\narm = { from = "end", to = ["arm"] }\n[run]')
    one, other = (
        run(write_and_read_case(tmp_path, text, name)) for name, text in (("offset", SHAFT), ("link", linked))
    )
    torques = [response.channels["supports.drive.torque"] for response in (one, other)]
    assert torques[1] == pytest.approx(torques[0], abs=1e-7 * np.abs(torques[0]).max())
    assert np.abs(torques[0]).max() > 5.0  # 2 kg (50 mm)^2 times 2 * 0.1 * (105 rad/s)^2 is 11 N m


def test_joint_separates_shaft_from_housing(tmp_path):
    """The journal turns in a bolted, non-circular bracket, which is no part of the shaft and transmits no torque."""
    stand = SHAFT.replace("drive = [0", 'foot = ["120 mm", "-80 mm", 0], seat = ["120 mm", "-20 mm", 0], drive = [0', 1)
    plate = 'plate = { shape = "rectangle", width_y = 0.03, width_z = 0.06 }'
    stand = stand.replace("sections = { ", f"sections = {{ {plate}, ")
    stand = stand.replace("[run]", 'stand = { nodes = ["foot", "seat"], material = "steel", section = "plate" }\n[run]')
    stand = stand.replace(', end = ["uy", "uz"]', f", foot = {ALL}")
    joint = '[rigid_links]\njournal = { from = "seat", to = ["end"], components = ["uy", "uz"] }\n[run]'
    response = run(write_and_read_case(tmp_path, stand.replace("[run]", joint)))
    assert not [name for name in response.channels if name.startswith("supports.foot")]
    assert "members.stand.compression" in response.channels
