"""Files that are there whole or not at all: written beside their place, and moved there once they are complete."""

from __future__ import annotations

import os
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path

from flexcam.response import Cause, RunFailedError, Status


@contextmanager
def whole(path: Path) -> Generator[Path]:
    """Give a name to write to; what is written takes the place of a file when all of it is there."""
    draft = path.with_name(f".flexcam-{os.getpid()}{path.suffix}") if path.is_file() or not path.exists() else path
    try:
        yield draft
        if draft != path:
            draft.replace(path)
    except OSError as fault:
        text = f"{path} could not be written: {fault.strerror or fault}"
        raise RunFailedError(Status(Cause.NOT_SAVED, text, "free space, or name another file or folder")) from None
    finally:
        if draft != path:
            with suppress(OSError):
                draft.unlink(missing_ok=True)
