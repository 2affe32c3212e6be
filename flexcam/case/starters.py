"""Starter cases: commented files in the package, copied to the user's folder."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path

from flexcam.core.errors import did_you_mean, refuse
from flexcam.io import free_to_write, write_text

_FOLDER = files("flexcam") / "templates"


def templates() -> dict[str, str]:
    """Return the starter cases."""
    names = sorted(item.name for item in _FOLDER.iterdir() if item.name.endswith(".toml"))
    return {name.removesuffix(".toml"): _text(name).partition("\n")[0].lstrip("# ") for name in names}


def new_case(template: str, path: Path | None = None, *, overwrite: bool = False) -> list[Path]:
    """Write a starter case and the files it refers to."""
    known = templates()
    if template not in known:
        raise refuse("template", repr(template), ", ".join(known), remedy=did_you_mean(template, known))
    text = _text(f"{template}.toml")
    target = path or Path(f"{template}.toml")
    if target.suffix != ".toml":
        raise refuse("-o", str(target), "a name that ends in .toml", "it is a case file")
    written = {target: text, **{target.with_name(name): _text(name) for name in _beside(tomllib.loads(text))}}
    for one in written:
        free_to_write("case", one, overwrite=overwrite)
    for one, content in written.items():
        write_text(one, content, overwrite=overwrite)
    return list(written)


def _text(name: str) -> str:
    return (_FOLDER / name).read_text(encoding="utf-8")


def _beside(value: object) -> Iterator[str]:
    """Yield the names of the package's files that a case refers to."""
    if isinstance(value, dict):
        for one in value.values():  # pyright: ignore[reportUnknownVariableType]
            yield from _beside(one)  # pyright: ignore[reportUnknownArgumentType]
    elif isinstance(value, str) and value.endswith(".csv"):
        yield value
