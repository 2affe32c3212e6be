"""Figures of laws, lifts, cams, springs and the fatigue strength of members."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from flexcam import cams
from flexcam.core import ComplexArray, FloatArray
from flexcam.core.units import format_quantity, to_display_unit
from flexcam.fem.sections import Material
from flexcam.plotting.figures import (
    COLOURS,
    add_legend,
    add_stacked_axes,
    add_title,
    create_axes,
    create_stacked_axes,
    line_styles,
)
from flexcam.valvetrain import MemberStrength, Spring
from flexcam.valvetrain.springs import spring_curve, wire_stress

if TYPE_CHECKING:
    from flexcam.analysis.cam_analysis import CamFacts

LAW_LABELS = ("s", "s'", "s''", "s'''")  # axis labels of laws, from top to bottom
LAW_POSITION = "z, part of the rise"  # abscissa label of laws
_POINTS = 1441
_RATIOS = np.linspace(0.05, 6.0, 600)
_JUMP_OFFSET = 1e-6  # angle before a discontinuity, rad, at which its left-hand limit is drawn


def law_figure(laws: Mapping[str, cams.Law]) -> Figure:
    """Return a figure with lift, velocity, acceleration and jerk of laws."""
    figure, axes = create_stacked_axes(LAW_LABELS, LAW_POSITION)
    draw_laws(axes, laws)
    add_legend(figure, axes[0])
    return add_title(figure, _single_name(laws))


def draw_laws(axes: Sequence[Axes], laws: Mapping[str, cams.Law]) -> None:
    """Draw lift, velocity, acceleration and jerk of laws."""
    z = np.linspace(0.0, 1.0, _POINTS)
    for (name, law), (color, dashes) in zip(laws.items(), line_styles(), strict=False):
        for order, axis in enumerate(axes):
            axis.plot(*_insert_gaps(z, law.breaks, law(z, order)), label=name, color=color, linestyle=dashes)


def lift_figure(events: Mapping[str, cams.Event]) -> Figure:
    """Return a figure with lift, velocity, acceleration and jerk of cams over the cam angle."""
    even = np.linspace(0.0, 2.0 * math.pi, _POINTS)
    factor, length = to_display_unit("m")
    units = (length, *(to_display_unit(unit)[1] for unit in ("m/rad", "m/rad^2", "m/rad^3")))
    names = ("lift", "velocity", "acceleration", "jerk")
    labels = [f"{name}\n{unit}" for name, unit in zip(names, units, strict=True)]
    figure, axes = create_stacked_axes(labels, "cam angle, deg")
    for (name, event), (color, dashes) in zip(events.items(), line_styles(), strict=False):
        joints = cams.joints(event)
        ends = np.array([joint.angle for joint in joints])
        both_sides = [even, ends, ends[ends > _JUMP_OFFSET] - _JUMP_OFFSET]  # of every jump
        angle = np.sort(np.concatenate(both_sides))
        for order, axis in enumerate(axes):
            steps = tuple(math.degrees(joint.angle - 0.5 * _JUMP_OFFSET) for joint in joints if joint.steps[order])
            curve = _insert_gaps(np.degrees(angle), steps, factor * event(angle, order))
            axis.plot(*curve, label=name, color=color, linestyle=dashes)
    add_legend(figure, axes[0])
    axes[-1].set(xticks=range(0, 361, 45), xlim=(0.0, 360.0))
    return figure


def timing_figure(cylinder: Mapping[str, CamFacts]) -> Figure:
    """Return a figure with the valve lifts of a cylinder over the crank angle from overlap TDC."""
    figure, (axes,) = create_axes((7.0, 4.2))
    crank = np.linspace(-360.0, 360.0, _POINTS)
    (factor, unit), lifts = to_display_unit("m"), dict[str, FloatArray]()
    for (name, facts), (color, dashes) in zip(cylinder.items(), line_styles(), strict=False):
        lifts[name] = factor * facts.valve_lift(facts.cam.event((facts.tdc or 0.0) + np.radians(0.5 * crank)))
        middle = math.degrees(facts.centreline_after_tdc or 0.0)
        label = f"{name}: centreline {abs(middle):.4g}° {'before' if middle < 0.0 else 'after'} TDC"
        axes.plot(crank, lifts[name], label=label, color=color, linestyle=dashes)
        axes.plot([middle, middle], [0.0, lifts[name].max()], color=color, linestyle=":", linewidth=0.8)
    for first, second in combinations(cylinder, 2):
        if cylinder[first].may_overlap(cylinder[second]):
            both = np.minimum(lifts[first], lifts[second])
            separation = math.degrees(cylinder[first].separation(cylinder[second]))
            label = f"both open; lobe separation {separation:.4g}° of the camshaft"
            axes.fill_between(crank, both, color="0.75", label=label)
    mark_dead_centres([axes])
    axes.set_ylabel(f"valve lift, {unit}")
    axes.set_ylim(bottom=0.0)
    figure.legend(loc="outside lower center", fontsize="small")
    return figure


def mark_dead_centres(axes: Sequence[Axes]) -> None:
    """Mark the dead centres in axes over the crank angle, one below the other."""
    for angle, centre in zip(range(-360, 361, 180), ("firing TDC", "BDC", "TDC", "BDC", "firing TDC"), strict=True):
        for axis in axes:
            axis.axvline(angle, color="0.4", linewidth=0.8)
        axes[0].text(angle, 1.01, centre, transform=axes[0].get_xaxis_transform(), ha="center", fontsize="small")
    axes[-1].set(xlabel="crank angle from overlap TDC, deg", xlim=(-360.0, 360.0))
    axes[-1].set_xticks(range(-360, 361, 90))


def spectrum_figure(laws: Mapping[str, cams.Law]) -> Figure:
    """Return a figure with the residual vibration of laws over rise time / period."""
    figure, (axes,) = create_axes((7.0, 4.0))
    for (name, law), (color, dashes) in zip(laws.items(), line_styles(), strict=False):
        axes.plot(_RATIOS, cams.residual_spectrum(law, _RATIOS), label=name, color=color, linestyle=dashes)
    axes.set(xlabel="rise time over the period of the oscillator", ylabel="residual amplitude over lift")
    axes.set(ylim=(0.0, 1.1), xlim=(0.0, float(_RATIOS[-1])))
    add_legend(figure, axes)
    return add_title(figure, _single_name(laws))


def _single_name(laws: Mapping[str, cams.Law]) -> str:
    """Return the name of a single law; several laws are named in the legend."""
    return next(iter(laws)) if len(laws) == 1 else ""


def profile_figure(
    profile: cams.CamProfile, *, angle: float = 0.0, coloured: tuple[cams.CamProfile, FloatArray, str] | None = None
) -> Figure:
    """Return a figure with a cam and its follower at one cam angle.

    With `coloured`, values at the angles of a profile of the same cam colour it; the text is the label of their scale.
    """
    figure, (axes,) = create_axes((6.0, 6.0))
    if coloured is not None:
        touched, values, label = coloured
        order = np.argsort(np.mod(touched.angle, 2.0 * math.pi))
        outline = to_display_unit("m")[0] * touched.points[order] @ np.array([1.0, 1j])
        rotated = outline * np.exp(1j * touched.turn * angle)
        points = np.column_stack([rotated.real, rotated.imag])
        segments = list(np.stack([points[:-1], points[1:]], axis=1))
        line = LineCollection(segments, cmap="viridis", linewidths=7.0, capstyle="round", zorder=1.5)
        line.set_array(0.5 * (values[order][1:] + values[order][:-1]))
        axes.add_collection(line)
        figure.colorbar(line, ax=axes, orientation="horizontal", shrink=0.8, label=label)
    draw_profile(axes, profile, angle, thin=coloured is not None)
    unit = to_display_unit("m")[1]
    axes.set(xlabel=f"x, {unit}", ylabel=f"y, {unit}")
    return figure


def draw_profile(axes: Axes, profile: cams.CamProfile, angle: float, *, thin: bool = False) -> None:
    """Draw a cam, rotated by its angle, with its follower; its outline may be thin and black."""
    rotation = np.exp(1j * profile.turn * angle)
    at = int(np.argmin(np.abs(np.angle(np.exp(1j * (profile.angle - angle))))))
    touch, follower, factor = profile.touch, profile.follower, to_display_unit("m")[0]
    around = np.exp(1j * np.linspace(0.0, 2.0 * math.pi, 361))
    colour, width = ("black", 0.8) if thin else (COLOURS[0], 2.0)
    outline, pitch = (np.vstack([p, p[:1]]) @ np.array([1.0, 1j]) * rotation for p in (profile.points, profile.pitch))
    _line(axes, outline, "cam", color=colour, linewidth=width)
    base = np.asarray(follower.base_radius * around, dtype=np.complex128)
    _line(axes, base, "base circle", color="0.6", linewidth=0.8, linestyle="--")
    if math.isfinite(follower.roller_radius):
        _line(axes, pitch, "pitch curve", color="0.6", linewidth=0.8, linestyle=":")
        _line(axes, touch.trace[at] + follower.roller_radius * around, "roller", color=COLOURS[1], linewidth=1.5)
    else:
        along = -1j * touch.normal[at] * 0.7 * follower.base_radius
        _line(axes, touch.point[at] + along * np.array([-1.0, 1.0]), "flat face", color=COLOURS[1], linewidth=1.5)
    point = factor * touch.point[at]
    axes.plot(point.real, point.imag, "o", color="black", markersize=4, label="contact")
    axes.plot(0.0, 0.0, "+", color="black")
    if isinstance(follower, (cams.SwingRollerFollower, cams.SwingFlatFollower)):
        end = touch.trace[at] if math.isfinite(follower.roller_radius) else touch.point[at]
        _line(axes, np.array([follower.distance, end], dtype=np.complex128), "arm", color=COLOURS[1], linewidth=1.0)
        axes.plot(factor * follower.distance, 0.0, "^", color=COLOURS[1], markersize=8, label="pivot")
    arrow = factor * 0.5 * follower.base_radius * np.exp(1j * profile.turn * np.radians([30.0, 150.0]))
    bow = {"arrowstyle": "->", "connectionstyle": f"arc3,rad={0.55 * profile.turn}", "color": "0.4"}
    start, end = ((point.real, point.imag) for point in arrow.tolist())  # an arrow in the direction of rotation
    axes.annotate("", xy=end, xytext=start, arrowprops=bow)
    axes.set_aspect("equal")
    axes.grid(alpha=0.3)
    axes.set_title(
        f"cam angle {math.degrees(profile.angle[at]):.4g} deg, lift {format_quantity('m', profile.lift[at], digits=4)}"
    )
    axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), fontsize="small")


def pressure_figure(profile: cams.CamProfile) -> Figure:
    """Return a figure with pressure angle and radius of curvature over the cam angle."""
    factor, unit = to_display_unit("m")
    labels = ["pressure angle\ndeg", f"radius of\ncurvature, {unit}"]
    figure, (upper, lower) = create_stacked_axes(labels, "cam angle, deg")
    angle = np.degrees(profile.angle)
    upper.plot(angle, np.degrees(profile.pressure_angle), color=COLOURS[0])
    # A nearly straight flank has a radius of metres, which would hide all other values.
    limit = 10.0 * float(np.abs(profile.touch.trace).max())
    lower.plot(angle, np.where(np.abs(profile.radius) < limit, factor * profile.radius, np.nan), color=COLOURS[0])
    lower.axhline(0.0, color="0.4", linewidth=0.8)
    lower.set(xlim=(0.0, 360.0), xticks=range(0, 361, 45))
    return figure


def _insert_gaps(x: FloatArray, breaks: Sequence[float], y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a curve with a gap at every jump, so that no vertical line is drawn."""
    at = np.searchsorted(x, np.sort(np.array(breaks)))
    return np.insert(x, at, np.nan), np.insert(y, at, np.nan)


def _line(axes: Axes, curve: ComplexArray, label: str, *, color: str, linewidth: float, linestyle: str = "-") -> None:
    scaled = to_display_unit("m")[0] * curve
    axes.plot(scaled.real, scaled.imag, label=label, color=color, linewidth=linewidth, linestyle=linestyle)


_WORDS = {"Cv": "C_v, max velocity", "Ca": "C_a, max acceleration", "Cj": "C_j, max jerk"}
_DIGITS = 4  # digits to which coincident laws agree; they share a label
_UNIT = "lift 1 over angle 1"


def law_front_figure(front: Sequence[cams.Synthesis], first: str, second: str) -> Figure:
    """Return a figure with a Pareto front of laws, and the laws with the same numbers and colours."""
    figure = Figure(figsize=(12.0, 7.6), layout="constrained")
    halves = figure.add_gridspec(1, 2)
    axes, right = figure.add_subfigure(halves[0]).add_subplot(), figure.add_subfigure(halves[1])
    # An infinite jerk is None.
    values = np.array([[getattr(result.criteria, name) for name in (first, second)] for result in front], dtype=float)
    draw_front(axes, values, [result.converged for result in front])
    axes.set(xlabel=f"{_WORDS[first]}, {_UNIT}", ylabel=f"{_WORDS[second]}, {_UNIT}")
    axes.set_title(f"Pareto front of {front[0].family}", fontsize="medium")
    below = add_stacked_axes(right, LAW_LABELS, LAW_POSITION)
    draw_laws(below, {str(i): result.law for i, result in enumerate(front, start=1)})
    below[0].set_title(f"Its laws, {_UNIT}", fontsize="medium")
    add_legend(right, below[0], columns=10)
    return figure


def draw_front(axes: Axes, values: FloatArray, converged: Sequence[bool]) -> None:
    """Draw two criteria against each other, numbered from 1, in the colours of the laws."""
    axes.plot(*values.T, color="0.65", linewidth=1.2, zorder=1)
    labels: dict[tuple[str, str], str] = {}
    points = zip(values.tolist(), converged, line_styles(), strict=False)
    for i, ((x, y), ok, (color, _)) in enumerate(points, start=1):
        if not (math.isfinite(x) and math.isfinite(y)):
            continue
        axes.scatter(x, y, s=36, facecolors=color if ok else "none", edgecolors=color, zorder=2)
        place, number = (f"{x:.{_DIGITS}g}", f"{y:.{_DIGITS}g}"), f"{i}" if ok else f"{i} not converged"
        labels[place] = f"{labels[place]}, {number}" if place in labels else number
    for (x, y), numbers in labels.items():
        axes.annotate(numbers, (float(x), float(y)), xytext=(6, 5), textcoords="offset points")
    axes.grid(alpha=0.3)


def spring_figure(springs: Mapping[str, tuple[Spring, float]]) -> Figure:
    """Return a figure with force and wire stress of springs over their travel, each with its travel at full lift, m."""
    (length, mm), (load, newton), (stress, mpa) = map(to_display_unit, ("m", "N", "Pa"))
    figure, (upper, lower) = create_stacked_axes(
        (f"force, {newton}", f"wire stress\n{mpa}"), f"travel from the installed length, {mm}", height=2.6
    )
    for (name, (spring, full)), (colour, dashes) in zip(springs.items(), line_styles(), strict=False):
        curve, bind = spring_curve(spring), spring.clash_travel
        free = float(np.interp(0.0, curve.force, curve.travel)) if curve.force[0] < 0.0 else curve.travel[0]
        end = 1.2 * full if bind is None else bind
        travel = np.unique(np.concatenate([np.linspace(max(free, -2.0 * end), end, 201), [0.0, full]]))
        force = np.interp(travel, curve.travel, curve.force)
        style: dict[str, Any] = {"color": colour, "linestyle": dashes}
        upper.plot(length * travel, load * force, label=name, **style)
        if spring.wire is not None:
            lower.plot(length * travel, stress * wire_stress(spring, travel), **style)
        marks = {"installed": (0.0, "o"), "full lift": (full, "s"), "coil bind": (bind, "^")}
        for state, (place, marker) in marks.items():
            if place is not None:
                loaded = float(np.interp(place, curve.travel, curve.force))
                values = format_quantity("N", loaded, digits=4), format_quantity("m", place, digits=4)
                label = f"{name}, {state}: {' at '.join(values)}"
                upper.plot(length * place, load * loaded, marker, color=colour, label=label)
        if bind is not None:
            for axis in (upper, lower):
                axis.axvline(length * bind, color=colour, linewidth=0.8, linestyle=":")
    if not lower.lines or all(spring.wire is None for spring, _ in springs.values()):
        lower.text(0.5, 0.5, "no wire given", transform=lower.transAxes, ha="center", color="0.3")
    add_legend(figure, upper, columns=2)
    return figure


def goodman_figure(members: Mapping[str, tuple[MemberStrength, Material]]) -> Figure:
    """Return a Goodman diagram: alternating over mean stress of members at their point of minimum safety."""
    figure, (axes,) = create_axes((7.0, 5.0))
    factor, unit = to_display_unit("Pa")
    lowest = factor * min(0.0, *(strength.mean for strength, _ in members.values()))
    limits = dict.fromkeys((m.endurance_limit, m.ultimate_strength) for _, m in members.values())
    for (endurance, ultimate), (colour, dashes) in zip(limits, line_styles(), strict=False):
        if endurance and ultimate:
            values = (format_quantity("Pa", value, digits=4) for value in (endurance, ultimate))
            label = "endurance limit {}, ultimate strength {}".format(*values)
            line = [factor * endurance, factor * endurance, 0.0]
            axes.plot([1.1 * lowest, 0.0, factor * ultimate], line, color=colour, linestyle=dashes, label=label)
    for i, (name, (strength, _)) in enumerate(members.items()):
        safety = "no strength given" if strength.safety is None else f"safety {strength.safety:.3g}"
        axes.plot(factor * strength.mean, factor * strength.alternating, "osD^vP*X"[i % 8], color=COLOURS[-1 - i % 6],
                  label=f"{name} at {strength.place}: {safety}")  # fmt: skip
    axes.axvline(0.0, color="0.4", linewidth=0.8)
    axes.set(xlabel=f"mean stress, {unit}", ylabel=f"alternating stress, {unit}")
    axes.set_ylim(bottom=0.0)
    figure.legend(loc="outside lower center", fontsize="small")
    return figure
