"""What is installed: versions, the compiler, and which extras are usable."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec

from flexcam.integrate import jit

_PACKAGES = ("flexcam", "numpy", "scipy", "h5py", "meshio", "pydantic", "matplotlib", "pyvista", "numba")
_EXTRAS = {
    "tables": ("pandas", "pyarrow", "xarray"),
    "cluster": ("distributed",),
    "movie": ("imageio", "imageio_ffmpeg"),
    "html": ("trame_vtk",),
    "design": ("pymoo",),
}
"""Extras of the package and the modules each needs."""


def installed() -> dict[str, str]:
    """Return what this installation consists of."""
    versions = {name: _version(name) for name in _PACKAGES}
    extras = {f"extra {name}": _usable(name, modules) for name, modules in _EXTRAS.items()}
    return {
        "python": f"{platform.python_version()}, {platform.platform()}",
        **versions,
        "compiled code": _code(),
        **extras,
    }


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


def _code() -> str:
    if not jit.is_available():
        return "no compiler: install numba for long runs and contacts"
    return f"compiled, cached in {jit.cache_root()}"


def _usable(extra: str, modules: tuple[str, ...]) -> str:
    missing = [name for name in modules if find_spec(name) is None]
    return f"not there ({', '.join(missing)}): pip install 'flexcam[{extra}]'" if missing else "usable"
