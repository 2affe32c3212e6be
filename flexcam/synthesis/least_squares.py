"""Least squares under linear inequalities."""

from __future__ import annotations

import numpy as np

from flexcam.linalg import FloatArray

_FEASIBLE = 1e-10
"""Residual of the dual problem below which the inequalities contradict each other."""


def constrained_least_squares(E: FloatArray, f: FloatArray, G: FloatArray, h: FloatArray) -> FloatArray | None:
    """Return the x of least norm of E x - f with G x >= h.

    The problem is turned into one of least distance, and that into one of non-negative least squares: C. L. Lawson and
    R. J. Hanson, Solving Least Squares Problems (1974), ch. 23.
    """
    from scipy.optimize import nnls

    Q, R = np.linalg.qr(E)
    best = np.asarray(np.linalg.solve(R, Q.T @ f), dtype=float)
    if not len(G) or bool((G @ best >= h).all()):
        return best
    # y = R (x - best): least norm of y with (G R^-1) y >= h - G best.
    C = np.linalg.solve(R.T, G.T).T
    d = h - G @ best
    size = max(float(np.abs(d).max()), np.finfo(float).tiny)
    d = d / size
    A = np.vstack([C.T, d])
    right = np.append(np.zeros(len(R)), 1.0)
    u = nnls(A, right, maxiter=30 * A.shape[1])[0]
    r = np.asarray(A @ u - right, dtype=float)
    if float(np.linalg.norm(r)) < _FEASIBLE:
        return None
    return best + np.asarray(np.linalg.solve(R, -r[:-1] / r[-1] * size), dtype=float)
