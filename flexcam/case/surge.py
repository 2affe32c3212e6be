"""Springs with mass whose parts a case does not say: as many as the waves of its cams need."""

from __future__ import annotations

from dataclasses import replace

from flexcam.case.case import Case
from flexcam.train.surge import parts_for_waves


def with_spring_parts(case: Case) -> Case:
    """Return a case whose springs with mass are divided, where it does not say into how many parts."""
    untold = {
        name: one for name, one in case.record.springs.items() if one.mass and "elements" not in one.model_fields_set
    }
    if not untold:
        return case
    lifts = [cam.made().event for cam in case.record.cams.values()]
    parts = {name: parts_for_waves(one.made(), lifts, case.speed) for name, one in untold.items()}
    divided = {name: one.model_copy(update={"elements": parts[name]}) for name, one in untold.items()}
    springs = case.record.springs | divided
    return replace(case, record=case.record.model_copy(update={"springs": springs}))
