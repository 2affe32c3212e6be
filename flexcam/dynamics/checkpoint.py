"""What a run carries from one block of results to the next, as plain arrays: a run that broke off goes on with it.

Knows no equations and no file: `dynamics` makes and takes checkpoints, `io` keeps them in the partial result.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from flexcam.dynamics.blocks import Block

Arrays = Mapping[str, NDArray[Any]]
"""Arrays by name; a dot stands between the names of what they belong to."""


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """A run between two blocks of its results.

    Parameters
    ----------
    steps
        Instants handed out so far, the start among them.
    problem
        What is solved, as a digest: see `flexcam.dynamics.solve`.
    arrays
        Everything that the next step depends on and the problem does not tell.
    """

    steps: int
    problem: str
    arrays: Arrays


@runtime_checkable
class CheckpointSink(Protocol):
    """A sink that keeps checkpoints too."""

    def keep(self, checkpoint: Checkpoint) -> None:
        """Take the state of the run behind the block that was written last."""
        ...


class Earlier(Protocol):
    """The finished part of a run that broke off."""

    @property
    def checkpoint(self) -> Checkpoint:
        """Where the run goes on."""
        ...

    def blocks(self) -> Iterator[Block]:
        """Yield the results up to there, block by block, as the run handed them out."""
        ...


def flatten(name: str, value: object) -> dict[str, NDArray[Any]]:
    """Return a value and all it is made of as arrays."""
    if value is None:
        return {}
    if not is_dataclass(value):
        return {name: np.asarray(value)}
    parts = (flatten(f"{name}.{one.name}", getattr(value, one.name)) for one in fields(value))
    return {key: array for part in parts for key, array in part.items()}


def arrays_below(name: str, arrays: Arrays) -> dict[str, NDArray[Any]]:
    """Return the arrays of one value, by their names within it."""
    return {key.removeprefix(f"{name}."): array for key, array in arrays.items() if key.startswith(f"{name}.")}
