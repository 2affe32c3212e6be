"""Limit maps state the units of their numbers."""

import numpy as np

from flexcam.cli.limits import limit_map_output
from flexcam.dynamics import Status
from flexcam.studies.plan import parse_axis
from flexcam.studies.quantities import LimitMap, grid_plan


def test_limit_map_uses_given_units():
    plan = grid_plan(
        [parse_axis("springs.valve.stiffness", "40,50kN/m"), parse_axis("contacts.intake.preload_factor", "2,3")]
    )
    one, other = plan.varied_axes
    found = LimitMap((one, other), {"loss_of_contact": np.full(plan.shape, 6000.0)}, (Status(),) * len(plan))
    assert [one.unit for one in found.axes] == ["kN/m", ""]
    output = limit_map_output(found, "camshaft")
    assert output.csv.startswith('"springs.valve.stiffness, kN/m",contacts.intake.preload_factor,')
    assert "[camshaft rpm]" in output.csv
    assert "columns: contacts.intake.preload_factor" in str(output.parts[0].title)
    assert output.json["over"]["unit"] == "kN/m"


def test_limit_over_one_parameter_is_curve():
    plan = grid_plan([parse_axis("springs.valve.stiffness", "40,50kN/m")])
    found = LimitMap(plan.varied_axes, {"float": np.array([6000.0, 6500.0])}, (Status(),) * 2)
    output = limit_map_output(found, "crankshaft")
    assert output.csv.splitlines() == [
        '"springs.valve.stiffness, kN/m",float [crankshaft rpm],status', "40.0,6000.0,done", "50.0,6500.0,done"
    ]  # fmt: skip
    assert output.json["limits_rpm"]["float"].tolist() == [6000.0, 6500.0]
    assert "and" not in output.json
    (line,) = output.draw().axes[0].lines
    assert line.get_xydata().tolist() == [[40.0, 6000.0], [50.0, 6500.0]]
