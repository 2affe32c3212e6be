"""Where a result is looked at when nobody says where: at full lift."""

from __future__ import annotations

import numpy as np

from flexcam.case import Case
from flexcam.fem import ROTATIONS
from flexcam.linalg import FloatArray
from flexcam.response import Response


def full_lift(case: Case, response: Response, angle: FloatArray) -> int:
    """Return the instant at which the valve is farthest from where it was installed."""
    at = np.minimum(np.searchsorted(response.angle, angle - 1e-9), len(response.angle) - 1)
    points = {rocker.to for rocker in case.record.rockers.values()}
    names = [name for name, _ in response.outline.probes]
    for chosen in ([name for name in names if name in points], [name for name in names if "." not in name]):
        paths = [np.abs(path[at]) for name in chosen for path in _paths(response, name)]
        farthest = max(paths, key=lambda path: float(np.ptp(path)), default=np.zeros(1))
        if np.ptp(farthest) > 0.0:
            return int(np.argmax(farthest))
    return len(angle) - 1


def _paths(response: Response, probe: str) -> list[FloatArray]:
    """Return the displacements of a probe along lines, shape (m,) each."""
    history = response[probe]
    if history.displacement.ndim == 1:
        return [history.displacement]
    return [
        path for name, path in zip(history.components, history.displacement.T, strict=True) if name not in ROTATIONS
    ]
