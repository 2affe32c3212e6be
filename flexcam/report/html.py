"""A report as one page that needs no network: text, data and programs in one file.

Jinja writes the page, with every value escaped unless it is a program of ours; the curves are plotly.js, which the
package plotly carries. What may run in the page is named by its hash, so nothing that came in with a case can.
"""

from __future__ import annotations

import base64
import hashlib
import json
import pkgutil
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flexcam import __version__
from flexcam.report.content import Album, Chart, Picture, Report, Scene

_PAGE = Path(__file__).parent / "page"
_LARGE = 5000.0
"""Numbers beyond which single precision would show on the cam angle."""

_SINGLE = 1e37
"""Numbers beyond which single precision has none: those of a run that diverged."""

_ESCAPED = {"<": "\\u003c", ">": "\\u003e", "&": "\\u0026", "\u2028": "\\u2028", "\u2029": "\\u2029"}


def page(report: Report) -> str:
    """Return a report as HTML."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from markupsafe import Markup

    ours = Markup  # what stands in a page as it is: our own programs, and data escaped by `embedded`
    scripts = [_plotly(), _text("curves.js"), _text("shapes.js")]
    jinja = Environment(loader=FileSystemLoader(_PAGE), autoescape=True, undefined=StrictUndefined, trim_blocks=True,
                        lstrip_blocks=True)  # fmt: skip
    return jinja.get_template("page.html").render(
        report=report, version=__version__, style=ours(_text("page.css")), scripts=[ours(one) for one in scripts],
        policy=_policy(scripts), data=ours(embedded(_data(report))), image=_image,
    )  # fmt: skip


def embedded(content: object) -> str:
    r"""Return a value as JSON that can stand inside a script element, whatever its strings are."""
    text = json.dumps(content, allow_nan=False)
    for character, escape in _ESCAPED.items():
        text = text.replace(character, escape)
    return text


def _text(name: str) -> str:
    return (_PAGE / name).read_text(encoding="utf-8")


def _plotly() -> str:
    """Return plotly.js; `import plotly` would load far more than this file."""
    return (pkgutil.get_data("plotly", "package_data/plotly.min.js") or b"").decode()


def _policy(scripts: list[str]) -> str:
    """Return what the page may do: run these programs, style itself, show pictures of its own; nothing from outside."""
    hashes = (base64.b64encode(hashlib.sha256(one.encode()).digest()).decode() for one in scripts)
    allowed = " ".join(f"'sha256-{one}'" for one in hashes)
    return f"default-src 'none'; script-src {allowed}; style-src 'unsafe-inline'; img-src data: blob:"


def _image(picture: Picture) -> str:
    """Return a picture as an address that holds it."""
    return "data:image/png;base64," + base64.b64encode(picture.png).decode()


def _data(report: Report) -> dict[str, object]:
    """Return what the programs of the page draw."""
    scenes = [_scene(chapter.scene) if chapter.scene else None for chapter in report.chapters]
    return {"albums": [_album(one) for one in report.albums], "scenes": scenes}


def _album(album: Album) -> dict[str, object]:
    return {"title": album.title, "charts": [_chart(one) for one in album.charts]}


def _chart(chart: Chart) -> dict[str, object]:
    return {
        "name": chart.name,
        "words": list(chart.words),
        "panels": [
            {
                "label": panel.label,
                "curves": [
                    {
                        "name": one.name,
                        "group": one.group,
                        "rigid": one.rigid,
                        "x": _numbers(one.x),
                        "y": _numbers(one.y),
                    }
                    for one in panel.curves
                ],
            }
            for panel in chart.panels
        ],
    }


def _scene(scene: Scene) -> dict[str, object]:
    return {
        "points": _numbers(scene.points),
        "lines": [{"name": name, "from": first, "to": last} for name, (first, last) in scene.lines.items()],
        "names": [{"name": name, "at": at} for name, at in scene.names.items()],
        "shapes": [
            {"name": one.name, "words": one.words, "count": len(one.frames), "frames": _numbers(one.frames)}
            for one in scene.shapes
        ],
    }


def _numbers(values: NDArray[np.float64]) -> Mapping[str, str]:
    """Return an array as plotly.js takes it: base64 of its bytes, single precision where that is enough."""
    largest = float(np.abs(values).max(initial=0.0))
    kind = "f8" if largest > _SINGLE or (largest > _LARGE and _rising(values)) else "f4"
    return {"dtype": kind, "bdata": base64.b64encode(np.ascontiguousarray(values, dtype=f"<{kind}").tobytes()).decode()}


def _rising(values: NDArray[np.float64]) -> bool:
    return values.ndim == 1 and bool((np.diff(values) >= 0.0).all())
