"""Natural modes, and the frequency response of a single mass.

`flexcam.cams.harmonics_below` returns the number of harmonics of a cam below a resonance.

References: C. Li, Cam motion simulation and optimization (2014), eqs. 1-4; W. T. Thomson, Theory of Vibration with
Applications, ch. 3.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from flexcam.core import (
    DENSE_LIMIT,
    ROUNDING_LIMIT,
    ComplexArray,
    FloatArray,
    IntArray,
    SingularMatrixError,
    Triplets,
    diagonal_scale,
    energy_rounding,
    factorize,
    null_space,
    select_constraints,
)
from flexcam.core.errors import positive, refuse
from flexcam.dynamics.status import ROUNDING_STATUS, Cause, NotPositiveError, RunFailedError, Status


def frequency_response(mass: float, damping: float, stiffness: float, omega: FloatArray) -> ComplexArray:
    """Return H of ``m y'' + c y' + k y = F0 exp(i w t)``, y = H F0 exp(i w t): ``1/(k - m w^2 + i c w)``, eq. 3."""
    natural = math.sqrt(positive("stiffness", stiffness, "N/m") / positive("mass", mass, "kg"))
    ratio = positive("damping", damping, "N s/m", zero=True) / (2.0 * math.sqrt(stiffness * mass))
    return normalized_response(np.asarray(omega) / natural, ratio) / stiffness


def normalized_response(frequency_ratio: FloatArray, damping_ratio: float) -> ComplexArray:
    """Return y/B of ``y'' + 2 xi w0 y' + w0^2 y = B w0^2 exp(i w t)``, eq. 4: ``1/(1 - r^2 + 2 i xi r)``, r = w/w0."""
    xi = positive("damping_ratio", damping_ratio, "", zero=True)
    r = np.asarray(frequency_ratio, dtype=float)
    denominator = 1.0 - r**2 + 2j * xi * r
    return np.divide(1.0, denominator, out=np.full(denominator.shape, complex(math.inf, 0.0)), where=denominator != 0.0)


_ASYMMETRY = 1e-9
"""Difference of a matrix from its transpose, relative to the largest entry, that is rounding."""

ERROR_LIMIT = 1e-6
"""Relative error of an eigenvalue above which a mode is omitted."""

_DEFAULT_COUNT = 20


def lanczos(
    mass: Triplets, stiffness: Triplets, rigid: FloatArray, count: int | None
) -> tuple[FloatArray, FloatArray, int]:
    """Return the lowest modes with stiffness."""
    requested = min(max((count or _DEFAULT_COUNT) - rigid.shape[1], 1), mass.size - 2)
    solve = _flexibility(stiffness, rigid, mass.multiply(rigid))
    massive = np.flatnonzero(mass.diagonal() > 0.0)
    if len(massive) <= DENSE_LIMIT:
        inverse_squares, shapes = _condense(mass.part(massive).dense(), massive, solve, mass.size)
    else:
        inverse_squares, shapes = _lanczos_iteration(mass, stiffness, solve, requested)
    largest = float(np.abs(inverse_squares).max(initial=0.0))
    rounding = np.sqrt(mass.size) * np.finfo(float).eps * largest
    if inverse_squares.min(initial=0.0) < -rounding / ERROR_LIMIT:
        raise NotPositiveError(shapes[:, int(np.argmin(inverse_squares))])
    # With fewer masses than requested modes, zeros remain as rounding of either sign.
    accurate = min(int(np.argmax(np.append(inverse_squares * ERROR_LIMIT <= rounding, True))), requested)
    lost = min(int(np.count_nonzero(inverse_squares > rounding)), requested) - accurate
    return 1.0 / inverse_squares[:accurate], shapes[:, :accurate], max(lost, 0)


Solve = Callable[[FloatArray], FloatArray]


def _lanczos_iteration(mass: Triplets, stiffness: Triplets, solve: Solve, count: int) -> tuple[FloatArray, FloatArray]:
    """Return 1/omega^2, descending, and shapes by Lanczos iteration.

    R. G. Grimes, J. G. Lewis, H. D. Simon, SIAM J. Matrix Anal. Appl. 15 (1994).
    """
    from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh

    K, M = stiffness.csr(), mass.csr()
    start = solve(M @ np.random.default_rng(0).standard_normal(mass.size))
    inverse = LinearOperator(K.shape, matvec=solve, dtype=np.float64)
    try:
        values, shapes = eigsh(K, k=count, M=M, sigma=0.0, OPinv=inverse, v0=start)
    except ArpackError as fault:
        text = f"the search for {count} modes did not converge: {fault}"
        raise RunFailedError(Status(Cause.NO_CONVERGENCE, text, "ask for fewer modes")) from None
    order = np.argsort(-1.0 / values)
    return 1.0 / values[order], shapes[:, order]


def _condense(M: FloatArray, massive: IntArray, solve: Solve, size: int) -> tuple[FloatArray, FloatArray]:
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
    fixed = select_constraints(np.linalg.qr(rigid / scale[:, None])[0])
    active = np.setdiff1d(np.arange(stiffness.size), fixed)
    try:
        factor = factorize(stiffness.part(active))
    except SingularMatrixError:
        raise NotPositiveError from None

    def solve(load: FloatArray) -> FloatArray:
        load = np.asarray(load, dtype=float).ravel()
        x = np.zeros_like(load)
        x[active] = factor.solve((load - heavy @ (rigid.T @ load))[active])
        return x - rigid @ (heavy.T @ x)

    return solve


@dataclass(frozen=True, eq=False)
class Modes:
    """Natural modes, from the lowest."""

    omegas: FloatArray  #: angular frequencies, rad/s, shape (k,); zero for motions without stiffness
    shapes: FloatArray  #: mass-orthonormal shapes, shape (n, k)
    rigid: int  #: number of modes (the first ones) without stiffness
    lost: int = 0  #: number of higher modes omitted because of rounding
    #: Relative rounding error of each frequency, shape (k,): an upper bound, about ten times the error.
    rounding: FloatArray = field(default_factory=lambda: np.zeros(0))

    @property
    def frequencies(self) -> FloatArray:
        """Frequencies, Hz, shape (k,)."""
        return self.omegas / (2.0 * np.pi)

    def describe_rounding(self) -> str:
        """Describe the rounding error of the frequencies; empty if negligible."""
        share = float(self.rounding.max(initial=0.0))
        if share <= _REPORT_LIMIT:
            return ""
        at = f"{self.frequencies[int(np.argmax(self.rounding))]:.4g} Hz"
        return f"Warning: rounding in the stiffness may change the frequency {at} by up to {100.0 * share:.1g} %"


_REPORT_LIMIT = 1e-4
"""Relative error of a frequency to report: tables show four digits."""


def modes(mass: Triplets, stiffness: Triplets, count: int | None = None, *, free: FloatArray | None = None) -> Modes:
    """Return the lowest natural modes.

    Parameters
    ----------
    mass
        Symmetric, positive semi-definite, n unknowns; unknowns without mass have no separate modes.
    stiffness
        Symmetric, positive semi-definite; singular where a motion is free.
    count
        Number of modes, with those without stiffness; None for all (up to a few hundred unknowns) or twenty (above).
    free
        Motions without stiffness, shape (n, k), if known exactly; None to find them numerically.

    Returns
    -------
    Modes
        Mass-orthonormal, ascending.

    Raises
    ------
    RunFailedError
        If a free motion has no mass, rounding in the stiffness spoils a mode, or the search for the modes of a large
        model does not converge.
    NotPositiveError
        If the stiffness is indefinite, as beyond buckling.

    Examples
    --------
    >>> pair = modes(Triplets.from_dense([[1.0, 0.0], [0.0, 1.0]]), Triplets.from_dense([[4.0, 0.0], [0.0, 9.0]]))
    >>> pair.omegas
    array([2., 3.])
    """
    rigid = _mass_orthonormal(_find_free_motions(stiffness) if free is None else free, mass)
    solver = _dense if mass.size <= 2 * DENSE_LIMIT else lanczos
    squares, shapes, lost = solver(mass, stiffness, rigid, count)
    shapes = _orthonormalize(shapes, rigid, mass)
    shares = energy_rounding(stiffness, shapes) / squares
    if (shares > ROUNDING_LIMIT).any():
        raise RunFailedError(_too_fine(float(shares.max())))
    omegas = np.concatenate([np.zeros(rigid.shape[1]), np.sqrt(squares)])
    shapes = np.concatenate([rigid, shapes], axis=1)
    requested = len(omegas) if count is None else min(count, len(omegas))
    errors = np.concatenate([np.zeros(rigid.shape[1]), 0.5 * shares])  # square root of the rounded eigenvalue
    signed = _normalize_signs(shapes[:, :requested])
    return Modes(omegas[:requested], signed, int(min(rigid.shape[1], requested)), int(lost), errors[:requested])


def _find_free_motions(stiffness: Triplets) -> FloatArray:
    """Return the null space of matrices without known free motions; more energy than rounding means a soft motion."""
    motions = null_space(stiffness)
    energy = np.abs(np.sum(motions * stiffness.multiply(motions), axis=0))
    rounding = energy_rounding(stiffness, motions)
    if (soft := energy > rounding).any():
        raise RunFailedError(_too_fine(float((rounding[soft] / energy[soft]).max())))
    return motions


def _too_fine(share: float) -> Status:
    text = f"{ROUNDING_STATUS.text} (up to {100.0 * share:.3g} % of a mode's energy)"
    return replace(ROUNDING_STATUS, text=text)


def _mass_orthonormal(motions: FloatArray, mass: Triplets) -> FloatArray:
    if not motions.shape[1]:
        return motions
    values, vectors = np.linalg.eigh(motions.T @ mass.multiply(motions))
    if values[0] <= 1e-13 * values[-1]:
        text = "a motion of the model has neither stiffness nor mass"
        raise RunFailedError(Status(Cause.SINGULAR, text, "support it or give it a mass"))
    return motions @ (vectors / np.sqrt(values))


def _orthonormalize(shapes: FloatArray, rigid: FloatArray, mass: Triplets) -> FloatArray:
    """Return shapes orthonormalized in the mass: to the free motions, then among themselves.

    Two Newton iterations for the nearest orthonormal set square the error twice and treat all shapes alike.
    """
    shapes = shapes - rigid @ (rigid.T @ mass.multiply(shapes))
    for _ in range(2):
        shapes = shapes @ (1.5 * np.eye(shapes.shape[1]) - 0.5 * shapes.T @ mass.multiply(shapes))
    return shapes


def _dense(
    mass: Triplets, stiffness: Triplets, rigid: FloatArray, count: int | None
) -> tuple[FloatArray, FloatArray, int]:
    """Return modes from the more accurate side: low ones from ``K^-1 M``, high ones from ``M^-1 K``."""
    M, K = mass.dense(), stiffness.dense()
    for what, matrix in (("mass", M), ("stiffness", K)):
        if np.abs(matrix - matrix.T).max(initial=0.0) > _ASYMMETRY * np.abs(matrix).max(initial=0.0):
            raise refuse(what, "a matrix that is not symmetric", "a symmetric one")
    squares, shapes, errors = _by_stiffness(M, K, diagonal_scale(stiffness), rigid)
    if (errors > ERROR_LIMIT).any() and (high := _by_mass(mass, K)) is not None:
        high = tuple(values[..., rigid.shape[1] :] for values in high)
        squares, shapes, errors = (part[..., : len(high[0])] for part in (squares, shapes, errors))
        switch = _switch(squares, errors, high[2])
        squares, shapes, errors = (
            np.concatenate([a[..., :switch], b[..., switch:]], axis=-1)
            for a, b in zip((squares, shapes, errors), high, strict=True)
        )
    requested = len(squares) if count is None else max(count - rigid.shape[1], 0)
    accurate = int(np.argmax(np.append(errors > ERROR_LIMIT, True)))
    used = min(accurate, requested)
    massive = np.count_nonzero(mass.diagonal() > 0.0) - rigid.shape[1]
    return squares[:used], shapes[:, :used], max(min(massive, requested) - accurate, 0)


def _switch(squares: FloatArray, low: FloatArray, high: FloatArray) -> int:
    """Return the first mode from the other side, without splitting a group of equal frequencies."""
    switch = int(np.argmax(np.append(high < low, True)))
    while 0 < switch < len(squares) and squares[switch] <= (1.0 + 1e-6) * squares[switch - 1]:
        switch -= 1
    return switch


def _by_stiffness(
    M: FloatArray, K: FloatArray, scale: FloatArray, rigid: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return omega^2, shapes and relative errors from ``L^-1 M L^-T``, K = L L^T, without the rigid motions.

    A stiffness on the rigid motions alone, weighted by M, makes K regular; as every other mode is M-orthogonal to
    them it changes none. They are then projected out, which leaves zeros (infinite frequency) at the end.
    """
    M, K = scale[:, None] * M * scale, scale[:, None] * K * scale
    free = rigid / scale[:, None]
    momentum = M @ free
    K = K + momentum @ momentum.T / max(1.0, float(np.abs(momentum).max(initial=0.0)) ** 2)
    try:
        L = np.linalg.cholesky(K)
    except np.linalg.LinAlgError:
        raise NotPositiveError(scale * np.linalg.eigh(K)[1][:, 0]) from None
    inverse = np.linalg.solve(L, np.linalg.solve(L, M).T)
    basis = np.linalg.qr(L.T @ free)[0]
    inverse -= basis @ (basis.T @ inverse)
    inverse -= (inverse @ basis) @ basis.T
    values, vectors = np.linalg.eigh(0.5 * (inverse + inverse.T))
    order = slice(None, None, -1) if not rigid.shape[1] else slice(None, rigid.shape[1] - 1, -1)
    values, vectors = values[order], vectors[:, order]
    bounded, errors = _with_errors(values)
    return 1.0 / bounded, scale[:, None] * np.linalg.solve(L.T, vectors) / np.sqrt(bounded), errors


def _by_mass(mass: Triplets, K: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Return omega^2, shapes and relative errors from ``L^-1 K L^-T``, L L^T the mass of what has one.

    Massless motions are condensed statically. Returns None if rounding prevents the factorization of the mass.
    """
    light = null_space(mass)
    dofs = np.setdiff1d(np.arange(mass.size), np.array(select_constraints(light), dtype=np.intp))
    unit = np.eye(len(K))  # unit motions of every unknown, with massless motions in static equilibrium
    if light.shape[1]:
        coupling = light.T @ K
        unit -= light @ factorize(Triplets.from_dense(coupling @ light)).solve(coupling)
    motions = unit[:, dofs]
    massive = mass.part(dofs)
    scale = diagonal_scale(massive)
    try:
        L = np.linalg.cholesky(scale[:, None] * massive.dense() * scale)
    except np.linalg.LinAlgError:
        return None
    stiffness = scale[:, None] * (motions.T @ K @ motions) * scale
    forward = np.linalg.solve(L, np.linalg.solve(L, stiffness).T)
    values, vectors = np.linalg.eigh(0.5 * (forward + forward.T))
    bounded, errors = _with_errors(values)
    return bounded, motions @ (scale[:, None] * np.linalg.solve(L.T, vectors)), errors


def _with_errors(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    eps, largest = np.finfo(float).eps, float(values.max(initial=0.0))
    bounded = np.maximum(values, max(eps**2 * largest, np.finfo(float).tiny))
    return bounded, np.where(values > 0.0, len(values) * eps * largest / bounded, np.inf)


_EQUAL = 1e-6
"""Relative difference up to which entries of a shape are equal: those of symmetric shapes differ by rounding."""


def _normalize_signs(shapes: FloatArray) -> FloatArray:
    """Return the shapes with positive largest entries, the first where several are equal, for reproducible signs."""
    if not shapes.size:
        return shapes
    sizes = np.abs(shapes)
    first = np.argmax(sizes >= (1.0 - _EQUAL) * sizes.max(axis=0), axis=0)
    largest = shapes[first, np.arange(shapes.shape[1])]
    return shapes * np.where(largest < 0.0, -1.0, 1.0)


_DEPENDENT = 1e-10
"""Fraction of strain energy of a static solution below which it depends linearly on others."""

_STILL = 1e-12
"""Fraction of the size of a shape, as square root of its strain energy, that is rounding."""


def corrected_modes(
    mass: Triplets, stiffness: Triplets, places: FloatArray, count: int, *, free: FloatArray | None = None
) -> FloatArray:
    """Return the lowest modes with their static correction."""
    rigid = modes(mass, stiffness, 1, free=free).rigid if free is None else free.shape[1]
    lowest = modes(mass, stiffness, rigid + count, free=free)
    shapes = lowest.shapes
    loads = places.T - mass.multiply(shapes) @ (shapes.T @ places.T)
    answers = _static_solutions(stiffness, loads, shapes[:, : lowest.rigid])
    answers -= shapes @ (shapes.T @ mass.multiply(answers))
    energy = (places @ shapes[:, lowest.rigid :]) ** 2 @ lowest.omegas[lowest.rigid :] ** -2.0
    return np.hstack([shapes, _orthogonalize(mass, stiffness, answers, energy)])


def _static_solutions(stiffness: Triplets, loads: FloatArray, rigid: FloatArray) -> FloatArray:
    """Return static solutions for loads that do no work on the free motions, shape (n, k)."""
    fixed = select_constraints(rigid / diagonal_scale(stiffness)[:, None])
    active = np.setdiff1d(np.arange(stiffness.size), fixed)
    answers = np.zeros(loads.shape)
    answers[active] = factorize(stiffness.part(active)).solve(loads[active])
    return answers


def _orthogonalize(mass: Triplets, stiffness: Triplets, shapes: FloatArray, modal_energy: FloatArray) -> FloatArray:
    """Return shapes of the same span with unit stiffness and diagonal mass, the lightest last.

    A shape is used if its energy exceeds that of its projection on the others.
    """
    energy = np.maximum(np.einsum("ik,ik->k", shapes, stiffness.multiply(shapes)), 0.0)
    independent = energy > _DEPENDENT * (modal_energy + energy)
    shapes = shapes[:, independent] / np.sqrt(energy[independent])
    values, vectors = np.linalg.eigh(shapes.T @ stiffness.multiply(shapes))
    stiff = values > _DEPENDENT
    unit = shapes @ (vectors[:, stiff] / np.sqrt(values[stiff]))
    _, rotation = np.linalg.eigh(unit.T @ mass.multiply(unit))
    basis = unit @ rotation[:, ::-1]
    # Otherwise a shape of a massless unknown would have the mass of rounding and a very high frequency.
    return np.where(np.abs(basis) > _STILL * diagonal_scale(stiffness)[:, None], basis, 0.0)


def craig_bampton(
    mass: Triplets, stiffness: Triplets, boundary: IntArray, interiors: Sequence[IntArray], count: int
) -> FloatArray:
    """Return the Craig-Bampton basis: boundary unknowns, constraint modes and fixed-interface modes."""
    inner = np.concatenate([np.zeros(0, np.intp), *interiors])
    if not np.array_equal(np.sort(np.concatenate([boundary, inner])), np.arange(stiffness.size)):
        raise refuse("boundary and interiors", f"{len(boundary)} + {len(inner)} unknowns", "every unknown once")
    unit = np.zeros((stiffness.size, len(boundary)))
    unit[boundary, np.arange(len(boundary))] = 1.0
    try:
        unit[inner] = -factorize(stiffness.part(inner)).solve(stiffness.multiply(unit)[inner])
    except SingularMatrixError as fault:
        names = ", ".join(str(inner[i]) for i in fault.unknowns[:6]) or "some"
        why = "a group that moves freely has no static solution"
        given, allowed = f"unknowns {names} free while it is held", "a boundary that holds every group"
        raise refuse("boundary", given, allowed, why) from None
    return np.hstack([unit, *(_fixed_interface_modes(mass, stiffness, group, count) for group in interiors)])


def _fixed_interface_modes(mass: Triplets, stiffness: Triplets, group: IntArray, count: int) -> FloatArray:
    local = modes(mass.part(group), stiffness.part(group), count, free=np.zeros((len(group), 0)))
    shapes = np.zeros((stiffness.size, local.shapes.shape[1]))
    shapes[group] = local.shapes
    return shapes


def mac(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the modal assurance criterion of two sets of shapes on the same components.

    ``|a^T b|^2/((a^T a)(b^T b))``: 1 for shapes that agree up to a factor, 0 for orthogonal ones, NaN for a
    shape without motion. Source: R. J. Allemang, The modal assurance criterion - twenty years of use and abuse, Sound
    and Vibration 37 (2003), eq. 1.
    """
    sizes = np.outer(np.sum(one**2, axis=0), np.sum(other**2, axis=0))
    return np.divide((one.T @ other) ** 2, sizes, out=np.full(sizes.shape, np.nan), where=sizes > 0.0)
