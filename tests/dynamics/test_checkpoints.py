"""Checkpoints: round trip of the state, and resumed runs without a file."""

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from flexcam import prepare, read_case
from flexcam.dynamics import SaveAt, fingerprint, newmark, solve
from flexcam.dynamics.blocks import flatten
from flexcam.dynamics.step_state import StepState

CASE = Path(__file__).parents[1] / "data/inline.toml"


def step_state(**more):
    n, c = np.arange(3.0) / 7.0, np.array([1.0, -2.0]) / 3.0
    return StepState(0.1, n, 2.0 * n, 3.0 * n, 4.0 * n, c, 2.0 * c, 3.0 * c, c[:1], **more)


@pytest.mark.parametrize("more", [
    {}, {"pressed": np.array([True, False]), "impulse": np.array([0.0, 0.7]), "iterations": 3, "stride": 1e-7}
])  # fmt: skip
def test_step_state_round_trip(more):
    """All fields survive, including those added in the future."""
    before = step_state(**more)
    arrays = {**flatten("last", before), "counts": np.zeros(2)}
    after = StepState.from_checkpoint("last", arrays)
    assert flatten("", after).keys() == flatten("", before).keys()
    assert {one.name for one in fields(StepState) if getattr(after, one.name) is None} == {
        one.name for one in fields(StepState) if getattr(before, one.name) is None
    }
    for name, values in flatten("", before).items():
        assert np.array_equal(flatten("", after)[name], values), name
        assert flatten("", after)[name].dtype == values.dtype, name


def test_missing_step_state_is_none():
    assert StepState.from_checkpoint("last", {"load": np.zeros(2)}) is None


class MemorySink:
    """Sink that holds the blocks and checkpoints of an interrupted run in memory, for `solve`."""

    def __init__(self, stop=100):
        self.stop, self._blocks, self.checkpoint = stop, [], None

    def write(self, block):
        if len(self._blocks) == self.stop:
            raise KeyboardInterrupt
        self._blocks.append(block)

    def write_checkpoint(self, checkpoint):
        self.checkpoint = checkpoint

    def close(self, status, stats):
        pass

    def blocks(self):
        return iter(self._blocks)


@pytest.mark.parametrize("path", ["direct", "modal", "kernel"])
@pytest.mark.parametrize("channels", [True, False])
@pytest.mark.parametrize("every", [10, 5])
def test_resume_without_file(path, channels, every):
    """Without channels, the modal engine computes the probes only."""
    ready = prepare(read_case(CASE, [f"run.engine={path}"]))
    problem = replace(ready.problem, steps=450)
    save = SaveAt(field_every=every, fields_per_block=100 // every, channels=channels)
    whole = solve(problem, ready.scheme, save=save)
    earlier = MemorySink(stop=3)
    solve(problem, ready.scheme, save=save, sinks=[earlier])
    assert earlier.checkpoint.steps == 300
    later = solve(problem, ready.scheme, save=save, resume=earlier)
    assert replace(later.stats, seconds=0.0) == replace(whole.stats, seconds=0.0)
    assert later.stats.seconds > earlier.checkpoint.arrays["seconds"] > 0.0, "the time of both parts"
    for name in ("displacement", "velocity", "acceleration"):
        assert np.array_equal(getattr(later.probes, name), getattr(whole.probes, name)), name
        assert np.array_equal(getattr(later.fields, name), getattr(whole.fields, name)), name
    for name, values in whole.channels.items():
        assert np.array_equal(later.channels[name], values), name


def test_fingerprint_distinguishes_problems():
    ready = prepare(read_case(CASE))
    fingerprints = {
        fingerprint(ready.problem, ready.scheme, ready.save),
        fingerprint(replace(ready.problem, steps=ready.problem.steps + 1), ready.scheme, ready.save),
        fingerprint(replace(ready.problem, step=np.nextafter(ready.problem.step, 1.0)), ready.scheme, ready.save),
        fingerprint(ready.problem, newmark(beta=0.3, gamma=0.6), ready.save),
        fingerprint(ready.problem, ready.scheme, SaveAt(field_every=7)),
        *(fingerprint(prepare(read_case(CASE, [one])).problem, ready.scheme, ready.save) for one in (
            "run.speed=3001rpm", "masses.valve.mass=0.101kg", "cams.intake.lift=6.001mm",
            "springs.valve.stiffness=41kN/m",
        )),
    }  # fmt: skip
    assert len(fingerprints) == 9
    again = prepare(read_case(CASE))
    assert fingerprint(again.problem, again.scheme, again.save) in fingerprints
