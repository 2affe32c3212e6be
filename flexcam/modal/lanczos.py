"""The lowest modes of a large model by Lanczos iteration on ``K^-1 M``, without any shift.

The free motions are taken out of the operator, so K need not be regular, and the lowest modes are its largest
eigenvalues, as on the dense path. Source: R. G. Grimes, J. G. Lewis, H. D. Simon, A shifted block Lanczos algorithm for
solving sparse symmetric generalized eigenproblems, SIAM J. Matrix Anal. Appl. 15 (1994).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexcam.linalg import (
    DENSE_LIMIT,
    FloatArray,
    IntArray,
    SingularMatrixError,
    Triplets,
    diagonal_scale,
    factorize,
    pins,
)
from flexcam.response import Cause, NotPositiveError, RunFailedError, Status

LOST = 1e-6
"""Relative error of an eigenvalue above which a mode is left out rather than shown wrong."""

_DEFAULT_COUNT = 20


def lanczos(
    mass: Triplets, stiffness: Triplets, rigid: FloatArray, count: int | None
) -> tuple[FloatArray, FloatArray, int]:
    """Return the lowest modes with stiffness."""
    wanted = min(max((count or _DEFAULT_COUNT) - rigid.shape[1], 1), mass.size - 2)
    solve = _flexibility(stiffness, rigid, mass.times_all(rigid))
    massive = np.flatnonzero(mass.diagonal() > 0.0)
    if len(massive) <= DENSE_LIMIT:
        inverse_squares, shapes = _condensed(mass.part(massive).dense(), massive, solve, mass.size)
    else:
        inverse_squares, shapes = _iterated(mass, stiffness, solve, wanted)
    largest = float(np.abs(inverse_squares).max(initial=0.0))
    rounding = np.sqrt(mass.size) * np.finfo(float).eps * largest
    if inverse_squares.min(initial=0.0) < -rounding / LOST:
        raise NotPositiveError(shapes[:, int(np.argmin(inverse_squares))])
    # Fewer masses than modes asked for leave zeros, that is rounding of either sign.
    good = min(int(np.argmax(np.append(inverse_squares * LOST <= rounding, True))), wanted)
    lost = min(int(np.count_nonzero(inverse_squares > rounding)), wanted) - good
    return 1.0 / inverse_squares[:good], shapes[:, :good], max(lost, 0)


Solve = Callable[[FloatArray], FloatArray]


def _iterated(mass: Triplets, stiffness: Triplets, solve: Solve, wanted: int) -> tuple[FloatArray, FloatArray]:
    """Return 1/omega^2, descending, and shapes by Lanczos iteration."""
    from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh

    K, M = stiffness.csr(), mass.csr()
    start = solve(M @ np.random.default_rng(0).standard_normal(mass.size))
    inverse = LinearOperator(K.shape, matvec=solve, dtype=np.float64)
    try:
        values, shapes = eigsh(K, k=wanted, M=M, sigma=0.0, OPinv=inverse, v0=start)
    except ArpackError as fault:
        text = f"the search for {wanted} modes did not converge: {fault}"
        raise RunFailedError(Status(Cause.NO_CONVERGENCE, text, "ask for fewer modes")) from None
    order = np.argsort(-1.0 / values)
    return 1.0 / values[order], shapes[:, order]


def _condensed(M: FloatArray, massive: IntArray, solve: Solve, size: int) -> tuple[FloatArray, FloatArray]:
    """Return 1/omega^2, descending, and shapes from the flexibility of the few unknowns with mass.

    With M = W W^T and F the flexibility, ``W^T F W`` has the eigenvalues of ``F M``; its vectors v give x = F W v.
    """
    values, vectors = np.linalg.eigh(M)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    loads = np.zeros((size, len(massive)))
    loads[massive] = root
    answers = np.column_stack([solve(column) for column in loads.T])
    inverse_squares, inner = np.linalg.eigh(root.T @ answers[massive])
    order = np.argsort(-inverse_squares)
    inverse_squares, inner = inverse_squares[order], inner[:, order]
    safe = np.where(inverse_squares > 0.0, inverse_squares, 1.0)
    return inverse_squares, answers @ inner / safe


def _flexibility(stiffness: Triplets, rigid: FloatArray, heavy: FloatArray) -> Solve:
    """Return the solve with K on the complement of the free motions: loads and answers have no part along them."""
    scale = diagonal_scale(stiffness)
    held = pins(np.linalg.qr(rigid / scale[:, None])[0])
    kept = np.setdiff1d(np.arange(stiffness.size), held)
    try:
        factor = factorize(stiffness.part(kept))
    except SingularMatrixError:
        raise NotPositiveError from None

    def solve(load: FloatArray) -> FloatArray:
        load = np.asarray(load, dtype=float).ravel()
        x = np.zeros_like(load)
        x[kept] = factor.solve((load - heavy @ (rigid.T @ load))[kept])
        return x - rigid @ (heavy.T @ x)

    return solve
