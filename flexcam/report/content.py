"""What a report holds, as values: tables, curves, shapes, words. Nothing here knows of a page."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from flexcam.linalg import FloatArray


@dataclass(frozen=True)
class Sheet:
    """A table.

    Parameters
    ----------
    title
        Above it.
    heads
        Of the columns; none where the first column says what a row is.
    rows
        Cells, as text.
    words
        Numbers of the columns that hold words; the others hold numbers.
    """

    title: str
    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    words: tuple[int, ...] = (0,)


@dataclass(frozen=True, eq=False)
class Curve:
    """A curve.

    Parameters
    ----------
    name
        In the legend.
    group
        Number of the run it belongs to, for its colour.
    rigid
        Whether it is of the rigid train.
    x, y
        In the units of the axes, shape (m,).
    """

    name: str
    group: int
    rigid: bool
    x: FloatArray
    y: FloatArray


@dataclass(frozen=True, eq=False)
class Panel:
    """Curves over each other on one axis.

    Parameters
    ----------
    label
        Of the vertical axis, with its unit.
    curves
        The curves.
    """

    label: str
    curves: tuple[Curve, ...]


@dataclass(frozen=True, eq=False)
class Chart:
    """Panels above each other, over the cam angle in degrees.

    Parameters
    ----------
    name
        What is shown, such as a probe.
    words
        The same in words, for who cannot see it.
    panels
        From above.
    """

    name: str
    words: tuple[str, ...]
    panels: tuple[Panel, ...]


@dataclass(frozen=True, eq=False)
class Album:
    """Charts of which a reader picks one.

    Parameters
    ----------
    title
        Above it.
    what
        What is picked, such as ``probe``.
    charts
        At least one.
    """

    title: str
    what: str
    charts: tuple[Chart, ...]


@dataclass(frozen=True, eq=False)
class Shape:
    """A motion of the lines of a scene.

    Parameters
    ----------
    name
        Such as ``mode 2, 67.11 Hz``.
    words
        What moves.
    frames
        Displacements, m, shape (frames, points, 3); one frame swings, several follow each other.
    """

    name: str
    words: str
    frames: FloatArray


@dataclass(frozen=True, eq=False)
class Scene:
    """Members as lines in space, and how they move.

    Parameters
    ----------
    points
        m, shape (points, 3), global axes.
    lines
        Member to the range of its points.
    names
        Named places to the number of their point.
    shapes
        Motions to choose from.
    """

    points: FloatArray
    lines: Mapping[str, tuple[int, int]]
    names: Mapping[str, int]
    shapes: tuple[Shape, ...]


@dataclass(frozen=True)
class Picture:
    """A picture that does not move, also for paper.

    Parameters
    ----------
    title
        Above it.
    png
        The file.
    words
        What it shows, for who cannot see it.
    """

    title: str
    png: bytes
    words: str


@dataclass(frozen=True, eq=False)
class Chapter:
    """What is said of one result.

    Parameters
    ----------
    name
        What tells it from the others.
    title
        Of its case, with the speed.
    verdict
        Sentences: flexible against rigid; none where that is not known.
    summary
        Sentences: what was modelled, what came out.
    warnings
        Sentences: what is doubtful, what is left out of the report and why.
    sheets
        Tables.
    pictures
        Of what was asked for beside the result.
    scene
        Members and their motions; None where there is none to draw.
    case
        Text of the case file.
    origin
        Where the result comes from: files, versions, date.
    """

    name: str
    title: str
    verdict: tuple[str, ...]
    summary: tuple[str, ...]
    warnings: tuple[str, ...]
    sheets: tuple[Sheet, ...]
    pictures: tuple[Picture, ...]
    scene: Scene | None
    case: str
    origin: Sheet


@dataclass(frozen=True, eq=False)
class Report:
    """A report on one or several results.

    Parameters
    ----------
    title
        Of the page.
    chapters
        One per result.
    albums
        Curves of all results over each other.
    notes
        Sentences: what of the curves there was no room for.
    still
        The most important of them, for paper; None where nothing moves.
    """

    title: str
    chapters: tuple[Chapter, ...]
    albums: tuple[Album, ...]
    notes: tuple[str, ...]
    still: Picture | None
