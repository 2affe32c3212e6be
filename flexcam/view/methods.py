"""What integrators do to a mode, over angular frequency times step."""

# pyright: reportUnknownMemberType=false
# matplotlib leaves the types of its keyword arguments open.

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from flexcam.integrate import Method
from flexcam.linalg import FloatArray
from flexcam.view.axes import legend, looks, stacked

_STEPS = np.geomspace(1e-2, 1e3, 301)


def method_figure(methods: Mapping[str, Method], damping: float = 0.0) -> Figure:
    """Return spectral radius, period error and damping of integrators."""
    labels = ("spectral radius", "period error, %", "damping ratio, %")
    figure, (radius, period, ratio) = stacked(labels, "angular frequency times step")
    for (name, method), (colour, dashes) in zip(methods.items(), looks(), strict=False):
        inside = _STEPS[min(method.stable_to(damping), _STEPS[-1]) >= _STEPS]
        low = inside[inside <= math.pi]
        curves = (
            (radius, inside, _each([method.spectral_radius(x, damping) for x in inside.tolist()])),
            (period, low, 100.0 * _each([method.period_error(x, damping) for x in low.tolist()])),
            (ratio, low, 100.0 * _each([method.damping_ratio(x, damping) for x in low.tolist()])),
        )
        for axis, at, values in curves:
            axis.semilogx(at, values, label=name, color=colour, linestyle=dashes)
    period.set_ylim(-20.0, 60.0)
    ratio.set_ylim(-0.5, 6.0)
    legend(figure, radius, len(methods))
    return figure


def _each(values: list[float]) -> FloatArray:
    """Return values as an array, NaN where there is none to draw."""
    found = np.array(values, dtype=float)
    return np.where(np.isfinite(found), found, math.nan)
