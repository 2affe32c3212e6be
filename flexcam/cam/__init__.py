"""Cam and follower geometry: profile, contact, curvature, pressure angle, cutter path, and back to the lift.

May import `motion`, `linalg` and `checks`; knows no beam.
A new follower is a dataclass in `follower`; every function here then works with it.
"""

from flexcam.cam.follower import (
    FlatFollower,
    Follower,
    RollerFollower,
    SwingFlatFollower,
    SwingRollerFollower,
    Touch,
    Turn,
)
from flexcam.cam.limits import PRESSURE_ANGLE, Finding, findings, minimum_base_radius, undercut
from flexcam.cam.petrescu import petrescu_efficiency, petrescu_profile, relaxed_arm
from flexcam.cam.profile import CamProfile, ProfileExtremes, cam_profile, profile_at, profile_extremes
from flexcam.cam.reading import Bridge, bridged, lift_from_profile

__all__ = [
    "PRESSURE_ANGLE",
    "Bridge",
    "CamProfile",
    "Finding",
    "FlatFollower",
    "Follower",
    "ProfileExtremes",
    "RollerFollower",
    "SwingFlatFollower",
    "SwingRollerFollower",
    "Touch",
    "Turn",
    "bridged",
    "cam_profile",
    "findings",
    "lift_from_profile",
    "minimum_base_radius",
    "petrescu_efficiency",
    "petrescu_profile",
    "profile_at",
    "profile_extremes",
    "relaxed_arm",
    "undercut",
]
