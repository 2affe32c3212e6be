"""What a run gives back: histories, fields, a status with its cause, and figures of the run.

Imports `linalg` and `checks`. Results leave a run in blocks; a `Sink` takes them: memory, a file, a progress bar. A new
cause of an end is a line in `status`.
"""

from flexcam.response.blocks import Block, SaveAt, Sink
from flexcam.response.counting import Advance, Thing, counted
from flexcam.response.histories import STATE, History, Outline, Response
from flexcam.response.peaks import extent, peak, turning_points
from flexcam.response.series import SLOPES, Series
from flexcam.response.status import TOO_FINE, Cause, RunFailedError, Stats, Status, heed
from flexcam.response.unstable import NOT_POSITIVE, NotPositiveError, gives_way

__all__ = [
    "NOT_POSITIVE",
    "SLOPES",
    "STATE",
    "TOO_FINE",
    "Advance",
    "Block",
    "Cause",
    "History",
    "NotPositiveError",
    "Outline",
    "Response",
    "RunFailedError",
    "SaveAt",
    "Series",
    "Sink",
    "Stats",
    "Status",
    "Thing",
    "counted",
    "extent",
    "gives_way",
    "heed",
    "peak",
    "turning_points",
]
