"""Laws and lifts as TOML files, to be named in a case."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, is_dataclass
from pathlib import Path

from flexcam.checks import refuse
from flexcam.io.csv import write_text
from flexcam.io.toml_text import toml_text
from flexcam.motion import KINDS, HarmonicLift, Law


def write_law(law: Law, path: Path, *, about: Mapping[str, object], overwrite: bool = False) -> Path:
    """Write a law as a file that a case names: ``law = "NAME.toml"``."""
    names = [name for name, kind in KINDS.items() if kind is type(law)]
    if not names or not is_dataclass(law):
        raise refuse("law", type(law).__name__, f"a law of the kinds {', '.join(KINDS)}")
    table = {key: value for key, value in asdict(law).items() if value is not None}
    return _write(path, {"format": 1, "law": {"id": names[0], **table}, "about": dict(about)}, overwrite=overwrite)


def write_lift(lift: HarmonicLift, path: Path, *, about: Mapping[str, object], overwrite: bool = False) -> Path:
    """Write a lift of harmonics as a file that a case names: ``lift_table = "NAME.toml"``."""
    return _write(path, {"format": 1, "lift": asdict(lift), "about": dict(about)}, overwrite=overwrite)


def _write(path: Path, content: Mapping[str, object], *, overwrite: bool) -> Path:
    if path.suffix != ".toml":
        raise refuse("output", str(path), "a name that ends in .toml", "so a case tells it from a name of a law")
    return write_text(path, toml_text(content), overwrite=overwrite)
