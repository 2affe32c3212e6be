"""flexcam: flexible valve trains and cam mechanisms by finite elements.

``import flexcam`` loads nothing: every name below is fetched from its room when it is first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING

__version__ = "0.1.0"

if TYPE_CHECKING:
    from flexcam.case import Case, build_model, read_case
    from flexcam.checks import FlexcamError, InputError
    from flexcam.fem import Damping, Material, Member, Mesh, PointMass, Section
    from flexcam.fidelity import compare
    from flexcam.integrate import Problem, generalized_alpha, hht, newmark, solve
    from flexcam.io import Result, read_mesh, read_result, write_mesh
    from flexcam.motion import LAWS, LiftEvent
    from flexcam.response import Response, RunFailedError, SaveAt, Status
    from flexcam.runner import modes, prepare, run
    from flexcam.system import ConstantSpeed, System
    from flexcam.train import Model

_ROOMS = {
    "case": ("Case", "build_model", "read_case"),
    "checks": ("FlexcamError", "InputError"),
    "fem": ("Damping", "Material", "Member", "Mesh", "PointMass", "Section"),
    "fidelity": ("compare",),
    "integrate": ("Problem", "generalized_alpha", "hht", "newmark", "solve"),
    "io": ("Result", "read_mesh", "read_result", "write_mesh"),
    "motion": ("LAWS", "LiftEvent"),
    "response": ("Response", "RunFailedError", "SaveAt", "Status"),
    "runner": ("modes", "prepare", "run"),
    "system": ("ConstantSpeed", "System"),
    "train": ("Model",),
}
_HOME = {name: room for room, names in _ROOMS.items() for name in names}

__all__ = [
    "LAWS",
    "Case",
    "ConstantSpeed",
    "Damping",
    "FlexcamError",
    "InputError",
    "LiftEvent",
    "Material",
    "Member",
    "Mesh",
    "Model",
    "PointMass",
    "Problem",
    "Response",
    "Result",
    "RunFailedError",
    "SaveAt",
    "Section",
    "Status",
    "System",
    "build_model",
    "compare",
    "generalized_alpha",
    "hht",
    "modes",
    "newmark",
    "prepare",
    "read_case",
    "read_mesh",
    "read_result",
    "run",
    "solve",
    "write_mesh",
]


def __getattr__(name: str) -> object:
    """Fetch a public name from its room on first use (PEP 562)."""
    if name not in _HOME:
        message = f"module 'flexcam' has no attribute {name!r}"
        raise AttributeError(message)
    value = getattr(import_module(f"flexcam.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
