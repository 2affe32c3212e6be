"""Description and limits of the machine, and versions of packages."""

from __future__ import annotations

import os
import platform
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np

from benchmarks.timing import minimum_time

ORDER = 1500
LENGTH = 50_000_000
"""Numbers of an array: 0.4 GB, more than any cache."""


def describe() -> dict[str, str | int]:
    """Return processor, cores, system and the library of linear algebra."""
    blas = np.show_config(mode="dicts")["Build Dependencies"]["blas"]
    return {
        "processor": _processor(),
        "cores": os.cpu_count() or 1,
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "numpy": np.__version__,
        "blas": f"{blas['name']} {blas['version']}",
    }


def _processor() -> str:
    """Return the model of the processor, with family and model number if the system has them."""
    path = Path("/proc/cpuinfo")
    lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    found = {key.strip(): value.strip() for key, _, value in (line.partition(":") for line in lines)}
    if "model name" not in found:
        return platform.processor() or platform.machine()
    return f"{found['model name']} (family {found.get('cpu family')}, model {found.get('model')})"


def measure_limits() -> dict[str, float]:
    """Return the speed of one thread: matrix product of BLAS, GFlop/s, and ``a = b + c`` of long arrays, GB/s."""
    A = np.random.default_rng(0).standard_normal((ORDER, ORDER))
    product = minimum_time(lambda: A @ A)
    b, c = np.ones(LENGTH), np.ones(LENGTH)
    a = np.empty(LENGTH)
    a[:] = 0.0  # allocates its pages before the measurement
    total = minimum_time(lambda: np.add(b, c, out=a))
    return {"GFlop/s": 2.0 * ORDER**3 / product / 1e9, "GB/s": 3.0 * 8.0 * LENGTH / total / 1e9}


def today() -> str:
    """Return the date."""
    return datetime.now(UTC).date().isoformat()


def package_versions(*packages: str) -> dict[str, str]:
    """Return the versions of those packages that are installed."""
    found: dict[str, str] = {}
    for package in packages:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found
