"""A map of limits tells the unit of its numbers also where they were given without one."""

from pathlib import Path

import numpy as np

from flexcam import read_case
from flexcam.cli.limits import limit_map_output
from flexcam.dynamics import Status
from flexcam.studies.plan import parse_axis
from flexcam.studies.quantities import LimitMap, grid_plan

CASE = read_case(Path(__file__).parents[1] / "data/inline.toml")


def _map(first, second):
    plan = grid_plan(parse_axis(*first), parse_axis(*second))
    one, other = plan.varied_axes
    rpm = {"loss_of_contact": np.full(plan.shape, 6000.0)}
    return LimitMap((one, other), rpm, (Status(),) * len(plan)).with_units(CASE)


def test_units_of_keys():
    found = _map(("springs.valve.stiffness", "40000,50000"), ("springs.valve.installed_force", "200,300"))
    told = limit_map_output(found, "crank")
    assert told.csv.startswith('"springs.valve.stiffness, N/m","springs.valve.installed_force, N"')
    assert "[crank rpm]" in told.csv
    assert "columns: springs.valve.installed_force, N" in str(told.parts[0].title)
    assert told.json["over"]["unit"] == "N/m"


def test_units_as_given_and_plain_numbers():
    found = _map(("springs.valve.stiffness", "40,50kN/m"), ("contacts.intake.preload_factor", "2,3"))
    assert [one.unit for one in found.axes] == ["kN/m", ""]
    told = limit_map_output(found, "camshaft")
    assert told.csv.startswith('"springs.valve.stiffness, kN/m",contacts.intake.preload_factor,')
