"""Motion laws and lift events: normalized laws, their derivatives, and the lift of a cam over its angle.

Knows no beam; may import `linalg` (array types) and `checks`.
A new law is one file with one frozen dataclass, and one line in `LAWS`.
"""

from collections.abc import Mapping
from types import MappingProxyType

from flexcam.motion.criteria import Criteria, criteria
from flexcam.motion.cycloidal import Cycloidal
from flexcam.motion.event import LiftEvent
from flexcam.motion.harmonic import FREUDENSTEIN, GUTMAN, Harmonic
from flexcam.motion.law import Law
from flexcam.motion.parabolic import Parabolic
from flexcam.motion.polynomial import Polynomial
from flexcam.motion.scca import Scca
from flexcam.motion.shm import SimpleHarmonic

LAWS: Mapping[str, Law] = MappingProxyType(
    {
        "shm": SimpleHarmonic(),
        "parabolic": Parabolic(),
        "cycloidal": Cycloidal(),
        "modified-trapezoid": Scca(0.25, 0.5, 0.25),
        "modified-sine": Scca(0.25, 0.0, 0.75),
        "2-3": Polynomial((2, 3)),
        "3-4-5": Polynomial((3, 4, 5)),
        "4-5-6-7": Polynomial((4, 5, 6, 7)),
        "5-6-7-8-9": Polynomial((5, 6, 7, 8, 9)),
        "gutman-1-3": GUTMAN,
        "freudenstein-1-3": FREUDENSTEIN,
    }
)
"""Every law by the name a case file gives it."""

__all__ = [
    "LAWS",
    "Criteria",
    "Cycloidal",
    "Harmonic",
    "Law",
    "LiftEvent",
    "Parabolic",
    "Polynomial",
    "Scca",
    "SimpleHarmonic",
    "criteria",
]
