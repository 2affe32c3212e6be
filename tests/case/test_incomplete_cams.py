"""Cams without all keys of their lift are refused; missing keys have no defaults."""

import pytest

from flexcam import InputError
from flexcam.case.builder import parse_follower
from flexcam.case.schema.cams import CamDesignRecord

COMPLETE = {"law": "shm", "lift": "6 mm", "rise": "60 deg", "return": "60 deg"}


@pytest.mark.parametrize("missing", [["lift"], ["law"], ["rise"], ["return"], ["lift", "return"], list(COMPLETE)])
def test_fault_names_missing_lift_keys(missing):
    given = {key: value for key, value in COMPLETE.items() if key not in missing}
    with pytest.raises(InputError) as refusal:
        _ = CamDesignRecord.model_validate(given).part
    assert refusal.value.faults[0].given == f"nothing for {', '.join(missing)}"


def test_complete_cam_has_given_lift():
    assert CamDesignRecord.model_validate(COMPLETE).part.event.height == pytest.approx(0.006)


def test_follower_requires_no_lift():
    follower, turn = parse_follower('{ type = "roller", radius = "9 mm" }', "15 mm", clockwise=True)
    assert (follower.base_radius, follower.roller_radius, turn) == (0.015, 0.009, -1)
