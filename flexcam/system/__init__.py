"""The equations of a mechanism: matrices, separable loads, local forces (`equations`), and their force laws.

Knows no beam and no integrator; may import `linalg` and `checks`.
A new force law is a function and a row of the table in `force_laws`, another drive of the camshaft a class in `drive`,
another basis one in `basis`.
"""

from flexcam.system.angle_functions import ONE, AngleFunction, AngleVector, Constant, constant, derivative
from flexcam.system.basis import Basis, Selection, Shapes, projected
from flexcam.system.channel import Channel, Motions, Moved, Observable, Observed, force_sum, load_sum, row_of, total
from flexcam.system.drive import CamMotion, ConstantSpeed, Drive, FluctuatingSpeed, SpeedByAngle
from flexcam.system.equations import Carried, Load, Probe, System
from flexcam.system.evaluated import Evaluated, Following
from flexcam.system.force_laws import ForceLaw, elastic_stop, hunt_crossley_contact, oil_column_law, spring_damper
from flexcam.system.local import CustomLaw, LocalForce, Reaction

__all__ = [
    "ONE",
    "AngleFunction",
    "AngleVector",
    "Basis",
    "CamMotion",
    "Carried",
    "Channel",
    "Constant",
    "ConstantSpeed",
    "CustomLaw",
    "Drive",
    "Evaluated",
    "FluctuatingSpeed",
    "Following",
    "ForceLaw",
    "Load",
    "LocalForce",
    "Motions",
    "Moved",
    "Observable",
    "Observed",
    "Probe",
    "Reaction",
    "Selection",
    "Shapes",
    "SpeedByAngle",
    "System",
    "constant",
    "derivative",
    "elastic_stop",
    "force_sum",
    "hunt_crossley_contact",
    "load_sum",
    "oil_column_law",
    "projected",
    "row_of",
    "spring_damper",
    "total",
]
