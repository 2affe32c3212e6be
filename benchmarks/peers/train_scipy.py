"""C1 by scipy's `solve_ivp` with a right-hand side compiled by numba, and the reference solution."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import numba
import numpy as np
from scipy.integrate import OdeSolution, solve_ivp

from benchmarks.peers.train import FloatArray, Setting, Train, equations

TOLERANCES = {
    "LSODA": (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8),
    "Radau": (1e-3, 1e-4, 1e-5, 1e-6),
    "DOP853": (1e-3, 1e-4, 1e-5, 1e-6),
}
ABSOLUTE = 1e-3
"""Ratio of the absolute to the relative tolerance, for displacements in m and velocities in m/s."""
REFERENCE_TOLERANCE = 1e-12


def settings(train: Train) -> Iterator[Setting]:
    """Yield three methods."""
    function = right_hand_side(train)
    for method, tolerances in TOLERANCES.items():
        for tolerance in tolerances:
            prepare = partial(_prepare, train, function, method, tolerance)
            yield Setting(f"scipy, {method}", f"tolerance {tolerance:.0e}", prepare)


def right_hand_side(train: Train) -> Callable[[float, FloatArray], FloatArray]:
    """Return the compiled time derivatives of displacements and velocities."""
    forces = equations(train, wrap=numba.njit).forces
    m1, m2, m3 = train.masses

    @numba.njit
    def rates(t: float, y: FloatArray) -> FloatArray:
        f1, f2, f3 = forces(t, y[0], y[1], y[2], y[3], y[4], y[5])
        derivatives = np.empty(6)
        derivatives[:3] = y[3:]
        derivatives[3], derivatives[4], derivatives[5] = f1 / m1, f2 / m2, f3 / m3
        return derivatives

    return rates


def reference(train: Train, method: str = "DOP853", tolerance: float = REFERENCE_TOLERANCE) -> OdeSolution:
    """Return a solution with a tight tolerance as a function of time, shape (6, n)."""
    solution = solve_ivp(
        right_hand_side(train), (0.0, train.period), train.start, method, rtol=tolerance, atol=tolerance * ABSOLUTE,
        max_step=train.max_step, dense_output=True,
    )  # fmt: skip
    if not solution.success:
        raise RuntimeError(solution.message)
    return solution.sol


def _prepare(
    train: Train, function: Callable[[float, FloatArray], FloatArray], method: str, tolerance: float
) -> Callable[[], FloatArray]:  # fmt: skip
    times, start = train.times, train.start

    def run() -> FloatArray:
        solution = solve_ivp(
            function, (0.0, train.period), start, method, t_eval=times, rtol=tolerance, atol=tolerance * ABSOLUTE,
            max_step=train.max_step,
        )  # fmt: skip
        if not solution.success:
            raise RuntimeError(solution.message)
        return solution.y.T

    return run
