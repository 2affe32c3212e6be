"""How far a run is from the truth of its own model's equations: errors of the steps and of the elements, estimated.

Each comes from runs of the same case with half and with twice the step, and with twice the elements (L. F. Richardson,
Phil. Trans. R. Soc. A 210, 1911). The distance to the better run is doubled: an error of first order is then covered,
one of second order is overstated by half. Where halving the step no longer brings the runs together, as after bounces
whose moments nothing predicts, no such estimate holds, and that is said.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

from flexcam.case import Case
from flexcam.fidelity.measure import Measured, distance
from flexcam.fidelity.rungs import Rung, as_beams, measured_run, steps_of, with_elements

_COVERS = 2.0
_CONVERGES = 0.75
"""Part of the distance at twice the step that is left at the step, up to which runs come together."""

_NOTHING = 1e-12
"""Part of a quantity's size below which distances are rounding."""


@dataclass(frozen=True)
class Error:
    """A number of a run and how far it may be off.

    Parameters
    ----------
    quantity
        As in `Measured`.
    unit
        SI.
    size
        Largest value, of the lift its range.
    time, space, model
        Estimated errors by the steps, by the elements, and by a model coarser than beams (its distance to them), of the
        history at its worst instant.
    holds
        Whether runs with shorter steps come together: without that the estimate says nothing.
    """

    quantity: str
    unit: str
    size: float
    time: float
    space: float
    model: float
    holds: bool

    @property
    def total(self) -> float:
        """All errors together."""
        return self.time + self.space + self.model


def estimate(case: Case, probe: str, until: float | None = None) -> list[Error]:
    """Return how far the numbers of a case's run may be off."""
    steps = steps_of(case)
    own = Rung("own", "", case).stepped(steps)
    finer = Rung("finer", "", with_elements(case, factor=2)).stepped(steps)
    # Half of an odd number of steps is none: then whether runs come together is asked of shorter steps.
    counts = (steps // 2, steps, 2 * steps) if steps % 2 == 0 else (steps, 2 * steps, 4 * steps)
    asked = own.case.record.fidelity
    coarse = asked.model != "beams" or asked.modes is not None
    work = sum(counts) + steps * (2 if coarse else 1)
    runs = {n: measured_run(own.stepped(n), probe, until, work) for n in counts}
    longer, shorter = (distance(runs[a], runs[b]) for a, b in pairwise(counts))
    base, better = runs[steps], runs[2 * steps]
    beams = as_beams(own.case)
    model = distance(base, measured_run(Rung("beams", "", beams), probe, until, work)) if coarse else {}
    mesh = distance(base, measured_run(finer, probe, until, work))
    return _errors(base, distance(base, better), mesh, model, (longer, shorter))


def _errors(
    base: Measured, step: Mapping[str, float], mesh: Mapping[str, float], model: Mapping[str, float],
    halvings: tuple[Mapping[str, float], Mapping[str, float]],
) -> list[Error]:  # fmt: skip
    longer, shorter = halvings
    errors: list[Error] = []
    for name in step:
        size = base.size(name)
        holds = shorter[name] <= max(_CONVERGES * longer[name], _NOTHING * size)
        parts = _COVERS * step[name], _COVERS * mesh[name], model.get(name, 0.0)
        errors.append(Error(name, base.unit(name), size, *parts, holds))
    return errors
