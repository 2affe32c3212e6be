"""Read everything in a file and say whether it is as it was written."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from flexcam.checks import Fault, InputError
from flexcam.io.guard import DAMAGE, datasets, guarded
from flexcam.io.instead import instead
from flexcam.io.result import status_of
from flexcam.io.sealed import SUM, seal_fault
from flexcam.io.sound import damaged, held


@dataclass(frozen=True)
class Verified:
    """What was read of a sound file.

    Parameters
    ----------
    datasets
        How many.
    checked
        How many of them have a checksum of their rows; the seal covers the others.
    bytes
        Of their numbers and texts.
    complete
        Whether the run that wrote it came to its end.
    """

    datasets: int
    checked: int
    bytes: int
    complete: bool


def verified(path: str | Path) -> Verified:
    """Read every dataset of a result, and the table of a sweep, to the last byte."""
    source = Path(path)
    allowed = "a result file of flexcam (.vtkhdf) or the table of a sweep (.h5)"
    with guarded(source, "result", allowed, instead(source)) as file:
        found = datasets(file)
        if faults := [fault for fault in (seal_fault(file), *map(_fault, found)) if fault]:
            raise InputError(faults)
        complete = "history" not in file or status_of(file).ok
        checked = sum(SUM in one.attrs for one in found)
        return Verified(len(found), checked, sum(int(one.nbytes) for one in found), complete)


def _fault(one: Any) -> Fault | None:  # noqa: ANN401 - h5py has no types
    try:
        return held(one)
    except DAMAGE as fault:
        return damaged(one, str(fault))
