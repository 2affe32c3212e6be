"""Status of a run: cause, message and statistics."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from flexcam.core import FloatArray, Triplets
from flexcam.core.errors import FlexcamError


class Cause(StrEnum):
    """Cause of the end of a run."""

    DONE = "done"
    INTERRUPTED = "interrupted"
    NOT_FINITE = "not-finite"
    NO_CONVERGENCE = "no-convergence"
    SINGULAR = "singular"
    NOT_SAVED = "not-saved"
    TIME_LIMIT = "time-limit"
    ROUNDING = "rounding"
    STEP_TOO_SMALL = "step-too-small"
    TOLERANCE = "tolerance-not-met"
    INFEASIBLE = "infeasible"
    NO_RENDERING = "no-rendering"
    REFUSED = "refused"
    WORKER_LOST = "worker-lost"
    OUT_OF_MEMORY = "out-of-memory"
    FAULT = "fault"


@dataclass(frozen=True)
class Status:
    """Status of a run: cause, location and remedy.

    Parameters
    ----------
    cause
        One of `Cause`.
    text
        Description with time, cam angle and unknown by name.
    remedy
        Remedy.

    Examples
    --------
    >>> Status().ok
    True
    """

    cause: Cause = Cause.DONE
    text: str = "the run is complete"
    remedy: str = ""

    @property
    def ok(self) -> bool:
        """True if the run is complete."""
        return self.cause is Cause.DONE

    @property
    def message(self) -> str:
        """Message with remedy, in addition to the cause; usually empty for a complete run."""
        return "" if self == Status() else "; ".join(filter(None, (self.text, self.remedy)))

    def __str__(self) -> str:
        return f"{self.cause}: {self.text}" + (f"; {self.remedy}" if self.remedy else "")


ROUNDING_STATUS = Status(
    Cause.ROUNDING,
    "rounding in the stiffness makes the result inaccurate: a member has too many elements, or stiffnesses differ "
    "too much for double precision",
    "use fewer elements (about 1000 per span still give four digits)",
)
"""Status of a computation dominated by rounding."""


class RunFailedError(FlexcamError, RuntimeError):
    """Computation that cannot be completed.

    Parameters
    ----------
    status
        Cause, place and remedy.
    """

    def __init__(self, status: Status) -> None:
        self.status = status
        super().__init__(str(status))


@dataclass(frozen=True)
class Stats:
    """Statistics of a run."""

    engine: str = "direct"  #: solver engine, see `flexcam.dynamics.engine_selection`; empty if the run was killed
    integrator: str = ""  #: "collocation" if it integrated the run; else empty
    steps: int = 0  #: steps done
    size: int = 0  #: unknowns of the mechanism; zero in results without this value
    unknowns: int = 0  #: unknowns integrated, without inactive ones. Zero if the run was killed
    iterations: int = 0  #: Newton iterations of local forces, all steps together
    events: int = 0  #: contact events located within steps
    substeps: int = 0  #: steps between output instants with adaptive steps; else zero
    rejected: int = 0  #: rejected steps, repeated with half their length
    periodicity: float = -1.0  #: relative residual of periodicity of the initial state; negative if not requested
    #: Largest residual force relative to the largest force; negative if not evaluated: without channels, without
    #: unknowns, or if the run ended before the first saved field.
    imbalance: float = -1.0
    #: Duration of the run, s, with its earlier parts if it was continued; negative if the run was killed.
    seconds: float = 0.0

    @property
    def is_complete(self) -> bool:
        """True if the statistics are complete; for a killed run only steps and size are known."""
        return self.seconds >= 0.0


def reraise_interrupt(status: Status) -> None:
    """Raise KeyboardInterrupt again if one of many runs was interrupted."""
    if status.cause is Cause.INTERRUPTED:
        raise KeyboardInterrupt


NOT_POSITIVE = Status(
    Cause.SINGULAR, "the stiffness is not positive",
    "check whether the contacts that hold them are open, or whether the force is too large (a member buckles, a lever "
    "folds over)",
)  # fmt: skip
"""Status of an indefinite stiffness without details."""

_MAX_NAMES = 3
"""Number of unknowns in a message."""

_DIGITS = 6
"""Digits for comparing unknowns, so that those of a symmetric motion keep their order."""

_ALSO = 0.3
"""Fraction of the most negative energy above which a further cause is named."""


class NotPositiveError(RunFailedError):
    """Indefinite stiffness; `motion`, shape (n,), has negative energy, None if unknown."""

    def __init__(self, motion: FloatArray | None = None) -> None:
        super().__init__(NOT_POSITIVE)
        self.motion = motion


def instability_status(names: Sequence[str], motion: FloatArray, parts: Iterable[tuple[str, Triplets]] = ()) -> Status:
    """Return the status of an indefinite stiffness."""
    sizes = np.abs(motion) / max(float(np.abs(motion).max(initial=0.0)), np.finfo(float).tiny)
    order: list[int] = np.argsort(-np.round(sizes, _DIGITS), kind="stable").tolist()
    unknowns = ", ".join(names[i] for i in order[:_MAX_NAMES])
    energies: dict[str, float] = defaultdict(float)  # all elements of a member have its name
    for name, part in parts:
        energies[name] += float(motion @ part.times(motion))
    minimum = min(energies.values(), default=0.0)
    causes = [name for name, energy in energies.items() if energy < 0.0 and energy <= _ALSO * minimum]
    reason = f"a force pushes {unknowns} aside, and nothing holds them"
    if causes:
        verb = "buckle or fold over" if len(causes) > 1 else "buckles or folds over"
        reason = f"{' and '.join(causes)} {verb} under load; largest motion: {unknowns}"
    return replace(NOT_POSITIVE, text=f"{NOT_POSITIVE.text}: {reason}")
