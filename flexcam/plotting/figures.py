"""Shared code of all figures: axes, line styles and output files.

The colours are those of M. Okabe and K. Ito for colour-blind readers; lines also differ in their dashes, for printing
without colour.
"""

from __future__ import annotations

import io
import textwrap
import warnings
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from itertools import cycle
from pathlib import Path
from typing import Literal

from matplotlib.axes import Axes
from matplotlib.figure import Figure, FigureBase

from flexcam.core.errors import refuse
from flexcam.io import atomic_write_path, check_writable

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Colours of curves in their order."""

_DASHES = ("-", "--", "-.", ":")
_FORMATS = (".svg", ".png", ".pdf")
TITLE_PAD = 14.0  # space between axes and title, points: the order numbers of a Campbell diagram are placed there
_TITLE_WIDTH = 76  # characters per line of a title above axes of standard width
# Resolution of an image for printing, dots per inch, and its number of colours; curves need few
_DPI, _COLOUR_COUNT = 160, 64


def save_figure(figure: Figure, path: Path, *, overwrite: bool = False) -> Path:
    """Write a figure."""
    check_figure_path(path, overwrite=overwrite)
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
        figure.axes[0].set_title(wrap_title(title), fontsize="medium", pad=TITLE_PAD)
    return figure


def wrap_title(title: str) -> str:
    """Wrap a title to the width of a figure."""
    return textwrap.fill(escape_math(title), _TITLE_WIDTH)


def escape_math(text: str) -> str:
    """Return a text whose dollar signs matplotlib draws instead of reading a formula between them."""
    return text.replace("$", r"\$")


def render_png(figure: Figure) -> bytes:
    """Return a figure as PNG for printing, with a size that does not depend on the number of points."""
    from PIL import Image

    full, reduced = io.BytesIO(), io.BytesIO()
    with _suppress_warnings():
        figure.savefig(full, format="png", dpi=_DPI)
    with Image.open(full) as image:
        image.convert("RGB").quantize(_COLOUR_COUNT).save(reduced, format="png", optimize=True)
    return reduced.getvalue()


def check_figure_path(path: Path, *, overwrite: bool = False) -> None:
    """Raise an error if a figure cannot be written to a path."""
    if path.suffix not in _FORMATS:
        raise refuse("picture", str(path), f"a name that ends in one of {', '.join(_FORMATS)}")
    check_writable("picture", path, overwrite=overwrite)


def line_styles() -> Iterator[tuple[str, str]]:
    """Yield pairs of colour and dashes; seven colours and four dash patterns repeat after 28 curves."""
    return zip(cycle(COLOURS), cycle(_DASHES), strict=False)


def create_axes(
    size: tuple[float, float], rows: int = 1, *, sharex: bool = True, grid: Literal["both", "x"] | None = "both"
) -> tuple[Figure, list[Axes]]:
    """Return a figure of a size in inches with axes in rows, with grid lines."""
    figure = Figure(figsize=size, layout="constrained")
    axes = list(figure.subplots(rows, sharex=sharex, squeeze=False)[:, 0])
    for axis in axes if grid else ():
        axis.grid(alpha=0.3, axis=grid or "both")
    return figure, axes


def create_stacked_axes(labels: Sequence[str], below: str, *, height: float = 1.6) -> tuple[Figure, list[Axes]]:
    """Return a figure with axes stacked vertically."""
    figure = Figure(figsize=(7.0, 1.2 + height * len(labels)), layout="constrained")
    return figure, add_stacked_axes(figure, labels, below)


def add_stacked_axes(figure: FigureBase, labels: Sequence[str], below: str) -> list[Axes]:
    """Return vertically stacked axes of a figure or a subfigure."""
    axes = list(figure.subplots(len(labels), sharex=True, squeeze=False)[:, 0])
    for axis, label in zip(axes, labels, strict=True):
        axis.set_ylabel(label)
        axis.grid(alpha=0.3)
    axes[-1].set_xlabel(below)
    figure.align_ylabels(axes)
    return axes


def add_legend(figure: FigureBase, axes: Axes, *, columns: int = 4) -> None:
    """Add a legend with the names of several curves above the axes, in as many columns as fit."""
    lines, names = axes.get_legend_handles_labels()
    if len(names) > 1:
        fitting = 110 // (max(map(len, names)) + 7)  # characters per line; the line before a name takes 7
        number = max(1, min(len(names), columns, fitting))
        figure.legend(lines, names, loc="outside upper center", fontsize="small", ncols=number)
