"""Runs and commands give what the goldens hold; `make_golden.py` says how far, and writes them anew.

Every run is a test of its own, so that a fault in one hides no other. The normal suite takes the small models, of which
each stands for a part; the rest is slow.
"""

from __future__ import annotations

import pytest

from tests.golden.commands import Command
from tests.golden.make_golden import DATA, Job, compared, computed, jobs, kept

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


def quick(job: Job) -> bool:
    """Return whether a run or command is of the normal suite."""
    if isinstance(job, Command):
        return job.name in QUICK_COMMANDS
    of_model = job.name in QUICK_RUNS_OF_MODELS and job.golden in QUICK_MODELS
    return of_model or (job.golden.startswith("models-") and job.name in QUICK_RUNS)


def marked(job: Job):
    marks = () if quick(job) else (pytest.mark.slow,)
    return pytest.param(job, id=f"{job.golden}-{job.name}".replace(" ", "-"), marks=marks)


@pytest.mark.usefixtures("shipped_selection")
@pytest.mark.parametrize("job", [marked(job) for job in JOBS])
def test_as_kept(job):
    moved = compared(job.golden, job.name, kept(job.golden).get(job.name, {}), computed(job))
    assert not moved, "\n".join(str(one) for one in moved)


def test_every_golden_is_of_a_run():
    held = {(path.stem, name) for path in DATA.glob("*.json") for name in kept(path.stem)}
    assert held == {(job.golden, job.name) for job in JOBS}


def test_what_moved_is_told():
    """A row that differs by 1e-8 of its peak is found in a linear run, and not in one whose contacts switch."""
    old = {"kind": "linear", "channels/a [N]": [2.0, 0.0, 1.0], "stats/engine": "modal"}
    new = {"kind": "linear", "channels/a [N]": [2.0 + 2e-8, 0.0, 1.0], "stats/engine": "direct"}
    told = [one.quantity for one in compared("golden", "run", old, new)]
    assert told == ["channels/a [N]", "stats/engine"]
    told = [one.quantity for one in compared("golden", "run", {**old, "kind": "switching"}, new)]
    assert told == ["kind", "stats/engine"]
