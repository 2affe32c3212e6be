"""Directive ``verification``: tests, rows and reasons of tolerances of a source in the verification manual."""

from __future__ import annotations

from functools import cache

from docutils import nodes
from manual.rows import KEPT, Row, file, read
from manual.tables import HEAD, cells
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective


@cache
def manual_rows() -> list[Row]:
    return read(KEPT)


class Verification(SphinxDirective):
    """Rows of the source that the title of the section names."""

    def run(self) -> list[nodes.Node]:
        """Return the names of the tests, the table and the reasons."""
        self.env.note_dependency(str(KEPT))
        source = self.state_machine.node[0].astext()
        rows = [row for row in manual_rows() if row["source"] == source]
        if not rows:
            message = f"no rows of {source!r}"
            raise self.error(message)
        reasons = dict.fromkeys(row["reason"] for row in rows)
        items = [nodes.list_item("", nodes.paragraph("", reason)) for reason in reasons]
        return [
            *(nodes.paragraph("", "", nodes.literal("", test)) for test in dict.fromkeys(map(file, rows))),
            table(HEAD, [cells(row) for row in rows]),
            nodes.paragraph("", "Reasons of the tolerances:"),
            nodes.bullet_list("", *items),
        ]


def table(head: tuple[str, ...], rows: list[list[str]]) -> nodes.table:
    """Return a table with a head row."""

    def line(texts: list[str] | tuple[str, ...]) -> nodes.row:
        return nodes.row("", *(nodes.entry("", nodes.paragraph("", text)) for text in texts))

    group = nodes.tgroup("", *(nodes.colspec("", colwidth=1) for _ in head), cols=len(head))
    group += nodes.thead("", line(head))
    group += nodes.tbody("", *map(line, rows))
    return nodes.table("", group, classes=["colwidths-auto"])


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_directive("verification", Verification)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
