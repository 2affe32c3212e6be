"""The valve train: members, masses, springs, rockers, cams and contacts as a model, and its equations.

May import `cam`, `integrate`, `modal`, `fem`, `motion`, `system` and what is below them.
A new kind of part is a dataclass in `parts` and its rows in `assembled`; a new contact is a file like `published`.
"""

from flexcam.train.assembled import build_structure, member_masses
from flexcam.train.buckling import StiffStrut, buckling_load, stiff_struts
from flexcam.train.build import build_system
from flexcam.train.cam_contact import hertz_line
from flexcam.train.chain import Chain, chain_of, straight, without_compression
from flexcam.train.compression import compressed
from flexcam.train.fineness import Fineness, FinenessSink
from flexcam.train.free_running import free_running, free_speed
from flexcam.train.left_out import left_out
from flexcam.train.links import DAMPING_DEPTH
from flexcam.train.loads import element_loads
from flexcam.train.modal_basis import modal_basis
from flexcam.train.model import (
    Adjuster,
    Cam,
    CamContact,
    Contact,
    GivenLoad,
    Lash,
    Lever,
    MassAt,
    Model,
    PublishedLoad,
    Pulsation,
    Rocker,
    Seat,
    Spring,
    Wire,
)
from flexcam.train.modes import ModelModes, model_modes
from flexcam.train.operation import (
    BOUNCE_HEIGHT,
    OPEN,
    Figure,
    Seating,
    main_lift,
    operation,
    operation_names,
    seating,
    separation,
)
from flexcam.train.published import follower_train
from flexcam.train.reached import ReachedModes, contact_modes, holding, modes_on_the_lift
from flexcam.train.resolution import CoarseCam, coarse_cams
from flexcam.train.rigid import ANY_SPEED, build_rigid
from flexcam.train.rigid_standing import shared_forces, touching_coils
from flexcam.train.strength import MemberStrength, StrengthSink
from flexcam.train.structure import Structure
from flexcam.train.transfer import lift_transfer, valve_ratio

__all__ = [
    "ANY_SPEED",
    "BOUNCE_HEIGHT",
    "DAMPING_DEPTH",
    "OPEN",
    "Adjuster",
    "Cam",
    "CamContact",
    "Chain",
    "CoarseCam",
    "Contact",
    "Figure",
    "Fineness",
    "FinenessSink",
    "GivenLoad",
    "Lash",
    "Lever",
    "MassAt",
    "MemberStrength",
    "Model",
    "ModelModes",
    "PublishedLoad",
    "Pulsation",
    "ReachedModes",
    "Rocker",
    "Seat",
    "Seating",
    "Spring",
    "StiffStrut",
    "StrengthSink",
    "Structure",
    "Wire",
    "buckling_load",
    "build_rigid",
    "build_structure",
    "build_system",
    "chain_of",
    "coarse_cams",
    "compressed",
    "contact_modes",
    "element_loads",
    "follower_train",
    "free_running",
    "free_speed",
    "hertz_line",
    "holding",
    "left_out",
    "lift_transfer",
    "main_lift",
    "member_masses",
    "modal_basis",
    "model_modes",
    "modes_on_the_lift",
    "operation",
    "operation_names",
    "seating",
    "separation",
    "shared_forces",
    "stiff_struts",
    "straight",
    "touching_coils",
    "valve_ratio",
    "without_compression",
]
