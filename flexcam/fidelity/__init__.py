"""How good a model is: measures of deviation, claims and closed forms of papers, and chains of few masses.

May import `run` and everything below it.
A new measure is a file here; the claims of another paper are a file like `claims`.
"""

from flexcam.fidelity.chain import Chain, chain, chain_run
from flexcam.fidelity.claims import Claim, claims, deviation, loaded_mode
from flexcam.fidelity.compare import Comparison, Deviation, compare
from flexcam.fidelity.petrescu import OneMass, Setting, setting
from flexcam.fidelity.settings import settings_of

__all__ = [
    "Chain",
    "Claim",
    "Comparison",
    "Deviation",
    "OneMass",
    "Setting",
    "chain",
    "chain_run",
    "claims",
    "compare",
    "deviation",
    "loaded_mode",
    "setting",
    "settings_of",
]
