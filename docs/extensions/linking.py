"""Links of the reference: names in docstrings and types in signatures lead to their entries."""

from __future__ import annotations

from docutils import nodes
from reference import homes, pages
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.ext.autosummary import AutoLink, ImportExceptionGroup, import_by_name


def resolve(app: Sphinx, env: BuildEnvironment, node: pending_xref, content: nodes.Node) -> nodes.Node | None:
    """Link a name of flexcam to its entry; a name that is not public stays plain text."""
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
    """A name in single quotes: a link where it is public, code wherever it is not; the name of a package links to its page."""

    def run(self) -> tuple[list[nodes.Node], list[nodes.system_message]]:
        """Return the link, or the name as code."""
        if self.text in pages() and self.text != "flexcam":
            self.text = f"~flexcam.{self.text}"
        found, messages = super().run()
        plain = [nodes.literal(n.rawsource, n.astext()) if isinstance(n, nodes.emphasis) else n for n in found]
        return plain, messages


def without_call(app: Sphinx, what: str, name: str, value: object, *rest: object) -> tuple[str, str] | None:
    """Return an empty signature for a protocol, which is not called."""
    return ("", "") if what == "class" and getattr(value, "_is_protocol", False) else None


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_role("name", Name())
    app.connect("autodoc-process-signature", without_call)
    app.connect("missing-reference", resolve)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
