"""info, schema, check's resolved case, export, modes with files, MAC and prestress, versions, progress."""

from __future__ import annotations

import csv
import math
import re
import sys
import tomllib
from importlib.metadata import version

import numpy as np
import pytest

from flexcam import read_result


def test_info(flexcam, result):
    told = flexcam("info", result, "--json")
    assert (told.code, told.err) == (0, "")
    assert told.json["run"] == "done"
    assert (told.json["saved_steps"], told.json["saved_fields"]) == (721, 37)
    assert told.json["probes"]["valve"] == ["valve"]
    assert told.json["channels"]["contacts.intake.force"] == "N"
    assert told.json["case"]["run"]["speed"] == pytest.approx(100.0 * math.pi)
    words = flexcam("info", result).out
    assert [word for word in ("721", "37", "valve", "contacts.intake.force") if word not in words] == []


def references(node):
    """Yield every $ref inside a schema."""
    if isinstance(node, dict):
        yield from [node["$ref"]] if isinstance(node.get("$ref"), str) else []
        node = list(node.values())
    for part in node if isinstance(node, list) else ():
        yield from references(part)


def test_schema(flexcam):
    """Every reference leads somewhere, every table is closed, every key has a type or a reference."""
    told = flexcam("schema")
    assert (told.code, told.err) == (0, "")
    schema = told.json
    assert schema["$schema"].startswith("https://json-schema.org/")
    assert {ref.removeprefix("#/$defs/") for ref in references(schema)} <= set(schema["$defs"])
    for name, table in schema["$defs"].items():
        if table.get("type") == "object":
            assert table["additionalProperties"] is False, name
            assert table.get("description"), name
        for key, one in table.get("properties", {}).items():
            assert one.keys() & {"type", "$ref", "anyOf", "oneOf", "allOf", "const", "enum"}, (name, key)


def test_schema_knows_the_keys_of_a_case(flexcam, case):
    schema = flexcam("schema").json
    raw = tomllib.loads(case.read_text(encoding="utf-8"))
    assert set(raw) <= set(schema["properties"])
    assert set(raw["rockers"]["rocker"]) <= set(schema["$defs"]["LumpedRecord"]["properties"])
    assert set(raw["cams"]["intake"]) <= set(schema["$defs"]["CamRecord"]["properties"])


def test_the_resolved_case_is_a_case(flexcam, case, result, tmp_path):
    """Printed in SI with all defaults, read back it gives the same result bit for bit or to a rounded input."""
    assert "# the case" not in flexcam("check", "case.toml").out
    told = flexcam("check", "case.toml", "--echo")
    (tmp_path / "again.toml").write_text(told.out[told.out.index("# the case") :], encoding="utf-8")
    assert flexcam("run", "again.toml", "-o", "out").code == 0
    one, other = read_result(result).response, read_result(tmp_path / "out/again.vtkhdf").response
    assert np.array_equal(one.time, other.time)
    for series in ("displacement", "velocity", "acceleration"):
        a, b = getattr(one.probes, series), getattr(other.probes, series)
        assert np.abs(a - b).max() <= 1e-12 * np.abs(a).max()


def table(path):
    with path.open(encoding="utf-8", newline="") as file:
        head, *rows = csv.reader(file)
    return dict(zip(head, np.array(rows, dtype=float).T, strict=True))


def test_csv(flexcam, result):
    assert flexcam("export", result, "--format", "csv").code == 0
    read, columns = read_result(result).response, table(result.with_suffix(".csv"))
    assert np.array_equal(columns["time [s]"], read.time)
    assert np.array_equal(columns["cam angle [deg]"], np.degrees(read.angle))
    units = {"displacement": "m", "velocity": "m/s", "acceleration": "m/s^2"}
    for quantity, unit in units.items():
        assert np.array_equal(columns[f"valve {quantity} [{unit}]"], getattr(read["valve"], quantity))
        assert np.array_equal(columns[f"cam.uy {quantity} [{unit}]"], getattr(read["cam.uy"], quantity))
        turned = unit.replace("m", "rad", 1)
        assert np.array_equal(columns[f"cam.rx {quantity} [{turned}]"], getattr(read["cam.rx"], quantity))
    assert np.array_equal(columns["contacts.intake.torque [N m]"], read.channels["contacts.intake.torque"])


def test_csv_of_some_probes(flexcam, result):
    assert flexcam("export", result, "--format", "csv", "--probe", "cam.uy", "--json").code == 0
    named = {head.split(" ")[0] for head in table(result.with_suffix(".csv"))}
    energies = {name for name in named if name.startswith("energy.")}
    assert len(energies) == 7
    contact = {"contacts.intake.force", "contacts.intake.torque"}
    shaft = {"cams.intake.twist", "cams.intake.deflection", "supports.drive.torque"}
    assert (
        named - energies - {"members.pushrod.compression", "members.pushrod.buckling_use"}
        == {"time", "cam", "cam.uy"} | contact | shaft
    )


def test_pvd_of_some_fields(flexcam, result):
    files = flexcam("export", result, "--every", "12", "--field", "displacement", "--json").json["files"]
    assert len(files) == 1 + 4  # 37 instants: 0, 12, 24, 36
    text = (result.parent.parent / files[1]).read_text(encoding="utf-8")
    assert 'Name="displacement"' in text
    assert 'Name="velocity"' not in text


def test_modes_for_paraview(flexcam, case, tmp_path):
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


def test_modes_are_not_overwritten(flexcam, case):
    assert flexcam("modes", "case.toml", "-o", "out").code == 0
    assert flexcam("modes", "case.toml", "-o", "out").code == 2
    assert flexcam("modes", "case.toml", "-o", "out", "--overwrite").code == 0


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
def test_prestress_of_a_pinned_pushrod(flexcam, column, share, factor):
    """F sqrt(1 - P/P_cr); at 16 elements their own error, (pi/16)^4/720 = 2e-6 of P_cr, is 2e-5 of 1 - 0.9."""
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
    assert "what gives way is members.pushrod, along" in done.err


def test_mac_with_itself(flexcam, column):
    """Unequal Iy and Iz part all frequencies, and a uniform mesh makes the shapes of a plane orthogonal by points."""
    name = column(0.0001)
    told = flexcam("modes", name, "--count", "4", "--mac", name, "--json").json
    found = np.array(told["mac"])
    assert np.diff(told["frequencies_hz"]).min() > 1.0
    assert np.abs(np.diag(found) - 1.0).max() <= 1e-12
    assert np.abs(found - np.eye(4)).max() <= 1e-9  # sums of sines over equal parts, rounding of the shapes


def test_mac_says_at_how_many_nodes_it_compares(flexcam, column, tmp_path):
    """Elements of other lengths share few nodes; there, shapes of one plane look alike."""
    text = (tmp_path / (name := column(0.0001))).read_text(encoding="utf-8")
    finer = re.sub(r"elements = (\d+)", lambda found: f"elements = {int(found[1]) + 1}", text)
    assert finer != text
    (tmp_path / "finer.toml").write_text(finer, encoding="utf-8")
    assert "fewer than modes" in flexcam("modes", name, "--count", "4", "--mac", "finer.toml").out
    assert "fewer than modes" not in flexcam("modes", name, "--count", "4", "--mac", name).out


def test_version_names_what_computes(flexcam):
    told = flexcam("--version").out
    assert [one for one in ("numpy", "scipy", "h5py") if f"{one} {version(one)}" not in told] == []
    assert told.startswith(f"flexcam {version('flexcam')}")


def test_no_bar_where_nobody_looks(flexcam, case):
    done = flexcam("run", "case.toml", "-o", "out")
    assert done.err == ""
    assert "\x1b" not in done.out


COUNTED = {
    "response": ("campbell", "--response", "--count", "2"),
    "campbell": ("campbell", "--count", "2"),
    "sensitivity": ("sensitivity", "--of", "deviation.peak", "--to", "masses.valve.mass"),
    "optimize": ("optimize", "--vary", "masses.valve.mass=80:90g", "--least", "frequency.1", "--evaluations", "24"),
}


@pytest.mark.parametrize("verb", COUNTED)
def test_many_runs_are_counted_where_somebody_looks(verb, flexcam, case, monkeypatch):
    monkeypatch.setattr(sys.stderr.__class__, "isatty", lambda _: True)
    command, *options = COUNTED[verb]
    done = flexcam(command, case, *options, "--set", "run.steps_per_revolution=360")
    assert done.code == 0
    assert re.search(r"(speeds|variants) .*\d+/\d+", done.err)


def test_laws_side_by_side(flexcam):
    found = flexcam("law", "--list", "--json").json["laws"]
    assert found["4-5-6-7"]["Cv"] == pytest.approx(35 / 16, rel=1e-12)
    assert found["parabolic"]["Cj"] is None
    assert "modified-trapezoid" in flexcam("law", "--list").out


def test_one_law(flexcam):
    found = flexcam("law", "cycloidal", "--json").json
    assert {"Cv", "Ca", "Cj", "Cm", "extremes", "end_conditions", "symmetric"} <= set(found)
    assert found["Ca"] == pytest.approx(6.283185307179586, rel=1e-12)
    assert "symmetric" in flexcam("law", "cycloidal").out


def test_an_unknown_law(flexcam):
    done = flexcam("law", "cycloid")
    assert done.code == 2
    assert "did you mean 'cycloidal'?" in done.err
