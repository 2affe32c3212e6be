"""Curves with matplotlib and mechanisms in 3D with pyvista; a module of figures is loaded when it is first used.

May import `case` and everything below it; results of `analysis` occur only in annotations. A new figure is a function
that draws into given axes; a new solid is a function in `scene.parts`.
"""

from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from flexcam.plotting import curves as curves
    from flexcam.plotting import figures as figures
    from flexcam.plotting import histories as histories
    from flexcam.plotting import spectra as spectra

_MODULES = ("curves", "figures", "histories", "spectra")


def __getattr__(name: str) -> ModuleType:
    """Import a module of figures on first use (PEP 562): matplotlib takes longer to load than many commands to run."""
    if name not in _MODULES:
        message = f"module {__name__!r} has no attribute {name!r}"
        raise AttributeError(message)
    return import_module(f"{__name__}.{name}")
