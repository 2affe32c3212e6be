"""Impacts of several contacts at once, against closed forms of Newton's law of restitution."""

from __future__ import annotations

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
    """Pressed where row @ u > gap."""
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


def flown(system, d, v, step=1e-3, steps=100):
    response = solve(Problem(system, ConstantSpeed(1.0), step, steps, State(np.array(d), np.array(v))), newmark())
    assert response.status.ok
    return response


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_two_seats_on_one_mass_bounce_as_one(e):
    """W = [[1, 1], [1, 1]]/m is singular: the share of each seat is open, the velocity is not."""
    one = flown(bodies([2.0], contact("seat", [-1.0], e), weight=9.81), [0.1], [0.0], steps=400)
    both = [contact(name, [-1.0], e) for name in ("seat", "other")]
    two = flown(bodies([2.0], *both, weight=9.81), [0.1], [0.0], steps=400)
    np.testing.assert_allclose(
        two["all"].velocity, one["all"].velocity, atol=1e-9 if e else 2e-3
    )  # e = 0: they lie on it
    assert np.abs(two.channels["energy.residual"]).max() < 1e-9 * 2.0 * 9.81 * 0.1


def test_the_harder_of_two_seats_decides():
    both = contact("soft", [-1.0], 0.2), contact("hard", [-1.0], 0.7)
    v = flown(bodies([2.0], *both), [0.005], [-1.0], steps=10)["all"].velocity
    assert v[-1] == pytest.approx(0.7, rel=1e-12)


def test_a_body_that_rests_takes_the_impulse():
    """The upper ball falls on one that lies on a seat: Newton's law holds at both contacts at once.

    From 0 <= p1, p2: the lower ball stays, u2+ = 0, and the upper one goes up with e times its speed.
    """
    e, v0 = 0.6, 1.0
    chain = bodies([1.0, 3.0], contact("between", [-1.0, 1.0], e), contact("seat", [0.0, -1.0], 0.3))
    v = flown(chain, [0.0105, 1e-9], [-v0, -1e-4], steps=15)["all"].velocity
    np.testing.assert_allclose(v[-1], [e * v0, 0.0], atol=2e-3)


def test_a_chain_in_flight_by_hand():
    """A body meets two that touch: p = W^-1 (1 + e) u with W of unit masses, [[2, -1], [-1, 2]], u = (1, 0)."""
    W = np.array([[2.0, -1.0], [-1.0, 2.0]])
    np.testing.assert_allclose(solve_complementarity(W, 1.5 * np.array([1.0, 0.0])), [1.0, 0.5], rtol=1e-14)


def test_no_impulse_pulls():
    """The second contact would have to pull: it parts faster than restitution asks, and takes no impulse."""
    W, asked = np.array([[2.0, 1.0], [1.0, 2.0]]), np.array([1.0, 0.2])
    found = solve_complementarity(W, asked)
    np.testing.assert_allclose(found, [0.5, 0.0], rtol=1e-14)
    assert ((W @ found)[1] >= asked[1], np.linalg.solve(W, asked)[1] < 0.0) == (True, True)


def test_walls_that_close_have_no_impulse():
    np.testing.assert_array_equal(solve_complementarity(np.array([[1.0, -1.0], [-1.0, 1.0]]), np.ones(2)), [0.0, 0.0])


def test_random_impacts_are_complementary_and_lose_energy():
    """Dependent contacts, masses apart by 1e6, a restitution for each; u = G v is what some motion makes."""
    random = np.random.default_rng(1)
    for _ in range(300):
        n, k = random.integers(1, 5), random.integers(1, 7)
        masses = 10.0 ** random.uniform(-3.0, 3.0, n)
        G = np.abs(random.normal(size=(k, n)))  # a common direction parts all of them
        W, v = (G / masses) @ G.T, random.normal(size=n) / np.sqrt(masses)
        rate, e = G @ v, random.uniform(0.0, 1.0, k)
        asked = np.where(rate >= 0.0, 1.0 + e, 2.0) * rate
        p = solve_complementarity(W, asked)
        size = np.abs(asked).max()
        after = v - G.T @ p / masses
        assert p.min() >= 0.0
        assert (W @ p - asked).min() >= -1e-9 * size
        assert np.abs(p * (W @ p - asked)).max() <= 1e-9 * size * max(p.max(), 1e-300)
        assert after**2 @ masses <= (1.0 + 1e-12) * (v**2 @ masses)


def test_one_contact_is_the_closed_form():
    for W, asked in ((0.3, 1.7), (2.0, -1.0)):
        assert solve_complementarity(np.array([[W]]), np.array([asked]))[0] == max(asked / W, 0.0)
