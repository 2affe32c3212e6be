"""Runs that save only probes give the same probes as complete runs, with every engine."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexcam import prepare, read_case
from flexcam.core import Triplets
from flexcam.dynamics import Cause, ConstantSpeed, Load, Probe, Problem, SaveAt, State, System, hht, newmark, solve

CASES = Path(__file__).parents[2] / "cases"
SERIES = ("displacement", "velocity", "acceleration")


@pytest.fixture(scope="module")
def published():
    return prepare(read_case(CASES / "tayeb/model-2-parabolic.toml"))


@pytest.mark.parametrize("every", [10, 37, 5000])
@pytest.mark.parametrize("scheme", [newmark(), hht(alpha=-0.1)], ids=["newmark", "hht"])
def test_probes_and_fields_match_complete_run(published, every, scheme):
    """Modes are integrated within blocks, or probes follow from a matrix product over longer blocks.

    An acceleration has the rounding of a displacement divided by the square of the step, some 1e-13 of it here.
    """
    problem = replace(published.problem, engine="modal", steps=1500)
    whole, few = (solve(problem, scheme, save=SaveAt(every, channels=kept)) for kept in (True, False))
    assert few.status.ok
    assert few.channels == {}
    assert np.array_equal(whole.time, few.time)
    assert np.array_equal(whole.angle, few.angle)
    assert np.array_equal(whole.field_time, few.field_time)
    for name in SERIES:
        one, other = getattr(whole.probes, name), getattr(few.probes, name)
        most = 1e-11 if name == "acceleration" else 1e-13
        np.testing.assert_allclose(other, one, rtol=0.0, atol=most * np.abs(one).max())
        fields, others = getattr(whole.fields, name), getattr(few.fields, name)
        np.testing.assert_allclose(others, fields, rtol=0.0, atol=most * np.abs(fields).max())


def test_all_engines_give_same_probes(published):
    problem = replace(published.problem, steps=1500)
    found = [
        solve(replace(problem, engine=path), newmark(), save=SaveAt(100, channels=False))
        for path in ("direct", "modal", "kernel")
    ]
    for other in found[1:]:  # different order of operations
        np.testing.assert_allclose(other.probes.displacement, found[0].probes.displacement, rtol=0.0, atol=1e-10 * 0.01)


def test_diverging_run_ends_at_same_step():
    """Newmark's method with beta 1/12 above its limit: the last finite step equals that of a complete run."""
    one = Triplets.from_dense([[1.0]])
    push = Load("push", np.ones(1), lambda motion: np.ones_like(motion.angle))
    watch = Probe("x", ("x",), np.eye(1), (None,))
    system = System(one, Triplets.zeros(1), one.scale(1e4), ("x",), (push,), probes=(watch,))
    problem = Problem(system, ConstantSpeed(1.0), step=0.03, steps=4000, engine="modal")
    scheme = newmark(beta=1.0 / 12.0)
    whole, few = (solve(problem, scheme, save=SaveAt(50, channels=kept)) for kept in (True, False))
    assert few.status == whole.status
    assert few.status.cause is Cause.NOT_FINITE
    assert len(few.time) == len(whole.time) < 4001
    assert np.isfinite(few.probes.displacement).all()


def test_probes_of_unloaded_system():
    """Without a load there are no load histories; the free vibration is still computed."""
    one = Triplets.from_dense([[1.0]])
    watch = Probe("x", ("x",), np.eye(1), (None,))
    system = System(one, Triplets.zeros(1), one, ("x",), probes=(watch,))
    problem = Problem(system, ConstantSpeed(1.0), step=0.01, steps=1500, start=State(np.ones(1), np.zeros(1)))
    whole, few = (solve(problem, newmark(), save=SaveAt(100, channels=kept)) for kept in (True, False))
    assert few.stats.engine == "modal"
    most = 1e-14  # relative to the maximum of one: rounding of a matrix product
    np.testing.assert_allclose(few.probes.displacement, whole.probes.displacement, rtol=0.0, atol=most)
