"""Pictures: curves of laws, lifts, cams and runs.

May import `fidelity` and everything below it; owns matplotlib, of which only `Figure` is used (no window).
A new picture is a function that draws into given axes, and one that makes its figure.
"""

from flexcam.view.axes import free_for_picture, png_of, save_figure, titled
from flexcam.view.campbell import campbell_figure
from flexcam.view.curves import (
    law_figure,
    lift_figure,
    pressure_figure,
    profile_figure,
    spectrum_figure,
)
from flexcam.view.histories import (
    Look,
    Over,
    channel_figure,
    contact_forces,
    draw_channel,
    draw_energy,
    draw_motion,
    energy_figure,
    motion_figure,
)
from flexcam.view.law_front import draw_front, law_front_figure
from flexcam.view.methods import method_figure
from flexcam.view.modes import draw_mode, mode_figure
from flexcam.view.orders import waterfall_figure
from flexcam.view.speeds import force_figure, growth_figure
from flexcam.view.studies import bars_figure, front_figure, map_figure, progress_figure, scatter_figure
from flexcam.view.trade import work_precision_figure

__all__ = [
    "Look",
    "Over",
    "bars_figure",
    "campbell_figure",
    "channel_figure",
    "contact_forces",
    "draw_channel",
    "draw_energy",
    "draw_front",
    "draw_mode",
    "draw_motion",
    "energy_figure",
    "force_figure",
    "free_for_picture",
    "front_figure",
    "growth_figure",
    "law_figure",
    "law_front_figure",
    "lift_figure",
    "map_figure",
    "method_figure",
    "mode_figure",
    "motion_figure",
    "png_of",
    "pressure_figure",
    "profile_figure",
    "progress_figure",
    "save_figure",
    "scatter_figure",
    "spectrum_figure",
    "titled",
    "waterfall_figure",
    "work_precision_figure",
]
