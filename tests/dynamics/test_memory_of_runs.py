"""Memory of a run: last revolution and extremes only, independent of the length of the run."""

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
RARE_FIELDS = SaveAt(field_every=36_000)


def prepare_case(revolutions, *settings):
    return prepare(flexcam.read_case(CASE, [f"run.revolutions={revolutions}", *settings]))


def run_problem(ready, **options):
    return flexcam.solve(ready.problem, ready.scheme, save=ready.save, **options)


@pytest.fixture(scope="module")
def pair():
    """Return a run in complete memory, and the same run with summary memory and its extremes."""
    ready = prepare_case(4)
    ready = replace(ready, save=replace(ready.save, fields_per_block=32))
    few = summary_sink(ready)
    seen = ExtremesSink(few.outline)
    return ready, run_problem(ready), run_problem(ready, memory=few, sinks=[seen]), seen


def test_summary_memory_holds_last_revolution(pair):
    ready, whole, few, _ = pair
    count = round(ready.revolution / ready.problem.step)
    assert count < len(few.time) <= count + 1 + ready.save.block
    np.testing.assert_array_equal(few.time, whole.time[-len(few.time) :])
    for name, values in few.channels.items():
        np.testing.assert_array_equal(values, whole.channels[name][-len(few.time) :])
    np.testing.assert_array_equal(few.time[few.latest(ready.revolution)], whole.time[whole.latest(ready.revolution)])
    assert few.status == whole.status


def test_memory_grows_with_completed_steps():
    """The run requests more steps than fit in memory, as with `stop` or `until`; memory grows with the steps."""
    ready = prepare_case(0.1)
    whole = run_problem(ready)
    other = MemorySink(whole.outline, instants=10**14, fields=10**14)
    kept = run_problem(ready, memory=other)
    np.testing.assert_array_equal(kept.time, whole.time)
    np.testing.assert_array_equal(kept.fields.displacement, whole.fields.displacement)


def test_summary_memory_holds_last_field(pair):
    _, whole, few, _ = pair
    np.testing.assert_array_equal(few.fields.displacement, whole.fields.displacement[-1:])
    np.testing.assert_array_equal(few.field_time, whole.field_time[-1:])


def test_extremes_cover_complete_run(pair):
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


def test_empty_sinks_have_zero_extremes(pair):
    _, whole, *_ = pair
    assert len(RecentSink(whole.outline, 1.0).response().time) == 0
    assert ExtremesSink(whole.outline).probe("valve")[0].tolist() == [0.0]
    assert ExtremesSink(whole.outline).channel("no such channel") == (0.0, 0.0)
    assert not ExtremesSink(whole.outline).most_bent.any()


def test_keep_option_of_run():
    case = flexcam.read_case(CASE, ["run.revolutions=6"])
    few, whole = flexcam.run(case, keep="revolution"), flexcam.run(case)
    assert len(few.time) < len(whole.time)
    assert few["valve"].displacement[-1] == whole["valve"].displacement[-1]
    with pytest.raises(InputError, match="keep: got 'some', expected 'all' or 'revolution'"):
        flexcam.run(case, keep="some")


def test_block_length_is_limited_for_rare_fields():
    assert [SaveAt(unknowns=n).block for n in (0, 625, 1000, 2500, 10**6)] == [2560, 2560, 1600, 640, 640]
    assert SaveAt(field_every=100).block == 3200
    assert SaveAt(field_every=1000).block == 8000
    assert [SaveAt(field_every=every).block for every in (8192, 8193, 10**9)] == [8192] * 3
    assert SaveAt(field_every=20_000, fields_per_block=2).block == 40_000


class _PeakMemorySink:
    """Sink that records the peak memory in each tenth of the run."""

    def __init__(self, steps):
        self.steps, self.done, self.peaks = steps, 0, [0] * 11

    def write(self, block):
        self.done += len(block.time)
        tenth = 10 * self.done // (self.steps + 1)
        self.peaks[tenth] = max(self.peaks[tenth], self.memory())

    def memory(self):
        return tracemalloc.get_traced_memory()[0]

    def close(self, status, stats):
        pass


class _ResidentMemorySink(_PeakMemorySink):
    def memory(self):
        return int(Path("/proc/self/statm").read_text().split()[1])


def run_and_measure(ready, peaks, tmp_path):
    ready = replace(ready, save=RARE_FIELDS)
    response = run_problem(ready, memory=summary_sink(ready), sinks=[open_result_file(ready, tmp_path), peaks])
    assert response.status.ok
    assert response.stats.steps == ready.problem.steps
    return peaks.peaks


def test_memory_does_not_grow_with_run_length(tmp_path):
    """The run has 1e5 steps, with histories of 30 MB."""
    ready = prepare_case(139)
    run_problem(replace(ready, problem=replace(ready.problem, steps=100, engine="kernel")))  # memory of the compiler
    tracemalloc.start()
    try:
        peaks = run_and_measure(ready, _PeakMemorySink(ready.problem.steps), tmp_path)
    finally:
        tracemalloc.stop()
    # A block of 8192 steps is allocated and freed repeatedly: 3 MB, of which the measurement sees a varying part.
    assert max(peaks[5:10]) < 1.01 * max(peaks[1:5])
    assert max(peaks) < 20e6


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="resident memory as Linux tells it")
def test_ten_million_steps_need_memory_of_one_million(tmp_path):
    """Resident memory of the process, result file (3 GB) and machine code included.

    Freed memory that the allocator retains reaches its maximum after some million steps: one per cent.
    """
    ready = prepare_case(13_900)
    assert ready.problem.steps > 1e7
    peaks = run_and_measure(ready, _ResidentMemorySink(ready.problem.steps), tmp_path)
    assert max(peaks[2:]) < 1.03 * peaks[1]
    assert max(peaks[6:]) < 1.005 * max(peaks[1:6])
