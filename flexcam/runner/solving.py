"""A case solved in time, within the memory there is."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from flexcam.budget import Budget, affordable, budget
from flexcam.case import Case
from flexcam.checkpoint import Earlier
from flexcam.checks import refuse
from flexcam.integrate import (
    outline,
    solve,
)
from flexcam.memory import Recent
from flexcam.response import Response, Sink
from flexcam.runner.prepared import Prepared, prepare


def recent(ready: Prepared) -> Recent:
    """Return what keeps no more of a run in memory than its summary needs."""
    return Recent(outline(ready.problem.system, channels=ready.save.channels), ready.revolution)


def budget_of(ready: Prepared, keep: Literal["all", "revolution"] = "all") -> Budget:
    """Return what a run takes of memory and disk."""
    kept = None if keep == "all" else round(ready.revolution / ready.problem.step)
    return budget(ready.problem, ready.model.mesh, ready.save, kept=kept)


def run(
    case: Case, *, rigid: bool = False, sinks: Sequence[Sink] = (), keep: Literal["all", "revolution"] = "all",
    allow_large: bool = False, resume: Earlier | None = None,
) -> Response:  # fmt: skip
    """Solve a case in time, by the model that stands in it.

    A model within ``fidelity.tolerance`` is sought by `flexcam.fidelity.chosen`, errors by `flexcam.fidelity.estimate`.

    Parameters
    ----------
    case
        From `flexcam.read_case`.
    rigid
        Solve the same mechanism with rigid members.
    sinks
        Further takers of the results, such as a result file.
    keep
        What the response holds: all of the run, or its last revolution and last field, with which memory does not
        grow with the length of the run.
    allow_large
        Whether a run may take more memory than there seems to be.
    resume
        What a run of this case finished before it broke off, from `unfinished`; it goes on from there.

    Returns
    -------
    Response
        Histories of the probes, fields, status.

    Raises
    ------
    InputError
        If parts do not fit together, or memory is too short.
    RunFailedError
        If the run cannot even start.

    Examples
    --------
    ``flexcam.run(flexcam.read_case("cases/tayeb/model-3-shm.toml"))["valve"].displacement`` is the lift of the valve.
    """
    if keep not in _KEPT:
        raise refuse("keep", repr(keep), " or ".join(map(repr, _KEPT)))
    ready = prepare(case, rigid=rigid, allow_large=allow_large)
    if not allow_large:
        affordable(budget_of(ready, keep))
    memory = recent(ready) if keep == "revolution" else None
    return solve(ready.problem, ready.scheme, save=ready.save, sinks=sinks, memory=memory, resume=resume)


_KEPT = ("all", "revolution")
