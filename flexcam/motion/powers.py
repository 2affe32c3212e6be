"""Sums of powers, as laws are made of."""

from __future__ import annotations

import numpy as np

from flexcam.linalg import FloatArray


def horner(z: FloatArray, coefficients: FloatArray) -> FloatArray:
    """Return a polynomial at some places, by Horner's scheme.

    Parameters
    ----------
    z
        Any shape.
    coefficients
        Of the powers from the zeroth, one at least.

    Returns
    -------
    ndarray
        Shape as `z`.

    Examples
    --------
    >>> horner(np.array([2.0]), np.array([1.0, 0.0, 3.0]))
    array([13.])
    """
    highest, *rest = coefficients[::-1].tolist()
    value = np.full_like(z, highest)
    for one in rest:
        value *= z
        value += one
    return value
