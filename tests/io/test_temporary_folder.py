"""Folders for a while: gone at the end, and at the next start where a process could not end itself."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
from importlib import import_module

import pytest

from flexcam.io import temporary_folder

HOLDS = """
import sys
from flexcam.io import temporary_folder
with temporary_folder() as folder:
    (folder / "case.toml").write_text("format = 1")
    print(folder, flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def home(tmp_path, monkeypatch):
    """Stand for the temporary folder of the system."""
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", None)
    return tmp_path


@pytest.fixture
def holder(home):
    """Start a process that holds a folder until it ends."""
    begun = subprocess.Popen(
        [sys.executable, "-c", HOLDS], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env={**os.environ}
    )
    begun.stdout.readline()  # it has its folder
    yield begun
    begun.kill()
    begun.communicate()


def test_a_folder_is_gone_at_the_end(home):
    with temporary_folder() as one, temporary_folder() as other:
        assert one != other
        assert {path.name for path in home.iterdir()} == {one.name, other.name}
    assert not list(home.iterdir())


def test_a_folder_is_gone_after_a_fault(home):
    with pytest.raises(ZeroDivisionError), temporary_folder():
        raise ZeroDivisionError
    assert not list(home.iterdir())


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="the system has no locks of folders")
def test_what_a_killed_process_left_goes_at_the_next_start_and_nothing_else(home, holder):
    """Neither the folder of a living process, nor that of another program or user, nor what a link leads to."""
    (held,) = home.iterdir()
    with temporary_folder():
        assert (held / "case.toml").exists()
    kept = home / "kept"
    kept.mkdir()
    (home / "flexcam-scratch-link").symlink_to(kept)
    (home / "flexcam-results").mkdir()
    (home / "flexcam-scratch-file").touch()
    holder.kill()
    holder.wait()
    with temporary_folder() as mine:
        assert not held.exists()
        assert mine.exists()
    names = {"kept", "flexcam-scratch-link", "flexcam-results", "flexcam-scratch-file"}
    assert {path.name for path in home.iterdir()} == names


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="the system has no owners of that kind")
def test_the_folder_of_another_user_stays(home, monkeypatch):
    other = home / "flexcam-scratch-other"
    other.mkdir()
    own = os.getuid()
    monkeypatch.setattr(os, "getuid", lambda: own + 1)
    with temporary_folder():
        assert other.exists()
    monkeypatch.undo()
    monkeypatch.setattr(tempfile, "tempdir", str(home))
    with temporary_folder():
        assert not other.exists()


def test_without_locks_nothing_is_taken_for_left(home, monkeypatch):
    monkeypatch.setattr(
        import_module("flexcam.io.files"), "lock_file", lambda file: False
    )  # its function has the same name
    with temporary_folder() as one, temporary_folder():
        assert one.exists()
    assert not list(home.iterdir())
