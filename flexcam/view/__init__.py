"""Pictures: curves of laws, lifts and cams.

May import `cam`, `motion` and what is below them; owns matplotlib, of which only `Figure` is used (no window).
A new picture is a function that draws into given axes, and one that makes its figure.
"""

from flexcam.view.axes import free_for_picture, save_figure
from flexcam.view.campbell import campbell_figure
from flexcam.view.curves import (
    law_figure,
    lift_figure,
    pressure_figure,
    profile_figure,
    spectrum_figure,
)
from flexcam.view.methods import method_figure
from flexcam.view.orders import waterfall_figure
from flexcam.view.speeds import force_figure, growth_figure
from flexcam.view.studies import bars_figure, front_figure, map_figure, progress_figure, scatter_figure
from flexcam.view.trade import work_precision_figure

__all__ = [
    "bars_figure",
    "campbell_figure",
    "force_figure",
    "free_for_picture",
    "front_figure",
    "growth_figure",
    "law_figure",
    "lift_figure",
    "map_figure",
    "method_figure",
    "pressure_figure",
    "profile_figure",
    "progress_figure",
    "save_figure",
    "scatter_figure",
    "spectrum_figure",
    "waterfall_figure",
    "work_precision_figure",
]
