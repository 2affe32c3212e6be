"""Least and largest values of a history: those of its dense output, which turns between its instants too.

Between two instants a motion is the cubic with its values and slopes at both, as `Series.between` has it. Without that
the largest of m steps in a period of a sine may be missed by ``1 - cos(pi/m)`` of it, half a percent with 30 steps; the
cubic misses it by ``(2 pi/m)^4/384`` (C. de Boor, A Practical Guide to Splines, 1978), a 200 000th. A history without
slopes, such as a force, is straight between its instants and largest at one of them.
"""

from __future__ import annotations

import numpy as np

from flexcam.linalg import FloatArray


def turning_points(time: FloatArray, values: FloatArray, slopes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return where the cubics between instants turn, and the values there; where one does not, its begin stands.

    Times have the shape (m,), values and slopes (m, ...), what is returned (2 (m - 1), ...).
    """
    length = np.diff(time).reshape(-1, *[1] * (values.ndim - 1))
    rise, begun, ended = np.diff(values, axis=0), length * slopes[:-1], length * slopes[1:]
    square, cubic = 3.0 * rise - 2.0 * begun - ended, begun + ended - 2.0 * rise
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        root = np.sqrt(square**2 - 3.0 * cubic * begun)  # not a number where the cubic does not turn
        q = -(square + np.copysign(root, square))
        x = np.stack([q / (3.0 * cubic), begun / q])
    x = np.where((x > 0.0) & (x < 1.0), x, 0.0)
    turned = values[:-1] + x * (begun + x * (square + x * cubic))
    instants = time[:-1].reshape(length.shape) + x * length
    return instants.reshape(-1, *values.shape[1:]), turned.reshape(-1, *values.shape[1:])


def peak(time: FloatArray, values: FloatArray, slopes: FloatArray | None = None) -> tuple[float, float]:
    """Return the largest absolute value of a history, shape (m,), and its instant; zeros where there are none."""
    if not len(values):
        return 0.0, 0.0
    instants, every = (time, values) if slopes is None else _with_turns(time, values, slopes)
    at = int(np.argmax(np.abs(every)))
    return float(np.abs(every[at])), float(instants[at])


def extent(time: FloatArray, values: FloatArray, slopes: FloatArray | None = None) -> float:
    """Return the range of a history, shape (m,): its largest value less its least."""
    every = values if slopes is None else _with_turns(time, values, slopes)[1]
    return float(np.ptp(every)) if len(every) else 0.0


def _with_turns(time: FloatArray, values: FloatArray, slopes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the instants of a history and its turning points, and the values there."""
    instants, turned = turning_points(time, values, slopes)
    return np.concatenate([time, instants]), np.concatenate([values, turned])
