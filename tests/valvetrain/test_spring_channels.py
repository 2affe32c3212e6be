"""What the channels of a spring hold: the force of its part at the moving end, a moment where it turns."""

import numpy as np
import pytest

from flexcam import prepare, read_case, run
from flexcam.analysis.natural_modes import modes
from flexcam.case.input_checks import check_values
from flexcam.report.tables import model_table

SURGING = """
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
TURNING = """
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


def test_force_is_that_of_the_part_at_the_moving_end(case):
    """It moves the mass and its share of the last part, of 15 g and spread linearly between the part's ends."""
    response = run(case(SURGING))
    end, before = (response[name].acceleration for name in ("mass.uy", "springs.coil.3"))
    wanted = -(0.1 + 0.015 / 3.0) * end - 0.015 / 6.0 * before
    force = response.channels["springs.coil.force"]
    assert np.abs(force - wanted).max() < 1e-9 * np.abs(force).max()  # the equation of motion of the mass


def test_force_includes_that_of_touching_coils(case):
    """0.2 mm of travel for a start at 1 mm: the equation of motion of the mass holds while the last coils touch."""
    clash = 'elements = 4, damping = 0.0, clash_travel = "0.2 mm", clash_stiffness = "400 kN/m"'
    response = run(case(SURGING.replace("elements = 4, damping = 0.0", clash)))
    end, before = (response[name].acceleration for name in ("mass.uy", "springs.coil.3"))
    wanted = -(0.1 + 0.015 / 3.0) * end - 0.015 / 6.0 * before
    force = response.channels["springs.coil.force"]
    assert response.channels["springs.coil.clash"].max() > 0.1 * np.abs(force).max()
    assert np.abs(force - wanted).max() < 1e-9 * np.abs(force).max()


def test_a_spring_that_turns_has_a_moment(case):
    made = case(TURNING)
    response = run(made)
    assert dict(response.outline.channels)["springs.wound.force"] == "N m"
    moment = response.channels["springs.wound.force"]
    assert moment == pytest.approx(0.5, rel=1e-9)  # in balance with the load
    angle = 0.6 * response["disc.ry"].displacement + 0.8 * response["disc.rz"].displacement
    assert angle == pytest.approx((0.5 - 2.0) / 30.0, rel=1e-9)


def test_check_tells_its_unit(case):
    made = case(TURNING)
    table = model_table(prepare(made), modes(made, 2))
    told = "".join(str(cell) for column in table.columns for cell in column.cells)
    assert "wound 30 N m/rad" in told
    assert not [one for one in check_values(made) if "springs.wound" in one]  # 30 N/m were hardly a spring
    assert [one for one in check_values(made) if "0.0001 N m/rad" in one]
