"""Files that a command writes: refused before anything is computed where they would take each other's place."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from flexcam.checks import Fault, InputError, together
from flexcam.commands.app import free_picture
from flexcam.io import free_to_write


def apart(written: Mapping[str, Path | None], read: Sequence[Path] = ()) -> None:
    """Refuse files that stand in each other's place, or in that of what the command reads, also to be overwritten."""
    taken = {_real(path): "what is read" for path in read}
    faults: list[Fault] = []
    for option, path in written.items():
        if path is None:
            continue
        if (other := taken.setdefault(_real(path), option)) != option:
            why = "it would be lost" if other == "what is read" else "the one would replace the other"
            faults.append(Fault(option, str(path), f"another file than {other}", why, "name another file"))
    if faults:
        raise InputError(faults)


def free_targets(csv: Path | None, plot: Path | None, read: Path, *, overwrite: bool) -> None:
    """Refuse a table and a picture that could not be written, before anything is computed."""
    together(
        lambda: apart({"--csv": csv, "--plot": plot}, [read]),
        lambda: None if csv is None else free_to_write("output", csv, overwrite=overwrite),
        lambda: free_picture(plot, overwrite),
    )


def _real(path: Path) -> str:
    return os.path.realpath(path)
