"""How good a model is: measures of deviation, claims and closed forms of papers, and chains of few masses.

May import `runner` and everything below it.
A new measure is a file here; the claims of another paper are a file like `claims`.
"""

from flexcam.fidelity.chain import chain, chain_run
from flexcam.fidelity.choose import Choice, choose, chosen
from flexcam.fidelity.claims import Claim, claims, deviation, loaded_mode
from flexcam.fidelity.compare import Comparison, Deviation, between, compare
from flexcam.fidelity.estimate import Error, estimate
from flexcam.fidelity.measure import Measured, distance, measured
from flexcam.fidelity.petrescu import OneMass, Setting, setting
from flexcam.fidelity.rungs import Rung, ladder
from flexcam.fidelity.settings import settings_of
from flexcam.fidelity.trade import Reference, Traded, reference, trade, tried

__all__ = [
    "Choice",
    "Claim",
    "Comparison",
    "Deviation",
    "Error",
    "Measured",
    "OneMass",
    "Reference",
    "Rung",
    "Setting",
    "Traded",
    "between",
    "chain",
    "chain_run",
    "choose",
    "chosen",
    "claims",
    "compare",
    "deviation",
    "distance",
    "estimate",
    "ladder",
    "loaded_mode",
    "measured",
    "reference",
    "setting",
    "settings_of",
    "trade",
    "tried",
]
