"""Error over work."""

# pyright: reportUnknownMemberType=false
# matplotlib leaves the types of its keyword arguments open.

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

from matplotlib.figure import Figure

from flexcam.fidelity import Traded
from flexcam.view.axes import legend, looks, stacked

_KINDS = ("lift", "acceleration")


def work_precision_figure(found: Sequence[Traded]) -> Figure:
    """Return the error of models over the work they take, both logarithmic."""
    figure, axes = stacked(tuple(f"error of {kind}, %" for kind in _KINDS), "unknowns times steps")
    runs = sorted((one for one in found if one.errors), key=lambda one: (one.rung, one.steps))
    names = 0
    for (name, group), (colour, dashes) in zip(groupby(runs, key=lambda one: one.rung), looks(), strict=False):
        of, names = list(group), names + 1
        for axis, kind in zip(axes, _KINDS, strict=True):
            work = [max(one.work, 1) for one in of]
            axis.loglog(work, [100.0 * one.errors[kind] for one in of], label=name, color=colour, linestyle=dashes,
                        marker="o", markersize=4)  # fmt: skip
            best = [one for one in of if one.best]
            axis.loglog([max(one.work, 1) for one in best], [100.0 * one.errors[kind] for one in best],
                        color=colour, linestyle="none", marker="s", markersize=8, fillstyle="none")  # fmt: skip
    legend(figure, axes[0], names)
    return figure
