"""Case text of a variant: changed values with the comments of the original file."""

from pathlib import Path

import pytest

from flexcam import read_case
from flexcam.case.reader import case_tables
from flexcam.case.variants import case_text

CASE = Path(__file__).parents[2] / "cases/pushrod-engine/intake.toml"
VALUES = (
    "springs.valve.stiffness=52.5 kN/m", "masses.valve.mass=95 g", "springs.tappet.damping=3", "run.crank_speed=4000rpm"
)  # fmt: skip


def test_comments_are_preserved_with_changed_values(tmp_path):
    case = read_case(CASE, VALUES)
    text = case_text(case, tmp_path / "best.toml", ["Best variant"])
    old, new = CASE.read_text(encoding="utf-8").splitlines(), text.splitlines()
    assert [line for line in new if line not in old] == [
        "# Best variant", 'valve = { at = "valve", mass = "95 g" }', 'stiffness = "52.5 kN/m"', "damping = 3",
        'crank_speed = "4000rpm"',
    ]  # fmt: skip
    (tmp_path / "best.toml").write_text(text, encoding="utf-8")
    assert case_tables(read_case(tmp_path / "best.toml")) == case_tables(case)


@pytest.mark.parametrize("words", [["run.speed=100"], ["contacts.lash.gap=0.3 mm", "rockers.rocker.arms=[0.02, 0.03]"],
                                   ["masses.cap={ at = 'valve', mass = 0.01 }"]])  # fmt: skip
def test_written_case_has_tables_of_variant(tmp_path, words):
    """Comments stay, also if a key replaces another one or a part is added."""
    case = read_case(CASE, words)
    text = case_text(case, tmp_path / "best.toml")
    (tmp_path / "best.toml").write_text(text, encoding="utf-8")
    assert case_tables(read_case(tmp_path / "best.toml")) == case_tables(case)
    assert "All numbers are chosen by flexcam" in text
