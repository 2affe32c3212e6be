"""flexcam: flexible valve trains and cam mechanisms by finite elements.

``import flexcam`` loads nothing: every name below is imported when it is first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING

__version__ = "0.1.0"

if TYPE_CHECKING:
    from flexcam.analysis.comparison import compare
    from flexcam.analysis.natural_modes import modes
    from flexcam.analysis.preparation import prepare
    from flexcam.analysis.run import run
    from flexcam.analysis.run_checks import check_response
    from flexcam.cams import LAWS, LiftEvent
    from flexcam.case.builder import build_model
    from flexcam.case.case import Case
    from flexcam.case.reader import read_case
    from flexcam.core.errors import FlexcamError, InputError
    from flexcam.dynamics import (
        ConstantSpeed,
        Problem,
        Response,
        RunFailedError,
        SaveAt,
        Status,
        System,
        generalized_alpha,
        hht,
        newmark,
        solve,
    )
    from flexcam.fem.assembly import Damping, Member
    from flexcam.fem.mesh import Mesh
    from flexcam.fem.rigid_bodies import PointMass
    from flexcam.fem.sections import Material, Section
    from flexcam.io import Result, read_mesh, read_result, write_mesh
    from flexcam.valvetrain import Model

_MODULES = {
    "analysis.comparison": ("compare",),
    "analysis.natural_modes": ("modes",),
    "analysis.preparation": ("prepare",),
    "analysis.run": ("run",),
    "analysis.run_checks": ("check_response",),
    "cams": ("LAWS", "LiftEvent"),
    "case.builder": ("build_model",),
    "case.case": ("Case",),
    "case.reader": ("read_case",),
    "core.errors": ("FlexcamError", "InputError"),
    "dynamics": (
        "ConstantSpeed", "Problem", "Response", "RunFailedError", "SaveAt", "Status", "System", "generalized_alpha",
        "hht", "newmark", "solve",
    ),
    "fem.assembly": ("Damping", "Member"),
    "fem.mesh": ("Mesh",),
    "fem.rigid_bodies": ("PointMass",),
    "fem.sections": ("Material", "Section"),
    "io": ("Result", "read_mesh", "read_result", "write_mesh"),
    "valvetrain": ("Model",),
}  # fmt: skip
_HOME = {name: module for module, names in _MODULES.items() for name in names}

__all__ = [
    "LAWS", "Case", "ConstantSpeed", "Damping", "FlexcamError", "InputError", "LiftEvent", "Material", "Member", "Mesh",
    "Model", "PointMass", "Problem", "Response", "Result", "RunFailedError", "SaveAt", "Section", "Status", "System",
    "build_model", "check_response", "compare", "generalized_alpha", "hht", "modes", "newmark", "prepare", "read_case",
    "read_mesh", "read_result", "run", "solve", "write_mesh",
]  # fmt: skip


def __getattr__(name: str) -> object:
    """Import a public name on first use (PEP 562)."""
    if name not in _HOME:
        message = f"module 'flexcam' has no attribute {name!r}"
        raise AttributeError(message)
    value = getattr(import_module(f"flexcam.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
