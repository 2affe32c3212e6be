"""What others see of a file in the making is whole, also while the next copy of it is made."""

from __future__ import annotations

import os

import pytest

from flexcam import InputError
from flexcam.io import result_writer


@pytest.fixture
def begun(tmp_path):
    """Return a draft of which one copy was shown."""
    made = result_writer.TemporaryResult(tmp_path / "case.writing", tmp_path / "case.partial.vtkhdf")
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
    monkeypatch.setattr(result_writer.shutil, "copyfile", half)
    with pytest.raises(KeyboardInterrupt):
        begun.show()
    assert (tmp_path / "case.partial.vtkhdf").read_bytes() == b"the first copy"


def test_a_copy_takes_the_place_of_the_one_before(begun, tmp_path):
    begun.path.write_bytes(b"the second copy")
    begun.show()
    assert (tmp_path / "case.partial.vtkhdf").read_bytes() == b"the second copy"
    assert not (tmp_path / "case.copying").exists()


def test_a_result_is_on_the_disk_before_it_takes_its_name(tmp_path, monkeypatch):
    """A power cut must not leave an empty file under the name of a result, nor the name unwritten."""
    synced, done = [], os.fsync
    made, final = (
        result_writer.TemporaryResult(tmp_path / "case.writing", tmp_path / "case.partial.vtkhdf"),
        tmp_path / "case.vtkhdf",
    )

    def sync(held):
        synced.append((os.fstat(held).st_ino, final.exists()))
        done(held)

    monkeypatch.setattr(result_writer.os, "fsync", sync)
    file = made.path.stat().st_ino
    made.rename(final)
    assert synced == [(file, False), (tmp_path.stat().st_ino, True)]


@pytest.fixture
def precious(tmp_path):
    """Return a file that a link may lead to."""
    path = tmp_path / "precious"
    path.write_bytes(b"precious")
    return path


def test_no_result_is_written_through_a_link(precious, tmp_path):
    """Whoever may write into the folder could lead a run to any file of the one who runs it."""
    (tmp_path / "case.writing").symlink_to(precious)
    with pytest.raises(InputError, match="symbolic link"):
        result_writer.TemporaryResult(tmp_path / "case.writing", tmp_path / "case.partial.vtkhdf")
    assert precious.read_bytes() == b"precious"


def test_no_copy_is_written_through_a_link(begun, precious, tmp_path):
    (tmp_path / "case.copying").symlink_to(precious)
    begun.show()
    assert (tmp_path / "case.partial.vtkhdf").read_bytes() == b"the first copy"
    assert precious.read_bytes() == b"precious"
