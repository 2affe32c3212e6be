"""A front of laws: two criteria against each other, and the laws themselves beside it."""

# pyright: reportUnknownMemberType=false
# matplotlib leaves the types of its keyword arguments open.

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexcam.linalg import FloatArray
from flexcam.motion import Criteria
from flexcam.synthesis import Synthesized
from flexcam.view.axes import legend, looks, stack
from flexcam.view.curves import LAW_LABELS, LAW_POSITION, draw_laws

_WORDS = {"Cv": "C_v, largest velocity", "Ca": "C_a, largest acceleration", "Cj": "C_j, largest jerk"}
_COLUMNS = 10
_DIGITS = 4
"""Digits to which laws at one place agree; they share a label."""

_UNIT = "lift 1 over angle 1"


def law_front_figure(front: Sequence[Synthesized], first: str, second: str) -> Figure:
    """Return a front of laws and the laws beside it, which bear the same numbers and colours."""
    figure = Figure(figsize=(12.0, 7.6), layout="constrained")
    halves = figure.add_gridspec(1, 2)
    axes, right = figure.add_subfigure(halves[0]).add_subplot(), figure.add_subfigure(halves[1])
    values = np.array([[_value(one.criteria, name) for name in (first, second)] for one in front])
    draw_front(axes, values, [one.converged for one in front])
    axes.set_xlabel(f"{_WORDS[first]}, {_UNIT}")
    axes.set_ylabel(f"{_WORDS[second]}, {_UNIT}")
    axes.set_title(f"Pareto front of {front[0].family}", fontsize="medium")
    below = stack(right, LAW_LABELS, LAW_POSITION)
    draw_laws(below, {str(i): one.law for i, one in enumerate(front, start=1)})
    below[0].set_title(f"Its laws, {_UNIT}", fontsize="medium")
    legend(right, below[0], len(front), columns=_COLUMNS)
    return figure


def draw_front(axes: Axes, values: FloatArray, converged: Sequence[bool]) -> None:
    """Draw two criteria against each other, numbered from 1 in the colours of the laws."""
    axes.plot(*values.T, color="0.65", linewidth=1.2, zorder=1)
    named: dict[tuple[str, str], str] = {}
    for i, ((x, y), whole, (color, _)) in enumerate(zip(values.tolist(), converged, looks(), strict=False), start=1):
        if not (math.isfinite(x) and math.isfinite(y)):
            continue
        axes.scatter(x, y, s=36, facecolors=color if whole else "none", edgecolors=color, zorder=2)
        place, number = (f"{x:.{_DIGITS}g}", f"{y:.{_DIGITS}g}"), f"{i}" if whole else f"{i} not converged"
        named[place] = f"{named[place]}, {number}" if place in named else number
    for (x, y), numbers in named.items():
        axes.annotate(numbers, (float(x), float(y)), xytext=(6, 5), textcoords="offset points")
    axes.grid(alpha=0.3)


def _value(criteria: Criteria, name: str) -> float:
    value: float | None = getattr(criteria, name)
    return math.nan if value is None else value
