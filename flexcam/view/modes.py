"""Mode shapes along the members."""

# pyright: reportUnknownMemberType=false
# matplotlib leaves the types of its keyword arguments open.

from __future__ import annotations

import textwrap

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexcam.checks import refuse
from flexcam.fem.deflection import deflection
from flexcam.linalg import FloatArray
from flexcam.train import ModelModes, Structure
from flexcam.view.axes import looks, wrapped

_PARTS = 8
"""Of an element, so that its cubic looks like one."""

_MOTIONS = ("along", "across y", "across z", "twist times radius")
_NOTHING = 1e-6
"""Part of the largest motion of a mode below which a curve says nothing."""

_WIDE = 58
"""Letters of a title to a column."""


def draw_mode(axes: Axes, structure: Structure, member: str, nodal: FloatArray, size: float) -> None:
    """Draw how a member moves in a mode, over the place along it."""
    part = structure.model.mesh.element_ranges()[member]
    moved = deflection(structure.beams, nodal, _PARTS, part)[..., :4]
    begin = np.cumsum(structure.beams.length[part]) - structure.beams.length[part]
    place = 1e3 * (begin[:, None] + structure.beams.length[part, None] * np.linspace(0.0, 1.0, _PARTS + 1)).ravel()
    scale = np.array([1.0, 1.0, 1.0, structure.model.members[member].section.radius]) / size
    for values, name, (colour, dashes) in zip((moved * scale).reshape(-1, 4).T, _MOTIONS, looks(), strict=False):
        if np.abs(values).max() > _NOTHING:
            axes.plot(place, values, label=name, color=colour, linestyle=dashes)
    axes.axhline(0.0, color="0.4", linewidth=0.8)
    axes.set_xlim(0.0, float(place[-1]))
    axes.set_ylim(-1.1, 1.1)
    axes.grid(alpha=0.3)


def mode_figure(structure: Structure, found: ModelModes, *, title: str = "") -> Figure:
    """Return modes along the members."""
    members = list(structure.model.mesh.lines)
    if not members:
        why = "shapes are drawn along members; flexcam modes says what moves in a train of masses"
        raise refuse("members", "none", "one or more", why)
    count = len(found.shares)
    size = (2.0 + 3.0 * len(members), 1.4 + 1.7 * count)
    figure = Figure(figsize=size, layout="constrained")
    grid = figure.subplots(count, len(members), squeeze=False, sharex="col", sharey=True)
    shapes = structure.dofs.nodal_modes(found.modes.shapes.T, structure.model.mesh.extent)
    for mode, (row, nodal) in enumerate(zip(grid, shapes, strict=True)):
        largest = _largest(structure, nodal)
        for axes, member in zip(row, members, strict=True):
            draw_mode(axes, structure, member, nodal, largest)
        row[0].set_ylabel(f"mode {mode + 1}")
        words = f"{found.modes.frequencies[mode]:.4g} Hz: {found.words(mode)}"
        row[0].set_title("\n".join(textwrap.wrap(words, _WIDE * len(members))), fontsize="small", loc="left")
        if not any(line.get_label() in _MOTIONS for axes in row for line in axes.lines):
            row[0].text(0.5, 0.75, "no member moves", transform=row[0].transAxes, ha="center", color="0.3")
    for axes, member in zip(grid[-1], members, strict=True):
        axes.set_xlabel(f"along {member}, mm")
    handles = {
        name: line for axes in grid.ravel() for line, name in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    figure.legend(list(handles.values()), list(handles), loc="outside lower center", fontsize="small", ncols=4)
    if title:
        figure.suptitle(wrapped(title), fontsize="medium")
    return figure


def _largest(structure: Structure, nodal: FloatArray) -> float:
    """Return the largest motion of the members' lines and surfaces; one where only other parts move."""
    moved = np.abs(deflection(structure.beams, nodal, _PARTS))
    radius = np.concatenate([
        np.full(part.stop - part.start, structure.model.members[name].section.radius)
        for name, part in structure.model.mesh.element_ranges().items()
    ])  # fmt: skip
    largest = max(float(moved[..., :3].max()), float((moved[..., 3] * radius[:, None]).max()))
    return largest if largest > 0.0 else 1.0
