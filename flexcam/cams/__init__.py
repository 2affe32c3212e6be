"""Motion laws, lift events, lift tables, cam profiles, followers and the synthesis of laws.

May import `core`. A new motion law is a class in `standard_laws` or `polynomial_laws` and a row in `law_registry`; a
new follower is a class in `followers`.
"""

from flexcam.cams.followers import (
    FlatFollower,
    Follower,
    FollowerContact,
    RollerFollower,
    SwingFlatFollower,
    SwingRollerFollower,
    Turn,
)
from flexcam.cams.harmonic_lift import (
    HarmonicFit,
    HarmonicLift,
    OrderSpectrum,
    Polydyne,
    SingleMass,
    Transfer,
    harmonic_fit,
    harmonics,
    harmonics_below,
    off_design_deviation,
    order_spectrum,
    polydyne,
)
from flexcam.cams.law_criteria import Criteria, Extreme, criteria, curve_minimum, residual_spectrum
from flexcam.cams.law_registry import KINDS, LAWS, LawKind, kind_names, law_kind
from flexcam.cams.lift_event import (
    THRESHOLDS,
    DelayedEvent,
    Event,
    Joint,
    LiftEvent,
    ValveEvent,
    centreline,
    event_extremes,
    joints,
    overlap,
    unique_event,
    valve_event,
)
from flexcam.cams.lift_table import LiftReport, PeriodicSpline, lift_table
from flexcam.cams.minimax import Synthesis, minimax, pareto
from flexcam.cams.motion_law import Law, Ramp, ReversedLaw
from flexcam.cams.polynomial_laws import BSplineLaw, Polynomial, quinquinomial, through_points
from flexcam.cams.profile import (
    PRESSURE_ANGLE,
    Bridge,
    CamProfile,
    ProfileFault,
    cam_profile,
    find_bridges,
    find_profile_faults,
    lift_from_profile,
    minimum_base_radius,
    profile_at,
    undercut,
)
from flexcam.cams.standard_laws import CompoundCycloid, CosineSum, Harmonic, Scca, harmonic_acceleration
from flexcam.cams.synthesis_family import Family, HarmonicFamily, SplineFamily

__all__ = [
    "KINDS", "LAWS", "PRESSURE_ANGLE", "THRESHOLDS", "BSplineLaw", "Bridge", "CamProfile", "CompoundCycloid",
    "CosineSum", "Criteria", "DelayedEvent", "Event", "Extreme", "Family", "FlatFollower", "Follower",
    "FollowerContact", "Harmonic", "HarmonicFamily", "HarmonicFit", "HarmonicLift", "Joint", "Law", "LawKind",
    "LiftEvent", "LiftReport", "OrderSpectrum", "PeriodicSpline", "Polydyne", "Polynomial",
    "ProfileFault", "Ramp", "ReversedLaw", "RollerFollower", "Scca", "SingleMass", "SplineFamily",
    "SwingFlatFollower", "SwingRollerFollower", "Synthesis", "Transfer", "Turn", "ValveEvent", "cam_profile",
    "centreline", "criteria", "curve_minimum", "event_extremes", "find_bridges", "find_profile_faults",
    "harmonic_acceleration", "harmonic_fit", "harmonics", "harmonics_below", "joints", "kind_names", "law_kind",
    "lift_from_profile", "lift_table", "minimax", "minimum_base_radius", "off_design_deviation", "order_spectrum",
    "overlap", "pareto", "polydyne", "profile_at", "quinquinomial", "residual_spectrum", "through_points",
    "undercut", "unique_event", "valve_event",
]  # fmt: skip
