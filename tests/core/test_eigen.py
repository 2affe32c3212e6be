"""Generalized eigenproblem against fifty digits: graded, repeated, clustered and free systems."""

import mpmath
import numpy as np
import pytest

from flexcam.core import eigen, solve_eigenproblem

EPS = np.finfo(float).eps


def exact_eigenvalues(M, K):
    """Return the eigenvalues by mpmath with fifty digits."""
    with mpmath.workdps(50):
        inverse = mpmath.cholesky(mpmath.matrix(M.tolist())) ** -1
        whole = inverse * mpmath.matrix(K.tolist()) * inverse.T
        return sorted(mpmath.eigsy((whole + whole.T) / 2, eigvals_only=True))


def errors(values, reference):
    return np.array([float(abs(mpmath.mpf(float(a)) - b)) for a, b in zip(values, reference, strict=True)])


def random_matrix(rng, n, decades):
    """Return a full positive definite matrix with eigenvalues over some decades."""
    Q = np.linalg.qr(rng.normal(size=(n, n)))[0]
    full = (Q * np.logspace(0.0, decades, n)) @ Q.T
    return 0.5 * (full + full.T)


def chain_stiffness(k, *, free=False):
    n = len(k)
    K = np.diag(k) + np.diag([*k[1:], 0.0]) - np.diag(k[1:], 1) - np.diag(k[1:], -1)
    return K - np.diag([k[0], *np.zeros(n - 1)]) if free else K


def matrix_pairs():
    rng = np.random.default_rng(7)
    n = 7
    M = np.diag(rng.uniform(0.5, 2.0, n))
    for decades in (0, 3, 6, 10, 13):
        grading = np.diag(np.logspace(0.0, 0.5 * decades, n))
        yield f"full, {decades} decades", M, random_matrix(rng, n, decades)
        yield f"graded stiffness, {decades} decades", M, grading @ random_matrix(rng, n, 1) @ grading
        yield f"graded mass, {decades} decades", grading @ random_matrix(rng, n, 1) @ grading, random_matrix(rng, n, 1)
        k = 10.0 ** rng.uniform(0.0, decades, n)
        yield f"chain, {decades} decades", M, chain_stiffness(k)
        yield f"free chain, {decades} decades", M, chain_stiffness(k, free=True)
    full, eye = random_matrix(rng, 5, 2), np.eye(10)
    yield "one value", np.eye(6), np.eye(6)
    yield "no stiffness", M, 0.0 * M
    for gap in (0.0, 1e-15, 1e-13, 1e-10, 1e-6, 1e-3):
        yield f"pairs {gap:g} apart", eye, np.kron(np.diag([1.0, 1.0 + gap]), full)
    yield "all within 1e-10", np.eye(6), np.eye(6) + 1e-10 * random_matrix(rng, 6, 1)
    yield "two free bodies", np.eye(4), np.kron(np.eye(2), 1e8 * np.array([[1.0, -1.0], [-1.0, 1.0]]))
    yield "masses over 12 decades", np.diag(10.0 ** rng.uniform(-6.0, 6.0, n)), random_matrix(rng, n, 2)
    yield "other units", 1e-9 * M, 1e12 * random_matrix(rng, n, 2)
    yield "alone", np.array([[3.0]]), np.array([[12.0]])


PAIRS = {name: (M, K) for name, M, K in matrix_pairs()}


@pytest.mark.parametrize("name", PAIRS)
def test_eigenvalues_match_fifty_digits(name):
    """Each error is within the rounding of the matrices along the eigenvector, and not above numpy's."""
    M, K = PAIRS[name]
    values, X = solve_eigenproblem(M, K)
    assert np.isfinite(values).all()
    assert np.isfinite(X).all()
    assert (values >= 0.0).all()
    assert (np.diff(values) >= 0.0).all()
    reference = exact_eigenvalues(M, K)
    off, top = errors(values, reference), max(float(abs(reference[-1])), 1e-300)
    # Products in extended precision leave its rounding of the largest value, and the result its own; values that the
    # rounding of the stiffness makes negative are set to zero.
    clamped = np.where(values == 0.0, 64.0 * EPS * np.sum(np.abs(X) * (np.abs(K) @ np.abs(X)), axis=0), 0.0)
    assert (off <= 2.0 * EPS * values + 4.0 * len(M) * np.finfo(np.longdouble).eps * top + clamped).all()
    inverse = np.linalg.inv(np.linalg.cholesky(M))
    plain = errors(np.linalg.eigvalsh(inverse @ K @ inverse.T), reference)
    assert off.max() <= max(plain.max(), 2.0 * EPS * top)


@pytest.mark.parametrize("name", PAIRS)
def test_eigenvectors_are_orthonormal_and_uncoupled(name):
    """Mass orthogonality to rounding for any ratio; stiffness orthogonality to rounding of the largest entries."""
    M, K = PAIRS[name]
    values, X = solve_eigenproblem(M, K)
    heavy, stiff, long = (one.astype(np.longdouble) for one in (M, K, X))
    right = long.T @ heavy @ long
    # Each entry of a vector is rounded once on output: n terms of |x||M||x| eps.
    sizes = np.abs(X).T @ np.abs(M) @ np.abs(X)
    assert (np.abs(right - np.eye(len(M))) <= 4.0 * EPS * np.maximum(sizes, 1.0)).all()
    coupled = np.abs(long.T @ stiff @ long - np.diag(values))
    largest = np.abs(X).T @ np.abs(K) @ np.abs(X)
    # A correction of a few roundings leaves its square; close eigenvalues amplify it, more on some processors.
    assert (coupled <= 64.0 * EPS * np.maximum(largest, 8.0 * EPS * values[-1])).all()


@pytest.mark.parametrize("M", [np.diag([1.0, -1.0]), np.array([[1.0, 2.0], [2.0, 1.0]])])
def test_indefinite_mass_raises_error(M):
    with pytest.raises(np.linalg.LinAlgError):
        solve_eigenproblem(M, np.eye(2))


def test_large_matrix_uses_numpy_eigenvalues(monkeypatch):
    """Values of numpy, clipped at zero, with and without a free motion."""
    monkeypatch.setattr(eigen, "_REFINEMENT_SIZE", 100)
    k = np.random.default_rng(0).uniform(1.0, 10.0, 210)
    for free in (False, True):
        values, X = solve_eigenproblem(np.eye(210), chain_stiffness(k, free=free))
        np.testing.assert_allclose(
            values, np.maximum(np.linalg.eigvalsh(chain_stiffness(k, free=free)), 0.0), atol=1e-12
        )
        np.testing.assert_allclose(X.T @ X, np.eye(210), atol=1e-12)


def graded_chain(n):
    """Return a chain of springs over twelve decades of stiffness and masses over six, as in large models."""
    rng = np.random.default_rng(n)
    return np.diag(10.0 ** rng.uniform(-3.0, 3.0, n)), chain_stiffness(10.0 ** rng.uniform(0.0, 12.0, n))


def test_sliced_product_has_extended_precision(monkeypatch):
    """Also for rows with entries over many decades: errors are relative to the maximum of the row."""
    rng = np.random.default_rng(3)
    one, other = (rng.normal(size=(150, 150)).astype(np.longdouble) * 10.0 ** rng.uniform(-9, 9, 150) for _ in "ab")
    one += one * np.longdouble(2.0) ** -60  # digits below double precision
    other = other.T
    sliced = eigen.long_product(one, other)
    monkeypatch.setattr(eigen, "_SMALL_SIZE", 200)
    sizes = np.abs(one).max(axis=1)[:, None] * np.abs(other).max(axis=0)
    off = np.abs(sliced - eigen.long_product(one, other)) / sizes
    assert off.max() <= 8.0 * np.finfo(np.longdouble).eps
    assert np.abs(one.astype(float) @ other.astype(float) - sliced).max() > 100.0 * np.abs(sizes * off).max()


@pytest.mark.slow
def test_sliced_and_plain_products_give_same_modes(monkeypatch):
    M, K = graded_chain(130)
    values, X = solve_eigenproblem(M, K)
    monkeypatch.setattr(eigen, "_SMALL_SIZE", 200)
    plain = solve_eigenproblem(M, K)[0]
    allowed = 2.0 * EPS * plain + 4.0 * len(M) * np.finfo(np.longdouble).eps * plain[-1]
    assert (np.abs(values - plain) <= allowed).all()
    np.testing.assert_allclose(X.T @ M @ X, np.eye(130), atol=1e-14)


def test_arguments_are_unchanged(readonly):
    M, K = readonly([[2.0, 0.1], [0.1, 1.0]]), readonly([[5.0, -1.0], [-1.0, 3.0]])
    solve_eigenproblem(M, K)
