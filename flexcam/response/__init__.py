"""What a run gives back: histories, fields, a status with its cause, and figures of the run.

Imports `linalg` and `checks`. Results leave a run in blocks; a `Sink` takes them: memory, a file, a progress bar. A new
cause of an end is a line in `status`.
"""

from flexcam.response.blocks import Block, SaveAt, Sink
from flexcam.response.counting import Advance, Thing, counted
from flexcam.response.histories import STATE, History, Outline, Response
from flexcam.response.series import Series
from flexcam.response.status import BUCKLED, TOO_FINE, Cause, RunFailedError, Stats, Status, heed

__all__ = [
    "BUCKLED",
    "STATE",
    "TOO_FINE",
    "Advance",
    "Block",
    "Cause",
    "History",
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
    "heed",
]
