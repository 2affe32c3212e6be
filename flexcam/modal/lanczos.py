"""The lowest modes of a large model by Lanczos iteration on ``K^-1 M``, without any shift.

The free motions are taken out of the operator, so K need not be regular, and the lowest modes are its largest
eigenvalues, as on the dense path. Source: R. G. Grimes, J. G. Lewis, H. D. Simon, A shifted block Lanczos algorithm for
solving sparse symmetric generalized eigenproblems, SIAM J. Matrix Anal. Appl. 15 (1994).
"""

from __future__ import annotations

import numpy as np

from flexcam.linalg import FloatArray, SingularMatrixError, Triplets, diagonal_scale, factorize, pins
from flexcam.response import Cause, RunFailedError, Status

BUCKLED = Status(
    Cause.SINGULAR, "the stiffness is not positive: an axial load is beyond buckling", "lower the compressive force"
)
_LOST = 1e-6
"""Relative error of an eigenvalue above which a mode is left out rather than shown wrong."""

_DEFAULT_COUNT = 20


def lanczos(
    mass: Triplets, stiffness: Triplets, rigid: FloatArray, count: int | None
) -> tuple[FloatArray, FloatArray, int]:
    """Return the lowest modes with stiffness.

    Parameters
    ----------
    mass, stiffness
        n x n, symmetric.
    rigid
        Free motions, mass-orthonormal, shape (n, k).
    count
        How many modes, the free motions included; None for twenty.

    Returns
    -------
    tuple
        omega^2 ascending, shapes as columns, and how many were left out because rounding would have spoilt them.

    Raises
    ------
    RunFailedError
        If the stiffness is not positive, or the iteration does not converge.
    """
    from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh

    wanted = min(max((count or _DEFAULT_COUNT) - rigid.shape[1], 1), mass.size - 2)
    M, K = mass.csr(), stiffness.csr()
    solve = _flexibility(stiffness, rigid, M @ rigid)
    start = solve(M @ np.random.default_rng(0).standard_normal(mass.size))
    inverse = LinearOperator(K.shape, matvec=solve, dtype=np.float64)
    try:
        values, shapes = eigsh(K, k=wanted, M=M, sigma=0.0, OPinv=inverse, v0=start)
    except ArpackError as fault:
        text = f"the search for {wanted} modes did not converge: {fault}"
        raise RunFailedError(Status(Cause.NO_CONVERGENCE, text, "ask for fewer modes")) from None
    if (values <= 0.0).any():
        raise RunFailedError(BUCKLED)
    order = np.argsort(values)
    values, shapes = values[order], shapes[:, order]
    errors = np.sqrt(mass.size) * np.finfo(float).eps * values / values[0]
    good = int(np.argmax(np.append(errors > _LOST, True)))
    return values[:good], shapes[:, :good], wanted - good


def _flexibility(stiffness: Triplets, rigid: FloatArray, heavy: FloatArray):  # noqa: ANN202 - a closure over the factor
    """Return the solve with K on the complement of the free motions: loads and answers have no part along them."""
    scale = diagonal_scale(stiffness)
    held = pins(np.linalg.qr(rigid / scale[:, None])[0])
    kept = np.setdiff1d(np.arange(stiffness.size), held)
    try:
        factor = factorize(stiffness.part(kept))
    except SingularMatrixError:
        raise RunFailedError(BUCKLED) from None

    def solve(load: FloatArray) -> FloatArray:
        load = np.asarray(load, dtype=float).ravel()
        x = np.zeros_like(load)
        x[kept] = factor.solve((load - heavy @ (rigid.T @ load))[kept])
        return x - rigid @ (heavy.T @ x)

    return solve
