"""Motion laws and lift events: normalized laws, their derivatives, and the lift of a cam over its angle.

Knows no beam; may import `linalg` (array types) and `checks`.
A new law is one file with one frozen dataclass, and one line in `registry`.
"""

from flexcam.motion.bspline import BSplineLaw, through_points
from flexcam.motion.cosine import CosineSum
from flexcam.motion.criteria import Criteria, Extreme, criteria
from flexcam.motion.cycloidal import Cycloidal
from flexcam.motion.event import Event, LiftEvent, Shifted
from flexcam.motion.extent import event_extremes
from flexcam.motion.extremes import lowest
from flexcam.motion.fb2 import CompoundCycloid
from flexcam.motion.harmonic import Harmonic
from flexcam.motion.harmonic_acceleration import harmonic_acceleration
from flexcam.motion.joints import Joint, joints
from flexcam.motion.law import Law
from flexcam.motion.lift_table import LiftReport, lift_table
from flexcam.motion.orders import OrderSpectrum, order_spectrum
from flexcam.motion.parabolic import Parabolic
from flexcam.motion.periodic import HarmonicLift, PeriodicSpline, harmonics
from flexcam.motion.polynomial import Polynomial, quinquinomial
from flexcam.motion.ramp import Ramp
from flexcam.motion.registry import KINDS, LAWS, LawKind, kind_names, law_kind
from flexcam.motion.scca import Scca
from flexcam.motion.shm import SimpleHarmonic
from flexcam.motion.spectrum import residual_spectrum
from flexcam.motion.turned import Turned
from flexcam.motion.valve_events import THRESHOLDS, ValveEvent, overlap, valve_event

__all__ = [
    "KINDS",
    "LAWS",
    "THRESHOLDS",
    "BSplineLaw",
    "CompoundCycloid",
    "CosineSum",
    "Criteria",
    "Cycloidal",
    "Event",
    "Extreme",
    "Harmonic",
    "HarmonicLift",
    "Joint",
    "Law",
    "LawKind",
    "LiftEvent",
    "LiftReport",
    "OrderSpectrum",
    "Parabolic",
    "PeriodicSpline",
    "Polynomial",
    "Ramp",
    "Scca",
    "Shifted",
    "SimpleHarmonic",
    "Turned",
    "ValveEvent",
    "criteria",
    "event_extremes",
    "harmonic_acceleration",
    "harmonics",
    "joints",
    "kind_names",
    "law_kind",
    "lift_table",
    "lowest",
    "order_spectrum",
    "overlap",
    "quinquinomial",
    "residual_spectrum",
    "through_points",
    "valve_event",
]
