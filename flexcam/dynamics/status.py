"""How a run ended, and its figures."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from flexcam.core import FloatArray, Triplets
from flexcam.core.errors import FlexcamError


class Cause(StrEnum):
    """Why a run ended."""

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
    NO_RENDERING = "no-rendering"
    REFUSED = "refused"
    WORKER_LOST = "worker-lost"
    FAULT = "fault"


@dataclass(frozen=True)
class Status:
    """How a run ended: the cause, the place and what to do.

    Parameters
    ----------
    cause
        One of `Cause`.
    text
        What happened, in words, with time, cam angle and unknown by name.
    remedy
        What to do about it.

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
        """Whether the run reached its end."""
        return self.cause is Cause.DONE

    @property
    def message(self) -> str:
        """What there is to say besides the cause, with what to do; of a run that is complete mostly nothing."""
        return "" if self == Status() else "; ".join(filter(None, (self.text, self.remedy)))

    def __str__(self) -> str:
        return f"{self.cause}: {self.text}" + (f"; {self.remedy}" if self.remedy else "")


TOO_FINE = Status(
    Cause.ROUNDING,
    "rounding in the stiffness takes too much of the answer: a member is cut into too many elements, or stiffnesses "
    "lie too far apart for double precision",
    "use fewer elements (up to some 1000 per span keep four digits)",
)
"""How a computation ends whose result would be rounding."""


class RunFailedError(FlexcamError, RuntimeError):
    """A computation that could not be finished.

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
    """Figures of a run.

    Parameters
    ----------
    engine
        The engine that integrated, see `flexcam.dynamics.engine_selection`; empty where a run was killed.
    steps
        Steps done.
    size
        Unknowns of the whole mechanism; zero in results that do not tell it.
    unknowns
        Unknowns integrated; those that nothing can move are left out. Zero where a run was killed.
    iterations
        Newton iterations of local forces, all steps together.
    events
        Moments located inside a step, where a contact opens or closes.
    substeps
        Steps taken between the instants of the results, where steps are adaptive; else zero.
    rejected
        Steps of too large an error, taken again with half their length.
    periodicity
        By how much the start misses returning after a revolution, as a part of the motion; negative if not asked for.
    imbalance
        Largest force out of balance, as a part of the largest force; negative where it was not looked at: without
        channels, without unknowns, or in a run that broke off before the first saved field.
    seconds
        Time spent in the step loop, s; negative where a run was killed before it could say.
    """

    engine: str = "direct"
    steps: int = 0
    size: int = 0
    unknowns: int = 0
    iterations: int = 0
    events: int = 0
    substeps: int = 0
    rejected: int = 0
    periodicity: float = -1.0
    imbalance: float = -1.0
    seconds: float = 0.0

    @property
    def told(self) -> bool:
        """Whether the run could say them; of one that was killed, only its steps are known, and its size."""
        return self.seconds >= 0.0


def raise_if_interrupted(status: Status) -> None:
    """Go on being interrupted: one of many runs was stopped, and what asked for them all stops as well."""
    if status.cause is Cause.INTERRUPTED:
        raise KeyboardInterrupt


NOT_POSITIVE = Status(
    Cause.SINGULAR, "the stiffness is not positive",
    "lower the force that presses it (a member buckles, a lever folds over), or hold what moves",
)  # fmt: skip
"""How a computation ends of which no more is known."""

_NAMED = 3
"""Unknowns that are named."""

_DIGITS = 6
"""Digits by which one unknown moves more than another: those of a symmetric motion stand in their order."""

_ALSO = 0.3
"""Part of the most negative energy from which on a further cause is named."""


class NotPositiveError(RunFailedError):
    """A stiffness that drives a motion instead of holding it back.

    Parameters
    ----------
    motion
        Along which it gives way, shape (n,); None where it is not known.
    """

    def __init__(self, motion: FloatArray | None = None) -> None:
        super().__init__(NOT_POSITIVE)
        self.motion = motion


def instability_status(names: Sequence[str], motion: FloatArray, parts: Iterable[tuple[str, Triplets]] = ()) -> Status:
    """Return how a computation ends whose stiffness is not positive."""
    sizes = np.abs(motion) / max(float(np.abs(motion).max(initial=0.0)), np.finfo(float).tiny)
    order: list[int] = np.argsort(-np.round(sizes, _DIGITS), kind="stable").tolist()
    along = f"along {', '.join(names[i] for i in order[:_NAMED])}"
    energies: dict[str, float] = defaultdict(float)  # all elements of a member have its name
    for name, part in parts:
        energies[name] += float(motion @ part.times(motion))
    worst = min(energies.values(), default=0.0)
    to_blame = [name for name, energy in energies.items() if energy < 0.0 and energy <= _ALSO * worst]
    what = f"what gives way is {' and '.join(to_blame)}, {along}" if to_blame else f"it gives way {along}"
    return replace(NOT_POSITIVE, text=f"{NOT_POSITIVE.text}: {what}")
