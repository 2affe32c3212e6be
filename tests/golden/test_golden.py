"""Runs and commands match the goldens; `make_golden.py` prints the differences and writes new goldens.

Every run is a separate test, so that a fault in one does not hide others. The normal suite has the small models, each
of which represents a part; the other ones are slow.
"""

from __future__ import annotations

import pytest

from tests.golden.commands import Command
from tests.golden.make_golden import DATA, Job, compare_records, compute_record, jobs, read_golden

QUICK_RUNS = {"beams/kernel", "beams/modal", "rigid/auto"}
"""Runs of every small model in the normal suite."""

QUICK_MODELS = {"models-linear-train"}
"""Small models with other runs in the normal suite; `tests/invariants` compares the engines on every force law."""

QUICK_RUNS_OF_MODELS = {"beams/direct", "chain/direct"}

QUICK_COMMANDS = {
    "law 4-5-6-7", "law scca", "li-fb2", "info", "export instants", "stability", "campbell",
    "compare contact", "modes", "modes equilibrium", "schema", "sweep", "sensitivity", "data/every-engine",
}  # fmt: skip

JOBS = jobs()


def is_quick(job: Job) -> bool:
    """Return whether a run or command is in the normal suite."""
    if isinstance(job, Command):
        return job.name in QUICK_COMMANDS
    of_model = job.name in QUICK_RUNS_OF_MODELS and job.golden in QUICK_MODELS
    return of_model or (job.golden.startswith("models-") and job.name in QUICK_RUNS)


def make_param(job: Job):
    marks = () if is_quick(job) else (pytest.mark.slow,)
    return pytest.param(job, id=f"{job.golden}-{job.name}".replace(" ", "-"), marks=marks)


@pytest.mark.usefixtures("shipped_selection")
@pytest.mark.parametrize("job", [make_param(job) for job in JOBS])
def test_record_matches_golden(job):
    moved = compare_records(job.golden, job.name, read_golden(job.golden).get(job.name, {}), compute_record(job))
    assert not moved, "\n".join(str(one) for one in moved)


def test_every_golden_belongs_to_a_job():
    stored = {(path.stem, name) for path in DATA.glob("*.json") for name in read_golden(path.stem)}
    assert stored == {(job.golden, job.name) for job in JOBS}


def test_differences_depend_on_kind_of_run():
    """A difference of 1e-8 of the peak is reported for a linear run, but not for one with switching contacts."""
    old = {"kind": "linear", "channels/a [N]": [2.0, 0.0, 1.0], "stats/engine": "modal"}
    new = {"kind": "linear", "channels/a [N]": [2.0 + 2e-8, 0.0, 1.0], "stats/engine": "direct"}
    quantities = [one.quantity for one in compare_records("golden", "run", old, new)]
    assert quantities == ["channels/a [N]", "stats/engine"]
    quantities = [one.quantity for one in compare_records("golden", "run", {**old, "kind": "switching"}, new)]
    assert quantities == ["kind", "stats/engine"]
