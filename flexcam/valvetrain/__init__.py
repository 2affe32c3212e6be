"""The valve train as a value (`model`), its equations (`system_builder`), its rigid model and its metrics.

May import `dynamics`, `fem`, `cams` and `core`. A new part is a dataclass in `parts` and its rows in `structure`; a new
contact is a function in `contacts`.
"""

from flexcam.valvetrain.cam_contact import find_pivot, hertz_line
from flexcam.valvetrain.camshaft import free_running, free_speed, shaft_axes, undriven_shafts
from flexcam.valvetrain.mass_chain import Chain, build_chain, straighten, without_compression
from flexcam.valvetrain.model import Model
from flexcam.valvetrain.modes import (
    ContactModes,
    ModelModes,
    contact_modes,
    contact_stiffness,
    describe_inactive,
    explain_planes,
    lift_transfer,
    modal_basis,
    model_modes,
    modes_on_the_lift,
)
from flexcam.valvetrain.parts import (
    DAMPING_DEPTH,
    Adjuster,
    Cam,
    CamContact,
    CheckValve,
    Contact,
    FilmBearing,
    Friction,
    GivenLoad,
    Lash,
    Lever,
    LoadTable,
    Lubrication,
    MassAt,
    OilChamber,
    PlungerTravel,
    PublishedLoad,
    Pulsation,
    Rocker,
    Seat,
    Spring,
    Wire,
)
from flexcam.valvetrain.resolution import Resolution, ResolutionSink
from flexcam.valvetrain.rigid_kinematics import (
    connected_nodes,
    driving_contact,
    follower_train,
    largest_lashes,
    rocker_of,
    valve_ratio,
)
from flexcam.valvetrain.rigid_model import (
    build_rigid,
    cam_forces,
    omit_coil_stops,
    pulling_contacts,
    rigid_motion,
    shared_forces,
    touching_coils,
)
from flexcam.valvetrain.springs import nest_interference, radial_stiffness, share_ends
from flexcam.valvetrain.strength import MemberStrength, StrengthSink, buckling_load, compressed_members, stiff_struts
from flexcam.valvetrain.structure import Structure, build_structure, element_loads, member_masses
from flexcam.valvetrain.system_builder import build_system
from flexcam.valvetrain.train_metrics import (
    BOUNCE_HEIGHT,
    OPEN,
    Metric,
    Seating,
    contact_loss,
    extreme_history,
    main_lift,
    opposed_contacts,
    seating,
    separation,
    separation_by_flank,
    spring_held_contacts,
    train_metric_names,
    train_metrics,
    valve_loft,
    valve_seating,
)

__all__ = [
    "BOUNCE_HEIGHT", "DAMPING_DEPTH", "OPEN", "Adjuster", "Cam", "CamContact", "Chain", "CheckValve", "Contact",
    "ContactModes", "FilmBearing", "Friction", "GivenLoad", "Lash", "Lever", "LoadTable", "Lubrication", "MassAt",
    "MemberStrength", "Metric", "Model", "ModelModes", "OilChamber", "PlungerTravel", "PublishedLoad", "Pulsation",
    "Resolution", "ResolutionSink", "Rocker", "Seat", "Seating", "Spring", "StrengthSink", "Structure", "Wire",
    "buckling_load", "build_chain", "build_rigid", "build_structure", "build_system", "cam_forces",
    "compressed_members", "connected_nodes", "contact_loss", "contact_modes", "contact_stiffness", "describe_inactive",
    "driving_contact", "element_loads", "explain_planes", "extreme_history", "find_pivot", "follower_train",
    "free_running", "free_speed", "hertz_line", "largest_lashes", "lift_transfer", "main_lift", "member_masses",
    "modal_basis", "model_modes", "modes_on_the_lift", "nest_interference", "omit_coil_stops", "opposed_contacts",
    "pulling_contacts", "radial_stiffness", "rigid_motion", "rocker_of", "seating", "separation", "separation_by_flank",
    "shaft_axes", "share_ends", "shared_forces", "spring_held_contacts", "stiff_struts", "straighten", "touching_coils",
    "train_metric_names", "train_metrics", "undriven_shafts", "valve_loft", "valve_ratio", "valve_seating",
    "without_compression",
]  # fmt: skip
