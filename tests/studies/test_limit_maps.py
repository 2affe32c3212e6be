"""Limit maps state the units of their numbers, also if the input has none."""

from pathlib import Path

import numpy as np

from flexcam import read_case
from flexcam.cli.limits import limit_map_output
from flexcam.dynamics import Status
from flexcam.studies.plan import parse_axis
from flexcam.studies.quantities import LimitMap, grid_plan

CASE = read_case(Path(__file__).parents[1] / "data/inline.toml")


def make_limit_map(first, second):
    plan = grid_plan(parse_axis(*first), parse_axis(*second))
    one, other = plan.varied_axes
    rpm = {"loss_of_contact": np.full(plan.shape, 6000.0)}
    return LimitMap((one, other), rpm, (Status(),) * len(plan)).with_units(CASE)


def test_limit_map_uses_units_of_keys():
    found = make_limit_map(("springs.valve.stiffness", "40000,50000"), ("springs.valve.installed_force", "200,300"))
    output = limit_map_output(found, "crank")
    assert output.csv.startswith('"springs.valve.stiffness, N/m","springs.valve.installed_force, N"')
    assert "[crank rpm]" in output.csv
    assert "columns: springs.valve.installed_force, N" in str(output.parts[0].title)
    assert output.json["over"]["unit"] == "N/m"


def test_limit_map_uses_given_units():
    found = make_limit_map(("springs.valve.stiffness", "40,50kN/m"), ("contacts.intake.preload_factor", "2,3"))
    assert [one.unit for one in found.axes] == ["kN/m", ""]
    output = limit_map_output(found, "camshaft")
    assert output.csv.startswith('"springs.valve.stiffness, kN/m",contacts.intake.preload_factor,')
