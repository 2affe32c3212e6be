"""Figures of a run over time or cam angle: motion of a probe, forces and other channels, energies."""

# pyright: reportUnknownMemberType=false
# matplotlib does not type its keyword arguments.

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator

from flexcam.core import FloatArray
from flexcam.core.errors import refuse, suggest_name
from flexcam.core.units import to_display_unit
from flexcam.dynamics import Response
from flexcam.io.exports import component_unit
from flexcam.io.result_writer import SERIES
from flexcam.plotting.figures import COLOURS, add_legend, create_stacked_axes, line_styles, wrap_title

Abscissa = Literal["angle", "time"]
"""Abscissa of the curves of a run: cam angle or time."""

_TICKS = (5, 10, 15, 30, 45, 90, 180, 360, 720)
_MOST_TICKS = 9
_BELOW = {"angle": "cam angle, deg", "time": "time, s"}
_FORCES = (".force",)


@dataclass(frozen=True)
class CurveStyle:
    """Style and name of a curve.

    Parameters
    ----------
    label
        Label in the legend.
    colour, dashes
        Colour and dashes in the format of matplotlib.
    width
        Width of the line, points.
    """

    label: str = ""
    colour: str = COLOURS[0]
    dashes: str = "-"
    width: float = 1.4


def draw_motion(
    axes: Sequence[Axes], response: Response, probe: str, *, over: Abscissa = "angle", look: CurveStyle | None = None
) -> None:
    """Draw displacement, velocity and acceleration of a probe."""
    history = response[probe]
    if history.displacement.ndim != 1:
        allowed = "one scalar: " + ", ".join(f"{probe}.{c}" for c in history.components)
        raise refuse("probe", repr(probe), allowed, "a curve is one scalar over the cam angle")
    for one, (series, unit) in zip(axes, SERIES.items(), strict=False):
        factor, _ = to_display_unit(component_unit(probe.rpartition(".")[2], unit))
        _draw(one, response, factor * getattr(history, series), over, look)


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
    rigid: Mapping[str, Response] | None = None, over: Abscissa = "angle", title: str = "",
) -> Figure:  # fmt: skip
    """Return a figure with the motion of a probe in several runs, and channels below it."""
    first = next(iter(responses.values()))
    component = probe.rpartition(".")[2]
    motions = [axis_label(series, component_unit(component, unit)) for series, unit in SERIES.items()]
    called = [axis_label(short_name(name), channel_unit(first, name)) for name in channels]
    figure, axes = create_stacked_axes([*motions, *called], _BELOW[over])
    for response, look in _style_responses(responses, rigid or {}):
        draw_motion(axes[: len(SERIES)], response, probe, over=over, look=look)
    _draw_channels(axes[len(SERIES) :], responses, rigid or {}, channels, over)
    return _finish_axes(figure, axes, over, title)


def channel_figure(
    responses: Mapping[str, Response], channels: Sequence[str], *, rigid: Mapping[str, Response] | None = None,
    over: Abscissa = "angle", title: str = "",
) -> Figure:  # fmt: skip
    """Return a figure with channels of several runs."""
    first = next(iter(responses.values()))
    figure, axes = create_stacked_axes(
        [axis_label(short_name(name), channel_unit(first, name)) for name in channels], _BELOW[over]
    )
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
    axes.plot(x, values, label=look.label, color=look.colour, linestyle=look.dashes, linewidth=look.width)


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
