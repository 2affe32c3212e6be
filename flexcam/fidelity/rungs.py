"""The ladder: one case as models of rising cost, each derived from the case itself."""

from __future__ import annotations

from dataclasses import dataclass, replace

from flexcam.case import Case
from flexcam.checks import InputError
from flexcam.fidelity.carried import carried_start
from flexcam.fidelity.measure import Measured, measured
from flexcam.integrate import solve
from flexcam.response import Response, RunFailedError
from flexcam.runner import DEFAULT_STEPS_PER_REVOLUTION, Prepared, prepare, standing

_ELEMENTS = (1, 2)
"""Elements per segment of every member, beside those of the case and twice as many."""

_MODES = (3, 10, 30)
"""Shapes of reduced models."""


@dataclass(frozen=True, eq=False)
class Rung:
    """A model of a case.

    Parameters
    ----------
    name
        Such as ``rigid`` or ``beams x2``.
    words
        What it is.
    case
        The case it is made from.
    """

    name: str
    words: str
    case: Case

    def prepared(self, until: float | None = None, work: int = 0) -> Prepared:
        """Return everything a run needs; the search for a periodic start ends at `until`, s of `time.monotonic`.

        `work` is the steps per revolution of all runs to come, this one among them: what makes many short runs fast may
        not be worth its while for one.
        """
        return prepare(self.case, until=until, runs=max(round(work / steps_of(self.case)), 1) if work else 1)

    def run(self, until: float | None = None, work: int = 0) -> Response:
        """Return its response, by `until` at the latest."""
        ready = self.prepared(until, work)
        return solve(ready.problem, ready.scheme, save=ready.save, until=until)

    def stepped(self, per_revolution: int) -> Rung:
        """Return the same model with other steps per revolution."""
        return replace(self, case=self.case.with_run({"steps_per_revolution": per_revolution, "step": None}))


def measured_run(rung: Rung, probe: str, until: float | None = None, work: int = 0) -> Measured:
    """Return what a rung's run has to be compared."""
    response = rung.run(until, work)
    if not response.status.ok:
        raise RunFailedError(response.status)
    return measured(response, probe)


def steps_of(case: Case) -> int:
    """Return the steps per camshaft revolution of a case, rounded where it gives a step."""
    run = case.record.run
    if run.step is None:
        return run.steps_per_revolution or DEFAULT_STEPS_PER_REVOLUTION
    ready = prepare(case, rigid=True)
    return round(ready.revolution / ready.problem.step)


def with_elements(case: Case, factor: int | None = None, each: int | None = None) -> Case:
    """Return a case with other elements per segment of its members and springs."""
    members = {
        name: one.model_copy(update={"elements": each or one.elements * (factor or 1)})
        for name, one in case.record.members.items()
    }
    springs = {
        name: one.model_copy(update={"elements": one.elements * (factor or 1)}) if one.mass or one.elements > 1 else one
        for name, one in case.record.springs.items()
    }
    made = replace(case, record=case.record.model_copy(update={"members": members, "springs": springs}))
    return carried_start(case, made)


def as_beams(case: Case) -> Case:
    """Return a case with all unknowns of its beams, whatever model it asks for."""
    return case.with_fidelity(
        {"model": "beams", "tolerance": None, "estimate": False, "modes": None, "reduction": "modes"}
    )


def _stands(rung: Rung) -> bool:
    """Tell whether a case has such a model: a chain is that of one train with nodes enough."""
    try:
        standing(rung.case)
    except (InputError, RunFailedError):
        return False
    return True


def ladder(case: Case) -> tuple[Rung, ...]:
    """Return the models of a case, coarse to fine."""
    beams = as_beams(case)
    own = {one.elements for one in case.record.members.values()}
    unknowns = standing(beams).problem.system.size
    fewer = [
        Rung(f"beams {n}", f"{n} element{'s' if n > 1 else ''} per segment", with_elements(beams, each=n))
        for n in _ELEMENTS
        if n < min(own, default=0)
    ]
    modes = [
        Rung(f"modes {n}", f"{n} modes with the static answers they miss", beams.with_fidelity({"modes": n}))
        for n in _MODES
        if 2 * n < unknowns
    ]
    chains = [
        Rung("sdof", "one mass for the train", beams.with_fidelity({"model": "sdof"})),
        Rung("chain 3", "three masses along the train", beams.with_fidelity({"model": "chain", "masses": 3})),
    ]
    return (
        Rung("rigid", "rigid members", beams.with_fidelity({"model": "rigid"}).with_run({"path": "auto"})),
        *(rung for rung in chains if _stands(rung)),
        *modes,
        *fewer,
        Rung("beams", "the case as it stands", beams),
        Rung("beams x2", "twice its elements", with_elements(beams, factor=2)),
    )
