"""Motion laws and lift events: normalized laws, their derivatives, and the lift of a cam over its angle.

Knows no beam; may import `linalg` (array types) and `checks`.
A new law is one file with one frozen dataclass, and one line in `LAWS`.
"""

from collections.abc import Mapping
from types import MappingProxyType

from flexcam.motion.cycloidal import Cycloidal
from flexcam.motion.event import LiftEvent
from flexcam.motion.law import Law
from flexcam.motion.parabolic import Parabolic
from flexcam.motion.shm import SimpleHarmonic

LAWS: Mapping[str, Law] = MappingProxyType(
    {"shm": SimpleHarmonic(), "parabolic": Parabolic(), "cycloidal": Cycloidal()}
)
"""Every law by the name a case file gives it."""

__all__ = ["LAWS", "Cycloidal", "Law", "LiftEvent", "Parabolic", "SimpleHarmonic"]
