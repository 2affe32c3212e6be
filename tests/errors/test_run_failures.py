"""Failed runs report cause, time and remedy and return the finished part; singular models are refused."""

from pathlib import Path

import numpy as np
import pytest

from flexcam import prepare, read_case
from flexcam.core import DENSE_LIMIT, Triplets
from flexcam.dynamics import (
    AngleVector,
    Cause,
    ConstantSpeed,
    LocalForce,
    Problem,
    Reaction,
    RunFailedError,
    SaveAt,
    State,
    System,
    constant,
    newmark,
    solve,
)

DRIVE = ConstantSpeed(5.0)
STEP = 0.01


class Law:
    """Force law of three functions of `gap`, the penetration, and `rate`: force and tangents."""

    def __init__(self, force, by_gap, by_rate):
        self.parts = force, by_gap, by_rate

    def respond(self, gap, rate, angle):
        force, by_gap, by_rate = (part(gap, rate) for part in self.parts)
        return Reaction(force, np.atleast_2d(by_gap), np.atleast_2d(by_rate))


def zero_force(gap, rate):
    return np.zeros(1)


def mass_chain(n, gap=(), law=None):
    """Return n masses on springs; `gap` lists unknowns without mass and stiffness."""
    stiff = np.ones(n)
    stiff[list(gap)] = 0.0
    places = np.arange(n)
    K, M = Triplets(n, places, places, 100 * stiff), Triplets(n, places, places, stiff)
    row = np.eye(1, n, 1)[0]
    force = (
        (LocalForce("joint", (AngleVector.constant(row),), (AngleVector.constant(row),), law, (constant(0.0),)),)
        if law
        else ()
    )
    return System(M, Triplets.zeros(n), K, tuple(f"part{i}.uy" for i in range(n)), local_forces=force)


def initial_state(n):
    return State(np.full(n, 0.1), np.zeros(n))


def assert_finite_with_remedy(response):
    assert len(response.time) == len(response.probes.displacement)
    for part in (response.probes, response.fields):
        for name in ("displacement", "velocity", "acceleration"):
            assert np.isfinite(getattr(part, name)).all()
    assert response.status.remedy


@pytest.mark.parametrize("save", [SaveAt(), SaveAt(20, 1), SaveAt(1, 1), SaveAt(1000, 1)], ids=str)
@pytest.mark.parametrize("local", [True, False], ids=["local", "matrix"])
def test_divergence_gives_status_not_finite(local, save):
    """The motion grows by (1 + x)/(1 - x) per step, x = g dt/2 = 0.9, and reaches 1e100 after about 80 steps."""
    gain = 180.0
    if local:
        system = mass_chain(3, law=Law(lambda g, r: gain * r, zero_force, lambda g, r: np.array([gain])))
    else:
        plain = mass_chain(3)
        system = System(plain.mass, Triplets.outer(np.eye(3)[1], np.eye(3)[1], -gain), plain.stiffness, plain.names)
    response = solve(Problem(system, DRIVE, STEP, 2000, initial_state(3)), newmark(), save=save)
    assert response.status.cause is Cause.NOT_FINITE
    assert not response.status.ok
    named = ("part1.uy", "joint") if local else ("part1.uy",)  # the diverged unknown, or the force that caused it
    assert any(name in response.status.text for name in named)
    assert "t = " in response.status.text
    assert "deg" in response.status.text
    assert_finite_with_remedy(response)
    assert 70 < len(response.time) < 100  # for every SaveAt the run ends at the limit of 1e100


@pytest.mark.parametrize("n", [3, DENSE_LIMIT + 10], ids=["dense", "sparse"])
def test_unknown_without_mass_and_stiffness_is_refused(n):
    with pytest.raises(RunFailedError, match=r"part2\.uy") as failure:
        solve(Problem(mass_chain(n, gap=[2]), DRIVE, STEP, 10), newmark())
    assert failure.value.status.cause is Cause.SINGULAR
    assert failure.value.status.remedy


@pytest.mark.parametrize("failing_step", [1, 700])
def test_discontinuous_force_gives_status_no_convergence(failing_step):
    """A force that changes sign against its own motion has no equilibrium."""
    wall = {"on": False, "calls": 0}

    def push(gap, rate):
        wall["calls"] += 1
        return np.where(gap > 0, 1e9, -1e9) if wall["calls"] > failing_step else np.zeros(1)

    system = mass_chain(3, law=Law(lambda g, r: -push(g, r), zero_force, zero_force))
    response = solve(Problem(system, DRIVE, STEP, 2000, initial_state(3)), newmark(), save=SaveAt(fields_per_block=32))
    assert response.status.cause is Cause.NO_CONVERGENCE
    assert "t = " in response.status.text
    assert "joint" in response.status.text
    assert_finite_with_remedy(response)
    assert len(response.time) >= min(failing_step - 5, 640)


def test_singular_tangent_gives_failure_status():
    """A negative spring cancels the effective stiffness S = M/(beta dt^2) + K: the Newton matrix is zero."""
    exact = 1.0 / (0.25 * STEP**2) + 100.0
    law = Law(lambda g, r: exact * g, lambda g, r: np.array([exact]), zero_force)
    response = solve(Problem(mass_chain(3, law=law), DRIVE, STEP, 50, initial_state(3)), newmark())
    assert response.status.cause in (Cause.NO_CONVERGENCE, Cause.SINGULAR, Cause.NOT_FINITE)
    assert_finite_with_remedy(response)


def test_nearly_coincident_nodes_give_status_rounding():
    """An element of 30 nm next to one of 55 mm: the stiffnesses differ by 18 decades."""
    case = Path(__file__).parents[2] / "cases/direct-acting/bucket.toml"
    with pytest.raises(RunFailedError) as failed:
        prepare(read_case(case, ['nodes.front.0="3e-05 mm"']))
    assert failed.value.status.cause is Cause.ROUNDING


def test_failure_causes_have_distinct_texts():
    assert len({str(cause) for cause in Cause}) == len(Cause)
