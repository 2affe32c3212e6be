"""Axes, looks and files that all figures share.

Colours are those of M. Okabe and K. Ito, which colour-blind readers tell apart; lines differ in their dashes as well,
for print without colour.
"""

# pyright: reportUnknownMemberType=false
# matplotlib leaves the types of its keyword arguments open.

from __future__ import annotations

import io
import textwrap
import warnings
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from itertools import cycle
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, FigureBase

from flexcam.checks import refuse
from flexcam.io import free_to_write, made_folder, whole

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Colours of curves, in their order."""

_DASHES = ("-", "--", "-.", ":")
_FORMATS = (".svg", ".png", ".pdf")
_ABOVE = 14.0
"""Points between axes and title: the numbers of a Campbell diagram's orders stand there."""

_LETTERS = 76
"""Of a title beside each other, above axes of usual width."""

_PAPER, _INKS = 160, 64
"""Dots per inch of a picture for paper, and its colours: curves need few."""


def save_figure(figure: Figure, path: Path, *, overwrite: bool = False) -> Path:
    """Write a figure."""
    free_for_picture(path, overwrite=overwrite)
    made_folder(path.parent)
    with _without_remarks(), whole(path) as draft:
        figure.savefig(draft, dpi=150)
    return path


@contextmanager
def _without_remarks() -> Generator[None]:
    """Leave out what matplotlib says of letters that its font lacks: it draws a box in their place."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from", category=UserWarning)
        yield


def titled(figure: Figure, title: str) -> Figure:
    """Put a title above the first axes, below a legend that stands outside of them."""
    if title:
        figure.axes[0].set_title(wrapped(title), fontsize="medium", pad=_ABOVE)
    return figure


def wrapped(title: str) -> str:
    """Return a title in lines that fit above a picture."""
    return "\n".join(textwrap.wrap(title, _LETTERS))


def png_of(figure: Figure) -> bytes:
    """Return a figure as a picture for paper, whose size does not grow with its curves."""
    from PIL import Image

    drawn, written = io.BytesIO(), io.BytesIO()
    with _without_remarks():
        figure.savefig(drawn, format="png", dpi=_PAPER)
    with Image.open(drawn) as image:
        image.convert("RGB").quantize(_INKS).save(written, format="png", optimize=True)
    return written.getvalue()


def free_for_picture(path: Path, *, overwrite: bool = False) -> None:
    """Refuse a path that a picture cannot be written to."""
    if path.suffix not in _FORMATS:
        raise refuse("picture", str(path), f"a name that ends in {', '.join(_FORMATS)}")
    free_to_write("picture", path, overwrite=overwrite)


def looks() -> Iterator[tuple[str, str]]:
    """Return pairs of colour and dashes; seven colours and four kinds of dashes repeat after 28 curves."""
    return zip(cycle(COLOURS), cycle(_DASHES), strict=False)


def stacked(labels: Sequence[str], below: str, *, height: float = 1.6) -> tuple[Figure, list[Axes]]:
    """Return a figure with axes above each other."""
    figure = Figure(figsize=(7.0, 1.2 + height * len(labels)), layout="constrained")
    return figure, stack(figure, labels, below)


def stack(figure: FigureBase, labels: Sequence[str], below: str) -> list[Axes]:
    """Return axes above each other, of a figure or a part of one."""
    axes = list(np.atleast_1d(np.asarray(figure.subplots(len(labels), sharex=True))))
    for one, label in zip(axes, labels, strict=True):
        one.set_ylabel(label)
        one.grid(alpha=0.3)
    axes[-1].set_xlabel(below)
    figure.align_ylabels(axes)
    return axes


def legend(figure: FigureBase, axes: Axes, count: int, *, columns: int = 4) -> None:
    """Put the names of several curves above the axes, where they cover none."""
    if count > 1:
        lines, names = axes.get_legend_handles_labels()
        figure.legend(lines, names, loc="outside upper center", fontsize="small", ncols=min(count, columns))
