"""Checkpoints: the state of a run between two blocks, as plain arrays, from which an interrupted run resumes.

`dynamics` creates and restores checkpoints; `io` stores them in the partial result.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from flexcam.dynamics.blocks import Block

Arrays = Mapping[str, NDArray[Any]]
"""Arrays by name; dots separate nested names."""


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """State of a run between two blocks.

    Parameters
    ----------
    steps
        Instants output so far, including the start.
    problem
        Digest of the problem, see `flexcam.dynamics.solve`.
    arrays
        State for the next step that is not part of the problem.
    """

    steps: int
    problem: str
    arrays: Arrays


@runtime_checkable
class CheckpointSink(Protocol):
    """Sink that also stores checkpoints."""

    def write_checkpoint(self, checkpoint: Checkpoint) -> None:
        """Store the checkpoint after the last block written."""
        ...


class CompletedPart(Protocol):
    """Completed part of an interrupted run."""

    @property
    def checkpoint(self) -> Checkpoint:
        """Checkpoint from which the run resumes."""
        ...

    def blocks(self) -> Iterator[Block]:
        """Yield the completed results block by block."""
        ...


def flatten(name: str, value: object) -> dict[str, NDArray[Any]]:
    """Return a value and its fields as flat arrays."""
    if value is None:
        return {}
    if not is_dataclass(value):
        return {name: np.asarray(value)}
    parts = (flatten(f"{name}.{one.name}", getattr(value, one.name)) for one in fields(value))
    return {key: array for part in parts for key, array in part.items()}


def select_prefix(name: str, arrays: Arrays) -> dict[str, NDArray[Any]]:
    """Return the arrays of one value by their nested names."""
    return {key.removeprefix(f"{name}."): array for key, array in arrays.items() if key.startswith(f"{name}.")}
