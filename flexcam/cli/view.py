"""Command that shows a mechanism: view."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from flexcam.case.builder import build_model
from flexcam.cli import app as cli
from flexcam.cli.sources import displayed_motion, open_sources
from flexcam.core.errors import refuse
from flexcam.valvetrain import build_structure

_MIN_SIZE, _MAX_SIZE = 64, 8192  # of a picture, pixels
_MAX_SCALE = 1e6


@cli.command("""\
flexcam view results/intake.vtkhdf
flexcam view results/intake.vtkhdf --color stress_von_mises --scale 50 --save train.gif
flexcam view case.toml --at 120deg --save train.png
flexcam view case.toml --mode 2 --save mode.mp4
""")
def view(
    source: Annotated[Path, Parameter(
        help="Result file (.vtkhdf), or case file (.toml) to show the rigid motion.")], *,
    picture: Annotated[Path | None, Parameter(
        "--save", help="Write a file (.png, .gif, .mp4 or .html) instead of opening a window.")] = None,
    color: Annotated[str | None, Parameter(
        help="Color the members by a saved field or a stress, such as stress_von_mises.")] = None,
    scale: Annotated[float, Parameter(
        help="Magnification of the elastic deformation; the rigid motion is not scaled.")] = 1.0,
    at: Annotated[str | None, Parameter(
        "--at", help="Cam angle of a still picture, or of the start of the motion: 120deg.")] = None,
    mode: Annotated[int | None, Parameter(help="Animate a natural mode, by its number in flexcam modes.")] = None,
    size: Annotated[str, Parameter(help="Size of the window or picture in pixels.")] = "1024x768",
    overrides: cli.Overrides = None, overwrite: cli.Overwrite = False, as_json: cli.Json = False,
) -> cli.CommandOutput:  # fmt: skip
    """Show the moving mechanism in 3D, or write a picture or an animation of it.

    The window has a slider over the cam angle. A picture of a result shows full lift by default.
    """
    from flexcam.plotting.rendering import FRAMES, check_output_path, save_view, select_renderer
    from flexcam.plotting.scene.mechanism import build_mechanism

    if not abs(scale) <= _MAX_SCALE:
        allowed = f"a finite number, at most {_MAX_SCALE:g} in size"
        raise refuse("--scale", scale, allowed, "the deformation would leave the picture")
    angle = cli.parse_optional("--at", at, "angle", "deg")
    found = re.fullmatch(r"(\d+)x(\d+)", size)
    pixels = (int(found[1]), int(found[2])) if found else (0, 0)
    if not all(_MIN_SIZE <= side <= _MAX_SIZE for side in pixels):
        raise refuse("--size", repr(size), f"WIDTHxHEIGHT of {_MIN_SIZE} to {_MAX_SIZE} pixels each, such as 1024x768")
    if picture is not None:
        check_output_path(picture, pixels, overwrite=overwrite)
    (read,) = open_sources([source], overrides)
    structure = build_structure(build_model(read.case))
    motion, title, still = displayed_motion(read, structure, color=color, mode=mode, angle=angle)
    drawn = build_mechanism(structure)
    if picture is not None and picture.suffix == ".html":
        from flexcam.plotting.solid_files import collect_parts, write_page

        frames = sorted({*motion.spread(FRAMES), still})
        labels = [motion.words(i, title, scale) for i in frames]
        parts = collect_parts(drawn, motion.at(frames), scale)
        write_page(picture, parts, drawn.view, labels, frames.index(still), motion.label)
    else:
        select_renderer(off_screen=picture is not None)
        from flexcam.plotting.solid_view import MechanismView

        stage = MechanismView(drawn, motion, off_screen=picture is not None, scale=scale, size=pixels, title=title)
        if picture is None:
            stage.open_window(still, swings=mode is not None)
        else:
            save_view(stage, picture, motion.spread(FRAMES), still)
    notes = (
        ["\n".join(["Sizes chosen for the drawing:", *(f"  {note}" for note in drawn.notes)])] if drawn.notes else []
    )
    json = {"instants": len(motion), "drawn": list(drawn.notes)}
    return cli.CommandOutput(notes, json, files=[] if picture is None else [picture])
