"""The seam between the physics and everything that works on it: see `equations`."""

from flexcam.system.channel import Channel, Observable, Observed, force_sum, load_sum, row_of, total
from flexcam.system.drive import CamMotion, ConstantSpeed, Drive, FluctuatingSpeed, SpeedByAngle
from flexcam.system.equations import Load, Probe, System
from flexcam.system.local import (
    AngleFunction,
    AngleVector,
    LocalForce,
    LocalLaw,
    Reaction,
    Resting,
    Stored,
    Storing,
    constant,
    derivative,
)

__all__ = [
    "AngleFunction",
    "AngleVector",
    "CamMotion",
    "Channel",
    "ConstantSpeed",
    "Drive",
    "FluctuatingSpeed",
    "Load",
    "LocalForce",
    "LocalLaw",
    "Observable",
    "Observed",
    "Probe",
    "Reaction",
    "Resting",
    "SpeedByAngle",
    "Stored",
    "Storing",
    "System",
    "constant",
    "derivative",
    "force_sum",
    "load_sum",
    "row_of",
    "total",
]
