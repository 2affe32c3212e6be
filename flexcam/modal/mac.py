"""How alike two sets of modes are."""

from __future__ import annotations

import numpy as np

from flexcam.linalg import FloatArray


def mac(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the modal assurance criterion of two sets of shapes on the same components.

    ``|a^T b|^2/((a^T a)(b^T b))``: 1 for shapes that agree up to a factor, 0 for orthogonal ones. Source: R. J.
    Allemang, The modal assurance criterion - twenty years of use and abuse, Sound and Vibration 37 (2003), eq. 1.
    """
    sizes = np.outer(np.sum(one**2, axis=0), np.sum(other**2, axis=0))
    return np.divide((one.T @ other) ** 2, sizes, out=np.zeros(sizes.shape), where=sizes > 0.0)
