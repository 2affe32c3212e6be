"""What stands beside a result that is not there: the copy of a run that goes on or broke off, or the end of one."""

from __future__ import annotations

from pathlib import Path

from flexcam.checks import did_you_mean
from flexcam.io.vtkhdf import partial_of

_RESULT, _PARTIAL, _WRITING = ".vtkhdf", ".partial.vtkhdf", (".writing", ".copying")


def instead(path: Path) -> str:
    """Return what to read in the place of a result that cannot be read."""
    if path.suffix == ".toml":
        return f"a case is solved first: flexcam run {path}"
    try:
        return _beside(path)
    except OSError:  # no name of a file, or a folder that may not be looked into: the refusal itself says so
        return ""


def _beside(path: Path) -> str:
    final = path.with_name(path.name.removesuffix(_PARTIAL) + _RESULT) if path.name.endswith(_PARTIAL) else path
    final = final.with_suffix(_RESULT) if final.suffix in _WRITING else final
    partial, writing = partial_of(final), final.with_suffix(_WRITING[0])
    if path.exists() and path.suffix not in _WRITING:
        return ""
    if final != path and final.exists():
        return f"its run is complete: {final}"
    if partial != path and partial.exists():
        return f"{partial} is there: what a run that is going on or broke off has finished"
    if writing.exists():
        return (
            f"{writing} is there: a run is going on, or was killed before its first copy; ask again once it has ended"
        )
    return did_you_mean(path.name, [one.name for one in path.parent.glob(f"*{_RESULT}")])
