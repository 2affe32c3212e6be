"""Classes of table cells for the style sheet: number cells do not wrap, and empty headers are hidden."""

from __future__ import annotations

import re

from docutils import nodes
from sphinx.application import Sphinx

NUMBER = re.compile(r"[<>±+\N{MINUS SIGN}-]{0,2}\s?\d[\d.,]*(e[+-]?\d+)?(\s?(%|[\w/^²³·]{1,8}))?")
"""A number with or without a unit."""


def add_classes(app: Sphinx, tree: nodes.document) -> None:
    """Add classes to number cells and to tables without header texts."""
    for cell in tree.findall(nodes.entry):
        if NUMBER.fullmatch(cell.astext().strip()):
            cell["classes"].append("number")
    for table in tree.findall(nodes.table):
        for head in table.findall(nodes.thead):
            if not head.astext().strip():
                table["classes"].append("headless")


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("doctree-read", add_classes)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
