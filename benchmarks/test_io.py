"""What saving costs: a full field written, and a run with and without its result file."""

from __future__ import annotations

from pathlib import Path

import pytest

from flexcam import prepare, read_case, read_result
from flexcam.fidelity.rungs import with_elements
from flexcam.integrate import solve
from flexcam.runner import result_file

MODEL = Path(__file__).parents[1] / "cases" / "tayeb" / "model-3-shm.toml"


class Kept:
    """Sink that keeps the blocks as they come."""

    def __init__(self):
        self.blocks = []

    def write(self, block):  # noqa: D102
        self.blocks.append(block)

    def close(self, status, stats):  # noqa: D102
        self.end = status, stats


@pytest.fixture(scope="module")
def full_field():
    """Model 3 on 102 nodes, every step of 2000 saved: the run and its blocks."""
    case = with_elements(read_case(MODEL, ["run.revolutions=0.5555555555", "output.field_every=1"]), 10)
    ready, kept = prepare(case), Kept()
    assert solve(ready.problem, ready.scheme, save=ready.save, sinks=[kept]).stats.steps == 2000
    return ready, kept


def test_full_field(benchmark, full_field, tmp_path):
    ready, kept = full_field

    def saved():
        file = result_file(ready, tmp_path, overwrite=True)
        for block in kept.blocks:
            file.write(block)
        file.close(*kept.end)
        return file.path

    assert read_result(benchmark(saved)).field("displacement").shape == (2001, 102, 3)


@pytest.mark.parametrize("saving", [False, True], ids=["in memory", "with its file"])
def test_run(benchmark, saving, tmp_path):
    """Model 3 at the default interval: every step of the probes, every 20th of the field."""
    ready = prepare(read_case(MODEL))

    def solved():
        sinks = [result_file(ready, tmp_path, overwrite=True)] if saving else []
        return solve(ready.problem, ready.scheme, save=ready.save, sinks=sinks)

    assert benchmark(solved).status.ok
