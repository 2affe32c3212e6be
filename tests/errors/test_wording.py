"""What refusals say: the version that is read, no hint at the key itself."""

from __future__ import annotations

import pytest

from flexcam import InputError
from flexcam.case import given_law, read_cams
from flexcam.checks import did_you_mean


def test_another_version_of_the_format(tmp_path):
    (tmp_path / "cams.toml").write_text('format = 2\n[cams.c]\nlaw = "shm"\nlift = "6 mm"\nrise = 1\nreturn = 1\n')
    with pytest.raises(InputError) as refusal:
        read_cams(tmp_path / "cams.toml")
    (fault,) = refusal.value.faults
    assert (fault.given, fault.allowed) == ("2", "1")
    assert "a newer flexcam" in fault.remedy


def test_no_hint_at_what_was_written():
    assert did_you_mean("exponents", ["exponents", "conditions"]) == ""
    with pytest.raises(InputError) as refusal:
        given_law({"id": "polynomial", "exponents": ["x"]})
    assert "did you mean" not in str(refusal.value)
