"""Curves over speed."""

# pyright: reportUnknownMemberType=false
# matplotlib leaves the types of its keyword arguments open.

from __future__ import annotations

from collections.abc import Mapping

from matplotlib.figure import Figure

from flexcam.linalg import FloatArray
from flexcam.view.axes import legend, looks, stacked


def force_figure(rpm: FloatArray, forces: Mapping[str, tuple[FloatArray, FloatArray]], shaft: str) -> Figure:
    """Return largest and least contact force over speed.

    Parameters
    ----------
    rpm
        Speeds, shape (m,).
    forces
        Least and largest force by model, N, shape (m,) each; NaN where there is none.
    shaft
        Whose speed it is.

    Returns
    -------
    Figure
        Two axes above each other.
    """
    figure, (upper, lower) = stacked(("largest force, N", "least force, N"), f"{shaft} speed, rpm")
    for (name, (least, largest)), (colour, dashes) in zip(forces.items(), looks(), strict=False):
        upper.plot(rpm, largest, label=name, color=colour, linestyle=dashes, marker="o", markersize=3)
        lower.plot(rpm, least, color=colour, linestyle=dashes, marker="o", markersize=3)
    lower.axhline(0.0, color="black", linewidth=0.8)
    legend(figure, upper, len(forces))
    return figure
