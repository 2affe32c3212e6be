"""Figures of the verification manual, computed and drawn by flexcam."""

from __future__ import annotations

import contextlib
import io
import re
import runpy
from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from flexcam import read_case, run
from flexcam.cams import LAWS, LiftEvent, cam_profile, quinquinomial
from flexcam.case.case import Case
from flexcam.case.reader import read_cams
from flexcam.dynamics import Response
from flexcam.plotting.curves import law_figure, lift_figure, profile_figure
from flexcam.plotting.histories import motion_figure

ROOT = Path(__file__).resolve().parents[2]
STYLE = {"svg.hashsalt": "flexcam", "svg.fonttype": "none", "path.simplify": True, "path.simplify_threshold": 0.05}
DIGITS = re.compile(r"\d+\.\d{3,}")
NAMED = re.compile(r'(?<=id=")[a-zA-Z][0-9a-f]{10}(?=["_])')
"""Names of clips, markers and curves, which matplotlib derives from all digits of their data."""

INSTANTS = 240
"""Instants per revolution in a figure."""


def case(name: str, *over: str) -> Case:
    return read_case(ROOT / f"cases/{name}.toml", list(over))


def figure_text(draw: Callable[[], Figure]) -> str:
    """Return a figure as SVG text that does not depend on the machine: no date, two decimals, numbers for names."""
    written = io.StringIO()
    with rc_context(STYLE):
        draw().savefig(written, format="svg", metadata={"Date": None, "Creator": None})
    return number_parts(DIGITS.sub(lambda number: f"{float(number[0]):.2f}", written.getvalue()))


def number_parts(text: str) -> str:
    """Name the parts of a figure by their order, independent of the last digits of the data."""
    for number, name in enumerate(dict.fromkeys(NAMED.findall(text)), start=1):
        text = text.replace(name, f"{name[0]}{number}")
    return text


def run_for_figure(one: Case, *, rigid: bool = False) -> Response:
    """Return a run at the instants of a figure."""
    response = run(one, rigid=rigid)
    turns = response.angle[-1] / (2.0 * np.pi)
    return response.at(np.linspace(0.0, response.time[-1], round(INSTANTS * turns) + 1)[1:])


def tayeb_sliman() -> Figure:
    speeds = {f"{rpm} rpm": case("tayeb/model-3-shm", f"run.speed={rpm}rpm") for rpm in (1000, 2000, 3000)}
    rigid = {name: run_for_figure(one, rigid=True) for name, one in speeds.items()}
    return motion_figure({name: run_for_figure(one) for name, one in speeds.items()}, "valve", rigid=rigid)


def tayeb_sliman_growth() -> Figure:
    one = case("tayeb/model-3-shm", "run.speed=4000rpm", "run.revolutions=8")
    return motion_figure({"": run_for_figure(one)}, "valve", rigid={"": run_for_figure(one, rigid=True)})


def li() -> Figure:
    one = case("li/valve-train")
    return motion_figure({"": run_for_figure(one)}, "valve.uy", rigid={"": run_for_figure(one, rigid=True)})


def li_cam() -> Figure:
    """Draw the cam of the swinging roller follower, half way up the rise."""
    cam = read_cams(ROOT / "cases/cams/li-swing.toml").cams["swing"].part
    return profile_figure(cam_profile(cam.event, cam.follower, turn=cam.turn), angle=np.pi / 3.0)


def petrescu() -> Figure:
    """Return the figure of the example: lift and acceleration of the closed form over the rise."""
    with contextlib.chdir(ROOT / "examples"), contextlib.redirect_stdout(io.StringIO()):
        return runpy.run_path("valve_spring_settings.py")["figure"]


def pavlovic_lutovac() -> Figure:
    return law_figure(
        {name: LAWS[name] for name in ("4-5-6-7", "pavlovic-trigonometric", "gutman-1-3", "pavlovic-new")}
    )


def roussev() -> Figure:
    return law_figure({f"row {row}": quinquinomial(row) for row in (1, 2, 3, 4)})


def roussev_cams() -> Figure:
    """Draw the cams of the case file: 8 mm over 120 deg up and down."""
    up, law = 2.0 * np.pi / 3.0, quinquinomial(1)
    high = LiftEvent(law, 0.008, up, up, dwell=up, single_dwell="high")
    return lift_figure({"high dwell": high, "low dwell": LiftEvent(law, 0.008, up, up, single_dwell="low")})


FIGURES: dict[str, Callable[[], Figure]] = {
    "tayeb-sliman": tayeb_sliman,
    "tayeb-sliman-growth": tayeb_sliman_growth,
    "li": li,
    "li-cam": li_cam,
    "petrescu": petrescu,
    "pavlovic-lutovac": pavlovic_lutovac,
    "roussev": roussev,
    "roussev-cams": roussev_cams,
}
"""Figures by the names of their files."""
