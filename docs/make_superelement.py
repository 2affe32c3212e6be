"""Make docs/pictures/calculix-rocker.svg: the mesh of the rocker, and frequency errors of the reduced model."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import flexcam
from flexcam.core import FloatArray
from flexcam.plotting.figures import COLOURS, line_styles, save_figure
from flexcam.valvetrain import build_structure
from flexcam.valvetrain.modes import model_modes

ROOT = Path(__file__).resolve().parents[1]
ROCKER = runpy.run_path(str(ROOT / "meshes/calculix_rocker.py"))

CLAMPED = (7871.910, 8068.188, 21596.65, 23078.72, 25356.46, 31362.50)
"""Frequencies of the complete model with a clamped pivot by CalculiX, Hz."""

MODE_COUNTS = (0, 2, 4, 8, 12, 16, 20, 24)


def frequencies(modes: int) -> FloatArray:
    """Return the lowest frequencies of the rocker with a clamped pivot, Hz."""
    overrides = [f"superelements.rocker.modes={modes}", "supports.pivot=['ux', 'uy', 'uz', 'rx', 'ry', 'rz']"]
    case = flexcam.read_case(ROOT / "cases/calculix-rocker/rocker.toml", [*overrides, "springs.valve.elements=1"])
    found = model_modes(build_structure(flexcam.build_model(case)), 10).modes.frequencies
    return found[found > 5000.0][: len(CLAMPED)]


def rocker_figure() -> Figure:
    """Return the figure of mesh and frequency errors."""
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    side, errors = figure.subplots(1, 2)
    size = 2 * len(ROCKER["STATIONS"]) - 1, 2 * ROCKER["ACROSS"] + 1
    grid = np.array([[ROCKER["position"]((i, j, 0))[:2] for j in range(size[1])] for i in range(size[0])], dtype=float)
    for line in (*grid[::2], *grid[:, ::2].swapaxes(0, 1)):
        side.plot(*line.T, color="0.5", linewidth=0.8)
    for colour, (name, (station, thick)) in zip(COLOURS, ROCKER["ENDS"].items(), strict=False):
        width = 1 + thick
        interface = grid[2 * station - width : 2 * station + width + 1, :: 1 if thick else size[1]].reshape(-1, 2)
        side.plot(*interface.T, "o", color=colour, markersize=4, label=name)
        side.plot(*interface.mean(axis=0), "+", color="black", markersize=10)
    side.set(aspect="equal", xlabel="mm", title="hexahedra, interface nodes and their reference nodes")
    side.title.set_fontsize("medium")
    side.legend(fontsize="small", loc="lower center", ncols=3, bbox_to_anchor=(0.5, -0.9))
    deviations = np.array([frequencies(modes) for modes in MODE_COUNTS]) / np.array(CLAMPED) - 1.0
    for i, (colour, dashes) in zip(range(len(CLAMPED)), line_styles(), strict=False):
        name = f"{1e-3 * CLAMPED[i]:.2f} kHz"
        errors.semilogy(MODE_COUNTS, 100.0 * deviations[:, i], color=colour, linestyle=dashes, marker=".", label=name)
    errors.set(xlabel="modes with fixed interface", ylabel="error of the frequency, %")
    errors.grid(alpha=0.3)
    errors.legend(fontsize="small", ncols=2)
    return figure


if __name__ == "__main__":
    save_figure(rocker_figure(), Path(__file__).parent / "pictures" / "calculix-rocker.svg", overwrite=True)
    if len(sys.argv) > 1:
        save_figure(rocker_figure(), Path(sys.argv[1]), overwrite=True)
