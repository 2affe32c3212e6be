"""Make docs/pictures/springs.svg: force, stiffness and first natural frequency of three valve springs over their travel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from flexcam.fem.dofs import direction
from flexcam.plotting.figures import add_legend, create_stacked_axes, line_styles, save_figure
from flexcam.valvetrain import Spring
from flexcam.valvetrain.springs import Coils, coil_spring, install_spring, spring_curve, spring_frequencies

WIRE, SHEAR_MODULUS, DENSITY = 3.9e-3, 79.3e9, 7850.0
SPRINGS = {
    "one pitch": [Coils(6.0, (24e-3, 24e-3), 7.9e-3)],
    "two pitches": [Coils(2.0, (24e-3, 24e-3), 5.4e-3), Coils(4.0, (24e-3, 24e-3), 9.2e-3)],
    "beehive": [Coils(4.0, (24e-3, 24e-3), 9e-3), Coils(2.5, (24e-3, 17e-3), 4.9e-3)],
}
TRAVELS = np.linspace(0.0, 20e-3, 401)


def free_spring(coils: Sequence[Coils]) -> Spring:
    """Return a spring at its free length, with ten elements per entry of coils."""
    spring = coil_spring(Spring("valve", direction("uy"), 0.0, elements=10), coils, WIRE, SHEAR_MODULUS, DENSITY)
    contact = 50.0 * max(part.stiffness for part in spring.parts)
    return install_spring(replace(spring, clash_stiffness=contact), None, None)


def spring_figure() -> Figure:
    """Return a figure with force, stiffness and first natural frequency over the travel from the free length."""
    labels = ("force, N", "stiffness, N/mm", "surge, Hz")
    figure, axes = create_stacked_axes(labels, "travel from the free length, mm")
    for (name, coils), (colour, dashes) in zip(SPRINGS.items(), line_styles(), strict=False):
        spring = free_spring(coils)
        curve, travel = spring_curve(spring), TRAVELS[(spring.clash_travel or 0.0) > TRAVELS]
        values = (
            np.interp(travel, curve.travel, curve.force),
            [1e-3 * curve.stiffness_at(x) for x in travel.tolist()],
            [spring_frequencies(spring, x)[0] for x in travel.tolist()],
        )
        for axis, curve_values in zip(axes, values, strict=True):
            axis.plot(1e3 * travel, curve_values, label=name, color=colour, linestyle=dashes)
    add_legend(figure, axes[0])
    return figure


if __name__ == "__main__":
    save_figure(spring_figure(), Path(__file__).parent / "pictures" / "springs.svg", overwrite=True)
