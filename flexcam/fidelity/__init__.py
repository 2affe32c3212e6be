"""How good a model is: measures of deviation, and the claims of the papers held against the computation.

May import `run` and everything below it.
A new measure is a file here; the claims of another paper are a file like `claims`.
"""

from flexcam.fidelity.claims import Claim, claims, deviation, loaded_mode
from flexcam.fidelity.compare import Comparison, Deviation, compare
from flexcam.fidelity.petrescu import OneMass, Setting, setting
from flexcam.fidelity.settings import settings_of

__all__ = [
    "Claim",
    "Comparison",
    "Deviation",
    "OneMass",
    "Setting",
    "claims",
    "compare",
    "deviation",
    "loaded_mode",
    "setting",
    "settings_of",
]
