"""Figures of spectra: Campbell diagrams, orders, growth rates, contact forces and modes over speed."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from numpy.typing import NDArray

from flexcam.core import FloatArray
from flexcam.core.errors import refuse
from flexcam.core.units import to_display_unit
from flexcam.dynamics import Response
from flexcam.fem.recovery import deflection
from flexcam.plotting.figures import COLOURS, add_legend, create_axes, create_stacked_axes, line_styles, wrap_title
from flexcam.plotting.histories import axis_label, channel_unit, last_revolution, short_name
from flexcam.valvetrain import ModelModes, Structure

if TYPE_CHECKING:
    from flexcam.analysis.natural_modes import Campbell
    from flexcam.analysis.orders import Waterfall

_MAX_CIRCLE_AREA = 160.0  # area of the largest circle, points squared


def campbell_figure(found: Campbell, scale: float, shaft: str) -> Figure:
    """Return a Campbell diagram: natural frequencies over speed with the orders of a cam."""
    figure, (axes,) = create_axes((8.0, 5.0), grid=None)
    rpm = scale * found.rpm
    highest = max(found.lifts, default=1) * float(found.rpm[-1]) / 60.0  # modes far above all order lines are cut off
    below = found.frequencies[found.frequencies <= 1.3 * highest]
    top = 1.1 * float(below.max() if len(below) else highest)
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
    styles, labelled = line_styles(), False
    for i, (column, reached) in enumerate(zip(found.frequencies.T, found.reached, strict=True)):
        visible = bool((column <= top).any())
        if reached:
            colour, dashes = next(styles)
            label = f"{i + 1}: {', '.join(found.words[i].split(', ')[:2])}" if visible else ""
            axes.plot(rpm, column, color=colour, linestyle=dashes, linewidth=1.8, marker="o", markersize=3, label=label)
        else:
            first = not labelled and visible
            axes.plot(rpm, column, color="0.5", linewidth=1.2, label="without force at the contact" * first)
            labelled = labelled or first
    failed = np.array([not status.ok for status in found.statuses])
    known = np.pad(np.isfinite(found.frequencies) | failed[:, None], ((1, 1), (0, 0)), mode="edge")
    at, mode = np.nonzero(~(known[:-2] & known[2:]) & (found.frequencies <= top))  # ends between the outer speeds
    if len(at):
        label = "line ends: a contact opens or closes"
        axes.plot(rpm[at], found.frequencies[at, mode], "|", color="black", markersize=14, label=label)
    crossings = [crossing for crossing in found.crossings if not math.isnan(crossing.load)]
    largest = max((crossing.load for crossing in crossings), default=0.0) or 1.0
    sizes = [max(_MAX_CIRCLE_AREA * crossing.load / largest, 8.0) for crossing in crossings]
    places = [scale * crossing.rpm for crossing in crossings], [crossing.frequency for crossing in crossings]
    label = "order meets mode; area: share of the force" if crossings else ""
    axes.scatter(*places, s=sizes, facecolors="none", edgecolors="black", linewidths=1.2, zorder=3, label=label)
    axes.set(xlim=(rpm[0], rpm[-1]), ylim=(0.0, top), xlabel=f"{shaft} speed, rpm", ylabel="natural frequency, Hz")
    if axes.get_legend_handles_labels()[0]:
        figure.legend(loc="outside lower center", fontsize="small", ncols=2)
    return figure


_DECADES = 3.0  # decades below the largest amplitude covered by the colour scale
_LINE_HEIGHT = 0.3  # height of the largest amplitude in a waterfall, relative to the range of speeds
_ANGLES = 1441  # instants per revolution of a map
_LINEAR_GROWTH = 1.0  # growth rate, 1/s, up to which the axis is linear; it covers this range: rounding appears as zero


def waterfall_figure(found: Sequence[Waterfall], scale: float, shaft: str) -> Figure:
    """Return a figure with orders over speed as colours and as lines raised by the speed, one row per history."""
    figure = Figure(figsize=(11.0, 0.8 + 3.2 * len(found)), layout="constrained")
    grid = figure.subplots(len(found), 2, squeeze=False, sharex=True)
    for row, waterfall in zip(grid, found, strict=True):
        _draw_orders(figure, row[0], row[1], waterfall, scale)
        for axis in row:
            axis.set_ylabel(f"{shaft} speed, rpm")
    for axis in grid[-1]:
        axis.set_xlabel("order of the camshaft")
    return figure


def _draw_orders(figure: Figure, left: Axes, axes: Axes, waterfall: Waterfall, scale: float) -> None:
    """Draw amplitudes as colours, and those of each speed as a line above it, the lowest speed in front."""
    factor, symbol = to_display_unit(waterfall.unit)
    rpm, sizes = scale * waterfall.rpm, factor * waterfall.amplitudes[:, 1:]
    largest = float(np.nanmax(sizes)) if np.isfinite(sizes).any() else 0.0
    orders = np.arange(1.0, sizes.shape[1] + 1.0)
    norm = LogNorm(10.0**-_DECADES * (largest or 1.0), largest or 1.0, clip=True)
    mesh = left.pcolormesh(orders, rpm, sizes, norm=norm, cmap="cividis", shading="nearest", rasterized=True)
    name = f"acceleration of {waterfall.signal.name}" if waterfall.signal.probe else short_name(waterfall.signal.name)
    figure.colorbar(mesh, ax=left, label=axis_label(name, waterfall.unit))
    height = _LINE_HEIGHT * float(np.ptp(rpm)) / (largest or 1.0)
    for i, (base, row) in enumerate(zip(rpm.tolist(), sizes, strict=True)):
        axes.fill_between(orders, base, base + height * row, facecolor="white", zorder=3.0 - i / len(rpm))
        axes.plot(orders, base + height * row, color=COLOURS[0], linewidth=1.0, zorder=3.0 - i / len(rpm))
    axes.set_title(f"highest peak {largest:.4g} {symbol}", fontsize="small", loc="right")


def angle_map_figure(rpm: FloatArray, runs: Sequence[Response | None], channel: str, shaft: str) -> Figure:
    """Return a map of a channel over the cam angle of the last revolution and speed; None for failed runs."""
    responses = [run for run in runs if run is not None]
    unit = channel_unit(responses[0], channel)
    factor, symbol = to_display_unit(unit)
    angle = np.linspace(0.0, 2.0 * math.pi, _ANGLES)
    values = np.full((len(runs), _ANGLES), math.nan)
    for row, run in zip(values, runs, strict=True):
        if run is not None:
            last = last_revolution(run)
            row[:] = factor * np.interp(angle, last.angle, last.channels[channel], period=2.0 * math.pi)
    figure, (axes,) = create_axes((7.0, 4.5), grid=None)
    axes.set_facecolor("0.85")
    mesh = axes.pcolormesh(np.degrees(angle), rpm, values, cmap="viridis", shading="nearest", rasterized=True)
    figure.colorbar(mesh, ax=axes, label=axis_label(short_name(channel), unit))
    i, j = np.unravel_index(int(np.nanargmax(values)), values.shape)
    label = f"maximum {values[i, j]:.4g} {symbol} at {rpm[i]:.0f} rpm"
    axes.plot(np.degrees(angle[j]), rpm[i], "o", color="white", markeredgecolor="black", label=label)
    axes.set(xlabel="cam angle, deg", ylabel=f"{shaft} speed, rpm", xlim=(0.0, 360.0), xticks=range(0, 361, 45))
    figure.legend(loc="outside upper center", fontsize="small")
    return figure


def force_figure(rpm: FloatArray, forces: Mapping[str, FloatArray], shaft: str) -> Figure:
    """Return a figure with minimum and maximum contact force, the rows of an array, over speed."""
    figure, (upper, lower) = create_stacked_axes(("max force, N", "min force, N"), f"{shaft} speed, rpm")
    for (name, (minimum, maximum)), (colour, dashes) in zip(forces.items(), line_styles(), strict=False):
        for axes, values in ((upper, maximum), (lower, minimum)):
            axes.plot(rpm, values, label=name, color=colour, linestyle=dashes, marker="o", markersize=3)
    lower.axhline(0.0, color="black", linewidth=0.8)
    add_legend(figure, upper)
    return figure


def growth_figure(rpm: FloatArray, growth: FloatArray, dangers: Mapping[str, NDArray[np.bool_]], shaft: str) -> Figure:
    """Return a figure with the growth rate of disturbances over speed and the causes of instability at each speed."""
    figure, (upper, lower) = create_stacked_axes(("growth, 1/s", "cause"), f"{shaft} speed, rpm")
    upper.plot(rpm, growth, color="black", marker="o", markersize=3)
    upper.set_yscale("symlog", linthresh=_LINEAR_GROWTH)
    upper.axhline(0.0, color="black", linewidth=0.8)
    low, high = upper.get_ylim()
    upper.set_ylim(min(low, -_LINEAR_GROWTH), max(high, _LINEAR_GROWTH))
    for row, ((_, at), (colour, _)) in enumerate(zip(dangers.items(), line_styles(), strict=False)):
        speeds = rpm[at]
        lower.plot(speeds, np.full(len(speeds), row), color=colour, marker="s", linestyle="none")
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
    length = structure.beams.length[structure.model.mesh.element_ranges()[member], None]
    along = np.cumsum(length, axis=0) - length + length * np.linspace(0.0, 1.0, _PARTS + 1)
    place = to_display_unit("m")[0] * along.ravel()
    motion = _member_motion(structure, member, nodal) / size
    for values, name, (colour, dashes) in zip(motion.T, _MOTIONS, line_styles(), strict=False):
        if np.abs(values).max() > _MIN_MOTION:
            axes.plot(place, values, label=name, color=colour, linestyle=dashes)
    axes.axhline(0.0, color="0.4", linewidth=0.8)
    axes.set(xlim=(0.0, float(place[-1])), ylim=(-1.1, 1.1))
    axes.grid(alpha=0.3)


def _member_motion(structure: Structure, member: str, nodal: FloatArray) -> FloatArray:
    """Return the motion of the centre line of a member, and its twist times its radius, m, shape (points, 4)."""
    part = structure.model.mesh.element_ranges()[member]
    radius = structure.model.members[member].section.at(0.5).radius
    return (deflection(structure.beams, nodal, _PARTS, part)[..., :4] * [1.0, 1.0, 1.0, radius]).reshape(-1, 4)


def mode_figure(structure: Structure, found: ModelModes, *, title: str = "") -> Figure:
    """Return a figure with modes along the members that move in them, one row per mode."""
    members = list(structure.model.mesh.lines)
    if not members:
        why = "shapes are drawn along members; flexcam modes says what moves in a train of masses"
        raise refuse("members", "none", "one or more", why)
    shapes = structure.dofs.nodal_modes(found.modes.shapes.T, structure.model.mesh.extent)
    motions = [
        {name: float(np.abs(_member_motion(structure, name, nodal)).max()) for name in members} for nodal in shapes
    ]
    moving = [[name for name, size in sizes.items() if size > _MIN_MOTION * max(sizes.values())] for sizes in motions]
    columns = max(map(len, moving), default=1) or 1
    heights = [2.2 if names else 0.4 for names in moving]
    figure = Figure(figsize=(2.0 + 4.0 * columns, 1.0 + sum(heights)), layout="constrained")
    rows = np.atleast_1d(np.asarray(figure.subfigures(len(moving), 1, height_ratios=heights)))
    handles: dict[str, Artist] = {}
    for mode, (row, nodal, names) in enumerate(zip(rows, shapes, moving, strict=True)):
        words = f"mode {mode + 1}, {found.modes.frequencies[mode]:.4g} Hz: {found.words(mode)}"
        lines = textwrap.wrap(words if names else f"{words}; no member moves", _TITLE_WIDTH * columns)
        row.suptitle("\n".join(lines), fontsize="small", x=0.02, ha="left")
        if not names:
            continue
        grid = row.subplots(1, columns, squeeze=False)[0]
        for axes in grid[len(names) :]:
            axes.set_axis_off()
        for axes, member in zip(grid, names, strict=False):
            draw_mode(axes, structure, member, nodal, max(motions[mode].values()))
            axes.set_xlabel(f"along {member}, {to_display_unit('m')[1]}")
            handles |= {name: line for line, name in zip(*axes.get_legend_handles_labels(), strict=True)}
    figure.legend(list(handles.values()), list(handles), loc="outside lower center", fontsize="small", ncols=4)
    if title:
        figure.suptitle(wrap_title(title), fontsize="medium")
    return figure
