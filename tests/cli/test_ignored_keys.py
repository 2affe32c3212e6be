"""Every key that a user gives has an effect, or the command reports that it ignores the key."""

from pathlib import Path

import pytest

from flexcam.case.case import CaseRecord
from flexcam.cli.app import COMMAND_FILES, IGNORED_KEYS

DATA = Path(__file__).parents[1] / "data"
INLINE = DATA / "inline.toml"


def is_known_key(key):
    """Return whether a key or a table is part of the case format."""
    record = CaseRecord
    for step in key.split("."):
        if step not in record.model_fields:
            return False
        inner = record.model_fields[step].annotation
        record = inner if hasattr(inner, "model_fields") else record
    return True


@pytest.mark.parametrize(("commands", "keys", "why"), IGNORED_KEYS)
def test_ignored_keys_name_existing_commands_and_keys(commands, keys, why):
    assert set(commands) <= set(COMMAND_FILES)
    assert all(is_known_key(f"fidelity.{key}") for key in keys)
    assert why


MODEL_OVERRIDES = [
    "fidelity.model=sdof", "fidelity.model=rigid", "fidelity.tolerance=20%", "fidelity.estimate=true",
    "fidelity.modes=3",
]  # fmt: skip
"""Keys of the model of a run, with values that differ from those of the file."""


@pytest.mark.parametrize("prestress", [(), ("--prestress", "equilibrium")])
@pytest.mark.parametrize("laid", MODEL_OVERRIDES)
def test_keys_without_effect_on_modes_are_reported(flexcam, laid, prestress):
    words = ("modes", INLINE, *prestress, "--json")
    done = flexcam(*words, "--set", laid)
    assert done.code == 0
    assert done.json == flexcam(*words).json
    key = laid.partition("=")[0]
    assert done.err.startswith(f"Note: {key} (--set")
    assert "has no effect in modes: natural modes " in done.err
    assert done.err.count("\n") == 1


def test_keys_with_effect_on_modes_are_not_reported(flexcam):
    plain = flexcam("modes", INLINE, "--json")
    assert plain.err == ""  # the [run] table of the file needs no note
    done = flexcam("modes", INLINE, "--set", "springs.valve.stiffness=50kN/m", "--json")
    assert done.err == ""
    assert done.json != plain.json


@pytest.mark.slow
def test_note_names_line_of_ignored_key(flexcam, tmp_path):
    """The tolerance of a case chooses the model of a run; commands that examine one model ignore it."""
    text = INLINE.read_text(encoding="utf-8") + '\n[fidelity]\ntolerance = "5 %"\nestimate = true\n'
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    line = text.splitlines().index('tolerance = "5 %"') + 1
    expected = f"Note: fidelity.tolerance (line {line}), fidelity.estimate (line {line + 1}) have no effect in "
    for command in (("stability",), ("compare",), ("campbell", "--response")):
        done = flexcam(*command, "case.toml", "--json")
        assert done.code == 0
        assert done.err.startswith(f"{expected}{command[0]}: only flexcam run ")
    assert flexcam("sensitivity", "case.toml", "--of", "frequency.1", "--to", "springs.valve.stiffness").err.startswith(
        f"Note: fidelity.estimate (line {line + 1}) has no effect in sensitivity"
    )
    assert flexcam("check", "case.toml").err == ""


@pytest.mark.slow
def test_run_uses_keys_of_its_model(flexcam):
    words = ("run", INLINE, "--set", "run.steps_per_revolution=360", "--overwrite")
    assert flexcam(*words, "--set", "fidelity.tolerance=20%").err == ""
    done = flexcam(*words, "--set", "fidelity.masses=5")
    assert done.err == ""
    assert "it counts the masses of a chain, and the model is beams" in " ".join(done.out.split())
