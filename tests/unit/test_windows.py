"""Steps that are looked into: polynomials say what the laws say, or do not say anything; machine code walks by them."""

from __future__ import annotations

import numpy as np
import pytest

from flexcam import prepare, read_case
from flexcam.integrate import Problem, SaveAt, State, newmark, solve
from flexcam.integrate.compiled.window import SAME, Windows
from flexcam.integrate.events import Walker
from flexcam.linalg import Triplets
from flexcam.system import AngleVector, ConstantSpeed, LocalForce, Probe, System
from flexcam.train.penalty import Stop

STEP = 1e-3
ENDS = 0.5 + STEP * np.arange(1, 5)
PARTS = (0.0, 0.013, 0.3456, 0.7, 1.0)
SOME = np.full(2, SAME)


def smooth(times):
    return np.stack([np.sin(40.0 * times), np.exp(times)], axis=-1)


def cornered(times):
    """Return two laws, the second with a corner within the third step."""
    return np.stack([np.sin(40.0 * times), np.abs(times - (ENDS[2] - 0.4 * STEP))], axis=-1)


def test_between_the_points_of_every_step():
    windows = Windows(7, ENDS, STEP, smooth, SOME)
    for row, end in enumerate(ENDS, start=7):
        for part in PARTS:
            expected = smooth(np.array([end - STEP + part * STEP]))[0]
            # The remainder of six points is (40 h)^6/6!/2^11 = 3e-15.
            np.testing.assert_allclose(windows.at(row, part), expected, rtol=0.0, atol=2e-14)


def test_a_corner_is_not_smoothed_over():
    windows = Windows(7, ENDS, STEP, cornered, SOME)
    assert windows.rows.tolist() == [7, 1, 1, 0, 1]
    assert windows.at(9, 0.5) is None
    assert windows.at(10, 0.5) is not None


def test_what_need_not_be_known_well():
    windows = Windows(7, ENDS, STEP, cornered, np.array([SAME, 1.0]))
    assert windows.rows[1:].all()


def test_outside():
    windows = Windows(7, ENDS, STEP, smooth, SOME)
    assert [windows.cover(row) for row in (6, 7, 10, 11)] == [False, True, True, False]
    assert windows.at(7, -0.1) is None
    assert windows.at(7, 1.1) is None


def moving(angle, order):
    """Where the stops are: they come and go with the cam."""
    return -0.1 + 0.05 * np.sin(angle) if order == 0 else 0.05 * np.cos(angle)


def test_two_events_in_one_step():
    """Two masses meet one stop one after the other: behind the first event the second is where the cam is by then."""
    pytest.importorskip("numba")
    stops = tuple(
        LocalForce(name, (AngleVector.constant(row),), (AngleVector.constant(-row),), Stop(40.0), (moving,), (0,))
        for name, row in zip("ab", np.eye(2), strict=True)
    )
    M, K = Triplets.from_dense(np.eye(2)), Triplets.from_dense(np.diag([1.0, 1.3]))
    probe = Probe("masses", ("a", "b"), np.eye(2), (None, None))
    system = System(M, Triplets.zeros(2), K, ("a", "b"), local_forces=stops, probes=(probe,))
    start = State(np.zeros(2), np.array([0.61, 0.53]))
    runs = [
        solve(
            Problem(system, ConstantSpeed(1.0), step=0.1, steps=12, start=start, path=path), newmark(),
            save=SaveAt(field_every=1),
        )
        for path in ("general", "compiled")
    ]  # fmt: skip
    general, compiled = (run["masses"].displacement for run in runs)
    assert [run.stats.events for run in runs] == [4, 4]
    np.testing.assert_allclose(compiled, general, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("name", ["pushrod-engine/intake", "direct-acting/bucket"])  # alone, and coupled by damping
def test_events_stay_in_machine_code(name, monkeypatch):
    """Nothing is walked in Python where laws are smooth: that costs a hundred times as much."""
    pytest.importorskip("numba")

    def never(*_):
        message = "a step was walked in Python"
        raise AssertionError(message)

    monkeypatch.setattr(Walker, "walk", never)
    ready = prepare(read_case(f"cases/{name}.toml", ["run.revolutions=1", "run.path='compiled'"]))
    response = solve(ready.problem, ready.scheme, save=ready.save)
    assert response.status.ok
    assert response.stats.events > 10
