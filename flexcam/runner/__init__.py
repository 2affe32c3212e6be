"""The one easy door: case, model, system, solve, response.

May import `case` and everything below it. What `flexcam.run` does can be done by hand with the parts it names.
A new part of what begins a run goes into `prepared`, of what keeps it into `saving`; no file is called after a
function, which it would hide.
"""

from flexcam.runner.figures import figures_of
from flexcam.runner.natural import mode_likeness, modes
from flexcam.runner.prepared import DEFAULT_STEPS_PER_REVOLUTION, Prepared, described, prepare, standing
from flexcam.runner.probes import scalar_probe
from flexcam.runner.saving import geometry_of, result_file, unfinished
from flexcam.runner.solving import budget_of, recent, run

__all__ = [
    "DEFAULT_STEPS_PER_REVOLUTION",
    "Prepared",
    "budget_of",
    "described",
    "figures_of",
    "geometry_of",
    "mode_likeness",
    "modes",
    "prepare",
    "recent",
    "result_file",
    "run",
    "scalar_probe",
    "standing",
    "unfinished",
]
