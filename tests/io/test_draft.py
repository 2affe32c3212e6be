"""What others see of a file in the making is whole, also while the next copy of it is made."""

from __future__ import annotations

import pytest

from flexcam.io import draft


@pytest.fixture
def begun(tmp_path):
    """Return a draft of which one copy was shown."""
    made = draft.Draft(tmp_path / "case.writing", tmp_path / "case.partial.vtkhdf")
    made.path.write_bytes(b"the first copy")
    made.show()
    yield made
    made.discard()


def test_a_copy_that_is_cut_off_is_never_seen(begun, tmp_path, monkeypatch):
    """As by `kill -9` in the middle of it."""

    def half(source, target):
        target.write_bytes(source.read_bytes()[:5])
        raise KeyboardInterrupt

    begun.path.write_bytes(b"the second copy")
    monkeypatch.setattr(draft.shutil, "copyfile", half)
    with pytest.raises(KeyboardInterrupt):
        begun.show()
    assert (tmp_path / "case.partial.vtkhdf").read_bytes() == b"the first copy"


def test_a_copy_takes_the_place_of_the_one_before(begun, tmp_path):
    begun.path.write_bytes(b"the second copy")
    begun.show()
    assert (tmp_path / "case.partial.vtkhdf").read_bytes() == b"the second copy"
    assert not (tmp_path / "case.copying").exists()
