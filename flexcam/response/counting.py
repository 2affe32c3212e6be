"""How far many things are."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

Advance = Callable[[int], None]
"""Told how many more of many things are finished."""


Thing = TypeVar("Thing")
"""What is counted."""


def counted(things: Iterable[Thing], advance: Advance | None) -> Iterator[Thing]:
    """Yield things one after the other, and tell after each that one more is finished.

    Parameters
    ----------
    things
        Any.
    advance
        Is told; None for nobody.

    Yields
    ------
    object
        The things.

    Examples
    --------
    >>> told = []
    >>> [2 * one for one in counted([1, 2], told.append)], told
    ([2, 4], [1, 1])
    """
    for one in things:
        yield one
        if advance is not None:
            advance(1)
