"""Why a speed goes unstable, and at which speeds it does.

May import `runner` and everything below it; `view` draws and `console` prints what stands here.
Each cause is a file of its own, and a new one is another; `verdict` puts them together.
"""

from flexcam.stability.campbell import Campbell, campbell
from flexcam.stability.discrete import Discrete
from flexcam.stability.resonance import Resonance
from flexcam.stability.speeds import over_speeds
from flexcam.stability.verdict import Stability, stability

__all__ = ["Campbell", "Discrete", "Resonance", "Stability", "campbell", "over_speeds", "stability"]
