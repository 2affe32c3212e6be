"""Waterfall: orders of histories over speed."""

# pyright: reportUnknownMemberType=false
# matplotlib leaves the types of its keyword arguments open.

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexcam.orders import Waterfall
from flexcam.units import shown
from flexcam.view.histories import axis_label, short_name

_DECADES = 3.0
"""Decades below the largest amplitude that the colours tell apart."""


def waterfall_figure(found: Sequence[Waterfall], scale: float, shaft: str) -> Figure:
    """Return orders over speed as colours, a picture per history above each other."""
    figure = Figure(figsize=(7.0, 0.8 + 2.8 * len(found)), layout="constrained")
    axes = list(np.atleast_1d(np.asarray(figure.subplots(len(found), sharex=True))))
    for axis, one in zip(axes, found, strict=True):
        _draw(figure, axis, one, scale)
    axes[-1].set_xlabel("order of the camshaft")
    for axis in axes:
        axis.set_ylabel(f"{shaft} speed, rpm")
    return figure


def _draw(figure: Figure, axes: Axes, found: Waterfall, scale: float) -> None:
    from matplotlib.colors import LogNorm

    factor, _ = shown(found.unit)
    sizes = factor * found.amplitudes[:, 1:]
    largest = float(np.nanmax(sizes)) if np.isfinite(sizes).any() else 1.0
    norm = LogNorm(10.0**-_DECADES * (largest or 1.0), largest or 1.0, clip=True)
    drawn = axes.pcolormesh(
        np.arange(1.0, sizes.shape[1] + 1.0), scale * found.rpm, sizes, norm=norm, cmap="cividis",
        shading="nearest", rasterized=True,
    )  # fmt: skip
    name = f"acceleration of {found.signal.name}" if found.signal.probe else short_name(found.signal.name)
    figure.colorbar(drawn, ax=axes, label=axis_label(name, found.unit))
