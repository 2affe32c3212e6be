"""Make the pictures of the tutorials, docs/pictures/tutorial-*.svg."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import flexcam
from flexcam.cams import cam_profile, lift_table, profile_at
from flexcam.case.builder import build_model
from flexcam.case.reader import CaseFile
from flexcam.case.starters import new_case
from flexcam.core import FloatArray, Triplets
from flexcam.dynamics import Load, Probe, Response, modes, static_displacement
from flexcam.fem.assembly import build_beams, mass, stiffness
from flexcam.fem.dofs import COMPONENTS, direction, dof_map
from flexcam.fem.mesh import refine
from flexcam.io import read_lift
from flexcam.plotting.curves import draw_profile
from flexcam.plotting.figures import COLOURS, add_legend, create_stacked_axes, line_styles, save_figure
from flexcam.studies.evaluation import evaluate

DOCS = Path(__file__).parent
TAYEB = DOCS.parent / "cases/tayeb/model-3-shm.toml"
ROOTS = np.array([1.875104068711961, 4.694091132974174, 7.854757438237612])
BLUE, RED, GREEN = COLOURS[:3]


def cantilever() -> dict[str, Figure]:
    """Return the deflection and modes of the bar, and the motion of its tip under a step force."""
    steel, circle = flexcam.Material(E=207e9, nu=0.29, density=7800.0), flexcam.Section.circle(0.020)
    mesh = refine(flexcam.Mesh([[0, 0, 0], [0.5, 0, 0]], {"bar": [0, 1]}, {"root": [0], "tip": [1]}), {"bar": 10})
    beams = build_beams(mesh, {"bar": flexcam.Member(steel, circle, rotary_inertia=False)})
    dofs = dof_map(mesh, [("root", COMPONENTS)])
    m, k = mass(beams, dofs), stiffness(beams, dofs)
    force = 100.0 * dofs.vector(mesh.node("tip"), direction("uy"))
    x = np.asarray(mesh.nodes)[:, 0]
    order = np.argsort(x)

    def deflection(values: FloatArray) -> FloatArray:
        return dofs.nodal_modes(values[None, :], 0.5)[0].reshape(len(x), -1)[order, 1]

    static_figure, (static_axes,) = create_stacked_axes(("deflection, mm",), "x, mm", height=1.9)
    mode_figure, (mode_axes,) = create_stacked_axes(("mode shape, 1",), "x, mm", height=1.9)
    fine, EI = np.linspace(0.0, 0.5, 201), steel.E * circle.Iz
    theory = 100.0 * fine**2 * (1.5 - fine) / (6.0 * EI)
    static = static_displacement(k, force, dofs.names)
    tip = static[dofs.names.index("tip.uy")]
    nodal = deflection(static)
    static_axes.plot(1e3 * fine, 1e3 * theory, color=BLUE, label="theory")
    static_axes.plot(1e3 * x[order], 1e3 * nodal * tip / nodal[-1], "o", color=RED, markersize=4, label="nodes")
    static_axes.legend(fontsize="small")
    found = modes(m, k, 6)
    for number, (colour, dashes) in zip((0, 2, 4), line_styles(), strict=False):
        pair = [
            dofs.nodal_modes(found.shapes[:, [i]].T, 0.5)[0].reshape(len(x), -1)[order] for i in (number, number + 1)
        ]
        shape = pair[0][:, 1] if abs(pair[0][-1, 1]) > abs(pair[1][-1, 1]) else pair[1][:, 1]
        name = f"{found.frequencies[number]:.1f} Hz"
        mode_axes.plot(1e3 * x[order], shape / shape[-1], color=colour, linestyle=dashes, marker=".", label=name)
    mode_axes.legend(fontsize="small")

    load, tip_row = Load("push", force, lambda motion: np.ones_like(motion.angle)), dofs.names.index("tip.uy")
    probe = Probe("tip", ("uy",), np.eye(dofs.size)[[tip_row]], (None,))
    system = flexcam.System(m, Triplets.zeros(dofs.size), k, dofs.names, loads=(load,), probes=(probe,))
    exact = ROOTS**2 * np.sqrt(EI / (steel.density * circle.A * 0.5**4))
    step = 2.0 * np.pi / exact[0] / 200
    response = flexcam.solve(
        flexcam.Problem(system, flexcam.ConstantSpeed(1.0), step=step, steps=600), flexcam.newmark()
    )
    theory = 400.0 * 0.5**3 / EI * (1.0 - np.cos(np.outer(response.time, exact))) @ ROOTS**-4.0
    displacement = response["tip"].displacement
    step_figure, (motion, difference) = create_stacked_axes(("tip, mm", "difference, mm"), "time, ms")
    motion.plot(1e3 * response.time, 1e3 * theory, color=BLUE, label="theory")
    motion.plot(
        1e3 * response.time, 1e3 * displacement, color=RED, linestyle="--", label="Newmark, 200 steps per period"
    )
    difference.plot(1e3 * response.time, 1e3 * (displacement - theory), color="black")
    add_legend(step_figure, motion)
    return {"cantilever-force": static_figure, "cantilever-modes": mode_figure, "cantilever-step": step_figure}


def published_cam() -> dict[str, Figure]:
    """Return flexible and rigid motion of the published model, the motion over speed, and the beat at 4000 rpm."""
    flexible, rigid = run(TAYEB), run(TAYEB, rigid=True)
    motions, axes = create_stacked_axes(("valve, mm", "velocity, m/s", "cam force, N"), "cam angle, deg")
    for name, response, colour, dashes in (("flexible", flexible, BLUE, "-"), ("rigid", rigid, RED, "--")):
        valve = response["valve"]
        force = response.channels["contacts.intake.force"]
        for axis, values in zip(axes, (1e3 * valve.displacement, valve.velocity, force), strict=True):
            draw(axis, response, values, name, colour, dashes)
    add_legend(motions, axes[0])
    speed_figure, (speeds,) = create_stacked_axes(("valve, mm",), "cam angle, deg", height=2.6)
    for rpm, (colour, dashes) in zip((1000, 2000, 3000, 4000), line_styles(), strict=False):
        response = run(TAYEB, f"run.speed={rpm}rpm")
        draw(speeds, response, 1e3 * response["valve"].displacement, f"{rpm} rpm", colour, dashes)
    draw(speeds, rigid, 1e3 * rigid["valve"].displacement, "rigid", "black", "-")
    add_legend(speed_figure, speeds, columns=5)
    beat, (upper, lower) = create_stacked_axes(("no damping:\nvalve, mm", "10 % of critical:\nvalve, mm"), "revolution")
    for axis, damping in ((upper, "0"), (lower, "0.1")):
        response = run(
            TAYEB,
            "run.speed=4000rpm",
            "run.revolutions=160",
            "run.steps_per_revolution=720",
            f"run.damping.modal={damping}",
        )
        peaks = 1e3 * response["valve"].displacement[1:].reshape(160, 720)
        axis.fill_between(np.arange(160), peaks.min(axis=1), peaks.max(axis=1), color=BLUE, step="mid")
    return {"published-motion": motions, "published-speeds": speed_figure, "published-beat": beat}


def pushrod_engine(folder: Path) -> dict[str, Figure]:
    """Return the points, the cam, a run and the contact loss of the pushrod engine."""
    path = folder / "engine.toml"
    new_case("pushrod-engine", path)
    case = flexcam.read_case(path)
    model = flexcam.build_model(case)
    points = Figure(figsize=(5.0, 5.0), layout="constrained")
    axes = points.subplots()
    positions = 1e3 * np.asarray(model.mesh.nodes)
    for name, nodes in model.mesh.lines.items():
        axes.plot(*positions[list(nodes)][:, :2].T, "-", linewidth=4.0, color="0.6", zorder=1)
        axes.annotate(
            name, positions[list(nodes)[:2]][:, :2].mean(axis=0), (8, 8), textcoords="offset points", color="0.4"
        )
    for name, nodes in model.mesh.points.items():
        x, y, _ = positions[nodes[0]]
        axes.plot(x, y, "o", color=BLUE)
        axes.annotate(name, (x, y), (6, -14), textcoords="offset points", fontsize="small")
    axes.set(xlabel="x, mm", ylabel="y, mm", xlim=(-15.0, 230.0), ylim=(-25.0, 295.0), aspect="equal")
    cam = model.cams["intake"]
    assert cam.follower is not None
    shape = Figure(figsize=(7.5, 4.2), layout="constrained")
    left, right = shape.subplots(1, 2, width_ratios=[1.0, 1.1])
    angle = np.radians(np.arange(0.0, 361.0, 0.5))
    draw_profile(left, cam_profile(cam.event, cam.follower, turn=cam.turn), np.radians(150.0))
    left.get_legend().remove()
    left.set(xlabel="x, mm", ylabel="y, mm")
    right.plot(np.degrees(angle), 1e3 * cam.event(angle), color=BLUE)
    right.plot(
        np.degrees(angle), 1e3 * profile_at(cam.event, cam.follower, angle).touch.radius, color=RED, linestyle="--"
    )
    right.set(xlabel="cam angle, deg", ylim=(-2.0, 80.0))
    right.legend(["lift, mm", "radius of curvature, mm"], fontsize="small")
    right.grid(alpha=0.3)

    flexible, rigid = run(path), run(path, rigid=True)
    run_figure, rows = create_stacked_axes(("valve lift, mm", "cam force, kN", "spring, N"), "cam angle, deg")
    for name, response, colour, dashes in (("flexible", flexible, BLUE, "-"), ("rigid", rigid, RED, "--")):
        force = 1e-3 * response.channels["contacts.intake.force"]
        for axis, values in zip(rows, (1e3 * response["valve"].displacement, force), strict=False):
            draw(axis, response, values, name, colour, dashes)
    draw(rows[2], flexible, flexible.channels["springs.valve.force"], "flexible", BLUE, "-")
    add_legend(run_figure, rows[0])
    speeds, (nose,) = create_stacked_axes(("cam force of the\nrigid train, kN",), "cam angle, deg", height=2.4)
    for rpm, (colour, dashes) in zip((5000, 5602, 6348), line_styles(), strict=False):
        response = run(path, f"run.crank_speed={rpm}rpm", rigid=True)
        draw(nose, response, 1e-3 * response.channels["contacts.intake.force"], f"{rpm} rpm", colour, dashes)
    add_legend(speeds, nose)
    loss_figure, rows = create_stacked_axes(("50 kN/m:\ncam force, kN", "70 kN/m:\ncam force, kN"), "cam angle, deg")
    for axis, rate in zip(rows, (50, 70), strict=True):
        response = run(
            path, "run.crank_speed=6000rpm", "run.steps_per_revolution=1800", f"springs.valve.stiffness={rate}kN/m"
        )
        force, degrees = response.channels["contacts.intake.force"], np.degrees(response.angle)
        draw(axis, response, 1e-3 * force, "force", BLUE, "-")
        open_contact = (force == 0.0) & (degrees > 105.0) & (degrees < 255.0)
        axis.fill_between(
            degrees, 0.0, 1.0, where=open_contact, transform=axis.get_xaxis_transform(), color=RED, alpha=0.25
        )
        axis.set_xlim(75.0, 285.0)
    return {
        "engine-points": points,
        "engine-cam": shape,
        "engine-run": run_figure,
        "engine-limits": speeds,
        "engine-loss": loss_figure,
    }


def measured_lift(folder: Path) -> dict[str, Figure]:
    """Return table, accelerations, residuals and the cam force of the measured lift."""
    new_case("measured-lift", folder / "lift.toml")
    table = read_lift(folder / "measured-lift.csv")
    angle = np.degrees(table.angle)
    inside = (angle > 150.0) & (angle < 320.0)
    event, _ = lift_table(table.angle, table.lift)
    interpolated, _ = lift_table(table.angle, table.lift, tolerance=0.0)
    smoother, _ = lift_table(table.angle, table.lift, tolerance=5e-6)
    table_figure, (lift, differences) = create_stacked_axes(
        ("lift, mm", "second difference,\nmm/rad²"), "cam angle, deg"
    )
    lift.plot(angle, 1e3 * table.lift, ".", markersize=2.5, color=BLUE)
    differences.plot(
        angle[1:-1], 1e3 * np.diff(table.lift, 2) / (table.angle[1] - table.angle[0]) ** 2, color=BLUE, linewidth=0.9
    )
    smooth_figure, (accelerations,) = create_stacked_axes(("acceleration, mm/rad²",), "cam angle, deg", height=2.6)
    fine = np.linspace(0.0, 2.0 * np.pi, 721)
    accelerations.plot(
        np.degrees(fine), 1e3 * interpolated(fine, 2), color="0.65", linewidth=0.9, label="through every point"
    )
    accelerations.plot(np.degrees(fine), 1e3 * event(fine, 2), color=BLUE, label="noise estimated")
    add_legend(smooth_figure, accelerations)
    residual_figure, rows = create_stacked_axes(
        ("estimated noise:\nresidual, µm", "5 µm:\nresidual, µm"), "cam angle, deg"
    )
    for axis, smoothed in zip(rows, (event, smoother), strict=True):
        axis.plot(
            angle[inside],
            1e6 * (table.lift - smoothed(table.angle))[inside],
            ".-",
            linewidth=0.7,
            markersize=3,
            color=BLUE,
        )
    force_figure, (force,) = create_stacked_axes(("cam force, N",), "cam angle, deg", height=2.6)
    raw = 'cams.intake.lift_table={file="measured-lift.csv",tolerance="0 um"}'
    for name, overrides, colour in (("through every point", [raw], "0.65"), ("smoothed", [], BLUE)):
        response = run(folder / "lift.toml", *overrides)
        draw(force, response, response.channels["contacts.intake.force"], name, colour, "-")
    add_legend(force_figure, force)
    return {
        "lift-table": table_figure, "lift-smooth": smooth_figure, "lift-residuals": residual_figure,
        "lift-force": force_figure,
    }  # fmt: skip


BSPLINE = '{{ id = "bspline", degree = 11, coefficients = [0, 0, 0, 0, {}, 1, 1, 1, 1] }}'
REDESIGN = (
    "cams.intake.law=" + BSPLINE.format("0.286, 0.522, 0.587, 0.771"),
    "cams.intake.return_law=" + BSPLINE.format("0.286, 0.519, 0.669, 0.84"),
    "springs.valve.stiffness=45.7kN/m", "springs.valve.installed_force=445N",
)  # fmt: skip
_FLAT = 'base_radius = "24.1 mm", width = "12 mm", follower = { type = "flat" }'
POLYDYNE = (f'cams.intake={{ at = "cam", lift_table = "polydyne.toml", phase = "105 deg", {_FLAT} }}',)


def redesign(folder: Path) -> dict[str, Figure]:
    """Return lift and acceleration of the cams, and contact force and valve loft over speed."""
    case = folder / "redesign.toml"
    new_case("pushrod-engine", case)
    table = ["synthesize", "polydyne", str(case), "--frequency", "1163 Hz", "--speed", "2750rpm"]
    subprocess.run(
        [sys.executable, "-m", "flexcam", *table, "-o", str(folder / "polydyne.toml")], check=True, capture_output=True
    )
    law_figure, (lift, acceleration) = create_stacked_axes(("lift, mm", "acceleration, mm/rad²"), "cam angle, deg")
    speed_figure, (force, loft) = create_stacked_axes(
        ("min force over\nthe nose, N", "valve loft, mm"), "crank speed, rpm"
    )
    angle, speeds = np.linspace(0.0, 2.0 * np.pi, 1441), range(4000, 6601, 200)
    file = CaseFile.open(case)
    for name, overrides, colour, dashes in (
        ("4-5-6-7", (), BLUE, "-"), ("polydyne", POLYDYNE, GREEN, "--"), ("redesigned", REDESIGN, RED, "-")
    ):  # fmt: skip
        event = build_model(file.read(overrides)).cams["intake"].event
        for axis, order in ((lift, 0), (acceleration, 2)):
            axis.plot(np.degrees(angle), 1e3 * event(angle, order), label=name, color=colour, linestyle=dashes)
        rows = [
            evaluate(file.read([*overrides, "run.revolutions=2", f"run.crank_speed={n}rpm"]), runs=99).scalars
            for n in speeds
        ]
        for axis, key, scale in ((force, "intake.nose_force.least", 1.0), (loft, "seat.valve_loft", 1e3)):
            values = [scale * row[f"contacts.{key}"] for row in rows]
            axis.plot(speeds, values, ".", label=name, color=colour, linestyle=dashes)
    add_legend(law_figure, lift)
    add_legend(speed_figure, force)
    return {"redesign-laws": law_figure, "redesign-speed": speed_figure}


def run(path: Path, *overrides: str, rigid: bool = False) -> Response:
    """Return the response of a case."""
    return flexcam.run(flexcam.read_case(path, overrides), rigid=rigid)


def draw(
    axis: Axes, response: Response, values: Sequence[float] | FloatArray, name: str, colour: str, dashes: str
) -> None:
    """Draw at most some hundred points of values over the cam angle."""
    every = max(1, len(response.angle) // 900)
    degrees = np.degrees(response.angle)[::every]
    axis.plot(degrees, np.asarray(values)[::every], label=name, color=colour, linestyle=dashes, linewidth=1.2)


def main() -> None:
    """Write the pictures."""
    with tempfile.TemporaryDirectory() as folder:
        figures = cantilever() | published_cam() | pushrod_engine(Path(folder)) | measured_lift(Path(folder))
        figures |= redesign(Path(folder))
        for name, figure in figures.items():
            save_figure(figure, DOCS / "pictures" / f"tutorial-{name}.svg", overwrite=True)


if __name__ == "__main__":
    main()
