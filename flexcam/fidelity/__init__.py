"""How good a model is: measures of deviation, and the claims of the papers held against the computation.

May import `run` and everything below it.
A new measure is a file here; the claims of another paper are a file like `claims`.
"""

from flexcam.fidelity.claims import Claim, claims, deviation, loaded_mode
from flexcam.fidelity.compare import Comparison, Deviation, compare

__all__ = ["Claim", "Comparison", "Deviation", "claims", "compare", "deviation", "loaded_mode"]
