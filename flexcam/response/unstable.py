"""How a computation ends whose stiffness is not positive, with what is known of the reason."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from flexcam.linalg import FloatArray, Triplets
from flexcam.response.status import Cause, RunFailedError, Status

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


def gives_way(names: Sequence[str], motion: FloatArray, parts: Iterable[tuple[str, Triplets]] = ()) -> Status:
    """Return how a computation ends whose stiffness is not positive."""
    sizes = np.abs(motion) / max(float(np.abs(motion).max(initial=0.0)), np.finfo(float).tiny)
    order: list[int] = np.argsort(-np.round(sizes, _DIGITS), kind="stable").tolist()
    along = f"along {', '.join(names[i] for i in order[:_NAMED])}"
    energies = sorted((float(motion @ part.times(motion)), name) for name, part in parts)
    to_blame = [name for energy, name in energies if energy < 0.0 and energy <= _ALSO * energies[0][0]]
    what = f"what gives way is {' and '.join(to_blame)}, {along}" if to_blame else f"it gives way {along}"
    return replace(NOT_POSITIVE, text=f"{NOT_POSITIVE.text}: {what}")
