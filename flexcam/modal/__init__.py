"""Natural modes: frequencies, shapes and effective masses.

Knows matrices only; may import `linalg`, `checks` and `response` (for a status).
Another eigensolver goes into `modes`, another measure of modes is a file beside it.
"""

from flexcam.modal.effective import effective_masses
from flexcam.modal.mac import mac
from flexcam.modal.modes import Modes, modes
from flexcam.modal.reduction import corrected_modes, craig_bampton
from flexcam.modal.sdof import frequency_response, normalized_response

__all__ = [
    "Modes",
    "corrected_modes",
    "craig_bampton",
    "effective_masses",
    "frequency_response",
    "mac",
    "modes",
    "normalized_response",
]
