"""Starter cases: commented files in the package, copied to the user's folder."""

from __future__ import annotations

import tomllib
from importlib.resources import files
from pathlib import Path

from flexcam.case.fault_report import iterate_values
from flexcam.core.errors import refuse, suggest_name
from flexcam.io import check_writable, write_text

_FOLDER = files("flexcam") / "templates"


def templates() -> dict[str, str]:
    """Return the starter cases."""
    names = sorted(item.name for item in _FOLDER.iterdir() if item.name.endswith(".toml"))
    return {name.removesuffix(".toml"): _read_template(name).partition("\n")[0].lstrip("# ") for name in names}


def new_case(template: str, path: Path | None = None, *, overwrite: bool = False) -> list[Path]:
    """Write a starter case and the files it refers to."""
    known = templates()
    if template not in known:
        raise refuse("template", repr(template), ", ".join(known), remedy=suggest_name(template, known))
    text = _read_template(f"{template}.toml")
    target = path or Path(f"{template}.toml")
    if target.suffix != ".toml":
        raise refuse("-o", str(target), "a name that ends in .toml", "the output is a case file")
    texts = [value for _, value in iterate_values(tomllib.loads(text)) if isinstance(value, str)]
    tables = [name for name in texts if name.endswith((".csv", ".mtx"))]
    contents = {target: text, **{target.with_name(name): _read_template(name) for name in tables}}
    for file, content in contents.items():
        same = file != target and file.is_file() and file.read_bytes() == content.encode()  # of another starter case
        check_writable("starter case", file, overwrite=overwrite or same)
    for file, content in contents.items():
        write_text(file, content, overwrite=True)
    return list(contents)


def _read_template(name: str) -> str:
    return (_FOLDER / name).read_text(encoding="utf-8")
