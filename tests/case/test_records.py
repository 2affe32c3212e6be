"""A table of the case builds its part of the model once, and every copy with other values its own."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from flexcam import InputError, build_model, prepare, read_case
from flexcam.case.input_checks import check_values
from flexcam.case.schema import cams, contacts, parts, run, springs
from flexcam.case.schema.base import PartRecord

CASE = Path(__file__).parents[1] / "data" / "every-key.toml"


def kinds():
    modules = (cams, contacts, parts, run, springs)
    found = {kind for module in modules for kind in vars(module).values() if isinstance(kind, type)}
    return [kind for kind in found if isinstance(kind, type) and issubclass(kind, PartRecord) and "build" in vars(kind)]


@pytest.fixture
def built(monkeypatch):
    """Return how often each table has built its part, by kind and place in memory."""
    count, kept = Counter(), []

    def counting(kind, build):
        def counted(self):
            kept.append(self)  # no other table takes its place in memory
            count[kind.__name__, id(self)] += 1
            return build(self)

        return counted

    for kind in kinds():
        monkeypatch.setattr(kind, "build", counting(kind, kind.build))
    return count


def test_every_table_builds_its_part_once(built):
    case = read_case(CASE)
    check_values(case)
    prepare(case)
    build_model(case)
    assert {name for name, _ in built} >= {"CamDesignRecord", "SpringRecord", "MassRecord"}
    assert set(built.values()) == {1}


def test_a_copy_with_other_values_builds_its_own_part():
    spring = next(iter(read_case(CASE).record.springs.values()))
    longer = spring.model_copy(update={"elements": 3})
    assert longer.part.elements == 3
    assert spring.part.elements == spring.elements
    assert spring == spring.model_copy()


def test_a_text_without_a_unit_is_refused_at_its_key():
    """A lift of 8.4 m was refused as an undercut profile, at the contact."""
    with pytest.raises(InputError) as refusal:
        read_case(CASE.parents[2] / "cases/pushrod-engine/intake.toml", ['cams.intake.lift="8.4"'])
    fault = refusal.value.faults[0]
    assert (fault.where.split(" ")[0], fault.why) == ("cams.intake.lift", "the text has no unit")
    assert fault.remedy.startswith("write '8.4 mm'")


def test_a_custom_section_keeps_its_fibres():
    given = '{ shape = "custom", A = "490 mm^2", Iy = "19000 mm^4", Iz = "12000 mm^4", J = "30000 mm^4", '
    given += 'fibre_y = "9 mm", fibre_z = "11 mm", torsion_arm = "8 mm" }'
    section = read_case(CASE.with_name("inline.toml"), [f"sections.shaft={given}"]).record.sections["shaft"].part
    assert (section.fibre_y, section.fibre_z, section.torsion_arm) == pytest.approx((0.009, 0.011, 0.008))
