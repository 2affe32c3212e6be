"""Figures over time, cam angle or a study: motion of a probe, forces, energies, results of studies."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import groupby
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MultipleLocator
from numpy.typing import NDArray

from flexcam.core import FloatArray
from flexcam.core.errors import InputError, refuse, suggest_name
from flexcam.core.units import to_display_unit
from flexcam.dynamics import SERIES, Response, Series, check_scalar_probe, component_unit, scalar_history
from flexcam.io.exports import energies
from flexcam.io.sweep_table import Column, SweepTable
from flexcam.plotting.figures import (
    COLOURS,
    TITLE_PAD,
    add_legend,
    create_axes,
    create_stacked_axes,
    escape_math,
    line_styles,
    wrap_title,
)

if TYPE_CHECKING:
    from flexcam.analysis.model_choice import ModelEvaluation

Abscissa = Literal["angle", "time", "crank"]
"""Abscissa of the curves of a run: cam angle, time, or crank angle of a four-stroke engine."""

_TICKS = (5, 10, 15, 30, 45, 90, 180, 360, 720)
_MAX_TICKS = 9
_BELOW = {"angle": "cam angle, deg", "time": "time, s", "crank": "crank angle from cam angle 0, deg"}
_SHORT_NAME = 10  # length of a name, characters, that shares a line of an axis label with a quantity


def curve_style(label: str, colour: str = COLOURS[0], dashes: str = "-", width: float = 1.4) -> dict[str, Any]:
    """Return name and style of a curve as keyword arguments of matplotlib's `plot`."""
    return {"label": escape_math(label), "color": colour, "linestyle": dashes, "linewidth": width}


def last_revolution(response: Response, zero: float = 0.0, begin: float = 0.0) -> Response:
    """Return the last revolution of a response, its cam angle counted from `zero` and rising from `begin`, rad."""
    indices = np.flatnonzero(response.angle > response.angle[-1:] - math.tau * (1.0 - _ROUNDING))
    angle = np.mod(response.angle[indices] - zero - begin + _ROUNDING, math.tau) - _ROUNDING + begin
    order = np.argsort(angle, kind="stable")
    rows = indices[order]
    return replace(
        response, time=response.time[rows], angle=angle[order],
        probes=Series(*(values[rows] for values in response.probes)),
        channels={name: values[rows] for name, values in response.channels.items()},
    )  # fmt: skip


_ROUNDING = 1e-9  # of an angle, relative to a revolution


def draw_motion(
    axes: Sequence[Axes], response: Response, probe: str, style: Mapping[str, Any], *, over: Abscissa = "angle",
    sign: float = 1.0,
) -> None:  # fmt: skip
    """Draw displacement, velocity and acceleration of a probe, times a sign, in a style of matplotlib's `plot`."""
    history = scalar_history(response, probe)
    for axis, (series, unit) in zip(axes, SERIES.items(), strict=False):
        factor, _ = to_display_unit(component_unit(probe.rpartition(".")[2], unit))
        axis.plot(abscissa(response, over), sign * factor * getattr(history, series), **style)


def draw_channel(
    axes: Axes, response: Response, channel: str, style: Mapping[str, Any], *, over: Abscissa = "angle"
) -> None:
    """Draw a channel, such as a contact force, in a style of matplotlib's `plot`."""
    factor, _ = to_display_unit(channel_unit(response, channel))
    axes.plot(abscissa(response, over), factor * response.channels[channel], **style)


def channel_unit(response: Response, channel: str) -> str:
    """Return the SI unit of a channel."""
    units = dict(response.outline.channels)
    if channel not in units:
        allowed = ", ".join(units) or "(no channel was saved)"
        raise refuse("channel", repr(channel), allowed, "", suggest_name(channel, units))
    return units[channel]


def contact_forces(response: Response) -> list[str]:
    """Return the channels of contact forces."""
    return [name for name, _ in response.outline.channels if name.startswith("contacts.") and name.endswith(".force")]


def motion_figure(
    responses: Mapping[str, Response], probe: str, channels: Sequence[str] = (), *,
    rigid: Mapping[str, Response] | None = None, over: Abscissa = "angle", title: str = "", lift: str = "",
    sign: float = 1.0, deviation: bool = False,
) -> Figure:  # fmt: skip
    """Return a figure with the motion of a probe in several runs, and channels below it.

    `lift` is the name of a point that a cam lifts: its displacement times `sign` is a lift, positive as it opens. With
    `deviation` the last axes have the difference of the displacement from the rigid run.
    """
    check_scalar_probe(probe, *(response.outline for response in responses.values()))
    component = probe.rpartition(".")[2]
    name, gap = lift or probe, " " if len(lift or probe) <= _SHORT_NAME else "\n"
    words = {series: "lift" if lift and series == "displacement" else series for series in SERIES}
    labels = [axis_label(f"{name}{gap}{words[series]}", component_unit(component, SERIES[series])) for series in SERIES]
    labels += _channel_labels(responses, channels)
    labels += [axis_label("flexible\nminus rigid", component_unit(component, "m"))] if deviation else []
    figure, axes = create_stacked_axes(labels, _BELOW[over])
    styled = _style_responses(responses, rigid or {})
    for response, style in styled:
        draw_motion(axes[: len(SERIES)], response, probe, style, over=over, sign=sign)
    _draw_channels(axes[len(SERIES) :], styled, channels, over)
    for (flexible, style), (rigid_run, _) in zip(styled[::2], styled[1::2], strict=True) if deviation else ():
        factor, _ = to_display_unit(component_unit(component, "m"))
        displacement, rigid_displacement = (scalar_history(run, probe).displacement for run in (flexible, rigid_run))
        difference = displacement - np.interp(flexible.angle, rigid_run.angle, rigid_displacement)
        axes[-1].plot(abscissa(flexible, over), sign * factor * difference, **style)
        axes[-1].axhline(0.0, color="0.4", linewidth=0.8)
    return _finish_axes(figure, axes, over, title)


def shade(axes: Sequence[Axes], x: FloatArray, instants: NDArray[np.bool_], name: str, colour: str) -> None:
    """Shade some instants in all axes."""
    for axis in axes if instants.any() else ():
        height: dict[str, Any] = {"transform": axis.get_xaxis_transform(), "alpha": 0.25, "linewidth": 0.0}
        axis.fill_between(x, 0.0, 1.0, where=list(instants), color=colour, label=name, **height)


def channel_figure(
    responses: Mapping[str, Response], channels: Sequence[str], *, rigid: Mapping[str, Response] | None = None,
    over: Abscissa = "angle", title: str = "", means: Mapping[str, Mapping[str, float]] | None = None,
) -> Figure:  # fmt: skip
    """Return a figure with channels of several runs, and their `means` by run and channel, SI."""
    figure, axes = create_stacked_axes(_channel_labels(responses, channels), _BELOW[over])
    _draw_channels(axes, _style_responses(responses, rigid or {}), channels, over)
    _finish_axes(figure, axes, over, title)
    for axis, channel in zip(axes, channels, strict=True):
        if channel.endswith(".force"):
            axis.axhline(0.0, color="0.4", linewidth=0.8)
        factor, symbol = to_display_unit(_unit_in_any(responses, channel))
        lines: list[Line2D] = []
        for (name, values), (colour, _) in zip((means or {}).items(), line_styles(), strict=False):
            if channel in values:
                mean = factor * values[channel]
                label = ", ".join(filter(None, (name, f"mean {mean:.4g} {symbol}")))
                lines.append(axis.axhline(mean, color=colour, linestyle="--", linewidth=1.0, label=label))
        if lines:
            axis.legend(handles=lines, loc="upper right", fontsize="x-small")
    return figure


def orbit_figure(responses: Mapping[str, Response], bearings: Sequence[str]) -> Figure:
    """Return a figure with the orbits of journals in their bearings in several runs; the outer circle is the clearance.

    The first direction across the shaft points up, and the shaft rotates counterclockwise.
    """
    columns = min(len(bearings), 4)
    rows = math.ceil(len(bearings) / columns)
    figure = Figure(figsize=(0.5 + 3.2 * columns, 0.5 + 3.4 * rows), layout="constrained")
    for i, bearing in enumerate(bearings, 1):
        axes = figure.add_subplot(rows, columns, i, projection="polar", theta_offset=0.5 * math.pi)
        for (name, response), (colour, dashes) in zip(responses.items(), line_styles(), strict=False):
            angle, radius = (response.channels[f"{bearing}.{key}"] for key in ("angle", "eccentricity"))
            axes.plot(angle, radius, color=colour, linestyle=dashes, label=escape_math(name))
        axes.set(title=short_name(bearing), ylim=(0.0, 1.0), yticks=(0.25, 0.5, 0.75, 1.0))
        axes.grid(alpha=0.3)
    add_legend(figure, figure.axes[0])
    return figure


def _channel_labels(responses: Mapping[str, Response], channels: Sequence[str]) -> list[str]:
    return [axis_label(short_name(name), _unit_in_any(responses, name)) for name in channels]


def _unit_in_any(responses: Mapping[str, Response], channel: str) -> str:
    first, *others = responses.values()
    return channel_unit(next((run for run in (first, *others) if channel in run.channels), first), channel)


def add_area_legend(figure: Figure) -> Figure:
    """Add a legend of the shaded areas of a figure below it."""
    if areas := list(figure.axes[0].collections):
        figure.legend(handles=areas, loc="outside lower center", fontsize="small")
    return figure


def _draw_channels(
    axes: Sequence[Axes], styled: Sequence[tuple[Response, Mapping[str, Any]]], channels: Sequence[str], over: Abscissa
) -> None:
    """Draw channels of runs, one axis each, as far as a run has them; a rigid one lacks the force of an adjuster."""
    for response, style in styled:
        for axis, channel in zip(axes, channels, strict=False):
            if channel in response.channels:
                draw_channel(axis, response, channel, style, over=over)


def energy_figure(responses: Mapping[str, Response], *, over: Abscissa = "angle", title: str = "") -> Figure:
    """Return a figure with the energies of runs and their residuals."""
    labels = ["energy, J" if len(responses) == 1 else f"{name}\nenergy, J" for name in responses]
    figure, axes = create_stacked_axes(labels, _BELOW[over], height=3.0)
    for axis, response in zip(axes, responses.values(), strict=True):
        for (name, energy), (colour, dashes) in zip(energies(response).items(), line_styles(), strict=False):
            if energy.any():
                axis.plot(abscissa(response, over), energy, **curve_style(name, colour, dashes))
    return _finish_axes(figure, axes, over, title)


def abscissa(response: Response, over: Abscissa) -> FloatArray:
    """Return cam angle or crank angle, deg, or time, s, of a run."""
    return response.time if over == "time" else np.degrees(response.angle) * (2.0 if over == "crank" else 1.0)


def _style_responses(
    responses: Mapping[str, Response], rigid: Mapping[str, Response]
) -> list[tuple[Response, dict[str, Any]]]:
    """Return the drawn responses with their styles: rigid runs are dotted, in the colour of their flexible runs."""
    styled: list[tuple[Response, dict[str, Any]]] = []
    for (name, response), (colour, dashes) in zip(responses.items(), line_styles(), strict=False):
        flexible = "flexible" if name in rigid and not name else name
        styled.append((response, curve_style(flexible, colour, "-" if dashes == ":" else dashes)))
        if name in rigid:
            rigid_colour = colour if len(responses) > 1 else COLOURS[1]
            styled.append((rigid[name], curve_style(f"{name}, rigid" if name else "rigid", rigid_colour, ":", 1.6)))
    return styled


def axis_label(name: str, unit: str) -> str:
    r"""Return an axis label with the unit below the name."""
    _, symbol = to_display_unit(unit)
    return f"{name}\n{symbol}" if symbol else name


def short_name(channel: str) -> str:
    """Return the short name of a channel for an axis label."""
    return " ".join(channel.split(".")[1:]).replace("_", " ")


def _finish_axes(figure: Figure, axes: Sequence[Axes], over: Abscissa, title: str) -> Figure:
    add_legend(figure, axes[0])
    first, last = axes[-1].dataLim.intervalx
    if over != "time" and abs(last - first - 360.0) < _WHOLE:
        last = first + 360.0
    if over != "time" and last > first:
        span = last - first
        spacing = next((float(deg) for deg in _TICKS if span / deg <= _MAX_TICKS), 720.0 * np.ceil(span / 720.0 / 8.0))
        axes[-1].xaxis.set_major_locator(MultipleLocator(spacing))
    if last > first:
        axes[-1].set_xlim(first, last)
    axes[0].set_title(wrap_title(title), fontsize="medium", pad=TITLE_PAD if over == "crank" else None)
    return figure


_WHOLE = 4.0  # angle that the samples of a revolution may leave open, deg
_LEVELS = 10
FAILED = "failed variant"  # label of variants without values


def bars_figure(
    groups: Mapping[str, Mapping[str, float]], label: str, ends: Mapping[str, FloatArray] | None = None
) -> Figure:
    """Return a bar chart by key, one diagram per scalar."""
    keys = max(len(values) for values in groups.values())
    figure, axes = create_axes((7.0, 0.8 + len(groups) * (0.5 + 0.35 * keys)), len(groups), sharex=False, grid="x")
    for axis, (name, values) in zip(axes, groups.items(), strict=True):
        sizes = np.array(list(values.values()))
        order = np.argsort(np.abs(sizes), kind="stable")
        spread = None if ends is None else np.abs(ends[name] - sizes)[:, order]
        axis.barh(np.array(list(values))[order], sizes[order], xerr=spread, color=COLOURS[0], capsize=3, height=0.6)
        axis.axvline(0.0, color="black", linewidth=0.8)
        axis.set_title(name, fontsize="medium", loc="left")
        axis.set_xlabel(label)
    return figure


def scatter_figure(values: Mapping[str, FloatArray], units: Mapping[str, str], middle: Mapping[str, float]) -> Figure:
    """Return histograms of scalars, one diagram per scalar."""
    figure, axes = create_axes((7.0, 0.8 + 2.4 * len(values)), len(values), sharex=False, grid=None)
    for axis, (name, data) in zip(axes, values.items(), strict=True):
        axis.hist(data, bins="auto" if np.ptp(data) > 0.0 else 3, color=COLOURS[5], edgecolor="black", linewidth=0.6)
        for quantile in np.quantile(data, [0.05, 0.95]).tolist() if len(data) else ():
            axis.axvline(quantile, color="black", linestyle="--", linewidth=1.0, label="5 % and 95 % quantiles")
        if name in middle:
            axis.axvline(middle[name], color=COLOURS[1], linewidth=1.8, label="nominal case")
        unit = units.get(name, "")
        axis.set(xlabel=name if unit in ("", "1") else f"{name}, {unit}", ylabel="sets of parts")
    handles = {label: line for axis in axes for line, label in zip(*axis.get_legend_handles_labels(), strict=True)}
    figure.legend(list(handles.values()), list(handles), loc="outside upper center", fontsize="small", ncols=2)
    return figure


def progress_figure(costs: FloatArray, inside: np.ndarray, best: FloatArray, label: str) -> Figure:
    """Return a figure with the goal over the evaluations of an optimization."""
    figure, (axes,) = create_axes((7.0, 4.0))
    at = np.arange(1, len(costs) + 1)
    finite = np.isfinite(costs)
    outline: dict[str, Any] = {"s": 16, "edgecolors": COLOURS[0], "linewidths": 0.8}
    for mask, fill, name in ((inside & finite, COLOURS[0], "feasible"), (~inside & finite, "none", "infeasible")):
        axes.scatter(at[mask], costs[mask], facecolors=fill, label=name, **outline)
    axes.plot(at, best, color=COLOURS[1], linewidth=1.5, drawstyle="steps-post", label="best so far")
    axes.set(xlabel="evaluation", ylabel=label)
    figure.legend(loc="outside upper center", ncols=3, fontsize="small")
    return figure


def fit_figure(
    instants: FloatArray, label: str, curves: Mapping[str, tuple[FloatArray, FloatArray, FloatArray]]
) -> Figure:
    """Return measured curves with those of the model before and after a fit, one diagram per curve."""
    figure, axes = create_axes((7.0, 0.8 + 2.6 * len(curves)), len(curves))
    order = np.argsort(instants)
    for axis, (name, (measured, before, after)) in zip(axes, curves.items(), strict=True):
        axis.plot(instants[order], measured[order], ".", color="0.55", markersize=3.0, label="measured")
        axis.plot(instants[order], before[order], "--", color=COLOURS[1], linewidth=1.2, label="before")
        axis.plot(instants[order], after[order], color=COLOURS[0], linewidth=1.4, label="after the fit")
        axis.set_ylabel(name)
    axes[-1].set_xlabel(label)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=3, fontsize="small")
    return figure


def front_figure(values: FloatArray, inside: np.ndarray, front: Sequence[int], labels: tuple[str, str]) -> Figure:
    """Return a figure with two goals against each other and their Pareto front."""
    figure, (axes,) = create_axes((7.0, 5.0))
    finite = np.isfinite(values).all(axis=1) & inside
    axes.scatter(*values[finite].T, s=8, color="0.65", label="feasible")
    axes.plot(*values[list(front)].T, color=COLOURS[1], marker="o", markersize=5, linewidth=1.2, label="front")
    axes.set(xlabel=labels[0], ylabel=labels[1])
    figure.legend(loc="outside upper center", ncols=2, fontsize="small")
    return figure


def limits_figure(places: Sequence[FloatArray], values: Mapping[str, FloatArray], labels: Sequence[str]) -> Figure:
    """Return a figure of values over one number as curves, over two as maps, one diagram per label."""
    if len(places) > 1:
        return map_figure(places[1], places[0], values, (labels[1], labels[0]))
    figure, axes = create_stacked_axes(list(values), labels[0], height=2.4)
    for axis, numbers in zip(axes, values.values(), strict=True):
        axis.plot(places[0], numbers, color=COLOURS[0], marker="o", markersize=3)
    return figure


def map_figure(
    along: FloatArray, down: FloatArray, values: Mapping[str, FloatArray], labels: tuple[str, str],
    failed: NDArray[np.bool_] | None = None,
) -> Figure:  # fmt: skip
    """Return maps of values over two numbers as filled contours, one diagram per label; NaN is hatched."""
    figure, axes = create_axes((7.0, 0.8 + 4.0 * len(values)), len(values), grid=None)
    for axis, (label, numbers) in zip(axes, values.items(), strict=True):
        axis.set_facecolor("0.92")
        axis.patch.set_hatch("//")
        axis.patch.set_edgecolor("0.7")
        if np.isfinite(numbers).any():
            low, high = np.nanmin(numbers), np.nanmax(numbers)
            levels = _LEVELS if high > low else [low - 1, low + 1]
            filled = axis.contourf(along, down, numbers, levels=levels, cmap="cividis")
            axis.clabel(axis.contour(along, down, numbers, levels=filled.levels, colors="white", linewidths=0.6),
                        fmt="%.4g", fontsize="x-small")  # fmt: skip
            figure.colorbar(filled, ax=axis, label=label)
        places = np.meshgrid(along, down)
        axis.plot(*(grid.ravel() for grid in places), ".", color="black", markersize=2)
        if failed is not None and failed.any():
            axis.plot(*(grid[failed] for grid in places), "x", color=COLOURS[1], label=FAILED)
            axis.legend(loc="upper right", fontsize="x-small")
        axis.set_ylabel(labels[1])
    axes[-1].set_xlabel(labels[0])
    return figure


def sweep_figure(table: SweepTable, x: str, names: Sequence[str]) -> Figure:
    """Return a figure with columns of a sweep over another one, with a line per combination of the other axes."""
    below, columns = _column(table, "--x", x), [_column(table, "--y", name) for name in names]
    places, labels = np.asarray(below.values), [_column_label(column, "\n") for column in columns]
    figure, axes = create_stacked_axes(labels, _column_label(below, ", "), height=2.4)
    others = [key for key in table.inputs if key.name != x and len(set(key.values)) > 1] if table.shape else []
    groups: dict[str, list[int]] = {}
    for i in range(len(table)):
        groups.setdefault(", ".join(f"{key.name} {key.format(i)}" for key in others), []).append(i)
    failed = np.array([not status.ok for status in table.statuses])
    for axis, column in zip(axes, columns, strict=True):
        values = _plain_numbers(column)
        for (name, rows), (colour, dashes) in zip(groups.items(), line_styles(), strict=False):
            order = rows if isinstance(below.values, tuple) else sorted(rows, key=lambda i: places[i])
            style: dict[str, Any] = {"linestyle": dashes if table.shape else "none", "marker": "o", "markersize": 3}
            axis.plot(places[order], values[order], label=name, color=colour, **style)
        missing = failed & np.isnan(values)
        if missing.any():
            axis.plot(places[missing], np.full(int(missing.sum()), 0.03), "x", color="black",
                      transform=axis.get_xaxis_transform(), label=FAILED)  # fmt: skip
    add_legend(figure, axes[0])
    return figure


def sweep_map(table: SweepTable, x: str, names: Sequence[str]) -> Figure:
    """Return filled contours of columns of a sweep over its two axes, the first of them `x`."""
    varied = [key for key in table.inputs if len(set(key.values)) > 1]
    keys = [key.name for key in varied]
    if not table.shape or len(varied) != 2 or any(isinstance(key.values, tuple) for key in varied):
        raise refuse("--map", ", ".join(keys) or "none", "a grid over two keys with numbers", "", "leave --map out")
    if x not in keys:
        raise refuse("--x", repr(x), " or ".join(keys), "a map is drawn over both keys")
    along, down = sorted(varied, key=lambda key: key.name != x)
    (first, at), (second, row) = (np.unique(np.asarray(key.values), return_inverse=True) for key in (along, down))
    maps: dict[str, FloatArray] = {}
    missing = np.zeros((len(second), len(first)), dtype=bool)
    for column in (_column(table, "--y", name) for name in names):
        values = np.full(missing.shape, np.nan)
        values[row, at] = _plain_numbers(column)
        maps[_column_label(column, "\n")] = values
        missing |= np.isnan(values)
    return map_figure(first, second, maps, (_column_label(along, ", "), _column_label(down, ", ")), missing)


def _column(table: SweepTable, option: str, name: str) -> Column:
    """Return a column of a sweep that an option names."""
    try:
        return table.column(name)
    except InputError as refusal:
        raise InputError(replace(fault, where=option) for fault in refusal.faults) from None


def _plain_numbers(column: Column) -> FloatArray:
    if isinstance(column.values, tuple):
        raise refuse("--y", repr(column.name), "a column of numbers", "it has words")
    return column.values


def _column_label(column: Column, between: str) -> str:
    return between.join(filter(None, (column.name, column.unit)))


def work_precision_figure(found: Sequence[ModelEvaluation]) -> Figure:
    """Return a figure with the error of models over their work, both logarithmic."""
    kinds = ("lift", "acceleration")
    figure, axes = create_stacked_axes(tuple(f"error of {kind}, %" for kind in kinds), "unknowns times steps")
    runs = sorted((run for run in found if run.errors), key=lambda run: (run.rung, run.steps))
    label = "Pareto-optimal"  # of the first model only
    for (name, group), (colour, dashes) in zip(groupby(runs, key=lambda run: run.rung), line_styles(), strict=False):
        points = list(group)
        best = [run for run in points if run.best]
        line = {"label": name, "linestyle": dashes, "marker": "o", "markersize": 4}
        square = {"label": label, "linestyle": "none", "marker": "s", "markersize": 8, "fillstyle": "none"}
        label = ""
        for axis, kind in zip(axes, kinds, strict=True):
            for subset, style in ((points, line), (best, square)):
                errors = [100.0 * run.errors[kind] for run in subset]
                axis.loglog([max(run.work, 1) for run in subset], errors, color=colour, **style)
    add_legend(figure, axes[0])
    return figure
