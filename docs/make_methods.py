"""Make docs/pictures/methods.svg: spectral radius, period error and damping ratio of the integrators."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from flexcam.core import FloatArray
from flexcam.dynamics import Method, bathe, central_difference, generalized_alpha, hht, newmark
from flexcam.plotting.figures import add_legend, create_stacked_axes, line_styles, save_figure

METHODS = {
    "average acceleration": newmark(),
    "linear acceleration": newmark(beta=1 / 6),
    "HHT, alpha = -0.1": hht(alpha=-0.1),
    "generalized-alpha, rho = 0.8": generalized_alpha(rho_inf=0.8),
    "Bathe": bathe(),
    "central difference": central_difference(),
}


_STEPS = np.geomspace(1e-2, 1e3, 301)


def method_figure(methods: Mapping[str, Method], damping: float = 0.0) -> Figure:
    """Return a figure with spectral radius, period error and damping of integrators."""
    labels = ("spectral radius", "period error, %", "damping ratio, %")
    figure, (radius, period, ratio) = create_stacked_axes(labels, "angular frequency times step")
    for (name, method), (colour, dashes) in zip(methods.items(), line_styles(), strict=False):
        stable = _STEPS[min(method.stability_limit(damping), _STEPS[-1]) >= _STEPS]
        low = stable[stable <= math.pi]
        curves = (
            (radius, stable, _to_array([method.spectral_radius(x, damping) for x in stable.tolist()])),
            (period, low, 100.0 * _to_array([method.period_error(x, damping) for x in low.tolist()])),
            (ratio, low, 100.0 * _to_array([method.damping_ratio(x, damping) for x in low.tolist()])),
        )
        for axis, steps, values in curves:
            axis.semilogx(steps, values, label=name, color=colour, linestyle=dashes)
    period.set_ylim(-20.0, 60.0)
    ratio.set_ylim(-0.5, 6.0)
    add_legend(figure, radius)
    return figure


def _to_array(values: list[float]) -> FloatArray:
    """Return values as an array with NaN for missing and infinite values."""
    array = np.array(values, dtype=float)
    return np.where(np.isfinite(array), array, math.nan)


def main() -> None:
    """Write the picture."""
    save_figure(method_figure(METHODS), Path(__file__).parent / "pictures" / "methods.svg", overwrite=True)


if __name__ == "__main__":
    main()
