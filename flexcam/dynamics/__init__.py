"""The equations of motion of a mechanism, its force laws, and the methods that solve them.

May import `core`; independent of beams, cams and valve trains. A new force law is a function and a row of the table
in `force_laws`; a new integrator is a file next to `central_difference`.
"""

from flexcam.dynamics.active_dofs import (
    ActiveDofs,
    InactiveGroup,
    active_dofs_of,
    basis_of,
    find_active_dofs,
    integrated_size,
    method_refusal,
)
from flexcam.dynamics.basis import Basis, DofSubset, ModeBasis, project_system
from flexcam.dynamics.bathe import Bathe, bathe
from flexcam.dynamics.blocks import SLOPES, Block, ProgressCallback, SaveAt, Series, Sink, track_progress
from flexcam.dynamics.cam_motion import (
    ONE,
    AngleFunction,
    AngleVector,
    CamFunctionCache,
    CamMotion,
    Constant,
    ConstantSpeed,
    DerivedCamFunction,
    Drive,
    FluctuatingSpeed,
    Phaser,
    ShiftedFunction,
    SpeedByAngle,
    constant,
    derivative,
)
from flexcam.dynamics.central_difference import CentralDifference, central_difference, highest_frequency
from flexcam.dynamics.collocation import Collocation, collocation
from flexcam.dynamics.engine_selection import collocation_refinement, default_method
from flexcam.dynamics.generalized_alpha import Scheme, generalized_alpha, hht, newmark
from flexcam.dynamics.integrator import Method
from flexcam.dynamics.law_data import ForceLaw, elastic_stop, hunt_crossley_contact, oil_column_law, spring_damper
from flexcam.dynamics.linearization import Tangents
from flexcam.dynamics.modes import (
    Modes,
    corrected_modes,
    craig_bampton,
    frequency_response,
    mac,
    modes,
    normalized_response,
)
from flexcam.dynamics.parameter_forces import Variation
from flexcam.dynamics.periodic import Floquet, floquet, solve_periodic
from flexcam.dynamics.problem import Adaptive, EngineName, Problem, State
from flexcam.dynamics.reference_integrators import ScipyIntegrator, dop853, radau
from flexcam.dynamics.response import (
    SERIES,
    STATE,
    History,
    Outline,
    Response,
    check_scalar_probe,
    component_unit,
    peak,
    scalar_history,
    scalar_probes,
    turning_points,
    value_range,
)
from flexcam.dynamics.solve import fingerprint, outline, prescribed_probes, solve
from flexcam.dynamics.statics import equilibrium, installed_state, moving_equilibrium, static_displacement
from flexcam.dynamics.status import (
    NOT_POSITIVE,
    ROUNDING_STATUS,
    Cause,
    NotPositiveError,
    RunFailedError,
    Stats,
    Status,
    instability_status,
    reraise_interrupt,
)
from flexcam.dynamics.system import (
    Channel,
    CustomLaw,
    Load,
    LocalForce,
    MotionView,
    Observable,
    Observation,
    PrescribedMotion,
    Probe,
    Reaction,
    System,
    force_sum,
    load_sum,
    observable_sum,
    row_of,
)
from flexcam.dynamics.tangent import TangentRun, tangent_run

__all__ = [
    "NOT_POSITIVE", "ONE", "ROUNDING_STATUS", "SERIES", "SLOPES", "STATE", "ActiveDofs", "Adaptive", "AngleFunction",
    "AngleVector", "Basis", "Bathe", "Block", "CamFunctionCache", "CamMotion", "Cause", "CentralDifference", "Channel",
    "Collocation", "Constant", "ConstantSpeed", "CustomLaw", "DerivedCamFunction", "DofSubset", "Drive", "EngineName",
    "Floquet", "FluctuatingSpeed", "ForceLaw", "History", "InactiveGroup", "Load", "LocalForce", "Method", "ModeBasis",
    "Modes", "MotionView", "NotPositiveError", "Observable", "Observation", "Outline", "Phaser", "PrescribedMotion",
    "Probe", "Problem", "ProgressCallback", "Reaction", "Response", "RunFailedError", "SaveAt", "Scheme",
    "ScipyIntegrator", "Series", "ShiftedFunction", "Sink", "SpeedByAngle", "State", "Stats", "Status", "System",
    "TangentRun", "Tangents", "Variation", "active_dofs_of", "basis_of", "bathe", "central_difference",
    "check_scalar_probe", "collocation", "collocation_refinement", "component_unit", "constant", "corrected_modes",
    "craig_bampton", "default_method", "derivative", "dop853", "elastic_stop", "equilibrium", "find_active_dofs",
    "fingerprint", "floquet", "force_sum", "frequency_response", "generalized_alpha", "hht", "highest_frequency",
    "hunt_crossley_contact", "instability_status", "installed_state", "integrated_size", "load_sum", "mac",
    "method_refusal", "modes", "moving_equilibrium", "newmark", "normalized_response", "observable_sum",
    "oil_column_law", "outline", "peak", "prescribed_probes", "project_system", "radau", "reraise_interrupt", "row_of",
    "scalar_history", "scalar_probes", "solve", "solve_periodic", "spring_damper", "static_displacement", "tangent_run",
    "track_progress", "turning_points", "value_range",
]  # fmt: skip
