"""Where the compiled step is kept between runs, and how it is fetched.

Machine code is kept in the user's own cache folder, never beside the package (an installation may be read-only) and
never in a shared one (what is loaded from it is run). Without a folder to write to, every process compiles anew.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable, Generator
from contextlib import contextmanager
from functools import lru_cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

_SOURCES = (
    "integrate/compiled/once.py", "integrate/compiled/kernel.py", "integrate/compiled/newton.py",
    "integrate/compiled/stepping.py", "integrate/compiled/locating.py", "integrate/compiled/march.py",
    "integrate/compiled/glide.py", "integrate/crossing.py", "integrate/iteration.py", "integrate/led.py",
    "system/pointwise.py",
)  # fmt: skip
"""What is compiled: another text has another folder, for the compiler itself looks at one file only."""


def _folder() -> Path | None:
    """Return the folder of this version's machine code; None where nothing can be kept."""
    package = Path(__file__).parents[2]
    text = b"".join((package / name).read_bytes() for name in _SOURCES)
    given = os.environ.get("FLEXCAM_CACHE") or os.environ.get("XDG_CACHE_HOME")
    try:
        home = Path(given) if given else Path.home() / ".cache"
        folder = home / "flexcam" / hashlib.sha256(text).hexdigest()[:16]
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except (OSError, RuntimeError):
        return None


@lru_cache
def folder() -> Path | None:
    """Return where machine code is kept."""
    return _folder()


@lru_cache
def available() -> bool:
    """Tell whether there is a compiler."""
    return find_spec("numba") is not None


def machine_code() -> Callable[..., int]:
    """Return the compiled march."""
    from flexcam.integrate.compiled.march import march

    return march


def gliding_code() -> Callable[..., None]:
    """Return the compiled march without local forces."""
    from flexcam.integrate.compiled.glide import glide

    return glide


@contextmanager
def keeping() -> Generator[bool]:
    """Let the compiler keep what is declared meanwhile in `folder`, whoever imports it first."""
    settings: Any = import_module("numba.core.config")
    before = settings.CACHE_DIR
    settings.CACHE_DIR = str(folder() or "")
    try:
        yield folder() is not None
    finally:
        settings.CACHE_DIR = before
