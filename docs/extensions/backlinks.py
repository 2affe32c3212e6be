"""Links from shown code back to its description: to the name under which a package exports it, not that of its file."""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx

_BACK = re.compile(r'<a class="viewcode-back" href="(?P<page>[^"#]*)#(?P<name>[^"]*)">.*?</a>')


def described(link: re.Match[str], names: dict[str, tuple[str, str]]) -> str:
    """Return a link as it is, or mended, or nothing where its page describes no such name.

    Sphinx knows one module per file, but several modules may export a name of one file.

    Parameters
    ----------
    link
        As Sphinx writes it.
    names
        Page and anchor of all described names.
    """
    name, home = link["name"], link["page"].removesuffix(".html").lstrip("./")
    parts = name.split(".")
    tails = [f".{name}", *("." + ".".join(parts[start:]) for start in range(1, len(parts)))]
    here = {known: anchor for known, (page, anchor) in names.items() if page == home}
    found = [anchor for tail in tails for known, anchor in here.items() if f".{known}".endswith(tail)]
    return link[0].replace(f"#{name}", f"#{found[0]}") if found else ""


def mend(app: Sphinx, page: str, template: str, context: dict[str, Any], tree: nodes.Node | None) -> None:
    if page.startswith("_modules/"):
        told = app.env.domains["py"].objects  # pyright: ignore[reportAttributeAccessIssue]
        names = {name: (entry.docname, entry.node_id) for name, entry in told.items()}
        context["body"] = _BACK.sub(lambda link: described(link, names), context["body"])


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("html-page-context", mend)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
