"""Commands on result and case files: info, check, schema, check --echo, export; versions and progress."""

import csv
import math
import re
import sys
import tomllib
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest

from flexcam import prepare, read_case, read_result
from flexcam.valvetrain.springs import spring_curve
from tests.thinning import slow_if


def test_info_of_result(flexcam, result):
    done = flexcam("info", result, "--json")
    assert (done.code, done.err) == (0, "")
    assert done.json["run"] == "done"
    assert (done.json["saved_steps"], done.json["saved_fields"]) == (721, 37)
    assert done.json["probes"]["valve"] == ["valve"]
    assert done.json["channels"]["contacts.intake.force"] == "N"
    assert done.json["case"]["run"]["speed"] == pytest.approx(100.0 * math.pi)
    words = flexcam("info", result).out
    assert [word for word in ("721", "37", "valve", "contacts.intake.force") if word not in words] == []


def references(node):
    """Yield every $ref inside a schema."""
    if isinstance(node, dict):
        yield from [node["$ref"]] if isinstance(node.get("$ref"), str) else []
        node = list(node.values())
    for part in node if isinstance(node, list) else ():
        yield from references(part)


def test_schema_is_closed_and_complete(flexcam):
    """Every reference resolves, every table is closed, every key has a type or a reference."""
    done = flexcam("schema")
    assert (done.code, done.err) == (0, "")
    schema = done.json
    assert schema["$schema"].startswith("https://json-schema.org/")
    assert {ref.removeprefix("#/$defs/") for ref in references(schema)} <= set(schema["$defs"])
    for name, table in schema["$defs"].items():
        if table.get("type") == "object":
            assert table["additionalProperties"] is False, name
            assert table.get("description"), name
        for key, definition in table.get("properties", {}).items():
            assert definition.keys() & {"type", "$ref", "anyOf", "oneOf", "allOf", "const", "enum"}, (name, key)


def test_schema_contains_keys_of_case(flexcam, case):
    schema = flexcam("schema").json
    raw = tomllib.loads(case.read_text(encoding="utf-8"))
    assert set(raw) <= set(schema["properties"])
    assert set(raw["rockers"]["rocker"]) <= set(schema["$defs"]["LumpedRecord"]["properties"])
    assert set(raw["cams"]["intake"]) <= set(schema["$defs"]["CamRecord"]["properties"])


def test_echoed_case_gives_same_result(flexcam, case, result, tmp_path):
    """The case printed in SI units with all defaults gives the same result bit for bit or up to rounded input."""
    assert "# the case" not in flexcam("check", "case.toml").out
    done = flexcam("check", "case.toml", "--echo")
    (tmp_path / "again.toml").write_text(done.out[done.out.index("# the case") :], encoding="utf-8")
    assert "fidelity.masses" not in flexcam("check", "again.toml").out, "warned of its own defaults"
    assert flexcam("run", "again.toml", "-o", "out").code == 0
    original, resolved = read_result(result).response, read_result(tmp_path / "out/again.vtkhdf").response
    assert np.array_equal(original.time, resolved.time)
    for series in ("displacement", "velocity", "acceleration"):
        expected, actual = getattr(original.probes, series), getattr(resolved.probes, series)
        assert np.abs(expected - actual).max() <= 1e-12 * np.abs(expected).max()


def table(path):
    with path.open(encoding="utf-8", newline="") as file:
        head, *rows = csv.reader(file)
    return dict(zip(head, np.array(rows, dtype=float).T, strict=True))


def test_csv_export_of_all_probes(flexcam, result):
    assert flexcam("export", result, "--format", "csv").code == 0
    response, columns = read_result(result).response, table(result.with_suffix(".csv"))
    assert np.array_equal(columns["time [s]"], response.time)
    assert np.array_equal(columns["cam angle [deg]"], np.degrees(response.angle))
    units = {"displacement": "m", "velocity": "m/s", "acceleration": "m/s^2"}
    for quantity, unit in units.items():
        assert np.array_equal(columns[f"valve {quantity} [{unit}]"], getattr(response["valve"], quantity))
        assert np.array_equal(columns[f"cam.uy {quantity} [{unit}]"], getattr(response["cam.uy"], quantity))
        angular_unit = unit.replace("m", "rad", 1)
        assert np.array_equal(columns[f"cam.rx {quantity} [{angular_unit}]"], getattr(response["cam.rx"], quantity))
    assert np.array_equal(columns["contacts.intake.torque [N m]"], response.channels["contacts.intake.torque"])


def test_csv_export_of_selected_probes(flexcam, result):
    assert flexcam("export", result, "--format", "csv", "--probe", "cam.uy", "--json").code == 0
    quantities = {head.split(" ")[0] for head in table(result.with_suffix(".csv"))}
    energies = {name for name in quantities if name.startswith("energy.")}
    assert len(energies) == 7
    contact = {"contacts.intake.force", "contacts.intake.torque"}
    shaft = {"cams.intake.twist", "cams.intake.deflection", "supports.drive.torque"}
    assert (
        quantities - energies - {"members.pushrod.compression", "members.pushrod.buckling_use"}
        == {"time", "cam", "cam.uy"} | contact | shaft
    )


def test_pvd_export_of_selected_fields(flexcam, result):
    files = flexcam("export", result, "--every", "12", "--field", "displacement", "--json").json["files"]
    assert len(files) == 1 + 4  # 37 instants: 0, 12, 24, 36
    text = (result.parent.parent / files[1]).read_text(encoding="utf-8")
    assert 'Name="displacement"' in text
    assert 'Name="velocity"' not in text


def test_version_lists_numerical_packages(flexcam):
    output = flexcam("--version").out
    assert [package for package in ("numpy", "scipy", "h5py") if f"{package} {version(package)}" not in output] == []
    assert output.startswith(f"flexcam {version('flexcam')}")


def test_no_progress_bar_without_terminal(flexcam, case):
    done = flexcam("run", "case.toml", "-o", "out")
    assert done.err == ""
    assert "\x1b" not in done.out


STUDY_OPTIONS = {
    "response": ("campbell", "--response", "--count", "2"),
    "campbell": ("campbell", "--count", "2"),
    "sensitivity": ("sensitivity", "--of", "deviation.peak", "--to", "masses.valve.mass", "--method", "differences"),
    "optimize": ("optimize", "--vary", "masses.valve.mass=80:90g", "--least", "frequency.1", "--evaluations", "24"),
}


@pytest.mark.parametrize(
    "verb",
    slow_if(lambda one: STUDY_OPTIONS[one][0] != "campbell", STUDY_OPTIONS),
)
def test_studies_show_progress_on_terminal(verb, flexcam, case, monkeypatch):
    monkeypatch.setattr(sys.stderr.__class__, "isatty", lambda _: True)
    command, *options = STUDY_OPTIONS[verb]
    done = flexcam(command, case, *options, "--set", "run.steps_per_revolution=360")
    assert done.code == 0
    assert re.search(r"(speeds|variants) .*\d+/[\d?]+", done.err)


def test_name_option_sets_result_name(flexcam, tmp_path):
    """Two runs of a case in one folder have two names; a name with a path or the suffix `.partial` is refused."""
    case = Path(__file__).parents[1] / "data/inline.toml"
    args = ("run", case, "-o", "out", "--set", "run.revolutions=0.1")
    for name in ((), ("--name", "fast 2")):
        assert flexcam(*args, *name).code == 0
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["fast 2.vtkhdf", "inline.vtkhdf"]
    assert flexcam(*args, "--name", "fast 2").code == 2
    for name in ("../away", "", "a.partial"):
        assert "--name" in flexcam(*args, "--name", name).err


def test_check_lists_published_load(flexcam, tayeb):
    assert re.search(r"Tayeb-Sliman model,\s+from\s+cam\s+intake,\s+acts\s+on\s+tappet", flexcam("check", tayeb(3)).out)


def test_check_prints_installed_rate_of_coil_spring(flexcam, tmp_path):
    """The rate is the slope of the static force at the installed length, where the spring table begins."""
    case = tmp_path / "train.toml"
    assert flexcam("new", "finger-follower", "-o", case).code == 0
    curve = spring_curve(prepare(read_case(case)).model.springs["valve"])
    rate = (np.interp(1e-6, curve.travel, curve.force) - np.interp(0.0, curve.travel, curve.force)) / 1e-6
    printed = float(re.search(r"springs +(?:.*, )?valve ([\d.]+) N/mm", flexcam("check", case).out)[1])
    assert printed == pytest.approx(1e-3 * rate, rel=1e-4)  # five digits are printed
