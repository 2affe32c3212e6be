"""How far many things are."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

Advance = Callable[[int], None]
"""Told how many more of many things are finished."""


Thing = TypeVar("Thing")
"""What is counted."""


def counted(things: Iterable[Thing], advance: Advance | None) -> Iterator[Thing]:
    """Yield things one after the other, and tell after each that one more is finished."""
    for one in things:
        yield one
        if advance is not None:
            advance(1)
