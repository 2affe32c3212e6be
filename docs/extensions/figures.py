"""Pictures of the gallery: every matplotlib `Figure` that a block of a script creates, without pyplot."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from PIL import Image, ImageFilter
from sphinx.application import Sphinx
from sphinx_gallery.scrapers import figure_rst

ORDER = (
    "cantilever", "camshaft_modes", "laws_side_by_side", "measured_lift", "published_cam", "campbell_diagram",
    "loss_of_contact", "oil_film_of_a_cam", "valve_spring_settings", "sweep_over_speed", "speed_against_accuracy",
)  # fmt: skip
"""Scripts in the order of the gallery; others follow."""


def order(file: str) -> tuple[int, str]:
    """Return the sort key of a script, given its file name."""
    name = file.removesuffix(".py")
    return (ORDER.index(name) if name in ORDER else len(ORDER), name)


def figures(block: tuple[str, str, int], values: dict[str, Any], settings: dict[str, Any]) -> str:
    """Save the figures of a block and return the text that shows them.

    Parameters
    ----------
    block
        Kind, text and first line; not used.
    values
        Data of the script: variables and image paths.
    settings
        Settings of the gallery.

    Returns
    -------
    str
        reStructuredText.
    """
    saved: list[str] = []
    for figure in [value for value in values["example_globals"].values() if isinstance(value, Figure)]:
        if not getattr(figure, "in_gallery", False) and figure.axes and block[0] == "code":
            path = str(next(values["image_path_iterator"]))
            figure.savefig(path, dpi=110)
            figure.in_gallery = True  # pyright: ignore[reportAttributeAccessIssue]
            saved.append(path)
    return figure_rst(saved, settings["src_dir"])


def thumbnails(app: Sphinx) -> None:
    """Make thumbnails with thicker lines, which are otherwise too pale after scaling."""
    images = Path(app.srcdir) / "gallery/images"
    for thumbnail in images.glob("thumb/sphx_glr_*_thumb.png"):
        large = images / thumbnail.name.replace("_thumb", "_001")
        if large.exists():
            with Image.open(large) as picture:
                scaled = picture.convert("RGB").filter(ImageFilter.MinFilter(3))
            scaled.thumbnail(app.config.sphinx_gallery_conf["thumbnail_size"])
            scaled.save(thumbnail)


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("builder-inited", thumbnails, priority=900)  # after the gallery
    return {"parallel_read_safe": True, "parallel_write_safe": True}
