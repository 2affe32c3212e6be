"""What of a run stays in memory: the last revolution and the extremes of all, however long the run is."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import flexcam
from flexcam.analysis.preparation import prepare
from flexcam.analysis.run import open_result_file, summary_sink
from flexcam.core.errors import InputError
from flexcam.dynamics import SaveAt, turning_points
from flexcam.dynamics.memory import ExtremesSink, MemorySink, RecentSink

CASE = Path(__file__).parents[1] / "data/inline.toml"
SELDOM = SaveAt(field_every=36_000)


def ready_of(revolutions, *settings):
    return prepare(flexcam.read_case(CASE, [f"run.revolutions={revolutions}", *settings]))


def solved(ready, **options):
    return flexcam.solve(ready.problem, ready.scheme, save=ready.save, **options)


@pytest.fixture(scope="module")
def pair():
    """Return a run kept whole, and the same one kept for a summary, with its extremes."""
    ready = ready_of(4)
    few = summary_sink(ready)
    seen = ExtremesSink(few.outline)
    return ready, solved(ready), solved(ready, memory=few, sinks=[seen]), seen


def test_the_last_revolution_is_kept(pair):
    ready, whole, few, _ = pair
    count = round(ready.revolution / ready.problem.step)
    assert count < len(few.time) <= count + 1 + ready.save.block
    np.testing.assert_array_equal(few.time, whole.time[-len(few.time) :])
    for name, values in few.channels.items():
        np.testing.assert_array_equal(values, whole.channels[name][-len(few.time) :])
    np.testing.assert_array_equal(few.time[few.latest(ready.revolution)], whole.time[whole.latest(ready.revolution)])
    assert few.status == whole.status


def test_a_run_that_would_never_fit_is_kept_as_far_as_it_comes():
    """More steps than there is memory for: such a run is ended by `stop` or `until`, and memory grows as it comes."""
    ready = ready_of(0.1)
    whole = solved(ready)
    other = MemorySink(whole.outline, instants=10**14, fields=10**14)
    kept = solved(ready, memory=other)
    np.testing.assert_array_equal(kept.time, whole.time)
    np.testing.assert_array_equal(kept.fields.displacement, whole.fields.displacement)


def test_the_last_field_is_kept(pair):
    _, whole, few, _ = pair
    np.testing.assert_array_equal(few.fields.displacement, whole.fields.displacement[-1:])
    np.testing.assert_array_equal(few.field_time, whole.field_time[-1:])


def test_extremes_are_those_of_everything(pair):
    _, whole, _, seen = pair
    after = ExtremesSink.of(whole)
    for name, _ in whole.outline.channels:
        values = whole.channels[name]
        assert seen.channel(name) == after.channel(name) == (values.min(), values.max())
    for name, _ in whole.outline.probes:
        moved, moving = (np.atleast_2d(one.T).T for one in (whole[name].displacement, whole[name].velocity))
        moved = np.concatenate([moved, turning_points(whole.time, moved, moving)[1]])
        np.testing.assert_array_equal(seen.probe(name), (moved.min(axis=0), moved.max(axis=0)))
    sizes = np.abs(whole.fields.displacement).max(axis=1)
    np.testing.assert_array_equal(seen.most_bent, whole.fields.displacement[np.argmax(sizes)])
    np.testing.assert_array_equal(after.most_bent, seen.most_bent)
    assert seen.steps == len(whole.time)


def test_nothing_comes_of_nothing(pair):
    ready, whole, *_ = pair
    assert len(RecentSink(whole.outline, 1.0).response().time) == 0
    assert ExtremesSink(whole.outline).probe("valve")[0].tolist() == [0.0]
    assert ExtremesSink(whole.outline).channel("no such channel") == (0.0, 0.0)
    assert not ExtremesSink(whole.outline).most_bent.any()
    del ready


def test_run_keeps_what_it_is_told():
    case = flexcam.read_case(CASE, ["run.revolutions=2"])
    few, whole = flexcam.run(case, keep="revolution"), flexcam.run(case)
    assert len(few.time) < len(whole.time)
    assert few["valve"].displacement[-1] == whole["valve"].displacement[-1]
    with pytest.raises(InputError, match="keep: got 'some', expected 'all' or 'revolution'"):
        flexcam.run(case, keep="some")


def test_blocks_are_short_however_seldom_fields_are_saved():
    assert SaveAt().block == 640
    assert SaveAt(field_every=100).block == 3200
    assert SaveAt(field_every=1000).block == 8000
    assert [SaveAt(field_every=every).block for every in (8192, 8193, 10**9)] == [8192] * 3
    assert SaveAt(field_every=20_000, fields_per_block=2).block == 40_000


class _Peaks:
    """A sink that looks how much memory is taken, in tenths of the run."""

    def __init__(self, steps):
        self.steps, self.done, self.peaks = steps, 0, [0] * 11

    def write(self, block):
        self.done += len(block.time)
        tenth = 10 * self.done // (self.steps + 1)
        self.peaks[tenth] = max(self.peaks[tenth], self.taken())

    def taken(self):
        return tracemalloc.get_traced_memory()[0]

    def close(self, status, stats):
        pass


class _Resident(_Peaks):
    def taken(self):
        return int(Path("/proc/self/statm").read_text().split()[1])


def kept_of(ready, peaks, tmp_path):
    ready = replace(ready, save=SELDOM)
    response = solved(ready, memory=summary_sink(ready), sinks=[open_result_file(ready, tmp_path), peaks])
    assert response.status.ok
    assert response.stats.steps == ready.problem.steps
    return peaks.peaks


def test_memory_does_not_grow_with_the_run(tmp_path):
    """Over 1e5 steps, whose histories are 30 MB."""
    ready = ready_of(139)
    solved(replace(ready, problem=replace(ready.problem, steps=100, engine="kernel")))  # the compiler's own memory
    tracemalloc.start()
    try:
        peaks = kept_of(ready, _Peaks(ready.problem.steps), tmp_path)
    finally:
        tracemalloc.stop()
    # A block of 8192 steps is what comes and goes: 3 MB, of which more or less is there when one looks.
    assert max(peaks[5:10]) < 1.01 * max(peaks[1:5])
    assert max(peaks) < 20e6


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="resident memory as Linux tells it")
def test_ten_million_steps_take_the_memory_of_one_million(tmp_path):
    """As the process has it, result file (3 GB) and machine code included.

    What is freed and kept for what comes next takes some million steps to be as much as it will ever be: a per cent.
    """
    ready = ready_of(13_900)
    assert ready.problem.steps > 1e7
    peaks = kept_of(ready, _Resident(ready.problem.steps), tmp_path)
    assert max(peaks[2:]) < 1.03 * peaks[1]
    assert max(peaks[6:]) < 1.005 * max(peaks[1:6])
