"""Chains of few masses of a case."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flexcam.case import Case, build_model
from flexcam.integrate import Problem, State
from flexcam.runner import Prepared, prepare
from flexcam.starting import started
from flexcam.train import Chain, chain_of

_GIVEN = ("rest", "equilibrium", "periodic")
"""Starts that are found anew for the chain; others are the beam model's, seen at what is kept."""


def chain(case: Case, count: int, *, contact: str | None = None, lumped: bool = False) -> Chain:
    """Return the train of a case as a chain of masses."""
    return chain_of(build_model(case), case.speed, count, contact=contact, lumped=lumped)


def chain_run(case: Case, count: int, *, contact: str | None = None, lumped: bool = False) -> Prepared:
    """Return a run of a case with its train as a chain of masses, ready for `flexcam.solve`."""
    ready, found = prepare(case), chain(case, count, contact=contact, lumped=lumped)
    problem = replace(ready.problem, system=found.system, start=None)
    if case.record.run.start in _GIVEN:
        return replace(ready, problem=started(case, ready.model, problem))
    return replace(ready, problem=replace(problem, start=_seen(ready.problem, found)))


def _seen(whole: Problem, found: Chain) -> State | None:
    """Return the start of the beam model in the chain's unknowns, by least squares."""
    if whole.start is None:
        return None
    moved = np.column_stack([whole.start.displacement, whole.start.velocity])
    near = np.linalg.lstsq(found.shapes, moved, rcond=None)[0]
    return replace(whole.start, displacement=near[:, 0], velocity=near[:, 1])
