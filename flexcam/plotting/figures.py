"""Shared code of all figures: axes, line styles and output files.

The colours are those of M. Okabe and K. Ito for colour-blind readers; lines also differ in their dashes, for printing
without colour.
"""

# pyright: reportUnknownMemberType=false
# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false, reportMissingImports=false
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false

from __future__ import annotations

import html
import io
import json
import re
import textwrap
import warnings
import zipfile
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from io import BytesIO
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, FigureBase

from flexcam.core.errors import refuse
from flexcam.io import atomic_write_path, check_writable, create_folder

if TYPE_CHECKING:
    from flexcam.plotting.solid_view import MechanismView


# matplotlib does not type its keyword arguments.


COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Colours of curves in their order."""

_DASHES = ("-", "--", "-.", ":")
_FORMATS = (".svg", ".png", ".pdf")
_TITLE_PAD = 14.0
"""Space between axes and title, points: the order numbers of a Campbell diagram are placed there."""

_TITLE_WIDTH = 76
"""Characters per line of a title above axes of standard width."""

_DPI, _COLOUR_COUNT = 160, 64
"""Resolution of an image for printing, dots per inch, and its number of colours; curves need few."""


def save_figure(figure: Figure, path: Path, *, overwrite: bool = False) -> Path:
    """Write a figure."""
    check_figure_path(path, overwrite=overwrite)
    create_folder(path.parent)
    with _suppress_warnings(), atomic_write_path(path) as draft:
        figure.savefig(draft, dpi=150)
    return path


@contextmanager
def _suppress_warnings() -> Generator[None]:
    """Suppress the warnings of matplotlib about missing glyphs, which it draws as boxes."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from", category=UserWarning)
        yield


def add_title(figure: Figure, title: str) -> Figure:
    """Add a title above the first axes, below an outside legend."""
    if title:
        figure.axes[0].set_title(wrap_title(title), fontsize="medium", pad=_TITLE_PAD)
    return figure


def wrap_title(title: str) -> str:
    """Wrap a title to the width of a figure."""
    return "\n".join(textwrap.wrap(title, _TITLE_WIDTH))


def render_png(figure: Figure) -> bytes:
    """Return a figure as PNG for printing, with a size that does not depend on the number of points."""
    from PIL import Image

    drawn, written = io.BytesIO(), io.BytesIO()
    with _suppress_warnings():
        figure.savefig(drawn, format="png", dpi=_DPI)
    with Image.open(drawn) as image:
        image.convert("RGB").quantize(_COLOUR_COUNT).save(written, format="png", optimize=True)
    return written.getvalue()


def check_figure_path(path: Path, *, overwrite: bool = False) -> None:
    """Raise an error if a figure cannot be written to a path."""
    if path.suffix not in _FORMATS:
        raise refuse("picture", str(path), f"a name that ends in {', '.join(_FORMATS)}")
    check_writable("picture", path, overwrite=overwrite)


def line_styles() -> Iterator[tuple[str, str]]:
    """Yield pairs of colour and dashes; seven colours and four dash patterns repeat after 28 curves."""
    return zip(cycle(COLOURS), cycle(_DASHES), strict=False)


def create_stacked_axes(labels: Sequence[str], below: str, *, height: float = 1.6) -> tuple[Figure, list[Axes]]:
    """Return a figure with axes stacked vertically."""
    figure = Figure(figsize=(7.0, 1.2 + height * len(labels)), layout="constrained")
    return figure, add_stacked_axes(figure, labels, below)


def add_stacked_axes(figure: FigureBase, labels: Sequence[str], below: str) -> list[Axes]:
    """Return vertically stacked axes of a figure or a subfigure."""
    axes = list(np.atleast_1d(np.asarray(figure.subplots(len(labels), sharex=True))))
    for one, label in zip(axes, labels, strict=True):
        one.set_ylabel(label)
        one.grid(alpha=0.3)
    axes[-1].set_xlabel(below)
    figure.align_ylabels(axes)
    return axes


def add_legend(figure: FigureBase, axes: Axes, count: int, *, columns: int = 4) -> None:
    """Add a legend with the names of several curves above the axes."""
    if count > 1:
        lines, names = axes.get_legend_handles_labels()
        figure.legend(lines, names, loc="outside upper center", fontsize="small", ncols=min(count, columns))


# trame-vtk has no types and is used only here.


def write_page(window: Any, path: Path, title: str) -> None:  # noqa: ANN401 - a window of VTK
    """Write the content of a window as an HTML page."""
    from trame_vtk.tools.vtksz2html import write_html

    packed, page = io.BytesIO(), io.StringIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("index.json", json.dumps(_serialize_window(window)))
    write_html(packed.getvalue(), page)
    alone = _ICONS.sub("`data:,`", page.getvalue())
    path.write_text(alone.replace("<head>", f"<head><title>{html.escape(title)}</title>", 1), encoding="utf-8")


_ICONS = re.compile(r"`https?://[^`]*/favicon[^`]*`")
"""Icons that the viewer would download."""


def _serialize_window(window: Any) -> dict[str, Any]:  # noqa: ANN401
    """Return a window in the format of vtk.js: its objects, and their arrays by hash."""
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


# pyvista and imageio do not type most of their interface.


REQUIREMENTS = {
    ".png": ("", ()),
    ".gif": ("movie", ("imageio",)),
    ".mp4": ("movie", ("imageio", "imageio_ffmpeg")),
    ".html": ("html", ("trame_vtk",)),
}
"""Requirements by file type: the extra of flexcam and its modules."""

FRAMES = 72
"""Frames per revolution."""

_PER_SECOND = 24


def check_output_path(path: Path, size: tuple[int, int], *, overwrite: bool = False) -> None:
    """Raise an error if an output file cannot be written, before rendering."""
    if path.suffix not in REQUIREMENTS:
        raise refuse("--save", str(path), f"a name that ends in {', '.join(REQUIREMENTS)}")
    extra, modules = REQUIREMENTS[path.suffix]
    lacking = [name for name in modules if find_spec(name) is None]
    if lacking:
        why = f"{' and '.join(lacking)} cannot be imported"
        raise refuse("--save", str(path), "a kind of file whose packages are installed", why,
                     f"pip install 'flexcam[{extra}]'")  # fmt: skip
    if path.suffix == ".mp4" and (size[0] % 2 or size[1] % 2):
        raise refuse("--size", f"{size[0]}x{size[1]}", "even numbers", "the colours of a movie are kept by fours")
    check_writable("picture", path, overwrite=overwrite)


def save_view(stage: MechanismView, path: Path, frames: Sequence[int], still: int) -> None:
    """Write an image or page of one instant, or a movie of several."""
    create_folder(path.parent)
    with atomic_write_path(path) as draft:
        _save(stage, draft, frames, still)


def _save(stage: MechanismView, path: Path, frames: Sequence[int], still: int) -> None:
    match path.suffix:
        case ".gif":
            path.write_bytes(_gif(stage, frames))
        case ".mp4":
            _movie(stage, path, frames)
        case ".png":
            stage.show(still)
            stage.plotter.screenshot(path)
        case _:
            stage.show(still)
            stage.plotter.render()
            write_page(stage.plotter.render_window, path, stage.title)
    stage.plotter.close()


def _gif(stage: MechanismView, frames: Sequence[int]) -> bytes:
    """Return a movie as bytes: the file writer would print system errors and continue."""
    from imageio.v2 import get_writer

    made = BytesIO()
    duration = 1000.0 / _PER_SECOND  # ms
    stage.plotter.mwriter = get_writer(made, format=".gif", mode="I", duration=duration, loop=0)
    for i in frames:
        stage.show(i)
        stage.plotter.write_frame()
    stage.plotter.mwriter.close()
    return made.getvalue()


def _movie(stage: MechanismView, path: Path, frames: Sequence[int]) -> None:
    quiet = {"ffmpeg_log_level": "quiet"}  # the error is reported below
    stage.plotter.open_movie(str(path), framerate=_PER_SECOND, macro_block_size=2, **quiet)
    for i in frames:
        stage.show(i)
        stage.plotter.write_frame()
    stage.plotter.close()
    if b"moov" not in path.read_bytes():  # the writer does not report a full disk
        raise OSError("its end is missing: no space left, perhaps")
