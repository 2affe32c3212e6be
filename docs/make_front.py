"""Make docs/pictures/front.png, the picture of README: a pushrod engine and its valve motion above the rated speed."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from matplotlib import image
from matplotlib.figure import Figure
from PIL import Image

from flexcam import read_case, run
from flexcam.dynamics import Response
from flexcam.plotting.histories import curve_style, draw_channel, draw_motion

ROOT = Path(__file__).parents[1]
PICTURES = ROOT / "docs/pictures"
SPEED = "run.crank_speed=6000rpm"
FORCE = "contacts.intake.force"
COLOURS = 64


def crop(path: Path) -> np.ndarray:
    """Return a picture without its text and its white margins."""
    pixels = image.imread(path)[60:, :, :3]
    dark = (pixels < 1.0).any(axis=2)
    rows, columns = np.flatnonzero(dark.any(axis=1)), np.flatnonzero(dark.any(axis=0))
    return pixels[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]


def front_figure(flexible: Response, rigid: Response) -> Figure:
    """Return a figure of the mechanism, and of lift and contact force with flexible and rigid members."""
    figure = Figure(figsize=(9.0, 4.2), layout="constrained")
    solids, curves = figure.subfigures(1, 2, width_ratios=(1.0, 2.2))
    left = solids.subplots()
    left.imshow(crop(PICTURES / "view-pushrod.png"))
    left.axis("off")
    lift, force = curves.subplots(2, sharex=True)
    for response, style in ((flexible, curve_style("flexible")), (rigid, curve_style("rigid", "#D55E00", "--"))):
        draw_motion([lift], response, "valve", style)
        draw_channel(force, response, FORCE, style)
    lift.set_ylabel("valve, mm")
    force.set_ylabel("cam to tappet, N")
    force.set_xlabel("cam angle, deg")
    force.set_xlim(0.0, 360.0)
    force.set_xticks(range(0, 361, 45))
    force.axhline(0.0, color="0.4", linewidth=0.8)
    for axes in (lift, force):
        axes.grid(alpha=0.3)
    lift.legend(loc="upper right", fontsize="small")
    lift.set_title("6000 crank rpm: the follower leaves its cam during the lift", fontsize="medium")
    return figure


def main() -> None:
    """Run the pushrod engine and write the picture with few colours."""
    case = read_case(ROOT / "cases/pushrod-engine/intake.toml", [SPEED])
    buffer = io.BytesIO()
    front_figure(run(case), run(case, rigid=True)).savefig(buffer, format="png", dpi=110)
    with Image.open(buffer) as picture:
        picture.convert("RGB").quantize(COLOURS).save(PICTURES / "front.png", optimize=True)


if __name__ == "__main__":
    main()
