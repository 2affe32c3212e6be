"""Figures of spectra: Campbell diagrams, orders, growth rates, contact forces and modes over speed."""

# pyright: reportUnknownMemberType=false
# matplotlib does not type its keyword arguments.

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from flexcam.analysis.campbell import Campbell
from flexcam.analysis.orders import Waterfall
from flexcam.core import FloatArray
from flexcam.core.errors import refuse
from flexcam.core.units import to_display_unit
from flexcam.fem.recovery import deflection
from flexcam.plotting.figures import add_legend, create_axes, create_stacked_axes, line_styles, wrap_title
from flexcam.plotting.histories import axis_label, short_name
from flexcam.valvetrain import ModelModes, Structure

_MAX_CIRCLE_AREA = 160.0  # area of the largest circle, points squared


def campbell_figure(found: Campbell, scale: float, shaft: str) -> Figure:
    """Return a Campbell diagram: natural frequencies over speed with the orders of a cam."""
    figure, (axes,) = create_axes((8.0, 5.0))
    rpm = scale * found.rpm
    top = _highest_drawn_frequency(found)
    _rays(axes, found, rpm, top)
    styles, labelled = line_styles(), False
    for i, (column, reached) in enumerate(zip(found.frequencies.T, found.reached, strict=True)):
        if reached:
            colour, dashes = next(styles)
            axes.plot(rpm, column, color=colour, linestyle=dashes, linewidth=1.8, marker="o", markersize=3,
                      label=_mode_label(found, i, top))  # fmt: skip
        else:
            first = not labelled and bool((column <= top).any())
            axes.plot(rpm, column, color="0.5", linewidth=1.2, label="without force at the contact" * first)
            labelled = labelled or first
    _circles(axes, found, scale)
    axes.set(xlim=(rpm[0], rpm[-1]), ylim=(0.0, top), xlabel=f"{shaft} speed, rpm", ylabel="natural frequency, Hz")
    if axes.get_legend_handles_labels()[0]:
        figure.legend(loc="outside lower center", fontsize="small", ncols=2)
    return figure


def _mode_label(found: Campbell, mode: int, top: float) -> str:
    """Return the label of a mode; empty if it is outside of the diagram."""
    if not (found.frequencies[:, mode] <= top).any():
        return ""
    return f"{mode + 1}: {', '.join(found.words[mode].split(', ')[:2])}"


def _highest_drawn_frequency(found: Campbell) -> float:
    """Return the highest frequency drawn: modes far above all order lines are cut off."""
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
    sizes = [max(_MAX_CIRCLE_AREA * one.load / largest, 8.0) for one in met]
    places = [scale * one.rpm for one in met], [one.frequency for one in met]
    label = "order meets mode; area: share of the force" if met else ""
    axes.scatter(*places, s=sizes, facecolors="none", edgecolors="black", linewidths=1.2, zorder=3, label=label)


_DECADES = 3.0  # decades below the largest amplitude covered by the colour scale


def waterfall_figure(found: Sequence[Waterfall], scale: float, shaft: str) -> Figure:
    """Return a figure with orders over speed as colours, one diagram per history."""
    figure, axes = create_axes((7.0, 0.8 + 2.8 * len(found)), len(found))
    for axis, one in zip(axes, found, strict=True):
        _draw(figure, axis, one, scale)
    axes[-1].set_xlabel("order of the camshaft")
    for axis in axes:
        axis.set_ylabel(f"{shaft} speed, rpm")
    return figure


def _draw(figure: Figure, axes: Axes, found: Waterfall, scale: float) -> None:
    from matplotlib.colors import LogNorm

    factor, _ = to_display_unit(found.unit)
    sizes = factor * found.amplitudes[:, 1:]
    largest = float(np.nanmax(sizes)) if np.isfinite(sizes).any() else 1.0
    norm = LogNorm(10.0**-_DECADES * (largest or 1.0), largest or 1.0, clip=True)
    drawn = axes.pcolormesh(
        np.arange(1.0, sizes.shape[1] + 1.0), scale * found.rpm, sizes, norm=norm, cmap="cividis",
        shading="nearest", rasterized=True,
    )  # fmt: skip
    name = f"acceleration of {found.signal.name}" if found.signal.probe else short_name(found.signal.name)
    figure.colorbar(drawn, ax=axes, label=axis_label(name, found.unit))


_LINEAR_GROWTH = 1.0
"""Growth rate, 1/s, below which the axis is linear; it always covers this range, so that rounding appears as zero."""


def force_figure(rpm: FloatArray, forces: Mapping[str, tuple[FloatArray, FloatArray]], shaft: str) -> Figure:
    """Return a figure with maximum and minimum contact force over speed."""
    figure, (upper, lower) = create_stacked_axes(("max force, N", "min force, N"), f"{shaft} speed, rpm")
    for (name, (least, largest)), (colour, dashes) in zip(forces.items(), line_styles(), strict=False):
        upper.plot(rpm, largest, label=name, color=colour, linestyle=dashes, marker="o", markersize=3)
        lower.plot(rpm, least, color=colour, linestyle=dashes, marker="o", markersize=3)
    lower.axhline(0.0, color="black", linewidth=0.8)
    add_legend(figure, upper, len(forces))
    return figure


def growth_figure(rpm: FloatArray, growth: FloatArray, dangers: Mapping[str, NDArray[np.bool_]], shaft: str) -> Figure:
    """Return a figure with the growth rate of disturbances over speed and the causes of instability at each speed."""
    figure, (upper, lower) = create_stacked_axes(("growth, 1/s", "cause"), f"{shaft} speed, rpm")
    upper.plot(rpm, growth, color="black", marker="o", markersize=3)
    upper.set_yscale("symlog", linthresh=_LINEAR_GROWTH)
    upper.axhline(0.0, color="black", linewidth=0.8)
    least, largest = upper.get_ylim()
    upper.set_ylim(min(least, -_LINEAR_GROWTH), max(largest, _LINEAR_GROWTH))
    for row, ((_, at), (colour, _)) in enumerate(zip(dangers.items(), line_styles(), strict=False)):
        chosen = rpm[at]
        lower.plot(chosen, np.full(len(chosen), row), color=colour, marker="s", linestyle="none")
    lower.set_yticks(range(len(dangers)), labels=list(dangers))
    lower.set_ylim(len(dangers) - 0.5, -0.5)
    lower.set_xlim(*upper.get_xlim())
    return figure


_PARTS = 8  # drawn segments per element, enough for a cubic
_MOTIONS = ("along", "across y", "across z", "twist times radius")
_MIN_MOTION = 1e-6  # motion relative to the maximum of a mode below which a curve is not drawn
_TITLE_WIDTH = 58  # characters per line of a title of one column


def draw_mode(axes: Axes, structure: Structure, member: str, nodal: FloatArray, size: float) -> None:
    """Draw the motion of a member in a mode over its length."""
    part = structure.model.mesh.element_ranges()[member]
    moved = deflection(structure.beams, nodal, _PARTS, part)[..., :4]
    begin = np.cumsum(structure.beams.length[part]) - structure.beams.length[part]
    place = 1e3 * (begin[:, None] + structure.beams.length[part, None] * np.linspace(0.0, 1.0, _PARTS + 1)).ravel()
    scale = np.array([1.0, 1.0, 1.0, structure.model.members[member].section.radius]) / size
    for values, name, (colour, dashes) in zip((moved * scale).reshape(-1, 4).T, _MOTIONS, line_styles(), strict=False):
        if np.abs(values).max() > _MIN_MOTION:
            axes.plot(place, values, label=name, color=colour, linestyle=dashes)
    axes.axhline(0.0, color="0.4", linewidth=0.8)
    axes.set(xlim=(0.0, float(place[-1])), ylim=(-1.1, 1.1))
    axes.grid(alpha=0.3)


def mode_figure(structure: Structure, found: ModelModes, *, title: str = "") -> Figure:
    """Return a figure with modes along the members."""
    members = list(structure.model.mesh.lines)
    if not members:
        why = "shapes are drawn along members; flexcam modes says what moves in a train of masses"
        raise refuse("members", "none", "one or more", why)
    count = len(found.shares)
    figure = Figure(figsize=(2.0 + 3.0 * len(members), 1.4 + 1.7 * count), layout="constrained")
    grid = figure.subplots(count, len(members), squeeze=False, sharex="col", sharey=True)
    shapes = structure.dofs.nodal_modes(found.modes.shapes.T, structure.model.mesh.extent)
    for mode, (row, nodal) in enumerate(zip(grid, shapes, strict=True)):
        largest = _maximum_motion(structure, nodal)
        for axes, member in zip(row, members, strict=True):
            draw_mode(axes, structure, member, nodal, largest)
        row[0].set_ylabel(f"mode {mode + 1}")
        words = f"{found.modes.frequencies[mode]:.4g} Hz: {found.words(mode)}"
        row[0].set_title("\n".join(textwrap.wrap(words, _TITLE_WIDTH * len(members))), fontsize="small", loc="left")
        if not any(line.get_label() in _MOTIONS for axes in row for line in axes.lines):
            row[0].text(0.5, 0.75, "no member moves", transform=row[0].transAxes, ha="center", color="0.3")
    for axes, member in zip(grid[-1], members, strict=True):
        axes.set_xlabel(f"along {member}, mm")
    handles = {
        name: line for axes in grid.ravel() for line, name in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    figure.legend(list(handles.values()), list(handles), loc="outside lower center", fontsize="small", ncols=4)
    if title:
        figure.suptitle(wrap_title(title), fontsize="medium")
    return figure


def _maximum_motion(structure: Structure, nodal: FloatArray) -> float:
    """Return the maximum motion of the members' centre lines and surfaces; 1 if only other parts move."""
    moved = np.abs(deflection(structure.beams, nodal, _PARTS))
    radius = np.concatenate([
        np.full(part.stop - part.start, structure.model.members[name].section.radius)
        for name, part in structure.model.mesh.element_ranges().items()
    ])  # fmt: skip
    largest = max(float(moved[..., :3].max()), float((moved[..., 3] * radius[:, None]).max()))
    return largest if largest > 0.0 else 1.0
