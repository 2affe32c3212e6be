"""A valve train of watch size, in millimetres and milligrams: no printed value is rounded to zero. Units of tables."""

import re

import pytest

WATCH = """
format = 1
nodes = { a = [0, 0, 0], cam = [0, 0, 8e-4], b = [0, 0, 1.6e-3], f = [9e-4, 0, 8e-4], g = [3.9e-3, 0, 8e-4] }
materials.steel = { E = "200 GPa", nu = 0.3, density = 7800 }
sections.arbor = { shape = "circle", diameter = "0.4 mm" }
sections.rod = { shape = "circle", diameter = "0.15 mm" }
members.arbor = { nodes = ["a", "cam", "b"], material = "steel", section = "arbor" }
members.rod = { nodes = ["f", "g"], material = "steel", section = "rod" }
supports = { a = ["ux", "uy", "uz", "rz"], b = ["ux", "uy"], f = ["uy", "uz", "rx", "ry", "rz"], g = ["uy", "uz"] }
masses.pointer = { at = "g", mass = "2 mg" }
springs.return = { at = "g", direction = "ux", stiffness = "0.05 N/mm", installed_force = "0.01 N" }
cams.c = { at = "cam", law = "cycloidal", lift = "0.15 mm", rise = "60 deg", return = "60 deg" }
contacts.c = { cam = "c", follower = "f", model = "bilateral", stiffness = "10 MN/m" }
run = { speed = "600 rpm", revolutions = 0.5, steps_per_revolution = 720, start = "equilibrium" }
output.probes = ["g", "cam"]
"""


def test_small_values_are_printed_with_enough_digits(flexcam, tmp_path):
    (tmp_path / "watch.toml").write_text(WATCH, encoding="utf-8")
    run = flexcam("run", "watch.toml").out
    assert re.search(r"g\.ux +-?0\.0000 mm +0\.1[45]\d+ mm", run)
    minimum, maximum = map(float, re.search(r"cam\.ux +(-[\d.]+) mm +(-[\d.]+) mm", run).groups())
    assert -5e-5 < minimum < maximum < -1e-7
    masses = re.search(r"^1 +[\d.]+ +\d+ +([\d.]+)", flexcam("modes", "watch.toml", "--count", "2").out, re.MULTILINE)
    assert 2e-6 < float(masses[1]) < 3e-6, "of pointer and rod"
    output = flexcam("compare", "watch.toml").out
    assert 0.0 < float(re.search(r"deviates by up to (\S+) % of the range", output)[1]) < 5e-2


def test_imperial_units_of_run_tables(flexcam, tmp_path):
    """Imperial units on request; the next command of the same process prints metric units."""
    (tmp_path / "watch.toml").write_text(WATCH, encoding="utf-8")
    metric = flexcam("run", "watch.toml").out
    imperial = flexcam("run", "watch.toml", "--units", "imperial", "--overwrite").out
    lift, inches = (float(re.search(r"g\.ux +-?[\d.]+ \w+ +([\d.]+) ", text)[1]) for text in (metric, imperial))
    assert inches == pytest.approx(lift / 25.4, rel=2e-2)  # digits of the table
    assert "lbf" in imperial
    assert " mm" not in imperial
    assert "lbf" not in flexcam("run", "watch.toml", "--overwrite").out
    refused = flexcam("plot", "watch.toml", "--what", "orbits", "--units", "imperial")
    assert refused.code == 2
    assert "--units" in refused.err


@pytest.mark.parametrize("command", ["check", "cam", "modes", pytest.param("limits", marks=pytest.mark.slow)])
def test_imperial_units_of_tables_without_run(flexcam, tmp_path, command):
    """No table prints a metric unit if imperial units are requested; 24 mm and 52 kN/m by hand."""
    flexcam("new", "pushrod-engine", "-o", "engine.toml")
    fast = ("--lowest", "4900 rpm", "--highest", "5100 rpm", "--set", "run.steps_per_revolution=360")
    options = (*fast, "--lift-deviation", "1 in") if command == "limits" else ()
    done = flexcam(command, "engine.toml", *options, "--units", "imperial")
    assert (done.code, done.err) == (0, "")
    assert not re.findall(r"[\d )](mm\S*|N|N/m+|kg|m/s\S*|MPa)\b", done.out.replace("above 1 mm", ""))
    expected = {"check": "valve 285.507 lbf/in", "cam": "below 0.75", "modes": "ux lb", "limits": "more than 1 in"}
    assert expected[command] in " ".join(done.out.split())


@pytest.mark.slow
def test_imperial_units_of_figures_without_run(flexcam, tmp_path):
    flexcam("new", "pushrod-engine", "-o", "engine.toml")
    for what, expected in (("spring", "force, lbf"), ("svaj", "in/rad²"), ("profile", "x, in")):
        assert flexcam("plot", "engine.toml", "--what", what, "--units", "imperial", "-o", f"{what}.svg").code == 0
        picture = (tmp_path / f"{what}.svg").read_text()
        assert expected in picture
        assert not re.search(r"\bmm\b", picture)
