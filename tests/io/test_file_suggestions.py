"""A result that is not there, beside what is: the run may be going on, have broken off, or have ended meanwhile."""

import pytest

from flexcam import InputError, read_result
from flexcam.io import verify_file

# what stands there, what is asked for, what is told
BESIDE = {
    "a run is writing it": (["case.partial.vtkhdf", "case.writing"], "case.vtkhdf", "case.partial.vtkhdf contains"),
    "its first copy is to come": (["case.writing"], "case.vtkhdf", "run is writing"),
    "what it writes": (["case.partial.vtkhdf", "case.writing"], "case.writing", "case.partial.vtkhdf contains"),
    "it ended": (["case.vtkhdf"], "case.partial.vtkhdf", "Its run is complete"),
    "it ended, what it wrote": (["case.vtkhdf"], "case.writing", "Its run is complete"),
    "another name": (["intake-2.vtkhdf"], "intake2.vtkhdf", "Did you mean 'intake-2.vtkhdf'?"),
    "a partial result under another name": (["a.partial.vtkhdf"], "b.vtkhdf", "There is no such file"),
}  # fmt: skip


@pytest.mark.parametrize("name", ["x" * 5000, "a\0b", "file/below"])
def test_no_name_of_a_result(name, tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError):
        read_result(tmp_path / name)


@pytest.mark.parametrize("read", [read_result, verify_file])
@pytest.mark.parametrize("what", BESIDE)
def test_what_is_there_is_told(what, read, tmp_path):
    there, asked, told = BESIDE[what]
    for name in there:
        (tmp_path / name).touch()
    with pytest.raises(InputError) as refusal:
        read(tmp_path / asked)
    assert told in str(refusal.value)
    if told.startswith("There"):
        assert refusal.value.faults[0].remedy == ""
