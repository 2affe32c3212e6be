"""Error estimate of a run, from runs with other steps and elements."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

from flexcam.analysis.comparison import Histories, distance
from flexcam.analysis.model_ladder import (
    run_histories,
    steps_per_revolution_of,
    with_beam_model,
    with_elements,
    with_steps,
)
from flexcam.case.case import Case

_SAFETY_FACTOR = 2.0
_CONVERGENCE_RATIO = 0.75
"""Maximum ratio of the distances at the step and at twice the step for convergent runs."""

_ROUNDING = 1e-12
"""Distances below this fraction of a quantity's size are rounding."""


@dataclass(frozen=True)
class Error:
    """Value of a run with its estimated error."""

    quantity: str  #: name as in `Histories`
    unit: str  #: SI unit
    size: float  #: maximum absolute value; for the lift its range
    #: `time`, `space`, `model`: maximum estimated errors of the history due to steps, elements, and a model coarser
    #: than beams (its distance from the beam model)
    time: float
    space: float
    model: float
    holds: bool  #: whether runs with shorter steps converge; otherwise the estimate is invalid

    @property
    def total(self) -> float:
        """Sum of all errors."""
        return self.time + self.space + self.model


def estimate_errors(case: Case, probe: str, until: float | None = None) -> list[Error]:
    """Return the estimated errors of a case's run."""
    steps = steps_per_revolution_of(case)
    own, finer = with_steps(case, steps), with_steps(with_elements(case, factor=2), steps)
    # An odd number of steps cannot be halved: convergence is then checked with shorter steps.
    counts = (steps // 2, steps, 2 * steps) if steps % 2 == 0 else (steps, 2 * steps, 4 * steps)
    asked = own.record.fidelity
    coarse = asked.model != "beams" or asked.modes is not None
    work = sum(counts) + steps * (2 if coarse else 1)
    runs = {n: run_histories(with_steps(own, n), probe, until, work) for n in counts}
    longer, shorter = (distance(runs[a], runs[b]) for a, b in pairwise(counts))
    base, better = runs[steps], runs[2 * steps]
    model = distance(base, run_histories(with_beam_model(own), probe, until, work)) if coarse else {}
    mesh = distance(base, run_histories(finer, probe, until, work))
    return _compute_errors(base, distance(base, better), mesh, model, (longer, shorter))


def _compute_errors(
    base: Histories, step: Mapping[str, float], mesh: Mapping[str, float], model: Mapping[str, float],
    halvings: tuple[Mapping[str, float], Mapping[str, float]],
) -> list[Error]:  # fmt: skip
    longer, shorter = halvings
    errors: list[Error] = []
    for name in step:
        size = base.size(name)
        holds = shorter[name] <= max(_CONVERGENCE_RATIO * longer[name], _ROUNDING * size)
        parts = _SAFETY_FACTOR * step[name], _SAFETY_FACTOR * mesh[name], model.get(name, 0.0)
        errors.append(Error(name, base.unit(name), size, *parts, holds))
    return errors
