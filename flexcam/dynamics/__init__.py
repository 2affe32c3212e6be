"""The equations of motion of a mechanism, its force laws, and the methods that solve them.

May import `core`; knows neither beams nor cams nor valve trains. A new force law is a function and a row of the table
in `force_laws`; a new integrator is a file beside `central_difference`.
"""

from flexcam.dynamics.active_dofs import ActiveDofs, InactiveGroup, find_active_dofs
from flexcam.dynamics.angle_functions import (
    ONE,
    AngleFunction,
    AngleVector,
    CamFunctionCache,
    Constant,
    DerivedCamFunction,
    constant,
    derivative,
)
from flexcam.dynamics.basis import Basis, DofSubset, ModeBasis, project_system
from flexcam.dynamics.bathe import Bathe, bathe
from flexcam.dynamics.blocks import SLOPES, Block, Item, ProgressCallback, SaveAt, Series, Sink, track_progress
from flexcam.dynamics.cam_motion import CamMotion, ConstantSpeed, Drive, FluctuatingSpeed, SpeedByAngle
from flexcam.dynamics.central_difference import CentralDifference, central_difference, highest_frequency
from flexcam.dynamics.exact_modes import Exact, exact
from flexcam.dynamics.floquet import Floquet, floquet
from flexcam.dynamics.force_laws import ForceLaw, elastic_stop, hunt_crossley_contact, oil_column_law, spring_damper
from flexcam.dynamics.generalized_alpha import Scheme, generalized_alpha, hht, newmark
from flexcam.dynamics.integrator import Method
from flexcam.dynamics.linearization import Tangents
from flexcam.dynamics.modal_reduction import corrected_modes, craig_bampton, effective_masses, mac
from flexcam.dynamics.modes import Modes, frequency_response, modes, normalized_response
from flexcam.dynamics.periodic import solve_periodic
from flexcam.dynamics.problem import Adaptive, Engine, Problem, State
from flexcam.dynamics.reduced_problem import active_dofs_of, basis_of, integrated_size, method_refusal
from flexcam.dynamics.response import STATE, History, Outline, Response, peak, turning_points, value_range
from flexcam.dynamics.scipy_reference import ScipyIntegrator, dop853, radau
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
    FullMotion,
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

__all__ = [
    "NOT_POSITIVE",
    "ONE",
    "ROUNDING_STATUS",
    "SLOPES",
    "STATE",
    "ActiveDofs",
    "Adaptive",
    "AngleFunction",
    "AngleVector",
    "Basis",
    "Bathe",
    "Block",
    "CamFunctionCache",
    "CamMotion",
    "Cause",
    "CentralDifference",
    "Channel",
    "Constant",
    "ConstantSpeed",
    "CustomLaw",
    "DerivedCamFunction",
    "DofSubset",
    "Drive",
    "Engine",
    "Exact",
    "Floquet",
    "FluctuatingSpeed",
    "ForceLaw",
    "FullMotion",
    "History",
    "InactiveGroup",
    "Item",
    "Load",
    "LocalForce",
    "Method",
    "ModeBasis",
    "Modes",
    "MotionView",
    "NotPositiveError",
    "Observable",
    "Observation",
    "Outline",
    "PrescribedMotion",
    "Probe",
    "Problem",
    "ProgressCallback",
    "Reaction",
    "Response",
    "RunFailedError",
    "SaveAt",
    "Scheme",
    "ScipyIntegrator",
    "Series",
    "Sink",
    "SpeedByAngle",
    "State",
    "Stats",
    "Status",
    "System",
    "Tangents",
    "active_dofs_of",
    "basis_of",
    "bathe",
    "central_difference",
    "constant",
    "corrected_modes",
    "craig_bampton",
    "derivative",
    "dop853",
    "effective_masses",
    "elastic_stop",
    "equilibrium",
    "exact",
    "find_active_dofs",
    "fingerprint",
    "floquet",
    "force_sum",
    "frequency_response",
    "generalized_alpha",
    "hht",
    "highest_frequency",
    "hunt_crossley_contact",
    "instability_status",
    "installed_state",
    "integrated_size",
    "load_sum",
    "mac",
    "method_refusal",
    "modes",
    "moving_equilibrium",
    "newmark",
    "normalized_response",
    "observable_sum",
    "oil_column_law",
    "outline",
    "peak",
    "prescribed_probes",
    "project_system",
    "radau",
    "reraise_interrupt",
    "row_of",
    "solve",
    "solve_periodic",
    "spring_damper",
    "static_displacement",
    "track_progress",
    "turning_points",
    "value_range",
]
