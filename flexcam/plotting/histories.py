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
from flexcam.core.errors import did_you_mean, refuse
from flexcam.core.units import shown
from flexcam.dynamics import Response
from flexcam.fem.frames import ROTATIONS
from flexcam.plotting.figures import COLOURS, legend, looks, stacked, wrapped

Over = Literal["angle", "time"]
"""Abscissa of the curves of a run: cam angle or time."""
SERIES = {"displacement": "", "velocity": "/s", "acceleration": "/s^2"}
"""Motions of a probe, and their units relative to that of the displacement."""

_TICKS = (5, 10, 15, 30, 45, 90, 180, 360, 720)
_MOST_TICKS = 9
_BELOW = {"angle": "cam angle, deg", "time": "time, s"}
_FORCES = (".force",)


@dataclass(frozen=True)
class Look:
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


def unit_of(component: str, series: str) -> str:
    """Return the SI unit of a probe's motion."""
    return ("rad" if component.rpartition(".")[2] in ROTATIONS else "m") + SERIES[series]


def draw_motion(
    axes: Sequence[Axes], response: Response, probe: str, *, over: Over = "angle", look: Look | None = None
) -> None:
    """Draw displacement, velocity and acceleration of a probe."""
    history = response[probe]
    if history.displacement.ndim != 1:
        allowed = "one scalar: " + ", ".join(f"{probe}.{c}" for c in history.components)
        raise refuse("probe", repr(probe), allowed, "a curve is one scalar over the cam angle")
    for one, series in zip(axes, SERIES, strict=False):
        factor, _ = shown(unit_of(probe, series))
        _draw(one, response, factor * getattr(history, series), over, look)


def draw_channel(
    axes: Axes, response: Response, channel: str, *, over: Over = "angle", look: Look | None = None
) -> None:
    """Draw a channel, such as a contact force."""
    factor, _ = shown(unit_of_channel(response, channel))
    _draw(axes, response, factor * response.channels[channel], over, look)


def unit_of_channel(response: Response, channel: str) -> str:
    """Return the SI unit of a channel."""
    known = dict(response.outline.channels)
    if channel not in known:
        allowed = ", ".join(known) or "(no channel was saved)"
        raise refuse("channel", repr(channel), allowed, "", did_you_mean(channel, known))
    return known[channel]


def contact_forces(response: Response) -> list[str]:
    """Return the channels of contact forces."""
    return [name for name, _ in response.outline.channels if name.startswith("contacts.") and name.endswith(_FORCES)]


def motion_figure(
    responses: Mapping[str, Response], probe: str, channels: Sequence[str] = (), *,
    rigid: Mapping[str, Response] | None = None, over: Over = "angle", title: str = "",
) -> Figure:  # fmt: skip
    """Return a figure with the motion of a probe in several runs, and channels below it."""
    first = next(iter(responses.values()))
    motions = [axis_label(series, unit_of(probe, series)) for series in SERIES]
    called = [axis_label(short_name(name), unit_of_channel(first, name)) for name in channels]
    figure, axes = stacked([*motions, *called], _BELOW[over])
    for response, look in _looked(responses, rigid or {}):
        draw_motion(axes[: len(SERIES)], response, probe, over=over, look=look)
    _draw_channels(axes[len(SERIES) :], responses, rigid or {}, channels, over)
    return _finished(figure, axes, over, title)


def channel_figure(
    responses: Mapping[str, Response], channels: Sequence[str], *, rigid: Mapping[str, Response] | None = None,
    over: Over = "angle", title: str = "",
) -> Figure:  # fmt: skip
    """Return a figure with channels of several runs."""
    first = next(iter(responses.values()))
    figure, axes = stacked(
        [axis_label(short_name(name), unit_of_channel(first, name)) for name in channels], _BELOW[over]
    )
    _draw_channels(axes, responses, rigid or {}, channels, over)
    for one, channel in zip(axes, channels, strict=True):
        if channel.endswith(_FORCES):
            one.axhline(0.0, color="0.4", linewidth=0.8)
    return _finished(figure, axes, over, title)


def _draw_channels(
    axes: Sequence[Axes], responses: Mapping[str, Response], rigid: Mapping[str, Response], channels: Sequence[str],
    over: Over,
) -> None:  # fmt: skip
    """Draw channels of runs, one axis each; the rigid model lacks some, such as the force of an adjuster."""
    for response, look in _looked(responses, rigid):
        for one, channel in zip(axes, channels, strict=True):
            if channel in response.channels or not any(response is other for other in rigid.values()):
                draw_channel(one, response, channel, over=over, look=look)


def draw_energy(axes: Axes, response: Response, *, over: Over = "angle") -> None:
    """Draw the energies of a run and their residual."""
    parts = [name for name in response.channels if name.startswith("energy.")]
    for name, (colour, dashes) in zip(parts, looks(), strict=False):
        if response.channels[name].any():
            draw_channel(axes, response, name, over=over, look=Look(name.removeprefix("energy."), colour, dashes))


def energy_figure(responses: Mapping[str, Response], *, over: Over = "angle", title: str = "") -> Figure:
    """Return a figure with the energies of runs."""
    labels = ["energy, J" if len(responses) == 1 else f"{name}\nenergy, J" for name in responses]
    figure, axes = stacked(labels, _BELOW[over], height=3.0)
    for one, response in zip(axes, responses.values(), strict=True):
        draw_energy(one, response, over=over)
    return _finished(figure, axes, over, title)


def _draw(axes: Axes, response: Response, values: FloatArray, over: Over, look: Look | None) -> None:
    look = look or Look()
    x = np.degrees(response.angle) if over == "angle" else response.time
    axes.plot(x, values, label=look.label, color=look.colour, linestyle=look.dashes, linewidth=look.width)


def _looked(responses: Mapping[str, Response], rigid: Mapping[str, Response]) -> list[tuple[Response, Look]]:
    """Return the drawn responses with their styles: rigid runs are dotted, in the colour of their flexible runs."""
    found: list[tuple[Response, Look]] = []
    for (name, response), (colour, dashes) in zip(responses.items(), looks(), strict=False):
        flexible = "flexible" if name in rigid and not name else name
        found.append((response, Look(flexible, colour, "-" if dashes == ":" else dashes)))
        if name in rigid:
            own = colour if len(responses) > 1 else COLOURS[1]
            found.append((rigid[name], Look(f"{name}, rigid" if name else "rigid", own, ":", 1.6)))
    return found


def axis_label(name: str, unit: str) -> str:
    r"""Return an axis label with the unit below the name."""
    _, symbol = shown(unit)
    return f"{name}\n{symbol}" if symbol else name


def short_name(channel: str) -> str:
    """Return the short name of a channel for an axis label."""
    return " ".join(channel.split(".")[1:]).replace("_", " ")


def _finished(figure: Figure, axes: Sequence[Axes], over: Over, title: str) -> Figure:
    lines, _ = axes[0].get_legend_handles_labels()
    legend(figure, axes[0], len(lines))
    first, last = axes[-1].dataLim.intervalx
    if over == "angle" and last > first:
        axes[-1].xaxis.set_major_locator(MultipleLocator(_tick(last - first)))
    if last > first:
        axes[-1].set_xlim(first, last)
    axes[0].set_title(wrapped(title), fontsize="medium")
    return figure


def _tick(span: float) -> float:
    """Return a tick spacing suitable for a revolution."""
    return next((float(one) for one in _TICKS if span / one <= _MOST_TICKS), 720.0 * np.ceil(span / 720.0 / 8.0))
