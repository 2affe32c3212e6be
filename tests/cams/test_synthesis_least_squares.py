"""Least squares with inequality constraints, against another solver and the optimality conditions."""

import numpy as np
import pytest

from flexcam.cams.harmonic_lift import constrained_least_squares


def random_problem(seed):
    """Return a random problem of 2 to 6 unknowns, and a feasible point or None."""
    from scipy.optimize import linprog

    rng = np.random.default_rng(seed)
    n, k = rng.integers(2, 7), rng.integers(3, 16)
    E = rng.normal(size=(n + rng.integers(0, 8), n))
    f, G, h = rng.normal(size=len(E)), rng.normal(size=(k, n)), rng.normal(size=k)
    inside = linprog(np.zeros(n), -G, -h, bounds=(None, None), method="highs")
    return E, f, G, h, inside.x


@pytest.mark.parametrize("seed", range(40))
def test_random_problems_match_slsqp(seed):
    """SLSQP starts from a feasible point; a convex problem has one optimum. Without a feasible point: None."""
    from scipy.optimize import minimize

    E, f, G, h, inside = random_problem(seed)
    x = constrained_least_squares(E, f, G, h)
    if inside is None:
        assert x is None
        return
    found = minimize(
        lambda y: ((E @ y - f) ** 2).sum(), inside, jac=lambda y: 2 * E.T @ (E @ y - f), method="SLSQP",
        constraints={"type": "ineq", "fun": lambda y: G @ y - h, "jac": lambda y: G},
        options={"ftol": 1e-13, "maxiter": 500},
    )  # fmt: skip
    assert (G @ x - h).min() > -1e-9
    assert ((E @ x - f) ** 2).sum() == pytest.approx(found.fun, rel=1e-7)
    np.testing.assert_allclose(x, found.x, atol=1e-5 * (1 + np.abs(x).max()))  # the objective is flat at its minimum


def test_random_problems_include_infeasible_ones():
    feasible = [random_problem(seed)[-1] is not None for seed in range(40)]
    assert 10 < sum(feasible) < 35


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_solution_satisfies_optimality_conditions(scale):
    """Karush-Kuhn-Tucker conditions: the gradient is a nonnegative combination of the active rows."""
    from scipy.optimize import nnls

    E, f, G, h = (scale * part for part in random_problem(3)[:4])
    x = constrained_least_squares(E, f, G, h)
    active = G @ x - h < 1e-9 * scale
    assert active.any()
    factors, rest = nnls(G[active].T, E.T @ (E @ x - f))
    assert rest < 1e-9 * scale**2
    assert (factors > 0.0).any()


@pytest.mark.parametrize("G", [np.zeros((0, 3)), np.eye(3)], ids=["no inequalities", "none active"])
def test_inactive_inequalities_give_plain_least_squares(G):
    rng = np.random.default_rng(5)
    E, f = rng.normal(size=(7, 3)), rng.normal(size=7)
    plain = np.linalg.lstsq(E, f, rcond=None)[0]
    x = constrained_least_squares(E, f, G, np.full(len(G), -100.0))
    np.testing.assert_allclose(x, plain, rtol=1e-12)


def test_contradicting_inequalities_return_none():
    E, f = np.eye(2), np.zeros(2)
    G = np.array([[1.0, 0.0], [-1.0, 0.0]])
    assert constrained_least_squares(E, f, G, np.array([1.0, -0.999])) is None
    x = constrained_least_squares(E, f, G, np.array([1.0, -1.001]))
    np.testing.assert_allclose(x, [1.0, 0.0], atol=1e-12)


def test_arguments_are_unchanged(readonly):
    E, f, G, h, _ = random_problem(3)
    first = constrained_least_squares(*map(readonly, (E, f, G, h)))
    np.testing.assert_array_equal(first, constrained_least_squares(E, f, G, h))
