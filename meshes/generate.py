"""Write the meshes of the published models into this folder: ``python meshes/generate.py``."""

from pathlib import Path

import numpy as np

from flexcam.fem.mesh import Mesh
from flexcam.io import write_mesh

_SHAFT_X = {1: (0.0, 0.060, 0.120, 0.180), 2: (0.0, 0.060, 0.120, 0.180),
            3: (0.0, 0.060, 0.080, 0.100, 0.120, 0.140, 0.160, 0.180)}  # fmt: skip
_PUSHROD_ELEMENTS = {1: 1, 2: 5, 3: 3}
_BEARING_X = (0.060, 0.180)
_CAM_X, _BASE_RADIUS, _PUSHROD_LENGTH = 0.120, 0.018, 0.250


def published_model(model: int) -> Mesh:
    """Return the mesh of model 1, 2 or 3 of Tayeb and Sliman as reconstructed for flexcam.

    The drawings are not available. This is the only arrangement with three bearings and axial motion of the inner
    pushrod nodes that has the published numbers of elements and unknowns (4/21, 8/25, 10/47). The order of the nodes is
    that of the published load vector (26): shaft from the drive end, pushrod top, inner nodes downwards, tappet.
    """
    x = np.array(_SHAFT_X[model])
    y = _BASE_RADIUS + np.linspace(_PUSHROD_LENGTH, 0.0, _PUSHROD_ELEMENTS[model] + 1)
    shaft = np.column_stack([x, 0.0 * x, 0.0 * x])
    rod = np.column_stack([np.full_like(y, _CAM_X), y, 0.0 * y])
    first = len(x)
    last = first + len(y) - 1
    points = {
        "drive": [0],
        "bearings": np.flatnonzero(np.isin(x, _BEARING_X)),
        "cam": np.flatnonzero(x == _CAM_X),
        "pushrod-top": [first],
        "guide": list(range(first, last)),
        "tappet": [last],
    }
    lines = {"camshaft": np.arange(first), "pushrod": np.arange(last, first - 1, -1)}
    return Mesh(np.concatenate([shaft, rod]), lines, points)


if __name__ == "__main__":
    for model in (1, 2, 3):
        target = Path(__file__).with_name(f"tayeb-{model}.msh")
        target.unlink(missing_ok=True)
        write_mesh(published_model(model), target)
