"""Order of integration across opening and closing of a contact, and impacts, against closed forms.

A mass falls from a height onto a stop; the phase of the touchdown within the step varies, and errors are root mean
squares over the phases, because a single phase may be accurate by chance.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from flexcam.core import Triplets
from flexcam.core.errors import InputError
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
    generalized_alpha,
    hht,
    newmark,
    solve,
    spring_damper,
)
from tests.thinning import mostly_slow

G, W, V0 = 9.81, 300.0, 1.0
CONTACT = 2.0 / W * (math.pi - math.atan(V0 * W / G))
PHASES = np.linspace(0.0, 1.0, 16, endpoint=False)


def falling_mass(law, restitution=None, *, mass=1.0):
    one = Triplets.from_dense([[1.0]])
    force = LocalForce(
        "stop", (AngleVector.constant(np.array([-1.0])),), (AngleVector.constant(np.array([1.0])),), law,
        (constant(0.0),), restitution,
    )  # fmt: skip
    weight = Load("weight", np.array([-G]), lambda motion: np.ones_like(motion.angle))
    return System(
        one.scale(mass), Triplets.zeros(1), Triplets.zeros(1), ("y",), (weight,), (force,),
        (Probe("y", ("y",), np.eye(1), (None,)),),
    )  # fmt: skip


def state_before_touchdown(before):
    """Return height and speed of a mass at a time before it touches down with V0."""
    return V0 * before - 0.5 * G * before**2, -V0 + G * before


def run_past_touchdown(system, scheme, steps, phase, after):
    """Return position and velocity at the end of a run, and the time since touchdown (before the next one)."""
    step = (0.01 + after) / steps
    before = 0.01 + phase * step
    height, speed = state_before_touchdown(before)
    time = steps * step
    response = solve(
        Problem(system, ConstantSpeed(1.0), step, steps, State(np.array([height]), np.array([speed]))), scheme
    )
    assert response.status.ok
    return response["y"].displacement[-1], response["y"].velocity[-1], time - before


@pytest.mark.parametrize(
    "scheme",
    [
        newmark(),
        pytest.param(hht(alpha=-0.05), marks=pytest.mark.slow),
        pytest.param(generalized_alpha(rho_inf=0.8), marks=pytest.mark.slow),
    ],
    ids=["newmark", "hht", "alpha"],
)
def test_order_through_touchdown_and_separation(scheme, fitted_order):
    """After contact the mass moves up with V0; the contact contributes the period error of the scheme."""
    counts = np.array([50, 100])
    rms = []
    for count in counts.tolist():
        errors = []
        for phase in PHASES:
            y, v, since = run_past_touchdown(falling_mass(elastic_stop(W**2)), scheme, count, phase, CONTACT + 0.01)
            up = since - CONTACT
            errors.append([(y - (V0 * up - 0.5 * G * up**2)) * W, v - (V0 - G * up)])
        rms.append(np.sqrt(np.mean(np.square(errors))))
    assert fitted_order(1.0 / counts, rms) > 1.8


def test_impacts_in_free_flight_are_exact(fitted_order):
    """Free flight is exact in average acceleration: the error of an impact located inside the step is rounding."""
    for phase in PHASES:
        y, v, since = run_past_touchdown(falling_mass(elastic_stop(1e9), 0.6), newmark(), 50, phase, 0.02)
        assert y == pytest.approx(0.6 * V0 * since - 0.5 * G * since**2, abs=1e-10)
        assert v == pytest.approx(0.6 * V0 - G * since, abs=1e-9)


@pytest.mark.parametrize("e", mostly_slow([0.0, 0.3, 0.8, 1.0], 2))
def test_bounce_heights_follow_restitution(e):
    """Heights fall by e^2 per bounce; the energy balance counts the loss as dissipated."""
    height, _ = state_before_touchdown(0.05)
    state, steps = State(np.array([height]), np.zeros(1)), 600 if e > 0.5 else 250
    response = solve(Problem(falling_mass(elastic_stop(1e9), e), ConstantSpeed(1.0), 1e-3, steps, state), newmark())
    assert response.status.ok
    y = response["y"].displacement
    tops = [float(y[i]) for i in range(1, len(y) - 1) if y[i] > y[i - 1] and y[i] >= y[i + 1] and y[i] > 1e-5]
    for i, top in enumerate(tops[:3]):
        assert top == pytest.approx(height * e ** (2 * (i + 1)), abs=G * 1e-6 / 8)  # the top is between two steps
    first = int(np.argmax(response["y"].velocity > 0.0)) if e else 200
    lost = response.channels["energy.dissipated"][first]
    assert lost == pytest.approx((1.0 - e**2) * G * height, rel=1e-6, abs=1e-9)
    assert np.abs(response.channels["energy.residual"]).max() < 1e-9 * G * height  # of a stop of 1e9 N/m
    assert y.min() > -1e-6


def test_impact_of_two_masses_conserves_momentum():
    """Two bodies in flight: momentum is constant, the relative speed reverses and is multiplied by e."""
    M = Triplets.from_dense(np.diag([2.0, 0.5]))
    row = np.array([1.0, -1.0])
    force = LocalForce(
        "both", (AngleVector.constant(row),), (AngleVector.constant(-row),), elastic_stop(1e8), (constant(-1e-3),), 0.5
    )
    probes = (Probe("all", ("a", "b"), np.eye(2), (None, None)),)
    system = System(M, Triplets.zeros(2), Triplets.zeros(2), ("a", "b"), (), (force,), probes)
    start = State(np.zeros(2), np.array([3.0, -1.0]))
    v = solve(Problem(system, ConstantSpeed(1.0), 1e-4, 20, start), newmark())["all"].velocity[-1]
    assert 2.0 * v[0] + 0.5 * v[1] == pytest.approx(2.0 * 3.0 - 0.5, rel=1e-12)
    assert v[0] - v[1] == pytest.approx(-0.5 * 4.0, rel=1e-12)


def test_restitution_without_mass_raises_error():
    system = falling_mass(elastic_stop(1e6), 0.5, mass=0.0)
    spring = replace(system, stiffness=Triplets.from_dense([[10.0]]))
    with pytest.raises(InputError, match="no mass"):
        solve(Problem(spring, ConstantSpeed(1.0), 1e-3, 5), newmark())


def test_event_count():
    height, _ = state_before_touchdown(0.05)
    state = State(np.array([height]), np.zeros(1))
    response = solve(Problem(falling_mass(elastic_stop(W**2)), ConstantSpeed(1.0), 1e-3, 150, state), newmark())
    assert response.stats.events == 2  # touchdown and separation
    bilateral = Problem(falling_mass(spring_damper(W**2)), ConstantSpeed(1.0), 1e-3, 150, state)
    assert solve(bilateral, newmark()).stats.events == 0  # no contact opens or closes


def test_average_acceleration_has_no_numerical_dissipation():
    """The numerical loss of the scheme is a separate channel: with springs and linear contacts it is rounding."""
    height, _ = state_before_touchdown(0.05)
    state = State(np.array([height]), np.zeros(1))
    for scheme, dissipates in ((newmark(), False), (newmark(beta=0.3025, gamma=0.6), True)):
        response = solve(Problem(falling_mass(elastic_stop(W**2)), ConstantSpeed(1.0), 1e-3, 400, state), scheme)
        largest = np.abs(response.channels["energy.numerical"]).max() / (G * height)
        assert (largest < 1e-9) is not dissipates
