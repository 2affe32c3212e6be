"""Trains of masses and springs only: points that are on no member move, are drawn, and are refused if invalid."""

# ruff: noqa: E501 - tables, a row to a line

import math
from pathlib import Path

import numpy as np
import pytest

from flexcam import InputError, build_model, modes, prepare, read_case, read_result, run, solve
from flexcam.analysis.comparison import deviation
from flexcam.analysis.run import open_result_file, output_geometry
from flexcam.io import write_modes, write_pvd

ROOT = Path(__file__).parents[2]
LI = ROOT / "cases/li/valve-train.toml"
SHORT = ["run.revolutions=0.45", "run.steps_per_revolution=720"]


@pytest.fixture
def write_train(tmp_path):
    """Return a function that writes the case of Li's train with replaced parts."""

    def make(*pairs):
        text = LI.read_text(encoding="utf-8")
        for old, new in pairs:
            assert old in text
            text = text.replace(old, new, 1)
        path = tmp_path / "train.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return make


@pytest.fixture(scope="module")
def saved_run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("lumped")
    ready = prepare(read_case(LI, SHORT))
    sink = open_result_file(ready, folder)
    return solve(ready.problem, ready.scheme, save=ready.save, sinks=[sink]), read_result(sink.path), sink.path


def test_points_are_saved_and_drawn(saved_run):
    response, result, _ = saved_run
    assert result.constant["node"].tolist() == [1, 2, 3]
    assert dict(result.mesh.lines) == {}
    at = np.searchsorted(response.time, response.field_time)
    valve = result.field("displacement")[:, 3, 1]
    np.testing.assert_array_equal(valve, response["valve.uy"].displacement[at])
    assert not any(values.any() for values in result.recovered.values())


def test_vtkhdf_points_are_vertices(saved_run):
    reading = pytest.importorskip("vtkmodules.vtkIOHDF")
    _, result, path = saved_run
    reader = reading.vtkHDFReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    reader.SetStep(len(result.response.field_time) - 1)
    reader.Update()
    output = reader.GetOutput()
    assert (output.GetNumberOfVerts(), output.GetNumberOfLines(), output.GetNumberOfPoints()) == (3, 0, 3)
    shown = output.GetPointData().GetArray("displacement").GetTuple(2)
    assert shown == tuple(result.field("displacement")[-1, 3])
    assert [output.GetCellData().GetArray("member").GetValue(i) for i in range(3)] == [-1, -1, -1]


def test_pvd_points_are_vertices(saved_run, tmp_path):
    reading = pytest.importorskip("vtkmodules.vtkIOXML")
    _, result, _ = saved_run
    drawn = output_geometry(build_model(read_case(LI)))
    found = modes(read_case(LI))
    files = [*write_pvd(result, tmp_path / "train.pvd"), *write_modes(
        tmp_path / "train-modes.vtkhdf", drawn, found.modes.frequencies, found.modes.shapes
    )]  # fmt: skip
    pieces = [path for path in files if path.suffix == ".vtp"]
    assert len(pieces) > len(result.response.field_time)
    for path in pieces[:2] + pieces[-2:]:
        reader = reading.vtkXMLPolyDataReader()
        reader.SetFileName(str(path))
        reader.Update()
        output = reader.GetOutput()
        assert (output.GetNumberOfVerts(), output.GetNumberOfLines(), output.GetNumberOfPoints()) == (3, 0, 3)


def test_mass_on_no_member_next_to_beam(tmp_path):
    text = (ROOT / "cases/checks/cantilever.toml").read_text(encoding="utf-8")
    text = text.replace("[materials.steel]", 'ball = ["0 mm", "0 mm", "600 mm"]\n\n[materials.steel]', 1)
    text += '[masses]\nball = { at = "ball", mass = "1 kg" }\n[springs]\n'
    text += 'soft = { at = "ball", to = "tip", direction = "ux", stiffness = "1 kN/m" }\n'
    text = text.replace("[supports]", '[supports]\nball = ["uy", "uz"]', 1)
    path = tmp_path / "both.toml"
    path.write_text(text, encoding="utf-8")
    ready = prepare(read_case(path))
    assert "ball.ux" in ready.problem.system.names
    assert ready.problem.system.free.shape[1] == 0
    drawn = output_geometry(ready.model)
    assert len(drawn.node) == 9 + 1
    assert drawn.cells().tolist() == [-1, 0]
    assert run(read_case(path)).status.ok


def test_unsupported_mass_falls_freely(tmp_path):
    """Rigid-body motion of a single node: x = g t^2/2."""
    path = tmp_path / "falling.toml"
    path.write_text("""
format = 1
[nodes]
stone = [0, 0, 0]
[masses]
stone = { at = "stone", mass = "2 kg" }
[run]
speed = "60 rpm"
revolutions = 0.2
steps_per_revolution = 100
gravity = [0, "-9.81 m/s^2", 0]
start = { velocity = { "stone.ux" = "1 m/s" } }
[output]
probes = ["stone"]
""", encoding="utf-8")  # fmt: skip
    ready = prepare(read_case(path))
    assert ready.problem.system.names == ("stone.ux", "stone.uy", "stone.uz")
    assert ready.problem.system.free.shape == (3, 3)
    response = run(read_case(path))
    np.testing.assert_allclose(response["stone.uy"].displacement, -0.5 * 9.81 * response.time**2, atol=1e-12)
    np.testing.assert_allclose(response["stone.ux"].displacement, response.time, atol=1e-12)


def test_active_unknowns_have_inertia_or_spring(write_train):
    """A body with rotary inertia rotates; a massless point moves along its springs."""
    turning = write_train(
        ('mass = "0.25 kg" }', 'mass = "0.25 kg", inertia = ["0 kg m^2", "1e-5 kg m^2", "1e-5 kg m^2"] }')
    )
    assert prepare(read_case(turning)).problem.system.names[:3] == ("tappet.uy", "tappet.ry", "tappet.rz")
    light = write_train(('m2 = { at = "rocker", mass = "0.18 kg" }\n', ""))
    case = read_case(light, SHORT)
    assert prepare(case).problem.system.names == ("tappet.uy", "rocker.uy", "valve.uy")
    two = 1.0 / (1.0 / 4e6 + 1.0 / 4e6)
    M, K = np.diag([0.25, 0.21]), np.array([[two, -two], [-two, two + 2.3e4]])
    expected = np.sqrt(np.linalg.eigvals(np.linalg.solve(M, K)).real.min()) / (2.0 * math.pi)
    assert modes(case).modes.frequencies[0] == pytest.approx(expected, rel=1e-9)


def test_rigid_model_keeps_springs_without_link(write_train):
    # The tolerance is that of cubic interpolation between two steps.
    assert deviation(read_case(LI, SHORT), "valve.uy").lift == pytest.approx(5.5e-3, rel=1e-6)
    loose = write_train(('stiffness = "4e6 N/m", link = true }\nk4', 'stiffness = "4e6 N/m" }\nk4'))
    # Static displacement of the springs k3 and k4 in series.
    expected = 5.5e-3 * 4e6 / (4e6 + 23e3)
    assert deviation(read_case(loose, SHORT), "valve.uy").lift == pytest.approx(expected, rel=1e-6)


INVALID = [
    (("axis = [1, 0, 0]\n", ""), "a cam at 'camshaft' on no member"),
    (('model = "bilateral", stiffness = "4e6 N/m"', 'model = "unilateral", stiffness = "hertz"'), "has no base_radius and no follower and no width"),
    (('follower = "tappet"', 'follower = "camshaft"'), "nothing that moves"),
    (('stiffness = "23 kN/m"', 'stiffness = "23 kN/m", link = true'), "a link with an end"),
    (('stiffness = "23 kN/m"', 'stiffness = "23 kN/m", installed_force = "1 N", installed_compression = "1 mm"'), "either installed_force or"),
]  # fmt: skip


@pytest.mark.parametrize(("pair", "words"), INVALID)
def test_invalid_lumped_train_is_refused(write_train, pair, words):
    with pytest.raises(InputError, match=words):
        run(read_case(write_train(pair), SHORT))


def test_hertz_contact_requires_member(write_train):
    path = write_train(
        ('model = "bilateral", stiffness = "4e6 N/m"', 'model = "unilateral", stiffness = "hertz"'),
        ("[contacts]", 'base_radius = "20 mm"\nwidth = "12 mm"\nfollower = { type = "flat" }\n[contacts]'),
    )
    with pytest.raises(InputError, match="The material is that of the member"):
        prepare(read_case(path))


def test_installed_compression_gives_installed_force(write_train):
    path = write_train(('stiffness = "23 kN/m"', 'stiffness = "23 kN/m", installed_compression = "10 mm"'))
    assert build_model(read_case(path)).springs["k4"].installed_force == pytest.approx(230.0, rel=1e-12)


def test_spring_with_mass_requires_no_other_mass(tmp_path):
    """A coil fixed at one end has the first frequency sqrt(k/m)/4 (Wahl 1963), and its run conserves energy."""
    text = """
        format = 1
        nodes = { end = [0.0, 0.0, 0.0] }
        supports = { end = ["ux", "uz"] }
        springs.coil = { at = "end", direction = "uy", stiffness = "40 kN/m", mass = "60 g", elements = 16 }
        loads.push = { at = "end", direction = "uy", force = "-10 N" }
        run = { speed = "3000 rpm", revolutions = 1, steps_per_revolution = 720, start = "rest" }
        output.probes = ["end"]
    """
    (tmp_path / "coil.toml").write_text(text, encoding="utf-8")
    case = read_case(tmp_path / "coil.toml")
    assert modes(case, 1).modes.frequencies[0] == pytest.approx(math.sqrt(40e3 / 0.06) / 4.0, rel=1e-3)
    response = run(case)
    assert response.status.ok
    assert np.abs(response.channels["energy.residual"]).max() < 1e-9
    (tmp_path / "coil.toml").write_text(text.replace(', mass = "60 g", elements = 16', ""), encoding="utf-8")
    with pytest.raises(InputError, match="a spring with mass"):
        read_case(tmp_path / "coil.toml")
