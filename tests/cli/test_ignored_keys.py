"""Every key that a user gives has an effect, or the command reports that it ignores it."""

from __future__ import annotations

from pathlib import Path

import pytest

from flexcam.case.case import CaseRecord
from flexcam.cli.app import COMMAND_FILES, IGNORED_KEYS

DATA = Path(__file__).parents[1] / "data"
INLINE = DATA / "inline.toml"


def known(key):
    """Tell whether a key, or a table, is one of the case format."""
    record = CaseRecord
    for step in key.split("."):
        if step not in record.model_fields:
            return False
        inner = record.model_fields[step].annotation
        record = inner if hasattr(inner, "model_fields") else record
    return True


@pytest.mark.parametrize(("commands", "keys", "why"), IGNORED_KEYS)
def test_the_table_names_what_there_is(commands, keys, why):
    assert set(commands) <= set(COMMAND_FILES)
    assert all(known(key) for key in keys)
    assert why


LAID = [
    "fidelity.model=sdof", "fidelity.model=rigid", "fidelity.tolerance=20%", "fidelity.estimate=true",
    "fidelity.modes=3",
]  # fmt: skip
"""Keys of the model of a run, with values that its file does not have."""


@pytest.mark.parametrize("prestress", [(), ("--prestress", "equilibrium")])
@pytest.mark.parametrize("laid", LAID)
def test_what_changes_no_mode_is_told(flexcam, laid, prestress):
    words = ("modes", INLINE, *prestress, "--json")
    done = flexcam(*words, "--set", laid)
    assert done.code == 0
    assert done.json == flexcam(*words).json
    key = laid.partition("=")[0]
    assert done.err.startswith(f"Note: {key} (--set")
    assert "has no effect in modes: natural modes " in done.err
    assert done.err.count("\n") == 1


def test_what_changes_modes_is_not_told(flexcam):
    plain = flexcam("modes", INLINE, "--json")
    assert plain.err == ""  # the file has a whole run, which is nothing to tell
    done = flexcam("modes", INLINE, "--set", "springs.valve.stiffness=50kN/m", "--json")
    assert done.err == ""
    assert done.json != plain.json


def test_a_key_of_the_file_is_told_by_its_line(flexcam, tmp_path):
    """The tolerance of a case chooses the model of a run; what looks at one model cannot follow it."""
    text = INLINE.read_text(encoding="utf-8") + '\n[fidelity]\ntolerance = "5 %"\nestimate = true\n'
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    line = text.splitlines().index('tolerance = "5 %"') + 1
    told = f"Note: fidelity.tolerance (line {line}), fidelity.estimate (line {line + 1}) have no effect in "
    for command in (("stability",), ("compare",), ("campbell", "--response")):
        done = flexcam(*command, "case.toml", "--json")
        assert done.code == 0
        assert done.err.startswith(f"{told}{command[0]}: only flexcam run ")
    assert flexcam("sensitivity", "case.toml", "--of", "frequency.1", "--to", "springs.valve.stiffness").err.startswith(
        f"Note: fidelity.estimate (line {line + 1}) has no effect in sensitivity"
    )
    assert flexcam("check", "case.toml").err == ""


@pytest.mark.slow
def test_a_run_acts_on_the_keys_of_its_model(flexcam):
    words = ("run", INLINE, "--set", "run.steps_per_revolution=360", "--overwrite")
    assert flexcam(*words, "--set", "fidelity.tolerance=20%").err == ""
    done = flexcam(*words, "--set", "fidelity.masses=5")
    assert done.err == ""
    assert "it counts the masses of a chain, and the model is beams" in " ".join(done.out.split())
