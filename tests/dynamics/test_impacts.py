"""Simultaneous impacts of several contacts, against closed forms of Newton's law of restitution."""

import numpy as np
import pytest

from flexcam.core import Triplets
from flexcam.dynamics import (
    AngleVector,
    ConstantSpeed,
    Load,
    LocalForce,
    Probe,
    Problem,
    State,
    System,
    constant,
    elastic_stop,
    newmark,
    solve,
)
from flexcam.dynamics.initial_acceleration import solve_complementarity


def contact(name, row, restitution, gap=0.0):
    """Return a contact that closes where row @ u > gap."""
    row = np.asarray(row, dtype=float)
    terms = (AngleVector.constant(row),), (AngleVector.constant(-row),)
    return LocalForce(name, *terms, elastic_stop(1e9), (constant(-gap),), restitution)


def bodies(masses, *contacts, weight=0.0):
    n = len(masses)
    names = tuple(f"body {i}" for i in range(n))
    load = Load("weight", -weight * np.array(masses), lambda motion: np.ones_like(motion.angle))
    nothing = Triplets.zeros(n)
    probes = (Probe("all", names, np.eye(n), (None,) * n),)
    return System(Triplets.from_dense(np.diag(masses)), nothing, nothing, names, (load,), contacts, probes)


def simulate(system, d, v, step=1e-3, steps=100):
    response = solve(Problem(system, ConstantSpeed(1.0), step, steps, State(np.array(d), np.array(v))), newmark())
    assert response.status.ok
    return response


@pytest.mark.parametrize("e", [0.0, 0.5, pytest.param(1.0, marks=pytest.mark.slow)])
def test_two_seats_on_one_mass_bounce_like_single_seat(e):
    """W = [[1, 1], [1, 1]]/m is singular: the impulse of each seat is undetermined, the velocity is not."""
    one = simulate(bodies([2.0], contact("seat", [-1.0], e), weight=9.81), [0.1], [0.0], steps=400)
    both = [contact(name, [-1.0], e) for name in ("seat", "other")]
    two = simulate(bodies([2.0], *both, weight=9.81), [0.1], [0.0], steps=400)
    np.testing.assert_allclose(
        two["all"].velocity, one["all"].velocity, atol=1e-9 if e else 2e-3
    )  # e = 0: the mass rests on the seats
    assert np.abs(two.channels["energy.residual"]).max() < 1e-9 * 2.0 * 9.81 * 0.1


def test_seat_with_higher_restitution_governs():
    both = contact("soft", [-1.0], 0.2), contact("hard", [-1.0], 0.7)
    v = simulate(bodies([2.0], *both), [0.005], [-1.0], steps=10)["all"].velocity
    assert v[-1] == pytest.approx(0.7, rel=1e-12)


def test_resting_body_transmits_impulse():
    """The upper ball falls on a ball that rests on a seat: Newton's law holds at both contacts.

    From 0 <= p1, p2: the lower ball stays at rest, u2+ = 0, and the upper one rebounds with e times its speed.
    """
    e, v0 = 0.6, 1.0
    chain = bodies([1.0, 3.0], contact("between", [-1.0, 1.0], e), contact("seat", [0.0, -1.0], 0.3))
    v = simulate(chain, [0.0105, 1e-9], [-v0, -1e-4], steps=15)["all"].velocity
    np.testing.assert_allclose(v[-1], [e * v0, 0.0], atol=2e-3)


def test_impulses_of_chain_in_flight():
    """A body hits two touching ones: p = W^-1 (1 + e) u with W of unit masses, [[2, -1], [-1, 2]], u = (1, 0)."""
    W = np.array([[2.0, -1.0], [-1.0, 2.0]])
    np.testing.assert_allclose(solve_complementarity(W, 1.5 * np.array([1.0, 0.0])), [1.0, 0.5], rtol=1e-14)


def test_impulses_are_nonnegative():
    """The impulse of the second contact would be negative: it separates faster than restitution, without impulse."""
    W, required = np.array([[2.0, 1.0], [1.0, 2.0]]), np.array([1.0, 0.2])
    found = solve_complementarity(W, required)
    np.testing.assert_allclose(found, [0.5, 0.0], rtol=1e-14)
    assert ((W @ found)[1] >= required[1], np.linalg.solve(W, required)[1] < 0.0) == (True, True)


def test_infeasible_walls_have_zero_impulse():
    np.testing.assert_array_equal(solve_complementarity(np.array([[1.0, -1.0], [-1.0, 1.0]]), np.ones(2)), [0.0, 0.0])


def test_random_impacts_are_complementary_and_dissipative():
    """Dependent contacts, mass ratios up to 1e6, different restitutions; u = G v belongs to an actual motion."""
    random = np.random.default_rng(1)
    for _ in range(300):
        n, k = random.integers(1, 5), random.integers(1, 7)
        masses = 10.0 ** random.uniform(-3.0, 3.0, n)
        G = np.abs(random.normal(size=(k, n)))  # a common direction opens all contacts
        W, v = (G / masses) @ G.T, random.normal(size=n) / np.sqrt(masses)
        rate, e = G @ v, random.uniform(0.0, 1.0, k)
        required = np.where(rate >= 0.0, 1.0 + e, 2.0) * rate
        p = solve_complementarity(W, required)
        size = np.abs(required).max()
        after = v - G.T @ p / masses
        assert p.min() >= 0.0
        assert (W @ p - required).min() >= -1e-9 * size
        assert np.abs(p * (W @ p - required)).max() <= 1e-9 * size * max(p.max(), 1e-300)
        assert after**2 @ masses <= (1.0 + 1e-12) * (v**2 @ masses)


def test_single_contact_matches_closed_form():
    for W, required in ((0.3, 1.7), (2.0, -1.0)):
        assert solve_complementarity(np.array([[W]]), np.array([required]))[0] == max(required / W, 0.0)
