"""Make pictures of models in docs/pictures: contact-*, element-signs, hydraulic-adjuster, rockers and spring-model."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Circle, Rectangle

from flexcam.cams import (
    LAWS,
    CamProfile,
    FlatFollower,
    Follower,
    LiftEvent,
    RollerFollower,
    cam_profile,
    profile_at,
)  # fmt: skip
from flexcam.core import FloatArray
from flexcam.dynamics.force_laws import hunt_crossley, stop
from flexcam.dynamics.oil_laws import oil_chamber
from flexcam.plotting.figures import COLOURS, line_styles, save_figure
from flexcam.valvetrain import OilChamber

PICTURES = Path(__file__).parent / "pictures"
BLUE, RED, GREEN = COLOURS[:3]
FACE = {"facecolor": "0.92", "edgecolor": "0.3", "linewidth": 1.2}
Point = tuple[float, float]


def draw_arrow(
    axes: Axes, start: Point, end: Point, text: str, colour: str = "black", shift: Point = (4.0, 4.0)
) -> None:
    """Draw an arrow with a text at its end; the shift is in points."""
    style = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.6, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", end, start, arrowprops=style)
    axes.annotate(text, end, shift, textcoords="offset points", color=colour)


def draw_dimension(axes: Axes, start: Point, end: Point, text: str, shift: Point = (4.0, 0.0)) -> None:
    """Draw a dimension line with a text in the middle; the shift is in points."""
    axes.annotate("", end, start, arrowprops={"arrowstyle": "<->", "color": "0.35", "shrinkA": 0, "shrinkB": 0})
    middle = 0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1])
    axes.annotate(text, middle, shift, textcoords="offset points", color="0.2")


def prepare_axes(axes: Axes, title: str, x: Point, y: Point) -> None:
    """Prepare axes for a drawing without a frame."""
    axes.set_title(title, fontsize="medium")
    axes.set(xlim=x, ylim=y, aspect="equal")
    axes.set_axis_off()


def draw_ground(axes: Axes, corner: Point, width: float, height: float) -> None:
    """Draw hatched ground."""
    axes.add_patch(Rectangle(corner, width, height, hatch="////", facecolor="none", edgecolor="0.5", linewidth=0.0))


def cam_at(follower: Follower, degrees: float) -> tuple[FloatArray, CamProfile]:
    """Return the outline of a cam at an angle, mm, shape (n, 2), and its contact."""
    event = LiftEvent(LAWS["4-5-6-7"], lift=8e-3, rise=math.radians(95.0), fall=math.radians(95.0))
    profile, contact = cam_profile(event, follower), profile_at(event, follower, np.array([math.radians(degrees)]))
    points = 1e3 * (profile.points @ np.array([1.0, 1j])) * np.exp(1j * math.radians(degrees))
    return np.column_stack([points.real, points.imag]), contact


def contact_frame() -> Figure:
    """Return the picture of a flat and a roller follower with the quantities of the contact."""
    figure = Figure(figsize=(9.0, 4.6), layout="constrained")
    flat, roller = figure.subplots(1, 2)
    outline, contact = cam_at(FlatFollower(18e-3), 45.0)
    x, y = 1e3 * contact.touch.point[0].real, 1e3 * contact.touch.point[0].imag
    prepare_axes(flat, "flat follower", (-28.0, 28.0), (-21.0, 42.0))
    flat.fill(*outline.T, **FACE)
    flat.add_patch(Rectangle((-17.0, y), 34.0, 3.5, facecolor="white", edgecolor=RED, linewidth=1.4))
    flat.add_patch(Rectangle((-3.0, y + 3.5), 6.0, 9.0, facecolor="white", edgecolor=RED, linewidth=1.4))
    flat.add_patch(Circle((0.0, 0.0), 18.0, fill=False, edgecolor="0.5", linestyle=":"))
    flat.plot([0.0, 0.0], [-2.0, 40.0], color="0.6", linestyle="-.", linewidth=0.8)
    draw_arrow(flat, (0.0, 33.0), (0.0, 41.0), "lift direction", shift=(5.0, -4.0))
    draw_arrow(flat, (x, y), (x, y + 11.0), "$F$ on the follower", RED)
    draw_arrow(flat, (x, y), (x, y - 11.0), "$F$ on the cam", BLUE, shift=(-70.0, -2.0))
    draw_dimension(flat, (0.0, 3.0), (x, 3.0), "$s'$", (-3.0, -13.0))
    flat.plot([x, x], [2.0, y], color="0.6", linewidth=0.8)
    draw_dimension(flat, (-22.0, 0.0), (-22.0, 18.0), "$r_b$", (-14.0, -3.0))
    draw_dimension(flat, (-22.0, 18.0), (-22.0, y), "$s$", (-11.0, -3.0))
    for height in (0.0, 18.0, y):
        flat.plot([-24.0, -14.0 if height else 0.0], [height] * 2, color="0.7", linewidth=0.6)
    flat.add_patch(Arc((0.0, 0.0), 12.0, 12.0, theta1=200.0, theta2=330.0, color="0.3"))
    draw_arrow(flat, (5.0, -3.3), (5.5, -2.2), r"$\theta$", shift=(4.0, -8.0))
    flat.plot(0.0, 0.0, "k+")

    outline, contact = cam_at(RollerFollower(16e-3, 8e-3), 45.0)
    centre, point = 1e3 * contact.touch.trace[0], 1e3 * contact.touch.point[0]
    normal = (centre - point) / abs(centre - point)
    prepare_axes(roller, "roller follower", (-24.0, 26.0), (-19.0, 52.0))
    roller.fill(*outline.T, **FACE)
    roller.add_patch(Circle((centre.real, centre.imag), 8.0, facecolor="white", edgecolor=RED, linewidth=1.4))
    roller.plot([0.0, 0.0], [-2.0, 50.0], color="0.6", linestyle="-.", linewidth=0.8)
    end, low = point + 24.0 * normal, point - 6.0 * normal
    roller.plot([low.real, end.real], [low.imag, end.imag], color="0.4", linestyle="--", linewidth=0.8)
    roller.annotate("contact normal", (end.real, end.imag), (-62.0, 5.0), textcoords="offset points", color="0.3")
    force = point - 13.0 * normal
    draw_arrow(roller, (point.real, point.imag), (force.real, force.imag), "$N$ on the cam", BLUE, (6.0, -4.0))
    draw_arrow(roller, (point.real, point.imag), (point.real, force.imag), "$F$", "black", (-13.0, -2.0))
    draw_arrow(roller, (point.real, force.imag), (force.real, force.imag), r"$F\,\tan\alpha$", "0.35", (-4.0, -14.0))
    draw_arrow(roller, (0.0, 42.0), (0.0, 50.0), "lift direction", shift=(5.0, -4.0))
    pressure_angle = math.degrees(math.atan2(normal.real, normal.imag))
    first, last = sorted((90.0, 90.0 - pressure_angle))
    roller.add_patch(Arc((centre.real, centre.imag), 24.0, 24.0, theta1=first, theta2=last, color="0.3"))
    middle = math.radians(90.0 - 0.5 * pressure_angle)
    roller.annotate(
        r"$\alpha$", (centre.real + 14.0 * math.cos(middle), centre.imag + 13.0 * math.sin(middle)), ha="center"
    )
    roller.plot([0.0, centre.real, point.real], [0.0, centre.imag, point.imag], "k.")
    return figure


def contact_laws() -> Figure:
    """Return the force of the seat law and of Hunt and Crossley's law over the penetration."""
    figure = Figure(figsize=(9.0, 3.8), layout="constrained")
    left, right = figure.subplots(1, 2)
    depths = np.linspace(0.0, 25e-6, 301)
    rates = dict(zip((0.3, 0.0, -0.3), line_styles(), strict=False))
    for rate, (colour, dashes) in rates.items():
        name = r"$\dot\gamma$ = " + (f"{rate:+.1f} m/s" if rate else "0")
        seat = [stop(x, rate, 60e6, 1e3, 1e-5)[0] for x in depths.tolist()]
        cam = [hunt_crossley(x, rate, 60e6, 0.3)[0] for x in depths.tolist()]
        for axes, force in ((left, seat), (right, cam)):
            axes.plot(1e6 * depths, force, label=name, color=colour, linestyle=dashes)
    depth, force = impact_history(0.09, 0.3)
    left.plot(1e6 * depth, force, color="0.5", linewidth=1.0, label="valve of 90 g, touchdown at 0.3 m/s")
    left.axvline(10.0, color="0.7", linewidth=0.8)
    left.annotate("damping depth $d$", (10.3, 30.0), color="0.4", fontsize="small")
    left.set_title("seat, lash: 60 MN/m, 1 kN s/m", fontsize="medium")
    right.set_title(r"Hunt and Crossley: 60 MN/m, $\chi$ = 0.3 s/m", fontsize="medium")
    for axes in (left, right):
        axes.set(xlabel="penetration γ, µm", ylabel="force, N", xlim=(0.0, 25.0), ylim=(0.0, 1900.0))
        axes.grid(alpha=0.3)
        axes.legend(fontsize="small")
    return figure


def hydraulic_adjuster() -> Figure:
    """Return the section of a hydraulic adjuster, and the force of its oil over the compression for some air contents."""
    figure = Figure(figsize=(9.0, 4.2), layout="constrained")
    section, curves = figure.subplots(1, 2)
    prepare_axes(section, "adjuster between body and plunger", (-36.0, 34.0), (-30.0, 42.0))
    for side in (-1.0, 1.0):
        section.add_patch(Rectangle((7.0 * side - 2.0, -26.0), 4.0, 48.0, **FACE))
        section.add_patch(Rectangle((3.2 * side - 1.3, -8.0), 2.6, 40.0, facecolor="white", edgecolor=RED))
    section.add_patch(Rectangle((-9.0, -30.0), 18.0, 4.0, **FACE))
    section.add_patch(Rectangle((-4.7, -26.0), 9.4, 16.0, facecolor=BLUE, alpha=0.25, edgecolor="none"))
    section.add_patch(Rectangle((-1.9, -8.0), 3.8, 36.0, facecolor=BLUE, alpha=0.1, edgecolor="none"))
    section.add_patch(Rectangle((-4.5, 28.0), 9.0, 5.0, facecolor="white", edgecolor=RED))
    section.add_patch(Circle((0.0, -9.8), 2.4, facecolor="0.75", edgecolor="0.2"))
    section.plot([-5.0, 5.0], [23.5, 23.5], color="0.2", linewidth=2.5)
    section.annotate(
        "retaining ring", (6.0, 23.5), (12.0, 26.0), color="0.3", arrowprops={"arrowstyle": "-", "color": "0.6"}
    )
    section.annotate("plunger", (4.5, 10.0), (12.0, 12.0), color=RED, arrowprops={"arrowstyle": "-", "color": "0.6"})
    section.annotate(
        "supply, $p_0$", (0.0, 14.0), (-25.0, 16.0), color="0.3", arrowprops={"arrowstyle": "-", "color": "0.6"}
    )
    section.annotate(
        "ball, open\nbelow $p_0 - p_c$",
        (-2.0, -10.0),
        (-35.0, -8.0),
        color="0.3",
        arrowprops={"arrowstyle": "-", "color": "0.6"},
    )
    section.annotate(
        "gap, leak", (4.7, -4.0), (12.0, -2.0), color="0.3", arrowprops={"arrowstyle": "-", "color": "0.6"}
    )
    section.annotate(
        "chamber, $p$", (3.0, -20.0), (12.0, -18.0), color=BLUE, arrowprops={"arrowstyle": "-", "color": "0.6"}
    )
    draw_dimension(section, (-12.0, -26.0), (-12.0, -12.0), "$h$", (-12.0, -3.0))
    draw_arrow(section, (0.0, 41.0), (0.0, 34.0), "$N$, $x$", shift=(6.0, 4.0))
    travels = np.linspace(-0.1e-3, 0.4e-3, 201)
    for air, (colour, dashes) in zip((0.0, 0.02, 0.05, 0.1), line_styles(), strict=False):
        law = OilChamber(0.02, 1.5e9, 11e-3, 6e-6, 8e-3, 5e-3, air, 3e5, follows_pressure=True).law(2e6, 60.0, 40.0)
        constants = np.array(law.constants)
        forces = [oil_chamber(x, x, 0.0, 0.0, constants, 0)[0] for x in travels.tolist()]
        curves.plot(1e3 * travels, forces, label=f"air {100.0 * air:g} %", color=colour, linestyle=dashes)
    curves.set(xlabel="compression x - z, mm", ylabel="force on the plunger, N", xlim=(-0.1, 0.4), ylim=(0.0, 2000.0))
    curves.set_title("11 mm, h = 5 mm, $p_0$ = 0.3 MPa, $F_0$ = 40 N", fontsize="medium")
    curves.grid(alpha=0.3)
    curves.legend(fontsize="small")
    return figure


def impact_history(mass: float, speed: float, step: float = 2e-8) -> tuple[FloatArray, FloatArray]:
    """Return penetration and force of a free mass in contact with the seat, by the semi-implicit Euler method."""
    x, v, rows = 0.0, speed, []
    while x >= 0.0:
        force = stop(x, v, 60e6, 1e3, 1e-5)[0]
        rows.append((x, force))
        v -= step * force / mass
        x += step * v
    return np.array(rows)[:, 0], np.array(rows)[:, 1]


def element_signs() -> Figure:
    """Return the picture of the positive directions of a beam element in both planes."""
    figure = Figure(figsize=(9.0, 2.6), layout="constrained")
    planes = zip(figure.subplots(1, 2), ("y", "z"), (True, False), strict=True)
    for axes, across, left_turn in planes:
        moment, other = ("z", "toward") if left_turn else ("y", "away from")
        prepare_axes(axes, f"x-{across} plane, {moment} {other} the reader", (-14.0, 104.0), (-16.0, 30.0))
        axes.add_patch(Rectangle((0.0, -3.0), 70.0, 6.0, **FACE))
        draw_arrow(axes, (-10.0, -14.0), (4.0, -14.0), "$x$", shift=(2.0, -3.0))
        draw_arrow(axes, (-10.0, -14.0), (-10.0, 0.0), f"${across}$", shift=(-10.0, -4.0))
        axes.plot([0.0, 70.0], [0.0, 0.0], "ko", markersize=4)
        axes.annotate("1", (-1.0, -9.0))
        axes.annotate("2", (63.0, -9.0))
        draw_arrow(axes, (0.0, 4.0), (0.0, 16.0), f"$u_{across}$", BLUE)
        draw_rotation(axes, (13.0, 9.0), left_turn, f"$r_{moment}$", BLUE)
        draw_arrow(axes, (71.0, 0.0), (84.0, 0.0), "$N$", RED, (3.0, -3.0))
        draw_arrow(axes, (71.0, 4.0), (71.0, 18.0), f"$V_{across}$", RED)
        draw_rotation(axes, (90.0, 10.0), left_turn, f"$M_{moment}$", RED)
    return figure


def draw_rotation(axes: Axes, centre: Point, left: bool, text: str, colour: str) -> None:
    """Draw a rotation arrow with a text."""
    style = f"arc3,rad={0.7 if left else -0.7}"
    start, end = ((5.0, -4.0), (-5.0, -4.0)) if left else ((-5.0, -4.0), (5.0, -4.0))
    arrow_style = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.6, "connectionstyle": style}
    first, last = ((centre[0] + x, centre[1] + y) for x, y in (start, end))
    axes.annotate("", last, first, arrowprops=arrow_style)
    axes.annotate(text, (centre[0], centre[1] + 4.0), color=colour, ha="center")


def rockers() -> Figure:
    """Return the picture of the three kinds of rocker."""
    figure = Figure(figsize=(9.0, 2.8), layout="constrained")
    lumped, lever, finger = figure.subplots(1, 3)
    prepare_axes(lumped, 'model = "lumped"', (-34.0, 48.0), (-30.0, 30.0))
    draw_arms(lumped, (0.0, 0.0), (-25.0, 0.0), (40.0, 0.0))
    draw_dimension(lumped, (-25.0, 10.0), (0.0, 10.0), "$a_1$", (-5.0, 4.0))
    draw_dimension(lumped, (0.0, 10.0), (40.0, 10.0), "$a_2$", (-5.0, 4.0))
    draw_arrow(lumped, (-25.0, -16.0), (-25.0, -3.0), "$p$", BLUE, (5.0, -12.0))
    draw_arrow(lumped, (40.0, -3.0), (40.0, -16.0), "$y$", RED, (-12.0, -2.0))
    lumped.annotate(r"$y = p\;a_2/a_1$", (6.0, -26.0), ha="center")

    prepare_axes(lever, 'model = "lever"', (-34.0, 48.0), (-30.0, 30.0))
    first, second = (-24.0, 8.0), (37.0, -9.0)
    draw_arms(lever, (0.0, 0.0), first, second)
    lever.plot([-30.0, 44.0], [0.0, 0.0], color="0.6", linestyle="-.", linewidth=0.8)
    lever.add_patch(Arc((0.0, 0.0), 34.0, 34.0, theta1=math.degrees(math.atan2(8.0, -24.0)), theta2=180.0, color="0.3"))
    lever.add_patch(Arc((0.0, 0.0), 44.0, 44.0, theta1=math.degrees(math.atan2(-9.0, 37.0)), theta2=0.0, color="0.3"))
    lever.annotate("$b_1$", (-16.5, 1.0), fontsize="small")
    lever.annotate("$b_2$", (23.0, -5.0), fontsize="small")
    lever.annotate("$a_1$", (-12.0, 8.0))
    lever.annotate("$a_2$", (14.0, 3.0))
    draw_spring(lever, (-24.0, -14.0), (-24.0, 6.0))
    draw_spring(lever, (37.0, -25.0), (37.0, -10.0), turns=3)
    lever.annotate("drive_stiffness", (-20.0, -14.0), fontsize="x-small")
    lever.annotate("stiffness", (33.0, -19.0), fontsize="x-small", ha="right")
    draw_arrow(lever, (-24.0, -26.0), (-24.0, -15.0), "", BLUE)
    draw_arrow(lever, (43.0, -13.0), (43.0, -25.0), "$y$", RED, (-2.0, -14.0))
    lever.annotate("driven node", (-20.0, -25.0), color=BLUE, fontsize="small")
    draw_arrow(lever, (-26.0, 11.0), (-22.5, 21.5), "$p$", BLUE, (4.0, -4.0))

    prepare_axes(finger, "finger follower (a lever)", (-8.0, 74.0), (-30.0, 30.0))
    draw_arms(finger, (0.0, 0.0), (30.0, 5.0), (60.0, 0.0))
    finger.add_patch(Circle((30.0, 5.0), 7.0, facecolor="white", edgecolor=RED, linewidth=1.4))
    finger.add_patch(Circle((30.0, 21.0), 9.0, **FACE))
    finger.annotate("cam", (30.0, 21.0), ha="center", va="center")
    draw_dimension(finger, (0.0, -12.0), (30.0, -12.0), "$a_1$", (-5.0, 4.0))
    draw_dimension(finger, (0.0, -21.0), (60.0, -21.0), "$a_2$", (-5.0, 3.0))
    draw_arrow(finger, (38.0, 5.0), (38.0, -8.0), "$p$", BLUE, (4.0, -1.0))
    draw_arrow(finger, (60.0, -3.0), (60.0, -16.0), "$y$", RED, (5.0, 0.0))
    return figure


def draw_arms(axes: Axes, pivot: Point, first: Point, second: Point) -> None:
    """Draw a rocker with its pivot on ground."""
    axes.plot(*zip(first, pivot, second, strict=True), color="0.45", linewidth=5.0, solid_capstyle="round", zorder=2)
    axes.fill([pivot[0], pivot[0] - 4.0, pivot[0] + 4.0], [pivot[1], pivot[1] - 7.0, pivot[1] - 7.0], **FACE, zorder=3)
    draw_ground(axes, (pivot[0] - 6.0, pivot[1] - 9.0), 12.0, 2.0)
    axes.plot(*pivot, "wo", markeredgecolor="black", zorder=4)


def draw_spring(axes: Axes, start: Point, end: Point, turns: int = 4, width: float = 2.4) -> None:
    """Draw a spring between two points as a zigzag line."""
    ends = np.array([start, end])
    along = ends[1] - ends[0]
    across = width * np.array([-along[1], along[0]]) / float(np.hypot(*along))
    positions = np.concatenate([[0.0, 0.1], np.linspace(0.15, 0.85, 2 * turns), [0.9, 1.0]])
    sides = np.concatenate([[0.0, 0.0], np.tile([1.0, -1.0], turns), [0.0, 0.0]])
    axes.plot(*(ends[0] + np.outer(positions, along) + np.outer(sides, across)).T, color="black", linewidth=1.1)


def spring_model() -> Figure:
    """Return the picture of a spring with several elements of mass, stiffness, damper and coil contact."""
    figure = Figure(figsize=(9.0, 2.6), layout="constrained")
    axes = figure.subplots()
    prepare_axes(axes, "", (-8.0, 132.0), (-22.0, 24.0))
    draw_ground(axes, (-4.0, -12.0), 4.0, 24.0)
    for i in range(4):
        left, right = 28.0 * i, 28.0 * i + 25.0
        draw_spring(axes, (left, 8.0), (right, 8.0))
        draw_damper(axes, left, right, 0.0)
        axes.plot([left, left + 9.0, left + 9.0], [-8.0, -8.0, -8.0], color="black", linewidth=1.1)
        axes.plot([left + 9.0] * 2, [-11.0, -5.0], color="black", linewidth=2.0)
        axes.plot([left + 13.0] * 2, [-11.0, -5.0], color="black", linewidth=2.0)
        draw_spring(axes, (left + 13.0, -8.0), (right, -8.0), turns=2, width=1.6)
        axes.add_patch(Rectangle((right, -12.0), 3.0, 24.0, facecolor=COLOURS[5], edgecolor="0.3"))
    axes.annotate("$n\\,k$", (14.0, 13.0), ha="center")
    axes.annotate("$n\\,c$", (4.0, 2.0), ha="center")
    axes.annotate("$l/n$", (11.0, -16.0), ha="center")
    axes.annotate("$k_c$", (19.0, -16.0), ha="center")
    axes.annotate("mass $m/n$ per element", (54.5, 14.0), ha="center")
    axes.annotate("fixed end (to, or ground)", (-6.0, -21.0), fontsize="small")
    axes.annotate("moving end (at)", (112.5, -19.0), ha="center", fontsize="small")
    draw_arrow(axes, (129.0, 0.0), (117.0, 0.0), "", RED)
    axes.annotate("travel $x$", (118.0, 2.5), color=RED)
    return figure


def draw_damper(axes: Axes, left: float, right: float, y: float) -> None:
    """Draw a dashpot."""
    middle = 0.5 * (left + right)
    axes.plot([left, middle - 1.0], [y, y], color="black", linewidth=1.1)
    axes.plot(
        [middle + 3.0, middle - 3.0, middle - 3.0, middle + 3.0], [y + 2.2, y + 2.2, y - 2.2, y - 2.2], "k", lw=1.1
    )
    axes.plot([middle - 1.0] * 2, [y - 1.6, y + 1.6], color="black", linewidth=2.0)
    axes.plot([middle - 3.0, left], [y, y], color="black", linewidth=1.1)
    axes.plot([middle - 1.0, right], [y, y], color="black", linewidth=1.1)


def main() -> None:
    """Write the pictures."""
    for make in (contact_frame, contact_laws, element_signs, hydraulic_adjuster, rockers, spring_model):
        save_figure(make(), PICTURES / f"{make.__name__.replace('_', '-')}.svg", overwrite=True)


if __name__ == "__main__":
    main()
