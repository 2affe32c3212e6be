"""Invalid lift tables: each error names the row or angle and a remedy."""

import math

import numpy as np
import pytest

from flexcam.cams import LAWS, LiftEvent, lift_table
from flexcam.core.errors import InputError
from tests.thinning import slow_if

DEGREE = math.radians(1.0)
LOBE = LiftEvent(LAWS["4-5-6-7"], 0.008, 65 * DEGREE, 65 * DEGREE, phase=70 * DEGREE)


def table(spacing=2.0, start=0.0, end=360.0):
    theta = np.arange(start, end, spacing) * DEGREE
    return theta, LOBE(theta)


def modify(row, **columns):
    theta, lift = table()
    for name, value in columns.items():
        {"theta": theta, "lift": lift}[name][row] = value
    return theta, lift


def omit(first, last, spacing=2.0):
    theta, lift = table(spacing)
    keep = (theta < first * DEGREE + 1e-9) | (theta > last * DEGREE - 1e-9)
    return theta[keep], lift[keep]


INVALID_TABLES = {
    "the same angle twice": (modify(40, theta=78 * DEGREE), "angle, row 41", "of cam angle, then 78", "sort"),
    "an angle that goes back": (modify(50, theta=60 * DEGREE), "angle, row 51", "98 deg of cam angle, then", "sort"),
    "descending": (tuple(column[::-1] for column in table()), "angle, row 2", "358 deg of cam angle, then 356", "sort"),
    "crank angles": ((np.arange(0, 720, 2) * DEGREE, np.repeat(LOBE(table()[0]), 2)), "angle", "718 deg of cam angle",
                     "crank angles"),
    "a little over a revolution": (table(end=363.0), "angle", "362 deg of cam angle", "shorten the table"),
    "eleven points": ((np.linspace(0, 6, 11), np.ones(11)), "lift table", "11 points", "measure at more angles"),
    "below the base circle": (modify(30, lift=-0.2e-3), "lift, row 31", "-0.2 mm at 60 deg", "on the base circle"),
    "a gap in the flank": (omit(90, 100), "angle, row 47", "no point between 90 and 100 deg", "measure there"),
    "a gap at the nose": (omit(128, 150), "angle, row 66", "no point between 128 and 150 deg", "measure there"),
    "a gap in a fine table": (omit(80, 88, 0.5), "angle, row 162", "between 80 and 88 deg", "measure there"),
    "the opening flank alone": (table(start=40.0, end=120.0), "lift", "mm at 118 deg", "measure the whole lift"),
    "the closing flank alone": (table(start=120.0, end=300.0), "lift", "mm at 120 deg", "measure the whole lift"),
    "a lift that does not come back": ((np.linspace(0, 360, 73) * DEGREE, np.linspace(0, 0.005, 73)), "lift",
                                       "0 mm at 0 deg, 5 mm at 360 deg", "measure the whole lift"),
}  # fmt: skip


@pytest.mark.parametrize("case", INVALID_TABLES)
def test_invalid_table_raises_error(case):
    columns, where, given, remedy = INVALID_TABLES[case]
    with pytest.raises(InputError) as refusal:
        lift_table(*columns)
    (fault,) = refusal.value.faults
    assert fault.where == where
    assert given in fault.given
    assert remedy in fault.remedy
    assert fault.allowed


@pytest.mark.parametrize(
    ("columns", "where"),
    [
        (modify(7, lift=math.nan), "lift table, row 8"),
        (modify(7, lift=math.inf), "lift table, row 8"),
        (modify(7, theta=math.nan), "lift table, row 8"),
        ((table()[0], table()[1][:-1]), "lift table"),
        ((table()[0][None], table()[1]), "angle"),
        ((table()[0], np.zeros(180)), "lift"),
        ((table()[0], -table()[1]), "lift"),
        (([], []), "lift table"),
        ((["a", "b"], [1.0, 2.0]), "angle"),
    ],
)
def test_non_numeric_or_zero_lift_raises_error(columns, where):
    with pytest.raises(InputError) as refusal:
        lift_table(*columns)
    assert refusal.value.faults[0].where == where


def test_all_faults_are_reported_at_once():
    theta, lift = modify(30, lift=-0.2e-3)
    theta[50] = theta[10]
    with pytest.raises(InputError) as refusal:
        lift_table(theta, lift)
    assert [fault.where for fault in refusal.value.faults] == ["angle, row 51", "lift, row 31"]


def test_lift_in_metres_instead_of_millimetres_causes_remark():
    theta, lift = table()
    (remark,) = lift_table(theta, 1e3 * lift)[1].remarks
    assert "8 m is unusual: did you mean 8 mm?" in remark


def test_table_of_radii_gives_warning():
    theta, lift = table()
    (remark,) = lift_table(theta, 0.0185 + lift)[1].remarks
    assert "the lift is 18.5 mm or more at every angle" in remark
    assert "does the table give radii?" in remark


@pytest.mark.parametrize("tolerance", [-1e-6, math.nan, math.inf])
def test_invalid_tolerance_raises_error(tolerance):
    with pytest.raises(InputError, match=r"^tolerance:"):
        lift_table(*table(), tolerance=tolerance)


VALID_TABLES = {
    "a gap on the base circle": omit(220, 300),
    "a gap of 3 deg as wide as its neighbours": table(3.0),
    "a coarse table": table(6.0),
    "a gap that hides nothing": omit(90, 94, 0.5),
    "angles above 360 deg": table(start=180.0, end=540.0),
    "negative angles": table(start=-180.0, end=180.0),
    "a reading a little below zero": modify(5, lift=-5e-6),
}


@pytest.mark.parametrize(
    "case",
    slow_if(lambda one: one == "a gap that hides nothing", VALID_TABLES),
)
def test_unusual_table_is_valid(case):
    theta, lift = VALID_TABLES[case]
    event, report = lift_table(theta, lift, tolerance=0.0)
    assert report.largest_change < 1e-9
    assert event.height == pytest.approx(0.008, rel=2e-3)
