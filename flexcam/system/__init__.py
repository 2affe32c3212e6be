"""The seam between the physics and everything that works on it: matrices, separable loads, local forces (`equations`).

Knows no beam and no integrator; may import `linalg` and `checks`.
A new kind of load or force that fits the equations needs nothing here; another form of a law for the compiled way is a
`Kind` in `formula`, another drive of the camshaft a class in `drive`, another basis one in `basis`.
"""

from flexcam.system.basis import Basis, Selection, Shapes, projected
from flexcam.system.channel import Channel, Motions, Moved, Observable, Observed, force_sum, load_sum, row_of, total
from flexcam.system.drive import CamMotion, ConstantSpeed, Drive, FluctuatingSpeed, SpeedByAngle
from flexcam.system.equations import Carried, Load, Probe, System
from flexcam.system.evaluated import Evaluated, Following
from flexcam.system.formula import ONE, Formula, Formulated, Kind
from flexcam.system.local import (
    AngleFunction,
    AngleVector,
    Changing,
    Constant,
    LocalForce,
    LocalLaw,
    Reaction,
    Resting,
    Smooth,
    Stored,
    Storing,
    constant,
    derivative,
)
from flexcam.system.reach import Reach, Still, reach

__all__ = [
    "ONE",
    "AngleFunction",
    "AngleVector",
    "Basis",
    "CamMotion",
    "Carried",
    "Changing",
    "Channel",
    "Constant",
    "ConstantSpeed",
    "Drive",
    "Evaluated",
    "FluctuatingSpeed",
    "Following",
    "Formula",
    "Formulated",
    "Kind",
    "Load",
    "LocalForce",
    "LocalLaw",
    "Motions",
    "Moved",
    "Observable",
    "Observed",
    "Probe",
    "Reach",
    "Reaction",
    "Resting",
    "Selection",
    "Shapes",
    "Smooth",
    "SpeedByAngle",
    "Still",
    "Stored",
    "Storing",
    "System",
    "constant",
    "derivative",
    "force_sum",
    "load_sum",
    "projected",
    "reach",
    "row_of",
    "total",
]
