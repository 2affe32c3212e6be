"""Suggestions for a missing result: the run may be in progress, interrupted or complete."""

import pytest

from flexcam import InputError, read_result

# existing files, requested file, part of the message
MISSING = {
    "a run is writing it": (["case.partial.vtkhdf", "case.writing"], "case.vtkhdf", "case.partial.vtkhdf contains"),
    "its first copy is to come": (["case.writing"], "case.vtkhdf", "run is writing"),
    "what it writes": (["case.partial.vtkhdf", "case.writing"], "case.writing", "case.partial.vtkhdf contains"),
    "it ended": (["case.vtkhdf"], "case.partial.vtkhdf", "The result of the complete run is"),
    "it ended, what it wrote": (["case.vtkhdf"], "case.writing", "The result of the complete run is"),
    "another name": (["intake-2.vtkhdf"], "intake2.vtkhdf", "Did you mean 'intake-2.vtkhdf'?"),
    "a partial result under another name": (["a.partial.vtkhdf"], "b.vtkhdf", "There is no such file"),
}  # fmt: skip


@pytest.mark.parametrize("name", ["x" * 5000, "a\0b", "file/below"])
def test_invalid_result_name_is_refused(name, tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError):
        read_result(tmp_path / name)


@pytest.mark.parametrize("what", MISSING)
def test_message_for_missing_result_names_related_file(what, tmp_path):
    existing, requested, expected = MISSING[what]
    for name in existing:
        (tmp_path / name).touch()
    with pytest.raises(InputError) as refusal:
        read_result(tmp_path / requested)
    assert expected in str(refusal.value)
    if expected.startswith("There"):
        assert refusal.value.faults[0].remedy == ""
