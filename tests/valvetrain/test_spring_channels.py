"""Spring channels: force of the part at the moving end, or moment of a rotational spring."""

import json

import numpy as np
import pytest

from flexcam import build_model, prepare, read_case, run
from flexcam.analysis.natural_modes import modes
from flexcam.case.input_checks import check_values
from flexcam.report.tables import model_table

SURGE_SPRING = """
format = 1
[nodes]
mass = [0, 0, 0]
[supports]
mass = ["ux", "uz"]
[masses]
mass = { at = "mass", mass = "0.1 kg" }
[springs]
coil = { at = "mass", direction = "uy", stiffness = "40 kN/m", mass = "60 g", elements = 4, damping = 0.0 }
[run]
speed = "60 rpm"
revolutions = 0.02
steps_per_revolution = 50000
start = { displacement = { "mass.uy" = "1 mm" } }
[output]
probes = ["mass"]
"""
ROTATIONAL_SPRING = """
format = 1
[nodes]
disc = [0, 0, 0]
[supports]
disc = ["ux", "uy", "uz"]
[masses]
disc = { at = "disc", mass = "1 kg", inertia = [0.02, 0.02, 0.02] }
[springs]
wound = { at = "disc", direction = [0, 0, 0, 0, 0.6, 0.8], stiffness = 30.0, installed_force = 2.0 }
weak = { at = "disc", direction = [0, 0, 0, 0, 0.8, -0.6], stiffness = 1e-4 }
[loads]
push = { at = "disc", direction = [0, 0, 0, 0, 0.6, 0.8], force = 0.5 }
[run]
speed = "60 rpm"
revolutions = 0.02
start = "equilibrium"
[output]
probes = ["disc"]
"""


@pytest.fixture
def case(tmp_path):
    def read(text):
        path = tmp_path / "spring.toml"
        path.write_text(text, encoding="utf-8")
        return read_case(path)

    return read


def test_force_is_that_of_part_at_moving_end(case):
    """The force accelerates the mass and a share of the last part, 15 g with linear motion between its ends."""
    response = run(case(SURGE_SPRING))
    end, before = (response[name].acceleration for name in ("mass.uy", "springs.coil.3"))
    wanted = -(0.1 + 0.015 / 3.0) * end - 0.015 / 6.0 * before
    force = response.channels["springs.coil.force"]
    assert np.abs(force - wanted).max() < 1e-9 * np.abs(force).max()  # the equation of motion of the mass


def test_force_includes_coil_contact(case):
    """0.2 mm of travel, initial displacement 1 mm: the equation of motion of the mass holds during coil contact."""
    clash = 'elements = 4, damping = 0.0, clash_travel = "0.2 mm", clash_stiffness = "400 kN/m"'
    response = run(case(SURGE_SPRING.replace("elements = 4, damping = 0.0", clash)))
    end, before = (response[name].acceleration for name in ("mass.uy", "springs.coil.3"))
    wanted = -(0.1 + 0.015 / 3.0) * end - 0.015 / 6.0 * before
    force = response.channels["springs.coil.force"]
    assert response.channels["springs.coil.clash"].max() > 0.1 * np.abs(force).max()
    assert np.abs(force - wanted).max() < 1e-9 * np.abs(force).max()


BEEHIVE = (
    "damping = 4.0, coils = [{ turns = 4, diameter = 0.024, pitch = 0.009 }, { turns = 2.5, diameter = [0.024, 0.017], "
)
BEEHIVE += (
    "pitch = 0.0049 }], wire = { diameter = 0.0039, shear_modulus = 79.3e9, density = 7850 }, installed_force = 240.0"
)


@pytest.fixture
def beehive(case):
    """Return the case of a beehive spring that oscillates by 6 mm about its equilibrium with a weight."""
    text = SURGE_SPRING.replace(
        'stiffness = "40 kN/m", mass = "60 g", elements = 4, damping = 0.0', f"elements = 4, {BEEHIVE}"
    )
    load = '[loads]\nweight = { at = "mass", direction = "uy", force = "400 N" }\n[run]'
    return case(text.replace("[run]", load).replace('"1 mm"', '"0 mm"').replace("0.02", "0.01"))


def test_progressive_coil_closing_is_not_clash(beehive):
    """The coils at the narrow end close before coil bind, and the equation of motion of the mass holds."""
    response = run(beehive)
    clearance, clash = (response.channels[f"springs.coil.{name}"] for name in ("clearance", "clash"))
    spring = build_model(beehive).springs["coil"]
    moved = np.column_stack([response["springs.coil"].displacement, response["mass.uy"].displacement])
    closed = np.diff(moved, axis=1, prepend=0.0) > [part.travel for part in spring.parts]
    assert closed[:, 4:].any()
    assert not closed[:, :4].any()
    assert clearance.min() > 1e-3
    assert not clash.any()
    end, before = (response[name].acceleration for name in ("mass.uy", "springs.coil.7"))
    last = spring.parts[-1]
    damped = last.damping * np.diff(np.column_stack([response["springs.coil"].velocity, response["mass.uy"].velocity]))
    wanted = 400.0 - (0.1 + last.mass / 3.0) * end - last.mass / 6.0 * before - damped[:, -1]
    force = response.channels["springs.coil.force"]
    assert np.abs(force - wanted).max() < 1e-9 * np.abs(force).max()


def test_check_shows_spring_curve(beehive, flexcam):
    """From the installed length to coil bind, stiffness and natural frequency increase at each corner."""
    output = flexcam("check", str(beehive.path))
    assert "Spring coil" in output.out
    curve = json.loads(flexcam("check", str(beehive.path), "--json").out)["spring_curves"]["coil"]
    travel, force, stiffness = (
        np.array([row[key] for row in curve]) for key in ("travel_m", "force_n", "stiffness_n_per_m")
    )
    np.testing.assert_allclose(np.diff(force), stiffness[:-1] * np.diff(travel), rtol=1e-12)
    assert travel[0] == 0.0
    assert force[0] == pytest.approx(240.0, rel=1e-12)
    assert travel[-1] == pytest.approx(build_model(beehive).springs["coil"].clash_travel, rel=1e-12)
    assert (np.diff(stiffness) > 0.0).all()
    assert (np.diff([row["frequencies_hz"][0] for row in curve]) > 0.0).all()


def test_rotational_spring_has_moment(case):
    made = case(ROTATIONAL_SPRING)
    response = run(made)
    assert dict(response.outline.channels)["springs.wound.force"] == "N m"
    moment = response.channels["springs.wound.force"]
    assert moment == pytest.approx(0.5, rel=1e-9)  # equilibrium with the load
    angle = 0.6 * response["disc.ry"].displacement + 0.8 * response["disc.rz"].displacement
    assert angle == pytest.approx((0.5 - 2.0) / 30.0, rel=1e-9)


def test_unit_of_rotational_spring_in_tables(case):
    made = case(ROTATIONAL_SPRING)
    table = model_table(prepare(made), modes(made, 2))
    output = "".join(str(cell) for column in table.columns for cell in column.cells)
    assert "wound 30 N m/rad" in output
    assert not [one for one in check_values(made) if "springs.wound" in one]  # 30 N/m would be implausible
    assert [one for one in check_values(made) if "0.0001 N m/rad" in one]


BASE = 'at = "valve", direction = "uy", installed_force = "400 N"'
PUSHROD = "cases/pushrod-engine/intake.toml"
SLOW = ("run.crank_speed=200rpm", "run.revolutions=1", "run.steps_per_revolution=1800")


def test_spring_force_of_rigid_model():
    """Installed force plus rate times rigid lift; a spring that no cam moves has its installed force."""
    idle = "springs.idle={ at='cam', direction='ux', stiffness=1.0, installed_force=7.0 }"
    case = read_case(PUSHROD, [f'springs.valve={{ {BASE}, stiffness = "50 kN/m" }}', idle])
    response = run(case, rigid=True)
    wanted = 400.0 + 50e3 * response["valve"].displacement
    np.testing.assert_allclose(response.channels["springs.valve.force"], wanted, rtol=1e-12)
    np.testing.assert_array_equal(response.channels["springs.idle.force"], 7.0)


@pytest.mark.parametrize("more", [
    'force_table = [["0 mm", "400 N"], ["4 mm", "550 N"], ["12 mm", "1100 N"]]',
    pytest.param('stiffness = "50 kN/m", clash_travel = "8 mm", clash_stiffness = "0.1 MN/m", mass = "60 g"',
                 marks=pytest.mark.slow),
    pytest.param('stiffness = "50 kN/m", pulsation = { order = 3, amplitude = 0.2 }', marks=pytest.mark.slow),
])  # fmt: skip
def test_rigid_spring_force_is_low_speed_limit(more):
    case = read_case(PUSHROD, [f"springs.valve={{ {BASE}, {more} }}", *SLOW])
    rigid, slow = (run(case, rigid=one).channels["springs.valve.force"] for one in (True, False))
    assert np.abs(rigid - slow).max() < 0.03 * slow.max()
    assert np.median(np.abs(rigid - slow)) < 0.005 * slow.max()
