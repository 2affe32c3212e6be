"""Selection of parameters for the normal test suite."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import pytest


def mostly_slow(values: Iterable[object], every: int = 3):
    """Return parameters with the mark `slow`, except for every third or `every`-th one.

    It is for many similar parameters. A row of several values is a tuple or a `pytest.param`.
    """
    parameters = []
    for i, value in enumerate(values):
        row = value if isinstance(value, tuple) else (value,)
        parameter = value if hasattr(value, "marks") else pytest.param(*row)
        marks = [*parameter.marks, *[pytest.mark.slow] * (i % every > 0)]
        parameters.append(pytest.param(*parameter.values, id=parameter.id, marks=marks))
    return parameters


def slow_if(is_slow: Callable[[object], bool], values: Iterable[object]):
    """Return parameters of one value each, with the mark `slow` for some of them."""
    return [pytest.param(value, marks=[pytest.mark.slow] * bool(is_slow(value))) for value in values]
