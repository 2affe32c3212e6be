"""Parsing of documentation pages whose code blocks are run in order in one folder.

Blocks of a page: ``python`` and ``sh`` are run, ``text`` after one of them is its expected output (``...`` matches
anything). A block with a caption is a file of that name: further TOML blocks are appended, a ``diff`` changes it. A
comment before a block is a note: ``<!-- slow -->`` (only in slow runs), ``<!-- exit 2 -->`` (exit code of the
command).
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
FOLDERS = ("tutorials", "topics", "howto")
PAGES = sorted(path for folder in FOLDERS for path in (ROOT / "docs" / folder).glob("*.md"))
BLOCK = re.compile(
    r"^(?:<!-- (?P<note>[^\n]*) -->\n)?```(?:\{code-block\} )?(?P<language>\w+)\n"
    r"(?::caption: (?P<caption>[^\n]+)\n\n?)?(?P<text>.*?)^```$",
    re.S | re.M,
)


@dataclass(frozen=True)
class Block:
    """A block of a page, with the number of its first line."""

    language: str
    text: str
    caption: str
    note: str
    line: int

    @property
    def slow(self):
        return "slow" in self.note.split()

    @property
    def code(self):
        first, *rest = self.note.split() or [""]
        return int(rest[0]) if first == "exit" else 0


def blocks(path):
    """Return the blocks of a page in order."""
    text = path.read_text(encoding="utf-8")
    return [
        Block(m["language"], m["text"], m["caption"] or "", m["note"] or "", text[: m.start()].count("\n") + 1)
        for m in BLOCK.finditer(text)
    ]


def page_name(path):
    return path.relative_to(ROOT / "docs").as_posix()


def words(text):
    return " ".join(text.split())


def assert_shown(shown, printed, where):
    """Assert that a text is in the output, except for white space and the parts replaced by dots."""
    pattern = ".*?".join(re.escape(words(part)) for part in shown.split("..."))
    assert re.search(pattern, words(printed), re.S), f"{where}: the page shows\n{shown}\nbut printed was\n{printed}"


def apply_diff(text, diff):
    """Return a text with a change of lines; the removed and context lines must occur once."""
    lines = [line for line in diff.splitlines() if line]
    old = "".join(f"{line[1:]}\n" for line in lines if line[0] in " -")
    new = "".join(f"{line[1:]}\n" for line in lines if line[0] in " +")
    assert text.count(old) == 1, f"found {text.count(old)} times:\n{old}"
    return text.replace(old, new)


def changes_package(path):
    """Return whether a page changes files of flexcam."""
    return any(block.caption.startswith(("flexcam/", "tests/")) for block in blocks(path))


def write_block(path, block):
    """Write, extend or change the file of a block with a caption."""
    current = path.read_text(encoding="utf-8") if path.exists() else ""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(
        apply_diff(current, block.text) if block.language == "diff" else current + block.text, encoding="utf-8"
    )
