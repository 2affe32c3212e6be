"""Write the texts of Python and TOML files as Markdown with the same line numbers, for the prose linter."""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

FOLDERS = ("flexcam", "cases")
"""Folders with docstrings, messages, help texts, key descriptions and comments of cases."""


def texts(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Yield the strings of a syntax tree with their lines; a field of a formatted string is `x`."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.JoinedStr):
            parts = (part.value if isinstance(part, ast.Constant) else "`x`" for part in node.values)
            yield node.lineno, "".join(map(str, parts))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.lineno, node.value
        else:
            yield from texts(node)


def python_as_markdown(source: str) -> str:
    """Return the texts of a Python file as Markdown."""
    lines = [""] * (source.count("\n") + 1)
    for first, text in texts(ast.parse(source)):
        if len(text.split()) < 3 or re.search(r"^(import|from) \w", text, re.M):
            continue  # a key, a name, a unit or a script
        for number, line in enumerate(text.split("\n"), start=first - 1):
            code = re.match(r"\s*(>>>|\.\.\.|\.\. )", line)
            line = "" if code else line.strip()
            lines[number] += f"- {line}" if number == first - 1 else line
    return "\n".join(lines)


def comments_as_markdown(source: str) -> str:
    """Return the comments of a TOML file as Markdown."""
    return "\n".join("- " + line.partition("# ")[2] if "# " in line else "" for line in source.split("\n"))


def main(target: Path) -> None:
    """Write one page per file."""
    for path in (path for folder in FOLDERS for path in sorted(Path(folder).rglob("*.*"))):
        if path.suffix in (".py", ".toml"):
            page = target / f"{path}.md"
            page.parent.mkdir(parents=True, exist_ok=True)
            source = path.read_text(encoding="utf-8")
            page.write_text(python_as_markdown(source) if path.suffix == ".py" else comments_as_markdown(source))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
