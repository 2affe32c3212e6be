"""A variant as a case file of its own."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

from flexcam.case import Case
from flexcam.case.report import filled
from flexcam.io import file_beside, toml_text


def case_text(case: Case, target: Path, told: Sequence[str] = ()) -> str:
    """Return a case with every value filled in, as TOML that is read from another folder."""
    moved = _named_from(filled(case.record), case.path, target.parent)
    head = "".join(f"# {line}\n" for line in told)
    return head + toml_text(cast("dict[str, Any]", moved))


def _named_from(value: object, case: Path, new: Path) -> object:
    """Return tables whose texts that name a file beside the case name it from another folder."""
    if isinstance(value, dict):
        return {name: _named_from(one, case, new) for name, one in cast("dict[str, object]", value).items()}
    if isinstance(value, list):
        return [_named_from(one, case, new) for one in cast("list[object]", value)]
    if isinstance(value, str) and Path(value).suffix and not os.path.isabs(value):
        old = file_beside(case, value)
        return value if old is None else Path(os.path.relpath(old, new)).as_posix()
    return value
