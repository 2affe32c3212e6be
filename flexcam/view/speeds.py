"""Curves over speed."""

# pyright: reportUnknownMemberType=false
# matplotlib leaves the types of its keyword arguments open.

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from flexcam.linalg import FloatArray
from flexcam.view.axes import legend, looks, stacked

_SLOW = 1.0
"""Growth, 1/s, that the axis always spans, and within which it is linear: rounding then looks like the zero it is."""


def force_figure(rpm: FloatArray, forces: Mapping[str, tuple[FloatArray, FloatArray]], shaft: str) -> Figure:
    """Return largest and least contact force over speed."""
    figure, (upper, lower) = stacked(("largest force, N", "least force, N"), f"{shaft} speed, rpm")
    for (name, (least, largest)), (colour, dashes) in zip(forces.items(), looks(), strict=False):
        upper.plot(rpm, largest, label=name, color=colour, linestyle=dashes, marker="o", markersize=3)
        lower.plot(rpm, least, color=colour, linestyle=dashes, marker="o", markersize=3)
    lower.axhline(0.0, color="black", linewidth=0.8)
    legend(figure, upper, len(forces))
    return figure


def growth_figure(rpm: FloatArray, growth: FloatArray, dangers: Mapping[str, NDArray[np.bool_]], shaft: str) -> Figure:
    """Return the growth rate of disturbances over speed, and which cause endangers which speed."""
    figure, (upper, lower) = stacked(("growth, 1/s", "endangered by"), f"{shaft} speed, rpm")
    upper.plot(rpm, growth, color="black", marker="o", markersize=3)
    upper.set_yscale("symlog", linthresh=_SLOW)
    upper.axhline(0.0, color="black", linewidth=0.8)
    least, largest = upper.get_ylim()
    upper.set_ylim(min(least, -_SLOW), max(largest, _SLOW))
    for row, ((_, at), (colour, _)) in enumerate(zip(dangers.items(), looks(), strict=False)):
        chosen = rpm[at]
        lower.plot(chosen, np.full(len(chosen), row), color=colour, marker="s", linestyle="none")
    lower.set_yticks(range(len(dangers)), labels=list(dangers))
    lower.set_ylim(len(dangers) - 0.5, -0.5)
    lower.set_xlim(*upper.get_xlim())
    return figure
