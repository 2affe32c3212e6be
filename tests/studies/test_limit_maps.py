"""Limit maps state the units of their numbers."""

import numpy as np

from flexcam.cli.limits import limit_map_output
from flexcam.dynamics import Status
from flexcam.studies.plan import parse_axis
from flexcam.studies.quantities import LimitMap, grid_plan


def test_limit_map_uses_given_units():
    plan = grid_plan(
        parse_axis("springs.valve.stiffness", "40,50kN/m"), parse_axis("contacts.intake.preload_factor", "2,3")
    )
    one, other = plan.varied_axes
    found = LimitMap((one, other), {"loss_of_contact": np.full(plan.shape, 6000.0)}, (Status(),) * len(plan))
    assert [one.unit for one in found.axes] == ["kN/m", ""]
    output = limit_map_output(found, "camshaft")
    assert output.csv.startswith('"springs.valve.stiffness, kN/m",contacts.intake.preload_factor,')
    assert "[camshaft rpm]" in output.csv
    assert "columns: contacts.intake.preload_factor" in str(output.parts[0].title)
    assert output.json["over"]["unit"] == "kN/m"
