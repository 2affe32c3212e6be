"""Written cases can be read again, and have the units of the user."""

from pathlib import Path

import pytest

from flexcam import read_case
from flexcam.case.case import resolve_record
from flexcam.case.reader import case_tables, complete_case_tables
from flexcam.io import format_toml
from tests.thinning import mostly_slow

ROOT = Path(__file__).parents[2]
CASES = [
    *mostly_slow(sorted(path for path in (ROOT / "cases").rglob("*.toml") if path.parent.name != "cams"), 5),
    *(ROOT / "tests/data" / f"{name}.toml" for name in ("every-key", "every-contact", "every-engine")),
    *mostly_slow(sorted((ROOT / "flexcam/templates").glob("*.toml")), 4),
]


@pytest.mark.parametrize("path", CASES, ids=lambda path: path.stem)
@pytest.mark.parametrize("write", [case_tables, complete_case_tables])
def test_case_round_trip(path, write, monkeypatch):
    """File paths are relative to the case, so the text is read as if from the path of the original."""
    case = read_case(path)
    text = format_toml(write(case))
    read = Path.read_bytes
    monkeypatch.setattr("flexcam.case.reader.read_text", lambda at: text if at == path else read(at).decode())
    assert resolve_record(read_case(path).record) == resolve_record(case.record)


def test_written_case_has_user_units_and_overrides():
    case = read_case(ROOT / "cases/pushrod-engine/intake.toml", ["springs.valve.stiffness=57.2kN/m"])
    tables = complete_case_tables(case)
    assert tables["springs"]["valve"]["stiffness"] == "57.2kN/m"
    assert tables["cams"]["intake"]["rise"] == "75 deg"
    assert tables["run"]["crank_speed"] == "5000 rpm"
    assert tables["cams"]["intake"]["dwell"] == "0.0 rad"
    assert tables["contacts"]["seat"]["damping_depth"] == "1e-05 m"
