"""Style of the bibliography: BibTeX's ``unsrt``, and a volume also without pages."""

from __future__ import annotations

from pybtex.plugin import register_plugin
from pybtex.style.formatting.unsrt import Style as Unsrt
from pybtex.style.formatting.unsrt import date
from pybtex.style.template import Node, field, join, optional, sentence, tag
from sphinx.application import Sphinx

VOLUME = join[
    field("volume"),
    optional["(", field("number"), ")"],
    optional[":", field("pages")],
]


class Sources(Unsrt):
    """Style of the bibliography; labels have names and years."""

    default_label_style = "alpha"

    def get_article_template(self, e: object) -> Node:
        """Return author, title, journal with known volume, number and pages, and year."""
        journal = sentence[tag("em")[field("journal")], optional[VOLUME], optional[date]]
        return join(sep=" ")[
            self.format_names("author"), self.format_title(e, "title"), journal, self.format_web_refs(e)
        ]


def setup(app: Sphinx) -> dict[str, bool]:
    register_plugin("pybtex.style.formatting", "sources", Sources)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
