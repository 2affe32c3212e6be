"""Each table of a case builds its part of the model once; changed copies build their own."""

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
def build_counts(monkeypatch):
    """Return the number of builds of each table, by record type and id."""
    count, tables = Counter(), []

    def count_builds(kind, build):
        def build_and_count(self):
            tables.append(self)  # keeps the table alive, so that its id is unique
            count[kind.__name__, id(self)] += 1
            return build(self)

        return build_and_count

    for kind in kinds():
        monkeypatch.setattr(kind, "build", count_builds(kind, kind.build))
    return count


def test_each_table_builds_its_part_once(build_counts):
    case = read_case(CASE)
    check_values(case)
    prepare(case)
    build_model(case)
    assert {name for name, _ in build_counts} >= {"CamDesignRecord", "SpringRecord", "MassRecord"}
    assert set(build_counts.values()) == {1}


def test_changed_copy_builds_its_own_part():
    spring = next(iter(read_case(CASE).record.springs.values()))
    longer = spring.model_copy(update={"elements": 3})
    assert longer.part.elements == 3
    assert spring.part.elements == spring.elements
    assert spring == spring.model_copy()


def test_text_without_unit_is_refused():
    """Earlier the contact was refused, since a lift of 8.4 m gave an undercut profile."""
    with pytest.raises(InputError) as refusal:
        read_case(CASE.parents[2] / "cases/pushrod-engine/intake.toml", ['cams.intake.lift="8.4"'])
    fault = refusal.value.faults[0]
    assert (fault.where.split(" ")[0], fault.why) == ("cams.intake.lift", "the text has no unit")
    assert fault.remedy == "add a unit, such as mm or m"


def test_custom_section_has_given_fibre_distances():
    given = '{ shape = "custom", A = "490 mm^2", Iy = "19000 mm^4", Iz = "12000 mm^4", J = "30000 mm^4", '
    given += 'fibre_y = "9 mm", fibre_z = "11 mm", torsion_arm = "8 mm" }'
    section = read_case(CASE.with_name("inline.toml"), [f"sections.shaft={given}"]).record.sections["shaft"].part
    assert (section.fibre_y, section.fibre_z, section.torsion_arm) == pytest.approx((0.009, 0.011, 0.008))
