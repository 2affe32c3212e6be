"""Figures of studies: sensitivities, scatter, progress of an optimization, Pareto fronts, maps of limits."""

# pyright: reportUnknownMemberType=false
# matplotlib does not type its keyword arguments.

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby

import numpy as np
from matplotlib.figure import Figure

from flexcam.analysis.model_choice import ModelEvaluation
from flexcam.core import FloatArray
from flexcam.plotting.figures import COLOURS, add_legend, create_stacked_axes, line_styles

_LEVELS = 10


def bars_figure(
    groups: Mapping[str, Mapping[str, float]], label: str, ends: Mapping[str, FloatArray] | None = None
) -> Figure:
    """Return a bar chart by key, one diagram per scalar."""
    keys = max(len(one) for one in groups.values())
    figure = Figure(figsize=(7.0, 0.8 + len(groups) * (0.5 + 0.35 * keys)), layout="constrained")
    axes = list(np.atleast_1d(np.asarray(figure.subplots(len(groups)))))
    for axis, (name, values) in zip(axes, groups.items(), strict=True):
        order = sorted(range(len(values)), key=lambda i: abs(list(values.values())[i]))
        sizes = np.array(list(values.values()))[order]
        spread = None if ends is None else np.abs(ends[name][:, order] - sizes)
        axis.barh([list(values)[i] for i in order], sizes, xerr=spread, color=COLOURS[0], capsize=3, height=0.6)
        axis.axvline(0.0, color="black", linewidth=0.8)
        axis.set_title(name, fontsize="medium", loc="left")
        axis.grid(alpha=0.3, axis="x")
        axis.set_xlabel(label)
    return figure


def scatter_figure(values: Mapping[str, FloatArray], units: Mapping[str, str], middle: Mapping[str, float]) -> Figure:
    """Return histograms of scalars, one diagram per scalar."""
    figure = Figure(figsize=(7.0, 0.8 + 2.4 * len(values)), layout="constrained")
    axes = list(np.atleast_1d(np.asarray(figure.subplots(len(values)))))
    for axis, (name, of) in zip(axes, values.items(), strict=True):
        axis.hist(of, bins="auto" if np.ptp(of) > 0.0 else 3, color=COLOURS[5], edgecolor="black", linewidth=0.6)
        for part in np.quantile(of, [0.05, 0.95]).tolist() if len(of) else ():
            axis.axvline(part, color="black", linestyle="--", linewidth=1.0, label="5 % and 95 % quantiles")
        if name in middle:
            axis.axvline(middle[name], color=COLOURS[1], linewidth=1.8, label="nominal case")
        unit = units.get(name, "")
        axis.set_xlabel(name if unit in ("", "1") else f"{name}, {unit}")
        axis.set_ylabel("sets of parts")
    named = {label: line for axis in axes for line, label in zip(*axis.get_legend_handles_labels(), strict=True)}
    figure.legend(list(named.values()), list(named), loc="outside upper center", fontsize="small", ncols=2)
    return figure


def progress_figure(costs: FloatArray, inside: np.ndarray, best: FloatArray, label: str) -> Figure:
    """Return a figure with the goal over the evaluations of an optimization."""
    figure = Figure(figsize=(7.0, 4.0), layout="constrained")
    axes = figure.add_subplot()
    at = np.arange(1, len(costs) + 1)
    known = np.isfinite(costs)
    for chosen, fill, name in ((inside & known, COLOURS[0], "feasible"), (~inside & known, "none", "infeasible")):
        axes.scatter(
            at[chosen], costs[chosen], s=16, facecolors=fill, edgecolors=COLOURS[0], linewidths=0.8, label=name
        )
    axes.plot(at, best, color=COLOURS[1], linewidth=1.5, drawstyle="steps-post", label="best so far")
    axes.set_xlabel("evaluation")
    axes.set_ylabel(label)
    axes.grid(alpha=0.3)
    figure.legend(loc="outside upper center", ncols=3, fontsize="small")
    return figure


def front_figure(values: FloatArray, inside: np.ndarray, front: Sequence[int], labels: tuple[str, str]) -> Figure:
    """Return a figure with two goals against each other and their Pareto front."""
    figure = Figure(figsize=(7.0, 5.0), layout="constrained")
    axes = figure.add_subplot()
    known = np.isfinite(values).all(axis=1) & inside
    axes.scatter(*values[known].T, s=8, color="0.65", label="feasible")
    axes.plot(*values[list(front)].T, color=COLOURS[1], marker="o", markersize=5, linewidth=1.2, label="front")
    axes.set_xlabel(labels[0])
    axes.set_ylabel(labels[1])
    axes.grid(alpha=0.3)
    figure.legend(loc="outside upper center", ncols=2, fontsize="small")
    return figure


def map_figure(
    along: FloatArray, down: FloatArray, rpm: Mapping[str, FloatArray], labels: tuple[str, str], shaft: str
) -> Figure:
    """Return a map of limits over two numbers as filled contours, one diagram per limit."""
    figure = Figure(figsize=(7.0, 0.8 + 4.0 * len(rpm)), layout="constrained")
    axes = list(np.atleast_1d(np.asarray(figure.subplots(len(rpm), sharex=True))))
    for axis, (name, speeds) in zip(axes, rpm.items(), strict=True):
        axis.set_facecolor("0.92")
        axis.patch.set_hatch("//")
        axis.patch.set_edgecolor("0.7")
        if np.isfinite(speeds).any():
            levels = (
                _LEVELS if np.nanmax(speeds) > np.nanmin(speeds) else [np.nanmin(speeds) - 1, np.nanmin(speeds) + 1]
            )
            filled = axis.contourf(along, down, speeds, levels=levels, cmap="cividis")
            axis.clabel(axis.contour(along, down, speeds, levels=filled.levels, colors="white", linewidths=0.6),
                        fmt="%.0f", fontsize="x-small")  # fmt: skip
            figure.colorbar(filled, ax=axis, label=f"{name.replace('_', ' ')}\n{shaft} speed, rpm")
        axis.plot(*(one.ravel() for one in np.meshgrid(along, down)), ".", color="black", markersize=2)
        axis.set_ylabel(labels[1])
    axes[-1].set_xlabel(labels[0])
    return figure


_KINDS = ("lift", "acceleration")


def work_precision_figure(found: Sequence[ModelEvaluation]) -> Figure:
    """Return a figure with the error of models over their work, both logarithmic."""
    figure, axes = create_stacked_axes(tuple(f"error of {kind}, %" for kind in _KINDS), "unknowns times steps")
    runs = sorted((one for one in found if one.errors), key=lambda one: (one.rung, one.steps))
    names = 0
    for (name, group), (colour, dashes) in zip(groupby(runs, key=lambda one: one.rung), line_styles(), strict=False):
        of, names = list(group), names + 1
        for axis, kind in zip(axes, _KINDS, strict=True):
            work = [max(one.work, 1) for one in of]
            axis.loglog(work, [100.0 * one.errors[kind] for one in of], label=name, color=colour, linestyle=dashes,
                        marker="o", markersize=4)  # fmt: skip
            best = [one for one in of if one.best]
            axis.loglog([max(one.work, 1) for one in best], [100.0 * one.errors[kind] for one in best],
                        color=colour, linestyle="none", marker="s", markersize=8, fillstyle="none")  # fmt: skip
    add_legend(figure, axes[0], names)
    return figure
