"""Links from source code to documentation: to the name that a package exports, not to that of the file."""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx

_BACK = re.compile(r'<a class="viewcode-back" href="(?P<page>[^"#]*)#(?P<name>[^"]*)">.*?</a>')


def correct_link(link: re.Match[str], names: dict[str, tuple[str, str]]) -> str:
    """Return a link to the anchor of its page, or an empty string if the page has no such name.

    Sphinx assumes one module per file, but several modules may export a name of one file.

    Parameters
    ----------
    link
        Link of Sphinx.
    names
        Page and anchor of all documented names.
    """
    name, home = link["name"], link["page"].removesuffix(".html").lstrip("./")
    parts = name.split(".")
    tails = [f".{name}", *("." + ".".join(parts[start:]) for start in range(1, len(parts)))]
    here = {known: anchor for known, (page, anchor) in names.items() if page == home}
    found = [anchor for tail in tails for known, anchor in here.items() if f".{known}".endswith(tail)]
    return link[0].replace(f"#{name}", f"#{found[0]}") if found else ""


def correct_links(app: Sphinx, page: str, template: str, context: dict[str, Any], tree: nodes.Node | None) -> None:
    if page.startswith("_modules/"):
        documented = app.env.domains["py"].objects  # pyright: ignore[reportAttributeAccessIssue]
        names = {name: (entry.docname, entry.node_id) for name, entry in documented.items()}
        context["body"] = _BACK.sub(lambda link: correct_link(link, names), context["body"])


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("html-page-context", correct_links)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
