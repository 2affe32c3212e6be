"""What saving costs: a full field written, and a run with and without its result file."""

from __future__ import annotations

import pytest

from benchmarks.measure.saving import CASE, full_field, ran, saved
from flexcam import prepare, read_case, read_result


def test_full_field(benchmark, tmp_path):
    """Model 3 on 102 nodes, every step of 2000 saved."""
    assert read_result(benchmark(saved, *full_field(), tmp_path)).field("displacement").shape == (2001, 102, 3)


@pytest.mark.parametrize("saving", [False, True], ids=["in memory", "with its file"])
def test_run(benchmark, saving, tmp_path):
    """Model 3 at the default interval: every step of the probes, every 20th of the field."""
    ready = prepare(read_case(CASE))
    assert benchmark(ran, ready, [tmp_path] if saving else []).status.ok
