"""Formulas as MathML, which browsers draw by themselves: no script, no network. docutils translates the LaTeX."""

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
"""Thin spaces about a function's name, which TeX sets by itself and docutils leaves out."""

_log = logging.getLogger(__name__)


def spaced(text: str) -> str:
    for pattern, spaces in _SPACES:
        text = re.sub(pattern, spaces, text)
    return text


def translated(node: nodes.Element, *, block: bool) -> str:
    """Return a formula as MathML; what cannot be translated is a warning, and so fails the build."""
    text = node.astext()
    try:
        return tex2mathml(spaced(text), as_block=block).replace("<mo>'</mo>", "<mo>\N{PRIME}</mo>")
    except MathError as fault:
        _log.warning("no MathML for %r: %s", text, fault, location=node)
        return f"<code>{text}</code>"


def inline(self: HTML5Translator, node: nodes.math) -> None:
    self.body.append(translated(node, block=False))
    raise nodes.SkipNode


def block(self: HTML5Translator, node: nodes.math_block) -> None:
    self.body.append(self.starttag(node, "div", CLASS="math"))
    if node["number"]:
        self.body.append(f'<span class="eqno">({get_node_equation_number(self, node)})</span>')
    self.body.append(translated(node, block=True) + "</div>\n")
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_html_math_renderer("mathml", (inline, None), (block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
