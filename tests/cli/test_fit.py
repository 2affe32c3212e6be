"""Command fit: a case fitted to the exported result of a run with other values, its files, and refused measurements."""

import numpy as np
import pytest

from flexcam import read_case
from flexcam.core.units import conversion_factor
from flexcam.studies.fitting import read_measurement

CASE = """\
format = 1
nodes = { mass = [0.0, 0.0, 0.0] }
supports = { mass = ["ux", "uz"] }
masses.mass = { at = "mass", mass = "0.1 kg" }
loads.push = { at = "mass", direction = "uy", force = -150.0 }
springs.one = { at = "mass", direction = "uy", stiffness = "40 kN/m", damping = "5 N s/m" }
output = { probes = ["mass"] }
[run]
speed = "3000 rpm"
revolutions = 2
steps_per_revolution = 90
"""
VARIED = ("--vary", "springs.one.stiffness=30:60kN/m", "--vary", "springs.one.damping=1:20 N s/m")


@pytest.fixture
def files(tmp_path, flexcam):
    """Write a case and the exported result of a run with other values; return both paths."""
    case, export = tmp_path / "case.toml", tmp_path / "out/case.csv"
    case.write_text(CASE, encoding="utf-8")
    overrides = ("--set", "springs.one.stiffness=44kN/m", "--set", "springs.one.damping=7N s/m")
    assert flexcam("run", case, "-o", "out", *overrides).code == 0
    assert flexcam("export", "out/case.vtkhdf", "--format", "csv").code == 0
    return case, export


@pytest.mark.slow
def test_fit_recovers_values_of_exported_run(flexcam, files, tmp_path):
    """The exported result has no noise, so the fit finds the values of its run; the fitted case contains them."""
    case, export = files
    column = ("--column", "mass.uy velocity")
    args = ("fit", case, "--to", export, *VARIED, *column)
    done = flexcam(*args, "-o", "best.toml", "--csv", "f.csv", "--plot", "f.svg", "--json")
    assert done.code == 0
    found = {value["key"]: value["value"] for value in done.json["values"]}
    assert found == pytest.approx({"springs.one.stiffness": 44.0, "springs.one.damping": 7.0}, rel=1e-4)
    (curve,) = done.json["curves"]
    assert curve["rms_after"] < 1e-3 * curve["rms_before"]
    best = read_case(tmp_path / "best.toml").record.springs["one"]
    assert (best.stiffness, best.damping) == pytest.approx((44e3, 7.0), rel=1e-4)
    assert (tmp_path / "f.csv").read_text(encoding="utf-8").startswith("time [s],")
    assert "measured" in (tmp_path / "f.svg").read_text(encoding="utf-8")
    shown = flexcam(*args).out
    assert "springs.one.stiffness, kN/m" in shown
    assert "±" in shown


@pytest.mark.slow
def test_fit_warns_of_undetermined_values(flexcam, files):
    """Mass, stiffness, damping and force affect a position only together; one interval excludes the true value."""
    case, export = files
    args = ("fit", case, "--to", export, "--column", "mass.uy displacement")
    keys = {"springs.one.stiffness": "20:80kN/m", "springs.one.damping": "1:20N s/m", "masses.mass.mass": "50:200g",
            "loads.push.force": "-300:-50N"}  # fmt: skip
    shown = flexcam(*args, *(word for key, ends in keys.items() for word in ("--vary", f"{key}={ends}"))).out
    assert f"The curves do not determine {' and '.join(keys)}: leave some of them out" in " ".join(shown.split())
    shown = flexcam(*args, "--vary", "springs.one.damping=1:5.5 N s/m").out
    assert "springs.one.damping is at an end of its --vary range" in shown
    assert "Successive residuals of mass.uy displacement are correlated" in shown


def test_fit_reports_interval_wider_than_range(flexcam, tmp_path):
    """Four points with scatter of their own magnitude permit any damping within the range."""
    (tmp_path / "case.toml").write_text(CASE, encoding="utf-8")
    (tmp_path / "m.csv").write_text("time [s],mass.uy [mm]\n0,3\n0.005,-9\n0.01,4\n0.02,-3\n", encoding="utf-8")
    varied = ("--vary", "springs.one.damping=3:20 N s/m")
    shown = " ".join(flexcam("fit", "case.toml", "--to", "m.csv", *varied).out.split())
    range_text = "3 to 20 N s/m; fit more curves"
    expected = f"springs.one.damping: its 95 % interval is wider than its --vary range, {range_text}"
    assert f"The curves hardly determine {expected}" in shown


def test_fit_over_angle_or_time_in_other_units(flexcam, files, tmp_path):
    """A curve over crank angle in mm of the last revolution, or over time in m, gives the same values."""
    case, export = files
    head, *rows = export.read_text(encoding="utf-8").splitlines()
    names = head.split(",")
    time, angle, place = (names.index(name) for name in ("time [s]", "cam angle [deg]", "mass.uy displacement [m]"))
    cells = [[float(cell) for cell in row.split(",")] for row in rows]
    crank = [f"{2.0 * cell_row[angle]!r},{1e3 * cell_row[place]!r}" for cell_row in cells if cell_row[angle] >= 360.0]
    (tmp_path / "crank.csv").write_text("\n".join(["crank angle [deg],mass.uy [mm]", *crank]), encoding="utf-8")
    seconds = [f"{cell_row[time]!r},{cell_row[place]!r}" for cell_row in cells]
    (tmp_path / "time.csv").write_text("\n".join(["# bench", "time [s],mass.uy displacement [m]", *seconds]))
    for name in ("crank.csv", "time.csv"):
        found = flexcam("fit", case, "--to", name, *VARIED, "--json").json
        assert found["values"][0]["value"] == pytest.approx(44.0, rel=1e-4), name
        assert found["curves"][0]["rms_after"] < 1e-3 * found["curves"][0]["rms_before"]


@pytest.mark.parametrize(("content", "options", "message"), [
    ("angle,mass.uy [m]\n0,1\n", (), "'crank angle', and at least one measured column"),
    ("time [s],mass.uyy [m]\n0,1\n", (), "a name that is no result of the case"),
    ("time [s],mass.uy [N]\n0,1\n", (), "a unit of length such as mm"),
    ("time [s],mass.uy [m]\n0,1\n0,x\n", (), "for each column: time [s], mass.uy"),
    ("time [s],mass.uy [m]\n0,1\n", (), "--to: got 1 measured value, expected at least 3"),
    ("time [s],mass.uy [m]\n0,1\n1,1\n2,1\n", (), "times of the run"),
    ("time [s],mass.uy [m]\n0,1\n", ("--column", "mass.uz"), "--column: got 'mass.uz'"),
    ("time [s],mass.uy [m]\n0,1\n", ("--noise", "mass.uy=much"), "a standard deviation in the unit of the column"),
    ("time [s],mass.uy [m]\n0,1\n", ("--noise", "mass.uy=-1"), "--noise"),
    ("time [s],mass.uy [m]\n0,1\n", ("-o", "best.csv"), "a name that ends in .toml"),
])  # fmt: skip
def test_invalid_measurements_are_refused(flexcam, tmp_path, content, options, message):
    (tmp_path / "case.toml").write_text(CASE, encoding="utf-8")
    (tmp_path / "m.csv").write_text(content, encoding="utf-8")
    done = flexcam("fit", "case.toml", "--to", "m.csv", *VARIED, *options)
    assert done.code in (2, 3)
    assert message in done.err


def write_mdf(path, *groups):
    """Write an MDF4 file with asammdf: a group per list of (name, unit, times, values)."""
    from asammdf import MDF, Signal  # takes half a second, which only one worker needs

    with MDF(version="4.10") as file:
        for group in groups:
            file.append([Signal(np.array(y), np.array(t), unit=unit, name=name) for name, unit, t, y in group])
        file.save(path, overwrite=True)


@pytest.mark.slow
def test_fit_to_mdf_file(flexcam, files, tmp_path):
    """An MDF4 file gives the values of the CSV file: crank angle, another unit and rate, and an unrelated channel."""
    case, export = files
    head, *rows = export.read_text(encoding="utf-8").splitlines()
    cells = np.array([[float(cell) for cell in row.split(",")] for row in rows])
    column = dict(zip(head.split(","), cells.T, strict=True))
    time, place = column["time [s]"], 1e3 * column["mass.uy displacement [m]"]
    last = column["cam angle [deg]"] >= 360.0
    angles = [("crank angle", "deg", time[last], 2.0 * column["cam angle [deg]"][last])]
    write_mdf(tmp_path / "m.mf4", angles, [("mass.uy", "mm", time[1:-1], place[1:-1])], [("oil", "bar", time, place)])
    found = flexcam("fit", case, "--to", "m.mf4", *VARIED, "--column", "mass.uy", "--json").json
    assert found["values"][0]["value"] == pytest.approx(44.0, rel=1e-4)
    (curve,) = read_measurement(tmp_path / "m.mf4", read_case(case), ["mass.uy"]).curves
    np.testing.assert_allclose(curve.values[:-1], 1e-3 * place[last][:-1], rtol=1e-12)
    assert np.isnan(curve.values[-1]), "the channel ends before the angle"


@pytest.mark.parametrize(("channels", "options", "message"), [
    ([("angle", "deg"), ("mass.uy", "m")], (), "a channel 'cam angle' or 'crank angle', with its unit"),
    ([("cam angle", "deg"), ("mass.uyy", "m")], (), "Did you mean"),
    ([("cam angle", "deg"), ("mass.uy", "m")], ("--column", "mass.uyy"), "Did you mean 'mass.uy'?"),
    ([("cam angle", ""), ("mass.uy", "m")], (), "--to, column 'cam angle'"),
    ([], (), "a readable MDF file"),
])  # fmt: skip
def test_invalid_mdf_files_are_refused(flexcam, tmp_path, channels, options, message):
    (tmp_path / "case.toml").write_text(CASE, encoding="utf-8")
    (tmp_path / "m.mf4").write_bytes(b"angle,lift")
    if channels:
        write_mdf(tmp_path / "m.mf4", [(name, unit, [0.0, 0.1], [0.0, 1.0]) for name, unit in channels])
    done = flexcam("fit", "case.toml", "--to", "m.mf4", *VARIED, *options)
    assert done.code == 2
    assert message in done.err


def test_mdf_file_requires_asammdf(flexcam, tmp_path, monkeypatch):
    (tmp_path / "case.toml").write_text(CASE, encoding="utf-8")
    (tmp_path / "m.mf4").touch()
    monkeypatch.setattr("flexcam.core.errors.find_spec", lambda name: None)
    assert "pip install 'flexcam[mdf]'" in flexcam("fit", "case.toml", "--to", "m.mf4", *VARIED).err


def test_conversion_factors():
    assert conversion_factor("kN", "N", "") == 1e3
    assert conversion_factor("m/s^2", "m/s^2", "") == 1.0
    assert conversion_factor("%", "1", "") == 0.01
