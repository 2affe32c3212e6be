"""Figures over time, cam angle or a study: motion of a probe, forces, energies, results of studies."""

# pyright: reportUnknownMemberType=false
# matplotlib does not type its keyword arguments.

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator

from flexcam.analysis.comparison import scalar_history
from flexcam.analysis.model_choice import ModelEvaluation
from flexcam.core import FloatArray
from flexcam.core.errors import refuse, suggest_name
from flexcam.core.units import to_display_unit
from flexcam.dynamics import SERIES, Response, component_unit
from flexcam.plotting.figures import (
    COLOURS,
    add_legend,
    create_axes,
    create_stacked_axes,
    escape_math,
    line_styles,
    wrap_title,
)

Abscissa = Literal["angle", "time"]
"""Abscissa of the curves of a run: cam angle or time."""

_TICKS = (5, 10, 15, 30, 45, 90, 180, 360, 720)
_MOST_TICKS = 9
_BELOW = {"angle": "cam angle, deg", "time": "time, s"}
_FORCES = (".force",)
_SHORT_NAME = 10  # length of a name, characters, that shares a line of an axis label with a quantity


@dataclass(frozen=True)
class CurveStyle:
    """Style and name of a curve."""

    label: str = ""  #: label in the legend
    colour: str = COLOURS[0]  #: colour and dashes in the format of matplotlib
    dashes: str = "-"
    width: float = 1.4  #: width of the line, points


def draw_motion(
    axes: Sequence[Axes], response: Response, probe: str, *, over: Abscissa = "angle", look: CurveStyle | None = None,
    sign: float = 1.0,
) -> None:  # fmt: skip
    """Draw displacement, velocity and acceleration of a probe, times a sign."""
    history = scalar_history(response, probe)
    for one, (series, unit) in zip(axes, SERIES.items(), strict=False):
        factor, _ = to_display_unit(component_unit(probe.rpartition(".")[2], unit))
        _draw(one, response, sign * factor * getattr(history, series), over, look)


def draw_channel(
    axes: Axes, response: Response, channel: str, *, over: Abscissa = "angle", look: CurveStyle | None = None
) -> None:
    """Draw a channel, such as a contact force."""
    factor, _ = to_display_unit(channel_unit(response, channel))
    _draw(axes, response, factor * response.channels[channel], over, look)


def channel_unit(response: Response, channel: str) -> str:
    """Return the SI unit of a channel."""
    known = dict(response.outline.channels)
    if channel not in known:
        allowed = ", ".join(known) or "(no channel was saved)"
        raise refuse("channel", repr(channel), allowed, "", suggest_name(channel, known))
    return known[channel]


def contact_forces(response: Response) -> list[str]:
    """Return the channels of contact forces."""
    return [name for name, _ in response.outline.channels if name.startswith("contacts.") and name.endswith(_FORCES)]


def motion_figure(
    responses: Mapping[str, Response], probe: str, channels: Sequence[str] = (), *,
    rigid: Mapping[str, Response] | None = None, over: Abscissa = "angle", title: str = "", lift: str = "",
    sign: float = 1.0,
) -> Figure:  # fmt: skip
    """Return a figure with the motion of a probe in several runs, and channels below it.

    `lift` is the name of a point that a cam lifts: its displacement times `sign` is a lift, positive as it opens.
    """
    first = next(iter(responses.values()))
    component = probe.rpartition(".")[2]
    name, gap = lift or probe, " " if len(lift or probe) <= _SHORT_NAME else "\n"
    words = {"displacement": "lift"} if lift else {}
    motions = [
        axis_label(f"{name}{gap}{words.get(series, series)}", component_unit(component, unit))
        for series, unit in SERIES.items()
    ]
    called = [axis_label(short_name(name), channel_unit(first, name)) for name in channels]
    figure, axes = create_stacked_axes([*motions, *called], _BELOW[over])
    for response, look in _style_responses(responses, rigid or {}):
        draw_motion(axes[: len(SERIES)], response, probe, over=over, look=look, sign=sign)
    _draw_channels(axes[len(SERIES) :], responses, rigid or {}, channels, over)
    return _finish_axes(figure, axes, over, title)


def channel_figure(
    responses: Mapping[str, Response], channels: Sequence[str], *, rigid: Mapping[str, Response] | None = None,
    over: Abscissa = "angle", title: str = "",
) -> Figure:  # fmt: skip
    """Return a figure with channels of several runs."""
    first = next(iter(responses.values()))
    called = [axis_label(short_name(name), channel_unit(first, name)) for name in channels]
    figure, axes = create_stacked_axes(called, _BELOW[over])
    _draw_channels(axes, responses, rigid or {}, channels, over)
    for one, channel in zip(axes, channels, strict=True):
        if channel.endswith(_FORCES):
            one.axhline(0.0, color="0.4", linewidth=0.8)
    return _finish_axes(figure, axes, over, title)


def _draw_channels(
    axes: Sequence[Axes], responses: Mapping[str, Response], rigid: Mapping[str, Response], channels: Sequence[str],
    over: Abscissa,
) -> None:  # fmt: skip
    """Draw channels of runs, one axis each; the rigid model lacks some, such as the force of an adjuster."""
    for response, look in _style_responses(responses, rigid):
        for one, channel in zip(axes, channels, strict=True):
            if channel in response.channels or not any(response is other for other in rigid.values()):
                draw_channel(one, response, channel, over=over, look=look)


def draw_energy(axes: Axes, response: Response, *, over: Abscissa = "angle") -> None:
    """Draw the energies of a run and their residual."""
    parts = [name for name in response.channels if name.startswith("energy.")]
    for name, (colour, dashes) in zip(parts, line_styles(), strict=False):
        if response.channels[name].any():
            draw_channel(axes, response, name, over=over, look=CurveStyle(name.removeprefix("energy."), colour, dashes))


def energy_figure(responses: Mapping[str, Response], *, over: Abscissa = "angle", title: str = "") -> Figure:
    """Return a figure with the energies of runs."""
    labels = ["energy, J" if len(responses) == 1 else f"{name}\nenergy, J" for name in responses]
    figure, axes = create_stacked_axes(labels, _BELOW[over], height=3.0)
    for one, response in zip(axes, responses.values(), strict=True):
        draw_energy(one, response, over=over)
    return _finish_axes(figure, axes, over, title)


def _draw(axes: Axes, response: Response, values: FloatArray, over: Abscissa, look: CurveStyle | None) -> None:
    look = look or CurveStyle()
    x = np.degrees(response.angle) if over == "angle" else response.time
    axes.plot(x, values, label=escape_math(look.label), color=look.colour, linestyle=look.dashes, linewidth=look.width)


def _style_responses(
    responses: Mapping[str, Response], rigid: Mapping[str, Response]
) -> list[tuple[Response, CurveStyle]]:
    """Return the drawn responses with their styles: rigid runs are dotted, in the colour of their flexible runs."""
    found: list[tuple[Response, CurveStyle]] = []
    for (name, response), (colour, dashes) in zip(responses.items(), line_styles(), strict=False):
        flexible = "flexible" if name in rigid and not name else name
        found.append((response, CurveStyle(flexible, colour, "-" if dashes == ":" else dashes)))
        if name in rigid:
            own = colour if len(responses) > 1 else COLOURS[1]
            found.append((rigid[name], CurveStyle(f"{name}, rigid" if name else "rigid", own, ":", 1.6)))
    return found


def axis_label(name: str, unit: str) -> str:
    r"""Return an axis label with the unit below the name."""
    _, symbol = to_display_unit(unit)
    return f"{name}\n{symbol}" if symbol else name


def short_name(channel: str) -> str:
    """Return the short name of a channel for an axis label."""
    return " ".join(channel.split(".")[1:]).replace("_", " ")


def _finish_axes(figure: Figure, axes: Sequence[Axes], over: Abscissa, title: str) -> Figure:
    lines, _ = axes[0].get_legend_handles_labels()
    add_legend(figure, axes[0], len(lines))
    first, last = axes[-1].dataLim.intervalx
    if over == "angle" and last > first:
        axes[-1].xaxis.set_major_locator(MultipleLocator(_tick_spacing(last - first)))
    if last > first:
        axes[-1].set_xlim(first, last)
    axes[0].set_title(wrap_title(title), fontsize="medium")
    return figure


def _tick_spacing(span: float) -> float:
    """Return a tick spacing suitable for a revolution."""
    return next((float(one) for one in _TICKS if span / one <= _MOST_TICKS), 720.0 * np.ceil(span / 720.0 / 8.0))


_LEVELS = 10


def bars_figure(
    groups: Mapping[str, Mapping[str, float]], label: str, ends: Mapping[str, FloatArray] | None = None
) -> Figure:
    """Return a bar chart by key, one diagram per scalar."""
    keys = max(len(one) for one in groups.values())
    figure, axes = create_axes((7.0, 0.8 + len(groups) * (0.5 + 0.35 * keys)), len(groups), sharex=False)
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
    figure, axes = create_axes((7.0, 0.8 + 2.4 * len(values)), len(values), sharex=False)
    for axis, (name, of) in zip(axes, values.items(), strict=True):
        axis.hist(of, bins="auto" if np.ptp(of) > 0.0 else 3, color=COLOURS[5], edgecolor="black", linewidth=0.6)
        for part in np.quantile(of, [0.05, 0.95]).tolist() if len(of) else ():
            axis.axvline(part, color="black", linestyle="--", linewidth=1.0, label="5 % and 95 % quantiles")
        if name in middle:
            axis.axvline(middle[name], color=COLOURS[1], linewidth=1.8, label="nominal case")
        unit = units.get(name, "")
        axis.set(xlabel=name if unit in ("", "1") else f"{name}, {unit}", ylabel="sets of parts")
    named = {label: line for axis in axes for line, label in zip(*axis.get_legend_handles_labels(), strict=True)}
    figure.legend(list(named.values()), list(named), loc="outside upper center", fontsize="small", ncols=2)
    return figure


def progress_figure(costs: FloatArray, inside: np.ndarray, best: FloatArray, label: str) -> Figure:
    """Return a figure with the goal over the evaluations of an optimization."""
    figure, (axes,) = create_axes((7.0, 4.0))
    at = np.arange(1, len(costs) + 1)
    known = np.isfinite(costs)
    outline: dict[str, Any] = {"s": 16, "edgecolors": COLOURS[0], "linewidths": 0.8}
    for chosen, fill, name in ((inside & known, COLOURS[0], "feasible"), (~inside & known, "none", "infeasible")):
        axes.scatter(at[chosen], costs[chosen], facecolors=fill, label=name, **outline)
    axes.plot(at, best, color=COLOURS[1], linewidth=1.5, drawstyle="steps-post", label="best so far")
    axes.set(xlabel="evaluation", ylabel=label)
    axes.grid(alpha=0.3)
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
        axis.grid(alpha=0.3)
    axes[-1].set_xlabel(label)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=3, fontsize="small")
    return figure


def front_figure(values: FloatArray, inside: np.ndarray, front: Sequence[int], labels: tuple[str, str]) -> Figure:
    """Return a figure with two goals against each other and their Pareto front."""
    figure, (axes,) = create_axes((7.0, 5.0))
    known = np.isfinite(values).all(axis=1) & inside
    axes.scatter(*values[known].T, s=8, color="0.65", label="feasible")
    axes.plot(*values[list(front)].T, color=COLOURS[1], marker="o", markersize=5, linewidth=1.2, label="front")
    axes.set(xlabel=labels[0], ylabel=labels[1])
    axes.grid(alpha=0.3)
    figure.legend(loc="outside upper center", ncols=2, fontsize="small")
    return figure


def map_figure(
    along: FloatArray, down: FloatArray, rpm: Mapping[str, FloatArray], labels: tuple[str, str], shaft: str
) -> Figure:
    """Return a map of limits over two numbers as filled contours, one diagram per limit."""
    figure, axes = create_axes((7.0, 0.8 + 4.0 * len(rpm)), len(rpm))
    for axis, (name, speeds) in zip(axes, rpm.items(), strict=True):
        axis.set_facecolor("0.92")
        axis.patch.set_hatch("//")
        axis.patch.set_edgecolor("0.7")
        if np.isfinite(speeds).any():
            low, high = np.nanmin(speeds), np.nanmax(speeds)
            levels = _LEVELS if high > low else [low - 1, low + 1]
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
        best = [one for one in of if one.best]
        line = {"label": name, "linestyle": dashes, "marker": "o", "markersize": 4}
        square = {"linestyle": "none", "marker": "s", "markersize": 8, "fillstyle": "none"}
        for axis, kind in zip(axes, _KINDS, strict=True):
            for some, style in ((of, line), (best, square)):
                errors = [100.0 * one.errors[kind] for one in some]
                axis.loglog([max(one.work, 1) for one in some], errors, color=colour, **style)
    add_legend(figure, axes[0], names)
    return figure
