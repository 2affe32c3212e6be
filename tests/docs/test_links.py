"""Every relative link of every Markdown page leads to a file, and to a heading where it names one."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
MADE = ("docs/gallery/", "docs/reference/api/", "docs/reference/commands/")
"""Pages that the build makes: they are checked there, by Sphinx."""
PAGES = [
    page
    for page in sorted([*ROOT.glob("*.md"), *ROOT.glob(".github/**/*.md"), *(ROOT / "docs").rglob("*.md")])
    if not str(page.relative_to(ROOT)).startswith(MADE)
]
LINK = re.compile(r"!?\[[^\]]*\]\(<?([^)\s>]+)>?[^)]*\)")
DIRECTIVE = re.compile(r"^```\{(?:include|image|figure|literalinclude)\} (\S+)", re.M)
FENCE = re.compile(r"^```.*?^```", re.S | re.M)


def targets(text):
    prose = re.sub(r"`[^`\n]*`", "", FENCE.sub("", text))
    return [t for t in [*LINK.findall(prose), *DIRECTIVE.findall(text)] if not re.match(r"[a-z]+:", t)]


def headings(text):
    """Return the anchors of a page, as GitHub and MyST make them."""
    titles = re.findall(r"^#+ (.*)$", FENCE.sub("", text), re.M)
    return {re.sub(r"[^\w\- ]", "", title.lower()).strip().replace(" ", "-") for title in titles}


def broken(page):
    for target in targets(page.read_text(encoding="utf-8")):
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        if file.is_relative_to(ROOT) and str(file.relative_to(ROOT)).startswith(MADE):
            continue
        if not file.exists():
            yield f"{target}: no such file"
        elif anchor and file.suffix == ".md" and anchor not in headings(file.read_text(encoding="utf-8")):
            yield f"{target}: no such heading"


def test_links_lead_somewhere():
    assert [f"{page.relative_to(ROOT)}: {fault}" for page in PAGES for fault in broken(page)] == []


def test_there_are_links():
    assert sum(len(targets(page.read_text(encoding="utf-8"))) for page in PAGES) > 40


def test_a_broken_link_is_found(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("# One\n[a](#one) [b](page.md#two) ![c](none.png) [d](https://x.y)\n", encoding="utf-8")
    assert list(broken(page)) == ["page.md#two: no such heading", "none.png: no such file"]
