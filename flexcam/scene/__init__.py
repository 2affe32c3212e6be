"""Scenes: a mechanism as solids in space at an instant, as arrays of points and triangles.

May import `case` and everything below it; knows no renderer. A new kind of part is a file that returns solids, its
place in `layout` and a line in `assembly`.
"""

from flexcam.scene.assembly import Mechanism, mechanism
from flexcam.scene.full_lift import full_lift
from flexcam.scene.instant import Instant
from flexcam.scene.motion import Motion, case_motion, mode_motion, result_motion
from flexcam.scene.solid import Solid, loft, merged

__all__ = [
    "Instant",
    "Mechanism",
    "Motion",
    "Solid",
    "case_motion",
    "full_lift",
    "loft",
    "mechanism",
    "merged",
    "mode_motion",
    "result_motion",
]
