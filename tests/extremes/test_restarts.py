"""A run restarted from the state of another run equals the uninterrupted run to rounding.

A `State` and a result file contain the state: displacement, velocity, acceleration, time and the internal states of
contacts.
"""

import functools
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexcam import prepare, read_case, run
from flexcam.analysis.run import open_result_file
from flexcam.dynamics import SaveAt, State, solve
from tests.thinning import mostly_slow

RESTART = "restart"
ROOT = Path(__file__).parents[2]
CASES = {
    "published load, no contact": ROOT / "tests/data/inline.toml",
    "contacts and seat": ROOT / "cases/direct-acting/bucket.toml",
    "hydraulic adjuster, its state": ROOT / "cases/pushrod-engine/intake.toml",
}
METHODS = {
    "Newmark": '{ method = "newmark" }', "HHT": '{ method = "hht" }', "Bathe": '{ method = "bathe" }',
    "generalized-alpha": '{ method = "generalized-alpha", rho_inf = 0.8 }',
}  # fmt: skip
SAVE_ALL = SaveAt(field_every=1, fields_per_block=64)
COARSE, LENGTH = "run.steps_per_revolution=480", 240
"""Half a revolution, in which valves open, bounce and close."""


@pytest.fixture(scope="module")
def restart_runs():
    """Return a function that gives the uninterrupted run and a function of the run from a step on; both are cached."""

    @functools.cache
    def make(name, method="Newmark"):
        ready = prepare(read_case(CASES[name], [COARSE, f"run.integrator={METHODS[method]}"]))
        problem = replace(ready.problem, steps=LENGTH)

        @functools.cache
        def restart(at):
            first = solve(replace(problem, steps=at), ready.scheme, save=SAVE_ALL)
            inner = first.inner if len(first.inner) else None
            d, v, a = (one[-1] for one in (first.fields.displacement, first.fields.velocity, first.fields.acceleration))
            state = State(d, v, float(first.time[-1]), inner, acceleration=a)
            return solve(replace(problem, steps=LENGTH - at, start=state), ready.scheme, save=SAVE_ALL)

        return solve(problem, ready.scheme, save=SAVE_ALL), restart

    return make


STOPS = [1, 64, 200]
SERIES = ("displacement", "velocity", "acceleration")


def relative_difference(full, restart, at):
    """Return the maximum relative difference of motion, contact forces and internal states."""
    # Energies start from zero in each run.
    channels = [name for name in full.channels if not name.startswith("energy.")]
    pairs = [(getattr(restart.fields, one), getattr(full.fields, one)) for one in SERIES]
    pairs += [(restart.channels[name], full.channels[name]) for name in channels]
    return max(float(np.abs(one - other[at:]).max()) / max(float(np.abs(other).max()), 1e-300) for one, other in pairs)


@pytest.mark.parametrize(("name", "method"), mostly_slow([
    ("published load, no contact", "Newmark"), ("contacts and seat", "Newmark"),
    pytest.param("hydraulic adjuster, its state", "Newmark", marks=pytest.mark.slow)] + [
    pytest.param("published load, no contact", method, marks=pytest.mark.slow) for method in METHODS
    if method != "Newmark"] + [
    pytest.param("contacts and seat", method, marks=pytest.mark.slow) for method in ("HHT", "Bathe")], 2))  # fmt: skip
def test_restarted_run_equals_uninterrupted_run(expect, restart_runs, name, method):
    full, restart = restart_runs(name, method)
    off = max(relative_difference(full, restart(at), at) for at in STOPS)
    expect.right(RESTART, f"{method}, {name}", what="difference from the uninterrupted run", reference=0.0,
                 computed=off, tolerance=1e-9, absolute=True)  # fmt: skip


def test_restart_without_acceleration_equals_full_run(restart_runs):
    """The initial acceleration follows from equilibrium, as the accelerations of this scheme do."""
    full, _ = restart_runs("published load, no contact")
    ready = prepare(read_case(CASES["published load, no contact"], [COARSE]))
    state = State(full.fields.displacement[64], full.fields.velocity[64], float(full.time[64]))
    later = solve(replace(ready.problem, steps=100, start=state), ready.scheme, save=SAVE_ALL)
    gap = np.abs(later.fields.displacement - full.fields.displacement[64:165]).max()
    assert 0.0 < gap <= 1e-11 * np.abs(full.fields.displacement).max()


@pytest.mark.parametrize("every", [1, pytest.param(20, marks=pytest.mark.slow)])
def test_restart_from_result_file_equals_full_run(expect, tmp_path, every):
    case = CASES["published load, no contact"]
    fields = f"output.field_every={every}"
    ready = prepare(read_case(case, ["run.revolutions=0.25", fields]))
    solve(ready.problem, ready.scheme, save=ready.save, sinks=[open_result_file(ready, tmp_path)])
    shutil.copy(case, tmp_path / "next.toml")
    overrides = ['run.start={ result = "inline.vtkhdf" }', "run.revolutions=0.25", fields]
    later = run(read_case(tmp_path / "next.toml", overrides))
    full = run(read_case(case, ["run.revolutions=0.5", fields]))
    at = len(full.time) // 2
    pairs = [(getattr(later["valve"], one), getattr(full["valve"], one)) for one in SERIES]
    off = max(float(np.abs(new - old[at:]).max() / np.abs(old).max()) for new, old in pairs)
    expect.right(RESTART, f"from a result file, a field every {every} steps", reference=0.0, computed=off,
                 what="difference from the uninterrupted run", tolerance=1e-11, absolute=True)  # fmt: skip
