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
from flexcam.cams.harmonic_fit import HarmonicFit, harmonic_fit, harmonics_below
from flexcam.cams.law_criteria import Criteria, Extreme, criteria, curve_minimum, residual_spectrum
from flexcam.cams.law_registry import KINDS, LAWS, LawKind, kind_names, law_kind
from flexcam.cams.lift_event import DelayedEvent, Event, Joint, LiftEvent, event_extremes, joints
from flexcam.cams.lift_table import LiftReport, lift_table
from flexcam.cams.minimax import Synthesis, minimax, pareto
from flexcam.cams.motion_law import Law, ReversedLaw
from flexcam.cams.periodic_lift import HarmonicLift, OrderSpectrum, PeriodicSpline, harmonics, order_spectrum
from flexcam.cams.polydyne import Polydyne, SingleMass, Transfer, motion_at, off_design_deviation, polydyne
from flexcam.cams.polynomial_laws import BSplineLaw, Polynomial, quinquinomial, through_points
from flexcam.cams.profile import (
    PRESSURE_ANGLE,
    CamProfile,
    ProfileExtremes,
    ProfileFault,
    cam_profile,
    find_profile_faults,
    minimum_base_radius,
    petrescu_efficiency,
    petrescu_profile,
    profile_at,
    profile_extremes,
    relaxed_offset,
    undercut,
)
from flexcam.cams.profile_reading import Bridge, find_bridges, lift_from_profile
from flexcam.cams.ramps import Ramp
from flexcam.cams.standard_laws import (
    CompoundCycloid,
    CosineSum,
    Cycloidal,
    Harmonic,
    Parabolic,
    Scca,
    SimpleHarmonic,
    harmonic_acceleration,
)
from flexcam.cams.synthesis_family import Family, HarmonicFamily, SplineFamily
from flexcam.cams.valve_events import THRESHOLDS, ValveEvent, overlap, valve_event

__all__ = [
    "KINDS",
    "LAWS",
    "PRESSURE_ANGLE",
    "THRESHOLDS",
    "BSplineLaw",
    "Bridge",
    "CamProfile",
    "CompoundCycloid",
    "CosineSum",
    "Criteria",
    "Cycloidal",
    "DelayedEvent",
    "Event",
    "Extreme",
    "Family",
    "FlatFollower",
    "Follower",
    "FollowerContact",
    "Harmonic",
    "HarmonicFamily",
    "HarmonicFit",
    "HarmonicLift",
    "Joint",
    "Law",
    "LawKind",
    "LiftEvent",
    "LiftReport",
    "OrderSpectrum",
    "Parabolic",
    "PeriodicSpline",
    "Polydyne",
    "Polynomial",
    "ProfileExtremes",
    "ProfileFault",
    "Ramp",
    "ReversedLaw",
    "RollerFollower",
    "Scca",
    "SimpleHarmonic",
    "SingleMass",
    "SplineFamily",
    "SwingFlatFollower",
    "SwingRollerFollower",
    "Synthesis",
    "Transfer",
    "Turn",
    "ValveEvent",
    "cam_profile",
    "criteria",
    "curve_minimum",
    "event_extremes",
    "find_bridges",
    "find_profile_faults",
    "harmonic_acceleration",
    "harmonic_fit",
    "harmonics",
    "harmonics_below",
    "joints",
    "kind_names",
    "law_kind",
    "lift_from_profile",
    "lift_table",
    "minimax",
    "minimum_base_radius",
    "motion_at",
    "off_design_deviation",
    "order_spectrum",
    "overlap",
    "pareto",
    "petrescu_efficiency",
    "petrescu_profile",
    "polydyne",
    "profile_at",
    "profile_extremes",
    "quinquinomial",
    "relaxed_offset",
    "residual_spectrum",
    "through_points",
    "undercut",
    "valve_event",
]
