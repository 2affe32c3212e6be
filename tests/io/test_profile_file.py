"""Cam profiles as CSV, DXF and VTK, read back by numpy, ezdxf and VTK."""

import csv
import math

import ezdxf
import numpy as np
import pytest
from ezdxf import units

from flexcam.analysis.cam_analysis import profile_table
from flexcam.cams import LAWS, FlatFollower, LiftEvent, RollerFollower, SwingRollerFollower, cam_profile
from flexcam.core.errors import InputError
from flexcam.io import ProfileTable, read_profile, write_profile

pyvista = pytest.importorskip("pyvista")

EVENT = LiftEvent(LAWS["3-4-5"], lift=0.006, rise=1.5, fall=1.4, dwell=0.2, phase=0.7)
FOLLOWERS = {
    "flat": (FlatFollower(0.018), 1),
    "roller": (RollerFollower(0.018, 0.009, 0.002), -1),
    "swinging roller": (SwingRollerFollower(0.02, 0.009, 0.05, 0.055), 1),
}
CUTTER = 0.04
PRINT_ROUNDING = 6e-12
"""Numbers are written with twelve digits: the error is at most half a unit of the last, 5e-12."""

HEADERS = [
    "cam angle [deg]", "lift [mm]", "velocity [mm/rad]", "acceleration [mm/rad^2]", "radius of curvature [mm]",
    "pressure angle [deg]", "lever arm of contact force [mm]", "sliding velocity [mm/rad]",
]  # fmt: skip


@pytest.fixture(params=FOLLOWERS.values(), ids=FOLLOWERS.keys())
def profile(request):
    follower, turn = request.param
    return cam_profile(EVENT, follower, count=120, turn=turn)


@pytest.fixture
def curves(profile):
    """Return the closed curves that a file must contain, m, shape (n, 2)."""
    found = {"profile": profile.points}
    if not isinstance(profile.follower, FlatFollower):
        found["pitch curve"] = profile.pitch
    return {**found, "cutter path": profile.points + CUTTER * profile.normals}


@pytest.fixture
def files(profile, tmp_path):
    """Write all formats and return their paths by suffix."""
    paths = write_profile(profile_table(profile, CUTTER), tmp_path / "of.a cam", ["vtp", "csv", "dxf"])
    assert [path.name for path in paths] == ["of.a cam.vtp", "of.a cam.csv", "of.a cam.dxf"]
    assert sorted(tmp_path.iterdir()) == sorted(paths)
    return {path.suffix: path for path in paths}


def test_csv_contains_profile_and_motion(files, profile, curves):
    with files[".csv"].open(encoding="utf-8", newline="") as file:
        head, *rows = csv.reader(file)
    assert head == HEADERS + [f"{name} {axis} [mm]" for name in curves for axis in "xy"]
    table = dict(zip(head, np.array(rows, dtype=float).T, strict=True))
    assert len(rows) == 120
    expected = {
        "cam angle [deg]": np.arange(120) * 3.0,
        "lift [mm]": 1e3 * EVENT(profile.angle),
        "velocity [mm/rad]": 1e3 * EVENT(profile.angle, 1),
        "acceleration [mm/rad^2]": 1e3 * EVENT(profile.angle, 2),
        "radius of curvature [mm]": 1e3 * profile.radius,
        "pressure angle [deg]": np.degrees(profile.pressure_angle),
        "lever arm of contact force [mm]": 1e3 * profile.offset,
        "sliding velocity [mm/rad]": 1e3 * profile.touch.sliding,
    }
    expected |= {f"{name} {axis} [mm]": 1e3 * xy[:, i] for name, xy in curves.items() for i, axis in enumerate("xy")}
    assert expected.keys() == table.keys()
    for name, values in expected.items():
        np.testing.assert_allclose(table[name], values, rtol=PRINT_ROUNDING, atol=1e-9, err_msg=name)


def test_dxf_contains_closed_curves_in_layers(files, profile, curves):
    """The drawing in millimetres has no faults, and each curve is closed and in its own layer."""
    drawing = ezdxf.readfile(files[".dxf"])
    assert drawing.units == units.MM
    assert drawing.header["$INSUNITS"] == 4
    assert not drawing.audit().errors
    lines = {line.dxf.layer: line for line in drawing.modelspace().query("LWPOLYLINE")}
    assert lines.keys() == curves.keys()
    assert len(drawing.modelspace()) == len(curves) + 1
    for name, points in curves.items():
        assert lines[name].closed
        assert not any(bulge for *_, bulge in lines[name].get_points("xyb"))
        np.testing.assert_allclose(np.array(lines[name].get_points("xy")), 1e3 * points, rtol=0.0, atol=1e-9)
    (circle,) = drawing.modelspace().query("CIRCLE")
    assert circle.dxf.layer == "base circle"
    assert circle.dxf.radius == pytest.approx(1e3 * profile.follower.base_radius, rel=1e-12)
    assert tuple(circle.dxf.center) == (0.0, 0.0, 0.0)
    colours = [drawing.layers.get(name).color for name in (*curves, "base circle")]
    assert len(set(colours)) == len(colours)


def test_vtp_contains_exact_closed_lines(files, profile, curves):
    """Points are in metres and exact; each curve is a closed line."""
    read = pyvista.read(files[".vtp"])
    assert read.n_lines == read.n_cells == len(curves)
    assert read.cell_data["curve"].tolist() == list(range(len(curves)))
    assert set(read.point_data.keys()) == set(HEADERS), "with their units"
    for i, points in enumerate(curves.values()):
        at = read.get_cell(i).point_ids
        line = read.points[at]
        assert np.array_equal(line[0], line[-1])
        assert np.array_equal(line[:-1, :2], points)
        assert not line[:, 2].any()
        assert np.array_equal(read.point_data["lift [mm]"][at][:-1], 1e3 * profile.lift)
        assert np.array_equal(read.point_data["pressure angle [deg]"][at][:-1], np.degrees(profile.pressure_angle))
        assert np.array_equal(read.point_data["cam angle [deg]"][at], np.degrees([*profile.angle, 0.0]))
    # The length of a convex curve is between twice its width and the perimeter of its bounding box.
    length = read.compute_cell_sizes(length=True)["Length"][0]
    across = np.ptp(profile.points, axis=0)
    assert 2.0 * across.max() < length < 2.0 * across.sum()


def test_infinite_radius_is_written_as_number(tmp_path):
    """A spreadsheet would read an infinite radius as text."""
    profile = cam_profile(EVENT, FlatFollower(0.018), count=12)
    profile.touch.radius[3] = math.inf
    (path,) = write_profile(profile_table(profile), tmp_path / "a", ["csv"])
    column = np.loadtxt(path, delimiter=",", skiprows=1)[:, HEADERS.index("radius of curvature [mm]")]
    assert np.isfinite(column).all()
    assert column[3] > 1e9


def square():
    corners = 0.01 * np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
    return ProfileTable({"profile": corners}, 0.007, {"height [mm]": np.arange(4.0)})


@pytest.mark.parametrize("taken", ["csv", "dxf", "vtp"])
def test_existing_file_is_overwritten_only_on_request(taken, tmp_path):
    """If one file exists, none is written."""
    old = tmp_path / f"a.{taken}"
    old.write_text("mine")
    with pytest.raises(InputError, match="overwrite") as refusal:
        write_profile(square(), tmp_path / "a", ["csv", "dxf", "vtp"])
    assert str(old) in str(refusal.value)
    assert [path.read_text() for path in tmp_path.iterdir()] == ["mine"]
    assert len(write_profile(square(), tmp_path / "a", ["csv", "dxf", "vtp"], overwrite=True)) == 3
    assert old.read_bytes() != b"mine"
    assert len(list(tmp_path.iterdir())) == 3


@pytest.mark.parametrize("forms", [["dxf"], ["csv", "vtp"]])
def test_only_requested_formats_are_written(forms, tmp_path):
    write_profile(square(), tmp_path / "a", forms)
    assert {path.suffix[1:] for path in tmp_path.iterdir()} == set(forms)


def test_table_of_one_curve_is_written(tmp_path):
    files = write_profile(square(), tmp_path / "a", ["csv", "dxf", "vtp"])
    assert files[0].read_text().splitlines() == [
        "height [mm],profile x [mm],profile y [mm]", "0,10,0", "1,0,10", "2,-10,0", "3,0,-10"
    ]  # fmt: skip
    assert len(ezdxf.readfile(files[1]).modelspace().query("LWPOLYLINE")) == 1
    assert pyvista.read(files[2]).points.tolist()[0] == pyvista.read(files[2]).points.tolist()[-1] == [0.01, 0.0, 0.0]


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_line_numbers_are_those_of_editors(end, tmp_path):
    """Python ends lines at further characters."""
    path = tmp_path / "points.csv"
    path.write_bytes(end.join(["# \x0b\x0c\x1c\x85\u2028\u2029", "x_mm, y_mm", "10, 0", "0, x"]).encode())
    with pytest.raises(InputError) as refused:
        read_profile(path)
    assert [fault.where for fault in refused.value.faults] == ["points.csv, line 4"]


@pytest.mark.parametrize("head", ["x in mm, y in mm", "x [mm], y [mm]", "x_mm, y", "x, y in mm"])
def test_unit_is_last_word_of_header(head, tmp_path):
    """The word "in" of a header does not mean inches."""
    path = tmp_path / "points.csv"
    path.write_text(f"{head}\n10, 0\n0, 10\n-10, 0\n", encoding="utf-8")
    assert np.array_equal(read_profile(path), [[0.01, 0.0], [0.0, 0.01], [-0.01, 0.0]])
    assert np.array_equal(read_profile(path, unit="mm"), read_profile(path))


@pytest.mark.parametrize("unit", ["um", "µm", "μm"])
def test_micrometre_units_are_recognized(unit, tmp_path):
    path = tmp_path / "profile.csv"
    path.write_text(f"x [{unit}], y [{unit}]\n1000, 0\n0, 1000\n-1000, 0\n", encoding="utf-8")
    assert read_profile(path)[0].tolist() == [1e-3, 0.0]
