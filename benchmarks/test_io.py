"""Time to write results: a full field, and a run with and without its result file."""

from __future__ import annotations

import pytest

from benchmarks.measure.saving import CASE, run_case, run_full_field, write_blocks
from flexcam import prepare, read_case, read_result


def test_full_field(benchmark, tmp_path):
    """Model 3 with 102 nodes and all of 2000 steps saved."""
    path = benchmark(write_blocks, *run_full_field(), tmp_path)
    assert read_result(path).field("displacement").shape == (2001, 102, 3)


@pytest.mark.parametrize("saving", [False, True], ids=["in memory", "with its file"])
def test_run(benchmark, saving, tmp_path):
    """Model 3 with every step of the probes and every 20th step of the field saved."""
    ready = prepare(read_case(CASE))
    assert benchmark(run_case, ready, [tmp_path] if saving else []).status.ok
