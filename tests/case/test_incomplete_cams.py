"""A cam that lacks keys of its lift is none: nothing stands in their place."""

from __future__ import annotations

import pytest

from flexcam import InputError
from flexcam.case.builder import parse_follower
from flexcam.case.schema.cams import CamDesignRecord

WHOLE = {"law": "shm", "lift": "6 mm", "rise": "60 deg", "return": "60 deg"}


@pytest.mark.parametrize("missing", [["lift"], ["law"], ["rise"], ["return"], ["lift", "return"], list(WHOLE)])
def test_a_cam_without_all_keys_of_its_lift_is_refused_with_their_names(missing):
    given = {key: value for key, value in WHOLE.items() if key not in missing}
    with pytest.raises(InputError) as refusal:
        _ = CamDesignRecord.model_validate(given).part
    assert refusal.value.faults[0].given == f"nothing for {', '.join(missing)}"


def test_a_whole_cam_has_its_own_lift():
    assert CamDesignRecord.model_validate(WHOLE).part.event.height == pytest.approx(0.006)


def test_a_follower_by_itself_needs_no_lift():
    follower, turn = parse_follower('{ type = "roller", radius = "9 mm" }', "15 mm", clockwise=True)
    assert (follower.base_radius, follower.roller_radius, turn) == (0.015, 0.009, -1)
