"""Make docs/pictures/film.svg: the velocities of both surfaces at a cam contact, and the oil film over the cam angle."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import flexcam
from flexcam.cams import CamProfile, cam_profile, profile_at
from flexcam.plotting.figures import COLOURS, save_figure
from flexcam.valvetrain import Cam
from flexcam.valvetrain.lubrication import cam_surface_velocity

DOCS = Path(__file__).parent
OIL = 'contacts.intake.lubrication={viscosity="10 mPa s",pressure_viscosity="15 1/GPa"}'
ANGLE = math.radians(212.0)
"""Cam angle of the drawing, at which both surfaces move in opposite directions relative to the contact."""


def draw_geometry(axes: Axes, cam: Cam) -> None:
    """Draw a cam under a flat face, with the velocities of both surfaces relative to the contact point."""
    assert cam.follower is not None
    around = cam_profile(cam.event, cam.follower, turn=cam.turn)
    touch = profile_at(cam.event, cam.follower, np.array([ANGLE]), cam.turn)
    points = 1e3 * (around.points @ np.array([1.0, 1j])) * np.exp(1j * cam.turn * ANGLE)
    axes.fill(points.real, points.imag, facecolor="0.9", edgecolor=COLOURS[0], linewidth=1.5)
    contact = complex(1e3 * touch.touch.point[0])
    axes.plot([contact.real - 16.0, contact.real + 16.0], [contact.imag] * 2, color=COLOURS[1], linewidth=2.0)
    first, second = velocities(touch)
    for name, size, below, colour in (("$u_1$", first[0], -2.2, COLOURS[0]), ("$u_2$", second[0], 2.2, COLOURS[1])):
        end = contact.real + 600.0 * size, contact.imag + below
        arrow = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.8, "shrinkA": 0, "shrinkB": 0}
        axes.annotate("", end, (contact.real, contact.imag + below), arrowprops=arrow)
        axes.annotate(name, end, (3.0 if size > 0.0 else -15.0, -4.0), textcoords="offset points", color=colour)
    axes.plot(*[[0.0, contact.real], [0.0, 0.0]], color="0.4", linewidth=0.8)
    axes.plot([contact.real] * 2, [0.0, contact.imag], color="0.4", linewidth=0.8)
    axes.annotate("$s'$", (0.5 * contact.real, -2.2), ha="center")
    axes.annotate("$r_0 + s$", (contact.real + 0.6, 0.5 * contact.imag))
    axes.plot(0.0, 0.0, "k+")
    axes.plot(contact.real, contact.imag, "ko", markersize=4)
    axes.set_ylim(points.imag.min() - 2.0, contact.imag + 6.0)
    axes.set_aspect("equal")
    axes.set_axis_off()


def velocities(profile: CamProfile) -> tuple[np.ndarray, np.ndarray]:
    """Return the velocities of cam and face relative to the contact point, m/rad."""
    first = cam_surface_velocity(profile)
    return first, first - profile.touch.sliding


def main() -> None:
    """Write the picture."""
    case = flexcam.read_case(DOCS.parent / "cases/direct-acting/bucket.toml", [OIL, "run.steps_per_revolution=720"])
    response = flexcam.run(case, rigid=True)
    cam = flexcam.build_model(case).cams["intake"]
    assert cam.follower is not None
    figure = Figure(figsize=(9.0, 4.2), layout="constrained")
    geometry, curves = figure.add_gridspec(1, 2, width_ratios=[1.0, 1.4])
    draw_geometry(figure.add_subplot(geometry), cam)
    upper, lower = figure.add_subfigure(curves).subplots(2, sharex=True)
    profile = profile_at(cam.event, cam.follower, response.angle, cam.turn)
    angle = np.degrees(response.angle)
    first, second = velocities(profile)
    for name, values, dashes, colour in (
        ("cam, $u_1$", first, "--", COLOURS[0]),
        ("face, $u_2$", second, "-.", COLOURS[1]),
        ("entrainment, $u$", 0.5 * (first + second), "-", "black"),
    ):
        upper.plot(angle, case.speed * values, label=name, color=colour, linestyle=dashes)
    lower.plot(angle, 1e6 * response.channels["contacts.intake.film"], color="black")
    upper.set_ylabel("velocity past the\ncontact, m/s")
    upper.legend(fontsize="small")
    lower.set_ylabel("minimum film, µm")
    lower.set_xlabel("cam angle, deg")
    lower.set_xlim(120.0, 340.0)
    for axes in (upper, lower):
        axes.grid(alpha=0.3)
    save_figure(figure, DOCS / "pictures" / "film.svg", overwrite=True)


if __name__ == "__main__":
    main()
