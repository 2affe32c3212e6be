"""Central difference and scipy's integrators against closed forms, stability limits and each other.

T. J. R. Hughes, The Finite Element Method (1987), ch. 9: the central difference is stable up to w dt = 2 at any damping
taken at the new instant, its period error at x = w dt is x / (2 asin(x/2)) - 1 without damping.
"""

import functools
import math

import numpy as np
import pytest

from flexcam import InputError
from flexcam.core import Triplets
from flexcam.dynamics import (
    AngleVector,
    Cause,
    ConstantSpeed,
    Load,
    LocalForce,
    Probe,
    Problem,
    State,
    System,
    central_difference,
    constant,
    dop853,
    elastic_stop,
    newmark,
    radau,
    solve,
)
from tests.integrators import METHODS

SOURCE = "Hughes (1987), explicit integration"


def chain_system(masses, springs, dampers=(), forces=(), push=None):
    """Return a chain of masses, the first spring to ground, with a load cos(theta) on the last mass."""
    n = len(masses)
    K, C = np.zeros((n, n)), np.zeros((n, n))
    for matrix, values in ((K, springs), (C, dampers)):
        for i, value in enumerate(values):
            row = np.zeros(n)
            row[i] = 1.0
            if i:
                row[i - 1] = -1.0
            matrix += value * np.outer(row, row)
    vector = np.eye(n)[-1] if push is None else np.array(push)
    load = Load("push", vector, lambda motion: np.cos(motion.angle))
    names = tuple(f"m{i}" for i in range(n))
    probe = Probe("all", names, np.eye(n), (None,) * n)
    return System(*(Triplets.from_dense(m) for m in (np.diag(masses), C, K)), names, (load,), forces, (probe,))


def run_to_end(system, method, steps, start=None):
    response = solve(Problem(system, ConstantSpeed(3.0), 1.0 / steps, steps, start), method)
    assert response.status.ok, str(response.status)
    return response["all"]


@pytest.mark.parametrize("damping", [0.0, 0.1, 2.0])
def test_stability_limit_of_central_difference(record, damping):
    record(source=SOURCE, case=f"central difference, damping ratio {damping:g}", quantity="stability limit w dt",
           unit="1", reference=2.0, computed=central_difference().stability_limit(damping), tolerance=1e-6,
           reason="growth counts from 1 + 1e-7; it begins as a square root without damping")  # fmt: skip


@pytest.mark.parametrize("x", [0.1, 0.5, 1.0, 1.9])
def test_period_error_of_central_difference(record, x):
    record(source=SOURCE, case=f"central difference, w dt = {x:g}", quantity="T'/T", unit="1",
           computed=1.0 + central_difference().period_error(x), reference=x / (2.0 * math.asin(x / 2.0)),
           tolerance=1e-12, reason="rounding")  # fmt: skip


def test_linear_acceleration_limit_matches_formula():
    assert newmark(beta=1 / 6).stability_limit() == pytest.approx(2.0 * math.sqrt(3.0), rel=1e-6)


@pytest.mark.parametrize("name", sorted(set(METHODS) - {"central-difference"}))
def test_implicit_methods_have_no_stability_limit(name):
    assert METHODS[name].stability_limit() == math.inf


def test_step_above_stability_limit_raises_error():
    """The run is bounded at 0.999 of the limit; at 1.001 of it the error names the limit in seconds."""
    system = chain_system([2.0, 1.0], [30.0, 20.0], push=[0.0, 0.0])
    omega = math.sqrt(np.linalg.eigvals(np.diag([0.5, 1.0]) @ system.stiffness.dense()).real.max())
    start = State(np.array([1e-3, -2e-3]), np.zeros(2))
    below, above = (Problem(system, ConstantSpeed(3.0), f * 2.0 / omega, 2000, start) for f in (0.999, 1.001))
    assert np.abs(solve(below, central_difference())["all"].displacement).max() < 0.1
    with pytest.raises(InputError, match=r"run\.step.*m1.*as many steps"):
        solve(above, central_difference())


def test_conditionally_stable_scheme_diverges_on_massless_joint():
    """For a massless damped joint every step is beyond the limit, and the status names the joint."""
    system = chain_system([2.0, 0.0, 1.0], [30.0, 20.0, 25.0], [0.0, 0.01], push=[0.5, 1.0, -0.3])
    response = solve(Problem(system, ConstantSpeed(3.0), 5e-4, 2000), newmark(beta=1 / 6))
    assert response.status.cause is Cause.NOT_FINITE
    assert "m1" in response.status.text
    assert np.isfinite(response["all"].displacement).all()


@functools.cache
def run_massless_joint(method, steps):
    """Return the run of mass - spring - loaded massless joint - spring - mass by a method."""
    system = chain_system([2.0, 0.0, 1.0], [30.0, 20.0, 25.0], push=[0.5, 1.0, -0.3])
    return run_to_end(system, method, steps, State(np.array([0.01, 0.0, 0.02]), np.array([0.1, 0.0, -0.2])))


@pytest.mark.parametrize("name", sorted(METHODS))
def test_methods_agree_with_massless_joint(record, name):
    """The reference is DOP853 at 1e-12."""
    reference, found = run_massless_joint(dop853(tolerance=1e-12), 20), run_massless_joint(METHODS[name], 2000)
    for quantity in ("displacement", "velocity"):
        # Second order at 1/200 of the highest period over 2 pi. The joint velocity is not an unknown of scipy's
        # integrators.
        masses = [0, 2] if quantity == "velocity" else [0, 1, 2]
        one, other = (getattr(history, quantity)[-1, masses] for history in (found, reference))
        np.testing.assert_allclose(one, other, rtol=1e-4, atol=1e-6)
    record(source=SOURCE, case=f"joint without mass, {name}", quantity="displacement of the last mass", unit="m",
           reference=reference.displacement[-1, 2], computed=found.displacement[-1, 2], tolerance=1e-4,
           reason="error constant of second order at w dt = 0.005")  # fmt: skip


def one_sided_stop(n, where, behind):
    """Return a one-sided spring to ground behind a gap, which acts in compression only."""
    row, law = AngleVector.constant(np.eye(n)[where]), elastic_stop(400.0)
    return LocalForce("stop", (row,), (AngleVector.constant(-np.eye(n)[where]),), law, (constant(-behind),))


@functools.cache
def run_against_stop(method, steps):
    """Return the run by a method of two masses that strike a one-sided spring several times."""
    return run_to_end(
        chain_system([2.0, 1.0], [30.0, 20.0], forces=(one_sided_stop(2, 1, 0.01),), push=[0.0, 3.0]), method, steps
    )


@pytest.mark.parametrize(
    "check", [pytest.param(radau(tolerance=1e-10), marks=pytest.mark.slow), dop853(tolerance=1e-10)]
)
def test_scipy_integrators_agree_with_stop_contact(record, check):
    """Two independent codes locate the contact events."""
    reference, found, contact = (
        run_against_stop(check, 50),
        run_against_stop(newmark(), 20000),
        run_against_stop(newmark(), 50),
    )
    assert contact.displacement.max() > 0.012  # the stop is in contact
    record(source=SOURCE, case=f"two masses against a stop, {check.name}", quantity="largest displacement", unit="m",
           reference=np.abs(reference.displacement).max(), computed=np.abs(found.displacement[::400]).max(),
           tolerance=2e-6, reason="second order at w dt = 0.0015, events within both")  # fmt: skip


@pytest.mark.parametrize("method", [central_difference(), radau()])
def test_massless_contacts_and_dampers_raise_error(method):
    springs = [30.0, 20.0, 25.0]
    damped = chain_system([2.0, 0.0, 1.0], springs, [0.0, 0.3, 0.0])
    with pytest.raises(InputError, match="m1"):
        run_to_end(damped, method, 1000)
    touched = chain_system([2.0, 0.0, 1.0], springs, forces=(one_sided_stop(3, 1, 0.01),))
    with pytest.raises(InputError, match="stop"):
        run_to_end(touched, method, 1000)


@pytest.mark.slow
def test_central_difference_with_stop_contact(record):
    implicit, explicit = run_against_stop(newmark(), 20000), run_against_stop(central_difference(), 20000)
    record(source=SOURCE, case="two masses against a stop, central difference", quantity="displacement after 1 s",
           unit="m", reference=implicit.displacement[-1, 1], computed=explicit.displacement[-1, 1], tolerance=1e-4,
           reason="both of second order, with opposite period errors")  # fmt: skip


def test_stability_limit_of_large_model():
    """The sparse algorithm (above 300 unknowns) is compared with the closed form of a free-fixed chain."""
    n = 400
    system = chain_system([1.0] * n, [1.0] * n, push=np.zeros(n))
    limit = 1.0 / math.sin(0.5 * math.pi * (2 * n - 1) / (2 * n + 1))  # 2 / (2 sin(...))
    start = State(1e-3 * np.ones(n), np.zeros(n))
    solve(Problem(system, ConstantSpeed(1.0), limit * (1 - 1e-4), 2, start), central_difference())
    with pytest.raises(InputError, match="is unstable"):
        solve(Problem(system, ConstantSpeed(1.0), limit * (1 + 1e-4), 2, start), central_difference())
