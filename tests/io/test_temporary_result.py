"""A visible partial result is always complete, also while its next copy is written."""

import os

import pytest

from flexcam import InputError
from flexcam.io import result_writer


@pytest.fixture
def temporary(tmp_path):
    """Return a temporary result of which one copy was published."""
    result = result_writer.TemporaryResult(tmp_path / "case.writing", tmp_path / "case.partial.vtkhdf")
    result.path.write_bytes(b"the first copy")
    result.show()
    yield result
    result.discard()


def test_interrupted_copy_is_not_visible(temporary, tmp_path, monkeypatch):
    """The interrupt has the effect of `kill -9` during a copy."""

    def copy_part(source, target):
        target.write_bytes(source.read_bytes()[:5])
        raise KeyboardInterrupt

    temporary.path.write_bytes(b"the second copy")
    monkeypatch.setattr(result_writer.shutil, "copyfile", copy_part)
    with pytest.raises(KeyboardInterrupt):
        temporary.show()
    assert (tmp_path / "case.partial.vtkhdf").read_bytes() == b"the first copy"


def test_copy_replaces_earlier_copy(temporary, tmp_path):
    temporary.path.write_bytes(b"the second copy")
    temporary.show()
    assert (tmp_path / "case.partial.vtkhdf").read_bytes() == b"the second copy"
    assert not (tmp_path / "case.copying").exists()


def test_result_is_synced_before_rename(tmp_path, monkeypatch):
    """A power failure must not leave an empty file with the name of a result, or lose the renamed file."""
    sync_calls, fsync = [], os.fsync
    result, final = (
        result_writer.TemporaryResult(tmp_path / "case.writing", tmp_path / "case.partial.vtkhdf"),
        tmp_path / "case.vtkhdf",
    )

    def sync(descriptor):
        sync_calls.append((os.fstat(descriptor).st_ino, final.exists()))
        fsync(descriptor)

    monkeypatch.setattr(result_writer.os, "fsync", sync)
    file = result.path.stat().st_ino
    result.rename(final)
    assert sync_calls == [(file, False), (tmp_path.stat().st_ino, True)]


@pytest.fixture
def link_target(tmp_path):
    """Return a file that is the target of a symbolic link."""
    path = tmp_path / "precious"
    path.write_bytes(b"precious")
    return path


def test_result_is_not_written_through_link(link_target, tmp_path):
    """A user with write access to the folder could otherwise redirect a run to any file of another user."""
    (tmp_path / "case.writing").symlink_to(link_target)
    with pytest.raises(InputError, match="symbolic link"):
        result_writer.TemporaryResult(tmp_path / "case.writing", tmp_path / "case.partial.vtkhdf")
    assert link_target.read_bytes() == b"precious"


def test_copy_is_not_written_through_link(temporary, link_target, tmp_path):
    (tmp_path / "case.copying").symlink_to(link_target)
    temporary.show()
    assert (tmp_path / "case.partial.vtkhdf").read_bytes() == b"the first copy"
    assert link_target.read_bytes() == b"precious"
