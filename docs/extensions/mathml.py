"""Formulas as MathML: docutils translates the LaTeX, and browsers render it without scripts or network."""

from __future__ import annotations

import re

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.util.math import get_node_equation_number
from sphinx.writers.html5 import HTML5Translator

_FUNCTION = r"\\(?:sin|cos|tan|sinh|cosh|tanh|exp|ln|log|arctan|det)(?![a-zA-Z])"
_SPACES = (
    (rf"(?<=[\w)}}])\s*({_FUNCTION})", r"\,\1"),
    (rf"({_FUNCTION})\s*(?=[A-Za-z0-9\\])(?!\\(?:left|big))", r"\1\,"),
)
"""Thin spaces around function names, which TeX adds and docutils does not."""

_log = logging.getLogger(__name__)


def add_spaces(text: str) -> str:
    for pattern, spaces in _SPACES:
        text = re.sub(pattern, spaces, text)
    return text


def translate(node: nodes.Element, *, block: bool) -> str:
    """Return a formula as MathML; an untranslatable formula causes a warning and so fails the build."""
    text = node.astext()
    try:
        return tex2mathml(add_spaces(text), as_block=block).replace("<mo>'</mo>", "<mo>\N{PRIME}</mo>")
    except MathError as error:
        _log.warning("no MathML for %r: %s", text, error, location=node)
        return f"<code>{text}</code>"


def visit_inline(self: HTML5Translator, node: nodes.math) -> None:
    self.body.append(translate(node, block=False))
    raise nodes.SkipNode


def visit_block(self: HTML5Translator, node: nodes.math_block) -> None:
    self.body.append(self.starttag(node, "div", CLASS="math"))
    if node["number"]:
        self.body.append(f'<span class="eqno">({get_node_equation_number(self, node)})</span>')
    self.body.append(translate(node, block=True) + "</div>\n")
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_html_math_renderer("mathml", (visit_inline, None), (visit_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
