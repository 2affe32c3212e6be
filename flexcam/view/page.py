"""A scene as a page that needs no server and no network: vtk.js and the scene in one file, to be turned by hand.

trame-vtk describes a window for vtk.js and holds the viewer. It is used without trame's server, which would look for a
download and a free port.
"""

# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false, reportMissingImports=false
# trame-vtk has no types, and is not needed for anything else.

from __future__ import annotations

import html
import io
import json
import re
import zipfile
from pathlib import Path
from typing import Any


def write_page(window: Any, path: Path, title: str) -> None:  # noqa: ANN401 - a window of VTK
    """Write what a window shows as a page."""
    from trame_vtk.tools.vtksz2html import write_html

    packed, page = io.BytesIO(), io.StringIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("index.json", json.dumps(_described(window)))
    write_html(packed.getvalue(), page)
    alone = _ICONS.sub("`data:,`", page.getvalue())
    path.write_text(alone.replace("<head>", f"<head><title>{html.escape(title)}</title>", 1), encoding="utf-8")


_ICONS = re.compile(r"`https?://[^`]*/favicon[^`]*`")
"""Icons that the viewer would fetch from its makers."""


def _described(window: Any) -> dict[str, Any]:  # noqa: ANN401
    """Return a window as vtk.js reads it: its objects, and their arrays by a hash."""
    from trame_vtk.modules.vtk.serializers import (
        SynchronizationContext,
        extract_array_hash,
        initialize_serializers,
        reference_id,
        serialize,
    )

    initialize_serializers()
    context = SynchronizationContext()
    context.set_ignore_last_dependencies(True)
    scene: Any = serialize(None, window, reference_id(window), context, 1)
    camera = window.GetRenderers().GetFirstRenderer().GetActiveCamera()
    scene["extra"] = {
        "vtkRefId": reference_id(window), "centerOfRotation": camera.GetFocalPoint(), "camera": reference_id(camera),
    }  # fmt: skip
    hashes = {
        one["hash"]: {**one, "content": context.get_cached_data_array(one["hash"], False)}
        for one in extract_array_hash(scene)
    }
    return {"hashes": hashes, "scene": scene}
