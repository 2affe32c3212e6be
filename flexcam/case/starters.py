"""Starter cases: commented files in the package, copied to the user's folder."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path

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
        raise refuse("-o", str(target), "a name that ends in .toml", "it is a case file")
    written = {
        target: text,
        **{target.with_name(name): _read_template(name) for name in _referenced_files(tomllib.loads(text))},
    }
    for one, content in written.items():
        same = one != target and one.is_file() and one.read_bytes() == content.encode()  # of another starter case
        check_writable("starter case", one, overwrite=overwrite or same)
    for one, content in written.items():
        write_text(one, content, overwrite=True)
    return list(written)


def _read_template(name: str) -> str:
    return (_FOLDER / name).read_text(encoding="utf-8")


def _referenced_files(value: object) -> Iterator[str]:
    """Yield the names of the package's files that a case refers to."""
    if isinstance(value, dict):
        for one in value.values():  # pyright: ignore[reportUnknownVariableType]
            yield from _referenced_files(one)  # pyright: ignore[reportUnknownArgumentType]
    elif isinstance(value, str) and value.endswith(".csv"):
        yield value
