"""The command modes: files for ParaView, prestress and modal assurance criterion."""

import math
import re

import numpy as np
import pytest

from flexcam.case.starters import new_case


def test_modes_writes_paraview_files(flexcam, case, tmp_path):
    reading = pytest.importorskip("vtkmodules.vtkIOHDF")
    files = flexcam("modes", "case.toml", "--count", "4", "-o", "out", "--json").json["files"]
    assert files[:3] == [f"out/case-modes.{kind}" for kind in ("vtkhdf", "vtp", "pvd")]
    assert len(files) == 3 + 24
    reader = reading.vtkHDFReader()
    reader.SetFileName(str(tmp_path / files[0]))
    reader.UpdateInformation()
    assert reader.GetNumberOfSteps() == 24
    reader.SetStep(12)
    reader.Update()
    data = reader.GetOutput().GetPointData()
    names = [data.GetArrayName(i) for i in range(data.GetNumberOfArrays())]
    shapes = sorted(name for name in names if name.startswith("mode_"))
    assert [name[:8] for name in shapes] == ["mode_01_", "mode_02_", "mode_03_", "mode_04_"]
    assert shapes[1] == "mode_02_67.1Hz"
    assert all(data.GetArray(name).GetNumberOfComponents() == 3 for name in shapes)


def test_modes_files_require_overwrite(flexcam, case):
    assert flexcam("modes", "case.toml", "-o", "out").code == 0
    assert flexcam("modes", "case.toml", "-o", "out").code == 2
    assert flexcam("modes", "case.toml", "-o", "out", "--overwrite").code == 0


MASSLESS = """
format = 1
nodes = { a = [0, 0, 0], b = [0.1, 0, 0] }
supports = { a = ["ux", "uy", "uz", "rx", "ry", "rz"] }
materials.steel = { E = "210 GPa", nu = 0.3, density = 0 }
sections.rod = { shape = "circle", diameter = "10 mm" }
members.rod = { nodes = ["a", "b"], material = "steel", section = "rod" }
run = { speed = "1000 rpm", revolutions = 1 }
"""


def test_model_without_mass_has_no_modes(flexcam, tmp_path):
    (tmp_path / "case.toml").write_text(MASSLESS, encoding="utf-8")
    output = flexcam("modes", "case.toml").out
    assert "no modes with contacts open. A mode needs a mass, or a member with density, that can move." in output


@pytest.mark.parametrize(
    ("template", "lashes"),
    [("gear-drive", "contacts.lash, contacts.driving, contacts.coasting"), ("pushrod-engine", "contacts.lash")],
)
def test_modes_name_open_lashes(template, lashes, flexcam, tmp_path):
    case = new_case(template, tmp_path / "case.toml")[0]
    output = " ".join(flexcam("modes", case, "--count", "1").out.split())
    assert f"Lashes that are open on the base circle, and have no stiffness there: {lashes}" in output
    assert f"{lashes}, " not in output


def test_modes_with_closed_contacts(flexcam, one_mass):
    """Frequencies on the spring alone, with cam and seat, and with the cam at full lift; rpm of the crankshaft."""
    seat = 'seat = { at = "mass", direction = "-uz", model = "seat", stiffness = "50 MN/m" }\n[run]'
    case = one_mass(("500 MN/m", "5 MN/m"), ("[run]", seat), ('speed = "3500', 'crank_speed = "3500'))
    report = flexcam("modes", case, "--json").json
    hertz = {
        name: math.sqrt(k / 0.1) / (2 * math.pi) for name, k in (("open", 4e4), ("base", 55.04e6), ("full", 5.04e6))
    }
    assert report["frequencies_hz"] == [pytest.approx(hertz["open"])]
    assert report["closed"]["k"]["base_circle_hz"] == [pytest.approx(hertz["base"])]
    assert report["closed"]["k"]["full_lift_hz"] == [pytest.approx(hertz["full"])]
    output = flexcam("modes", case).out
    assert "modes, contacts open" in output
    assert re.search(rf"1 +{hertz['open']:.2f} +{120 * hertz['open']:.0f} ", output)
    assert "crank rpm" in output
    for place in ("base", "full"):
        assert re.search(rf" {hertz[place]:.2f} +{120 * hertz[place]:.0f} ", output)
    assert "contacts open" in flexcam("check", case).out


def test_output_explains_columns_and_mode_numbers(flexcam, tayeb):
    """A shaft in radial bearings is free along its axis, so the first mode above zero has number 2."""
    output = re.sub(r"\s+", " ", flexcam("modes", tayeb(3)).out)
    assert "ux, uy, uz kg: effective mass of the mode for base excitation along x, y, z" in output
    assert "frequency.1 is no. 2" in output
    value = flexcam("sensitivity", tayeb(3), "--of", "frequency.1", "--to", "masses.valve.mass").out
    assert re.search(r"2 +67\.11", output)
    assert "67.1" in value


COLUMN = """
format = 1
[nodes]
foot = [0, 0, 0]
top = [0, "400 mm", 0]
[materials.steel]
E = "200 GPa"
nu = 0.3
density = "7800 kg/m^3"
[sections]
rod = { shape = "rectangle", width_y = "9 mm", width_z = "6 mm" }
[members]
pushrod = { nodes = ["foot", "top"], material = "steel", section = "rod", elements = 16, rotary_inertia = false }
[supports]
foot = ["ux", "uy", "uz", "ry"]
top = ["ux", "uz"]
[loads.push]
at = "top"
direction = "-uy"
force = "PUSH N"
[run]
speed = "60 rpm"
"""
L, IZ, IY = 0.4, 6e-3 * 9e-3**3 / 12.0, 9e-3 * 6e-3**3 / 12.0
EULER = math.pi**2 * 200e9 * IY / L**2
BENDING = [(k * math.pi / L) ** 2 * math.sqrt(200e9 * IY / (7800.0 * 54e-6)) / (2 * math.pi) for k in (1, 2)]


@pytest.fixture
def column(tmp_path):
    def write(push, name="column.toml"):
        (tmp_path / name).write_text(COLUMN.replace("PUSH", f"{push:.17g}"), encoding="utf-8")
        return name

    return write


@pytest.mark.parametrize(("share", "factor"), [(0.5, 0.5), (0.9, 0.1), (-1.0, 2.0)])
def test_frequency_of_prestressed_pinned_pushrod(flexcam, column, share, factor):
    """F sqrt(1 - P/P_cr); the error of 16 elements, (pi/16)^4/720 = 2e-6 of P_cr, is 2e-5 of 1 - 0.9."""
    name = column(share * EULER)
    plain, rest, loaded = (
        flexcam("modes", name, "--json", *more).json["frequencies_hz"][0]
        for more in ((), ("--prestress", "rest"), ("--prestress", "equilibrium"))
    )
    assert plain == pytest.approx(BENDING[0], rel=2e-6)
    assert rest == pytest.approx(plain, rel=1e-9)  # the push acts from the start of the run, not as installed
    assert loaded == pytest.approx(BENDING[0] * math.sqrt(factor), rel=2e-5)


def test_prestress_beyond_buckling_fails(flexcam, column):
    done = flexcam("modes", column(1.05 * EULER), "--prestress", "equilibrium")
    assert done.code == 3
    assert "members.pushrod buckles or folds over" in done.err


def test_mac_of_case_with_itself(flexcam, column):
    """Unequal Iy and Iz separate all frequencies; on a uniform mesh shapes of a plane are orthogonal at nodes."""
    name = column(0.0001)
    report = flexcam("modes", name, "--count", "4", "--mac", name, "--json").json
    found = np.array(report["mac"])
    assert np.diff(report["frequencies_hz"]).min() > 1.0
    assert np.abs(np.diag(found) - 1.0).max() <= 1e-12
    assert np.abs(found - np.eye(4)).max() <= 1e-9  # sums of sines over equal parts, rounding of the shapes


def test_mac_is_undefined_without_moving_compared_node(flexcam):
    """The second mode is the surge of the valve spring, whose coils are not nodes of the mesh."""
    flexcam("new", "pushrod-engine")
    args = ("modes", "pushrod-engine.toml", "--count", "2", "--mac", "pushrod-engine.toml")
    assert flexcam(*args, "--json").json["mac"] == [[pytest.approx(1.0), None], [None, None]]
    assert "A dash: the mode moves none of the common nodes" in flexcam(*args).out


def test_mac_reports_few_common_nodes(flexcam, column, tmp_path):
    """Meshes of different element lengths share few nodes, at which the shapes of one plane are similar."""
    text = (tmp_path / (name := column(0.0001))).read_text(encoding="utf-8")
    finer = re.sub(r"elements = (\d+)", lambda found: f"elements = {int(found[1]) + 1}", text)
    assert finer != text
    (tmp_path / "finer.toml").write_text(finer, encoding="utf-8")
    assert "fewer than the modes" in flexcam("modes", name, "--count", "4", "--mac", "finer.toml").out
    assert "fewer than the modes" not in flexcam("modes", name, "--count", "4", "--mac", name).out


def test_modes_and_check_name_bending_planes_by_global_axes(flexcam):
    """The pushrod is parallel to y; its second bending mode moves along z, the direction of its effective mass."""
    case = flexcam("new", "pushrod-engine", "--json").json["files"][0]
    found = flexcam("modes", case, "--count", "4", "--json").json
    assert found["moves"][2:] == ["pushrod bending in x-y 100 %", "pushrod bending in y-z 100 %"]
    assert np.argmax(found["effective_masses"][3]) == 2
    assert "pushrod: bending in y-z (uz, rx)" in re.sub(r"\s+", " ", flexcam("check", case).out)
    assert "local:" not in flexcam("modes", case, "--count", "4").out


def test_equal_frequencies_of_two_planes_are_explained_once(flexcam, tmp_path):
    case = tmp_path / "rod.toml"
    case.write_text("""
format = 1
nodes = { base = [0, 0, 0], tip = [0.3, 0, 0] }
materials.steel = { E = 207e9, nu = 0.29, density = 7800 }
sections.bar = { shape = "circle", diameter = "8 mm" }
members.rod = { nodes = ["base", "tip"], elements = 4, material = "steel", section = "bar" }
supports.base = ["ux", "uy", "uz", "rx", "ry", "rz"]
run = { speed = "100 rpm" }
""", encoding="utf-8")  # fmt: skip
    output = " ".join(flexcam("modes", case, "--set", "masses.end={ at = 'tip', mass = 0.2 }").out.split())
    assert output.count("Equal frequencies: ") == 1
    assert "such as rod, bends in both" in output
    stiffer = 'sections.bar={shape="rectangle", width_y="8 mm", width_z="12 mm"}'
    assert "Equal frequencies" not in flexcam("modes", case, "--set", stiffer).out


def test_effective_mass_of_train_with_rocker(flexcam, case):
    """(phi' M r)^2 / (phi' M phi) of the train as one body on the valve spring: the pushrod is rigid to 0.1 %.

    The valve moves 1.6 times the follower. The rocker does not rotate with the base: it enters the denominator only.
    """
    found = flexcam("modes", "case.toml", "--count", "2", "--json").json
    pushrod = 7800.0 * math.pi / 4.0 * (8e-3**2 - 5e-3**2) * 0.25
    driven, valve, rocker = 0.1 + pushrod, 0.1, 1e-4 / 0.025**2
    expected = (driven + 1.6 * valve) ** 2 / (driven + 1.6**2 * valve + rocker)
    assert found["effective_masses"][1][1] == pytest.approx(expected, rel=3e-3)


def test_effective_mass_includes_the_mass_at_supports(flexcam, tmp_path):
    """One linear element of a rod: M = m/6 [[2, 1], [1, 2]], so that (m/3 + m/6)^2/(m/3) = 3/4 m moves along it."""
    case = tmp_path / "rod.toml"
    case.write_text("""
format = 1
nodes = { base = [0, 0, 0], tip = [0.3, 0, 0] }
materials.steel = { E = 207e9, nu = 0.29, density = 7800 }
sections.bar = { shape = "custom", A = 1e-4, Iy = 1e-9, Iz = 1e-9, J = 2e-9 }
members.rod = { nodes = ["base", "tip"], elements = 1, material = "steel", section = "bar" }
supports.base = ["ux", "uy", "uz", "rx", "ry", "rz"]
run = { speed = "100 rpm" }
""", encoding="utf-8")  # fmt: skip
    masses = np.array(flexcam("modes", case, "--json").json["effective_masses"])
    assert masses[:, 0].max() == pytest.approx(0.75 * 7800.0 * 1e-4 * 0.3)


def test_effective_mass_of_spring_to_ground_or_to_support(flexcam, tmp_path):
    """A spring with mass that ends at a supported node is the same as one to ground."""
    case, found = tmp_path / "spring.toml", []
    for end in ("", 'to = "wall", '):
        case.write_text(f"""
format = 1
nodes = {{ wall = [0, 0, 0], tip = [0.1, 0, 0] }}
masses.tip = {{ at = "tip", mass = 0.5 }}
masses.wall = {{ at = "wall", mass = 0.5 }}
springs.one = {{ at = "tip", {end}direction = "ux", stiffness = 1e4, mass = 1.0, elements = 8 }}
supports = {{ wall = ["ux", "uy", "uz", "rx", "ry", "rz"], tip = ["uy", "uz"] }}
run = {{ speed = "100 rpm" }}
""", encoding="utf-8")  # fmt: skip
        found.append(np.array(flexcam("modes", case, "--json").json["effective_masses"])[:, 0])
    np.testing.assert_allclose(found[0], found[1], rtol=1e-9, atol=1e-12)
    assert found[0].sum() < 1.5


def test_oblique_member_has_local_bending_planes(flexcam):
    case = flexcam("new", "pushrod-engine", "--json").json["files"][0]
    inclined = 'nodes.pushrod-top=["150 mm", "274 mm", "0 mm"]'
    output = re.sub(r"\s+", " ", flexcam("modes", case, "--count", "4", "--set", inclined).out)
    assert "pushrod bending in local x-z" in output
    assert "local: axes of a member that is not along a global axis: x along it, y towards its `orientation`" in output
