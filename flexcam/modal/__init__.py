"""Natural modes: frequencies, shapes, effective masses and what moves in them.

Knows matrices only; may import `linalg` and `response` (for a status).
"""

from flexcam.modal.modes import Modes, modes

__all__ = ["Modes", "modes"]
