"""Make pictures of friction, backlash and joints: friction.svg, backlash.svg and rigid-link.svg in docs/pictures."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from make_physics import BLUE, FACE, GREEN, PICTURES, RED, draw_arrow, draw_ground, draw_rotation, prepare_axes
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Circle, Polygon, Rectangle

import flexcam
from flexcam.case.schema.contacts import LashRecord
from flexcam.dynamics.force_laws import sliding_friction, stop
from flexcam.fem.dofs import rigid_ties
from flexcam.plotting.figures import line_styles, save_figure

GEAR = Path(flexcam.__file__).parent / "templates" / "gear-drive.toml"


def friction() -> Figure:
    """Return the picture of the friction points, and of the friction law over the sliding velocity."""
    figure = Figure(figsize=(9.0, 4.0), layout="constrained")
    drawing, curve = figure.subplots(1, 2)
    draw_sliding_parts(drawing)
    speeds = np.linspace(-0.5, 0.5, 2001)
    parameters = {
        "Coulomb, $F$ = 8 N": (8.0, 0.0),
        "breakaway force $F_0$ = 15 N": (15.0, 0.0),
        "and damping $c$ = 6 N s/m": (15.0, 6.0),
    }
    for (name, (breakaway, damping)), (colour, dashes) in zip(parameters.items(), line_styles(), strict=False):
        forces = [sliding_friction(v, 8.0, breakaway, 0.1, damping, 0.01)[0] for v in speeds.tolist()]
        curve.plot(speeds, forces, label=name, color=colour, linestyle=dashes)
    for speed, name in ((0.01, "$v_0$"), (0.1, "$v_s$")):
        curve.axvline(speed, color="0.7", linewidth=0.8)
        curve.annotate(name, (speed, -16.0), (3.0, 0.0), textcoords="offset points", color="0.3")
    curve.set(xlabel="sliding velocity v, m/s", ylabel="friction f, N", xlim=(-0.5, 0.5), ylim=(-17.0, 17.0))
    curve.set_title("$v_0$ = 0.01 m/s, $v_s$ = 0.1 m/s", fontsize="medium")
    curve.grid(alpha=0.3)
    curve.legend(fontsize="small", loc="upper left")
    return figure


def draw_sliding_parts(axes: Axes) -> None:
    """Draw a valve in its guide, a tappet in its bore and a rocker on its pivot, with the friction on each."""
    prepare_axes(axes, "friction on the moving part", (-26.0, 92.0), (-46.0, 44.0))
    for side in (-1.0, 1.0):  # guide and seal
        axes.add_patch(Rectangle((side * 6.5 - 3.5, -22.0), 7.0, 34.0, **FACE))
        axes.add_patch(Rectangle((side * 5.0 - 2.0, 13.0), 4.0, 6.0, facecolor=GREEN, alpha=0.5, edgecolor="0.3"))
        axes.add_patch(Rectangle((42.0 + side * 15.0 - 3.0, -24.0), 6.0, 30.0, **FACE))
    axes.add_patch(Rectangle((-3.0, -32.0), 6.0, 64.0, facecolor="white", edgecolor="0.2"))
    axes.fill([-3.0, -12.0, 12.0, 3.0], [-32.0, -40.0, -40.0, -32.0], facecolor="white", edgecolor="0.2")
    axes.add_patch(Rectangle((30.0, -20.0), 24.0, 22.0, facecolor="white", edgecolor="0.2"))
    axes.plot([72.0, 78.0, 88.0], [22.0, 26.0, 20.0], color="0.45", linewidth=5.0, solid_capstyle="round")
    axes.add_patch(Circle((78.0, 26.0), 3.4, facecolor="white", edgecolor="0.2", zorder=4))
    draw_ground(axes, (74.0, 10.0), 8.0, 3.0)
    axes.plot([78.0, 78.0], [13.0, 23.0], color="0.3", linewidth=3.0)
    line = {"arrowstyle": "-", "color": "0.6"}
    for text, point, position in (
        ("seal", (-5.0, 16.0), (-26.0, 22.0)),
        ("guide", (-7.0, -6.0), (-26.0, -6.0)),
        ("bore", (57.0, -14.0), (64.0, -14.0)),
        ("pivot", (79.0, 29.0), (82.0, 36.0)),
    ):
        axes.annotate(text, point, position, arrowprops=line, color="0.3", va="center")
    draw_arrow(axes, (0.0, 33.0), (0.0, 43.0), "$v$", BLUE, (4.0, -6.0))
    draw_arrow(axes, (42.0, 3.0), (42.0, 15.0), "$v$", BLUE, (4.0, -6.0))
    for x in (-3.0, 3.0):
        draw_arrow(axes, (x, 8.0), (x, -4.0), "$f$" if x > 0.0 else "", RED, (5.0, -4.0))
    for x in (30.0, 54.0):
        draw_arrow(axes, (x, -4.0), (x, -16.0), "$f$" if x > 50.0 else "", RED, (-11.0, 2.0))
    draw_rotation(axes, (78.0, 30.0), True, "", BLUE)
    draw_rotation(axes, (78.0, 17.0), False, "", RED)


def backlash() -> Figure:
    """Return the picture of a tooth between two flanks, and of their torque over the relative angle."""
    figure = Figure(figsize=(9.0, 4.0), layout="constrained")
    mesh, curve = figure.subplots(1, 2)
    draw_tooth(mesh)
    flank = flexcam.read_case(GEAR).record.contacts["driving"]
    assert isinstance(flank, LashRecord)
    limit = 1.6 * flank.gap
    angles = np.linspace(-limit, limit, 1201)
    constants = flank.stiffness or 0.0, flank.damping, flank.damping_depth or 0.0
    rates = dict(zip((1.0, 0.0, -1.0), line_styles(), strict=False))
    for rate, (colour, dashes) in rates.items():
        name = r"$\dot\varphi$ = " + (f"{rate:+g} rad/s" if rate else "0")
        torque = [
            stop(x - flank.gap, rate, *constants)[0] - stop(-x - flank.gap, -rate, *constants)[0]
            for x in angles.tolist()
        ]
        curve.plot(np.degrees(angles), torque, label=name, color=colour, linestyle=dashes)
    half = math.degrees(flank.gap)
    for side, name in ((-half, "coasting"), (half, "driving")):
        curve.axvline(side, color="0.7", linewidth=0.8)
        curve.annotate(name, (1.05 * side, -19.0), color="0.3", ha="left" if side > 0.0 else "right", fontsize="small")
    curve.locator_params(axis="x", nbins=6)
    curve.set(xlabel=r"gear ahead of the shaft, $\varphi$, deg", ylabel="torque on the shaft, N m", ylim=(-21.0, 21.0))
    curve.set_title(f"{1e-3 * constants[0]:g} kN m/rad, gap {half:g} deg on each flank", fontsize="medium")
    curve.grid(alpha=0.3)
    curve.legend(fontsize="small", loc="upper left")
    return figure


def draw_tooth(axes: Axes) -> None:
    """Draw a tooth of the gear between two teeth of the wheel on the shaft."""
    prepare_axes(axes, "", (-46.0, 46.0), (-24.0, 50.0))
    axes.add_patch(Polygon([(-46, 50), (-46, 34), (-12, 34), (-6, 8), (6, 8), (12, 34), (46, 34), (46, 50)], **FACE))
    wheel = [(-46, -24), (-46, 30), (-22, 30), (-16, 4), (16, 4), (22, 30), (46, 30), (46, -24)]
    axes.add_patch(Polygon(wheel, facecolor="white", edgecolor=RED, linewidth=1.4))
    axes.plot([-46.0, 46.0], [19.0, 19.0], color="0.5", linestyle="-.", linewidth=0.8)
    axes.annotate("pitch circle, $r$", (-45.0, 20.5), color="0.4", fontsize="small")
    left, right = 8.5, 19.5
    for side, name in ((1.0, "driving"), (-1.0, "coasting")):
        axes.annotate("", (side * left, 19.0), (side * right, 19.0), arrowprops={"arrowstyle": "<->", "color": "0.2"})
        axes.annotate("$j/2$", (side * 14.0, 21.0), ha="center")
        axes.annotate(name, (side * 33.0, 8.0), ha="center", color="0.3", fontsize="small")
    axes.annotate("gear", (0.0, 42.0), ha="center")
    axes.annotate("wheel on the shaft", (0.0, -8.0), ha="center", color=RED)
    draw_arrow(axes, (-16.0, 39.0), (-4.0, 39.0), "", BLUE)
    axes.annotate(r"$\varphi$", (-22.0, 38.0), color=BLUE)
    axes.annotate("gap: $j/(2r)$, rad", (0.0, -19.0), ha="center")


LEADING, PUSHED, VALVE = (0.0, 0.0), (-30.0, -8.0), (44.0, 6.0)


def rigid_link() -> Figure:
    """Return the picture of nodes that follow a leading node, and of a ball joint between two members."""
    figure = Figure(figsize=(9.0, 3.4), layout="constrained")
    body, joint = figure.subplots(1, 2)
    prepare_axes(body, "all components: one rigid body", (-42.0, 58.0), (-24.0, 30.0))
    nodes = np.array([(*place, 0.0) for place in (LEADING, PUSHED, VALVE)])
    mesh = flexcam.Mesh(nodes, {}, {}, links={"link": np.arange(3)})
    ties = rigid_ties(mesh, {"link": ("ux", "uy", "uz", "rx", "ry", "rz")})
    assert ties is not None
    motion = np.array([4.0, 6.0, 0.0, 0.0, 0.0, math.radians(12.0)])
    moved = nodes + np.vstack([motion[:3], (ties.matrices[1:] @ motion)[:, :3]])
    for places, colour, dashes in ((nodes, "0.45", "-"), (moved, BLUE, "--")):
        for end in (1, 2):
            body.plot(*places[[0, end], :2].T, color=colour, linestyle=dashes, linewidth=3.0, solid_capstyle="round")
        body.plot(*places[:, :2].T, "o", color="black" if colour == "0.45" else BLUE)
    draw_arrow(body, (0.0, 0.0), (44.0, 6.0), r"$\mathbf{r}$", "black", (-70.0, -20.0))
    for start, end, name in zip(nodes, moved, ("from", "to", "to"), strict=True):
        draw_arrow(body, tuple(start[:2]), tuple(end[:2]), "", RED)
        body.annotate(name, start[:2], (0.0, -15.0), textcoords="offset points", ha="center")
    body.annotate(r"$\mathbf{u}_{from}$", moved[0, :2], (-6.0, 8.0), textcoords="offset points", color=RED, ha="right")
    body.annotate(r"$\mathbf{u}_{to}$", moved[2, :2], (6.0, -14.0), textcoords="offset points", color=RED)
    old, new = (math.degrees(math.atan2(*(end - start)[1::-1])) for start, end in (nodes[[0, 2]], moved[[0, 2]]))
    body.plot([4.0, 4.0 + VALVE[0]], [6.0, 6.0 + VALVE[1]], color=BLUE, linestyle=":", linewidth=1.0)
    body.add_patch(Arc((4.0, 6.0), 66.0, 66.0, theta1=old, theta2=new, color=BLUE))
    body.annotate(r"$\theta$", (39.0, 14.0), color=BLUE)
    prepare_axes(joint, 'components = ["ux", "uy", "uz"]: ball joint', (-50.0, 50.0), (-24.0, 30.0))
    x = np.linspace(0.0, 1.0, 41)
    bent = 12.0 * x**2 * (3.0 - x) / 2.0  # two cantilevers under a force at their common end
    for side in (-1.0, 1.0):
        draw_ground(joint, (side * 45.0 - 2.0, -10.0), 4.0, 20.0)
        joint.plot(side * 43.0 * (1.0 - x), 0.0 * x, color="0.7", linewidth=2.0)
        joint.plot(side * 43.0 * (1.0 - x), bent, color=BLUE, linewidth=2.5)
    joint.plot(0.0, 12.0, "wo", markeredgecolor="black", markersize=9.0, zorder=5)
    draw_arrow(joint, (0.0, -2.0), (0.0, 10.0), "", RED)
    joint.annotate(r"$\mathbf{u}_{to} = \mathbf{u}_{from}$", (0.0, 16.0), ha="center")
    joint.annotate(r"$\theta_{to} \neq \theta_{from}$", (0.0, 22.0), ha="center")
    joint.annotate("member", (-30.0, 6.0), ha="center", color=BLUE)
    joint.annotate("member", (30.0, 6.0), ha="center", color=BLUE)
    return figure


def main() -> None:
    """Write the pictures."""
    for make in (friction, backlash, rigid_link):
        save_figure(make(), PICTURES / f"{make.__name__.replace('_', '-')}.svg", overwrite=True)


if __name__ == "__main__":
    main()
