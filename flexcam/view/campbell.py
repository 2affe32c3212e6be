"""Campbell diagram: natural frequencies over speed, orders as rays, what they meet as circles."""

# pyright: reportUnknownMemberType=false
# matplotlib leaves the types of its keyword arguments open.

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexcam.stability import Campbell
from flexcam.view.axes import looks

_LARGEST = 160.0
"""Area of the largest circle, points squared."""

_MET = "an order meets a mode; area: its part of the force"


def campbell_figure(found: Campbell, scale: float, shaft: str) -> Figure:
    """Return natural frequencies over speed with the orders of a cam."""
    figure = Figure(figsize=(8.0, 5.0), layout="constrained")
    axes = figure.add_subplot()
    rpm = scale * found.rpm
    top = _top(found)
    _rays(axes, found, rpm, top)
    styles, told = looks(), False
    for i, (column, reached) in enumerate(zip(found.frequencies.T, found.reached, strict=True)):
        if reached:
            colour, dashes = next(styles)
            axes.plot(rpm, column, color=colour, linestyle=dashes, linewidth=1.8, marker="o", markersize=3,
                      label=_named(found, i, top))  # fmt: skip
        else:
            first = not told and bool((column <= top).any())
            axes.plot(rpm, column, color="0.5", linewidth=1.2, label="not felt at the contact" * first)
            told = told or first
    _circles(axes, found, scale)
    axes.set_xlim(rpm[0], rpm[-1])
    axes.set_ylim(0.0, top)
    axes.set_xlabel(f"{shaft} speed, rpm")
    axes.set_ylabel("natural frequency, Hz")
    if axes.get_legend_handles_labels()[0]:
        figure.legend(loc="outside lower center", fontsize="small", ncols=2)
    return figure


def _named(found: Campbell, mode: int, top: float) -> str:
    """Return the name of a mode; one beyond the picture has none."""
    if not (found.frequencies[:, mode] <= top).any():
        return ""
    return f"{mode + 1}: {', '.join(found.words[mode].split(', ')[:2])}"


def _top(found: Campbell) -> float:
    """Return the highest frequency drawn: what is far above every ray would press the rest together."""
    highest = max(found.lifts, default=1) * float(found.rpm[-1]) / 60.0
    known = found.frequencies[~np.isnan(found.frequencies)]
    below = known[known <= 1.3 * highest]
    return 1.1 * float(below.max() if len(below) else highest)


def _rays(axes: Axes, found: Campbell, rpm: np.ndarray, top: float) -> None:
    for n in found.lifts:
        hz = n * found.rpm / 60.0
        axes.plot(rpm, hz, color="0.75", linewidth=0.7, zorder=0.5)
        inside = hz[-1] <= top
        at = rpm[-1] if inside else float(np.interp(top, hz, rpm))
        if at >= rpm[0] and (inside or hz[0] < top):
            shift, side = ((3, 0), "left") if inside else ((0, 3), "center")
            axes.annotate(
                str(n), (at, min(hz[-1], top)), shift, textcoords="offset points", ha=side,
                va="center" if inside else "bottom", fontsize="x-small", color="0.35", annotation_clip=False,
            )  # fmt: skip


def _circles(axes: Axes, found: Campbell, scale: float) -> None:
    met = [one for one in found.crossings if not math.isnan(one.load)]
    largest = max((one.load for one in met), default=0.0) or 1.0
    sizes = [max(_LARGEST * one.load / largest, 8.0) for one in met]
    axes.scatter(
        [scale * one.rpm for one in met], [one.frequency for one in met], s=sizes, facecolors="none",
        edgecolors="black", linewidths=1.2, zorder=3, label=_MET * bool(met),
    )  # fmt: skip
