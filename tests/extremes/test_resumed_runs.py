"""A run resumed from its partial result writes the same file as the uninterrupted run, bit by bit.

The tests cover all engines, methods and models of a case, so that a missing part of the checkpoint is detected.
"""

import functools
import zlib
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from flexcam import prepare, read_case
from flexcam.analysis.run import open_partial_result, open_result_file
from flexcam.dynamics import Cause, SaveAt, solve
from tests.sinks import Cut
from tests.thinning import slow_if

ROOT = Path(__file__).parents[2]
LINEAR = ROOT / "tests/data/inline.toml"
BUCKET = ROOT / "cases/direct-acting/bucket.toml"
ADJUSTER = ROOT / "cases/pushrod-engine/intake.toml"
CONTACTS = ROOT / "tests/data/every-contact.toml"
SHAFT = ROOT / "cases/tayeb/model-1-shm.toml"

SAVE = SaveAt(field_every=10, fields_per_block=2)
STEPS = 150
"""Eight blocks of twenty steps, the last one of eleven."""

RUNS = {
    "general, linear": (LINEAR, "run.engine=direct"),
    "general, contacts and seat": (BUCKET, "run.engine=direct"),
    "general, hydraulic adjuster": (ADJUSTER, "run.engine=direct"),
    "general, lash, Hertz, dissipation": (CONTACTS, "run.engine=direct"),
    "modal": (LINEAR, "run.engine=modal"),
    "modal, generalized-alpha": (LINEAR, "run.engine=modal", "run.integrator.method=generalized-alpha"),
    "compiled, linear": (LINEAR, "run.engine=kernel"),
    "compiled, contacts and seat": (BUCKET, "run.engine=kernel"),
    "compiled, hydraulic adjuster": (ADJUSTER, "run.engine=kernel"),
    "collocation, contacts and seat": (BUCKET, "run.integrator.method=collocation"),
    "collocation, divided steps": (
        BUCKET, "run.integrator.method=collocation", "run.steps_per_revolution=200",
    ),
    "HHT, contacts": (BUCKET, "run.engine=direct", "run.integrator.method=hht"),
    "Bathe, contacts": (BUCKET, "run.integrator.method=bathe"),
    "central difference": (LINEAR, "run.integrator.method=central-difference", "run.steps_per_revolution=36000"),
    "scipy's Radau": (LINEAR, "run.integrator.method=radau", "run.steps_per_revolution=3600"),
    "scipy's DOP853": (LINEAR, "run.integrator.method=dop853", "run.steps_per_revolution=7200"),
    "adaptive steps": (BUCKET, "run.adaptive={ tolerance = 1e-6 }"),
    "adaptive steps, linear": (LINEAR, "run.adaptive={ tolerance = 1e-7 }"),
    "four modes": (BUCKET, "fidelity.modes=4"),
    "Craig-Bampton": (BUCKET, "fidelity.modes=4", "fidelity.reduction=craig-bampton"),
    "every unknown, none left out": (LINEAR, "fidelity.prune=false"),
    "rigid": (ADJUSTER, "fidelity.model=rigid"),
    "one mass": (ADJUSTER, "fidelity.model=sdof"),
    "chain": (ADJUSTER, "fidelity.model=chain"),
    "periodic start": (SHAFT, "run.start=periodic"),
    "speed that swings": (LINEAR, "run.fluctuation={ orders = [2], amplitudes = [0.05], phases = ['0 deg'] }"),
}  # fmt: skip


def prepare_run(kind, *, steps=STEPS, save=SAVE):
    path, *overrides = RUNS[kind]
    ready = prepare(read_case(path, overrides))
    return replace(ready, problem=replace(ready.problem, steps=steps), save=save)


def solve_to_file(ready, folder, *, cut=None, earlier=None):
    file = open_result_file(ready, folder, resume=earlier)
    sinks = [file] if cut is None else [Cut(cut), file]
    return solve(ready.problem, ready.scheme, save=ready.save, sinks=sinks, resume=earlier), file


def content(path):
    """Return all datasets and attributes of a file as bytes, except date, run time and the digest over them."""
    found = {}

    def visit(name, item):
        for key, value in item.attrs.items():
            # The digest, "seal", covers date and run time.
            if key not in ("DIMENSION_LIST", "REFERENCE_LIST", "seconds", "seal"):
                found[f"{name}@{key}"] = np.asarray(value).tolist()
        if isinstance(item, h5py.Dataset) and name != "about/created":
            found[name] = item[()] if item.dtype.kind == "O" else (item.shape, item[()].tobytes())

    with h5py.File(path) as file:
        visit("", file)
        file.visititems(visit)
    return found


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory):
    """Return a function that gives the response of the uninterrupted run and the content of its file."""

    @functools.cache
    def make(kind):
        response, file = solve_to_file(prepare_run(kind), tmp_path_factory.mktemp("whole"))
        assert response.status.ok, response.status
        return response, content(file.path)

    return make


def different_names(found, expected):
    return sorted(name for name in found.keys() | expected.keys() if found.get(name) != expected.get(name))


SLOW = {
    "general, hydraulic adjuster", "general, lash, Hertz, dissipation", "modal, generalized-alpha", "HHT, contacts",
    "compiled, hydraulic adjuster", "scipy's Radau", "adaptive steps", "central difference", "chain",
    "Craig-Bampton", "every unknown, none left out", "periodic start", "speed that swings", "one mass", "rigid",
    "scipy's DOP853", "four modes", "compiled, linear", "Bathe, contacts",
    "collocation, contacts and seat", "general, contacts and seat", "modal", "compiled, contacts and seat",
}  # fmt: skip
"""Runs whose checkpoint has the same parts as that of another run."""


@pytest.mark.parametrize("kind", slow_if(lambda kind: kind in SLOW, RUNS))
def test_resumed_run_equals_uninterrupted_run(kind, uninterrupted, tried, tmp_path):
    """The run is interrupted twice, at random blocks, and prepared anew in between."""
    response, expected = uninterrupted(kind)
    first, second = sorted(np.random.default_rng(zlib.crc32(kind.encode())).choice(np.arange(1, 8), 2, replace=False))
    broken, _ = solve_to_file(prepare_run(kind), tmp_path, cut=first)
    assert broken.status.cause is Cause.INTERRUPTED
    ready = prepare_run(kind)
    earlier = open_partial_result(ready, tmp_path)
    assert earlier.checkpoint.steps == 20 * first
    solve_to_file(ready, tmp_path, cut=second, earlier=earlier)
    ready = prepare_run(kind)
    earlier = open_partial_result(ready, tmp_path)
    assert earlier.checkpoint.steps == 20 * second
    again, file = solve_to_file(ready, tmp_path, earlier=earlier)
    assert again.status.ok
    assert not different_names(content(file.path), expected)
    assert [one.name for one in tmp_path.iterdir()] == [file.path.name]
    assert replace(again.stats, seconds=0.0) == replace(response.stats, seconds=0.0)
    for name in ("time", "angle", "field_time", "field_angle"):
        assert np.array_equal(getattr(again, name), getattr(response, name)), name
    for name in ("displacement", "velocity", "acceleration"):
        assert np.array_equal(getattr(again.probes, name), getattr(response.probes, name)), name
    tried("killed", f"stopped twice and resumed: {kind}", 2, "every dataset equals that of the uninterrupted run")


def test_time_limit_before_first_block_keeps_checkpoint(uninterrupted, tmp_path):
    """The next run continues from the same checkpoint."""
    kind = "general, linear"
    solve_to_file(prepare_run(kind), tmp_path, cut=3)
    ready = prepare_run(kind)
    earlier = open_partial_result(ready, tmp_path)
    timed_out = solve(
        ready.problem, ready.scheme, save=ready.save, sinks=[open_result_file(ready, tmp_path, resume=earlier)],
        resume=earlier, until=0.0,
    )  # fmt: skip
    assert timed_out.status.cause is Cause.TIME_LIMIT
    ready = prepare_run(kind)
    earlier = open_partial_result(ready, tmp_path)
    assert earlier.checkpoint.steps >= 60
    _, file = solve_to_file(ready, tmp_path, earlier=earlier)
    assert not different_names(content(file.path), uninterrupted(kind)[1])
