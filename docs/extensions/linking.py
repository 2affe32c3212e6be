"""Links of names in docstrings and types in signatures to their entries in the reference."""

from __future__ import annotations

from docutils import nodes
from reference import homes, pages
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.ext.autosummary import AutoLink, ImportExceptionGroup, import_by_name


def resolve(app: Sphinx, env: BuildEnvironment, node: pending_xref, content: nodes.Node) -> nodes.Node | None:
    """Return a link from a name of flexcam to its entry; a name that is not public remains plain text."""
    target = node.get("reftarget", "")
    if node.get("refdomain") != "py" or not target.startswith("flexcam"):
        return None
    try:
        value = import_by_name(target)[1]
    except ImportExceptionGroup:
        return None
    home = homes().get(id(value))
    if home is None or home == target:
        return content
    return env.domains["py"].resolve_xref(env, node["refdoc"], app.builder, "obj", home, node, content)


class Name(AutoLink):
    """Role of a name in single backquotes: a link for a public name or package, otherwise code."""

    def run(self) -> tuple[list[nodes.Node], list[nodes.system_message]]:
        """Return the link, or the name as code."""
        if self.text in pages() and self.text != "flexcam":
            self.text = f"~flexcam.{self.text}"
        found, messages = super().run()
        plain = [nodes.literal(n.rawsource, n.astext()) if isinstance(n, nodes.emphasis) else n for n in found]
        return plain, messages


def hide_protocol_signature(app: Sphinx, what: str, name: str, value: object, *rest: object) -> tuple[str, str] | None:
    """Return an empty signature for a protocol."""
    return ("", "") if what == "class" and getattr(value, "_is_protocol", False) else None


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_role("name", Name())
    app.connect("autodoc-process-signature", hide_protocol_signature)
    app.connect("missing-reference", resolve)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
