"""Parameters of which the normal suite takes a part."""

from __future__ import annotations

from collections.abc import Iterable

import pytest


def mostly_slow(values: Iterable[object], every: int = 3):
    """Return parameters of which every third, or another part, is of the normal suite and the rest of the slow one.

    For parameters that prove the same at many places; a row of several values is a tuple or a `pytest.param`.
    """
    made = []
    for i, value in enumerate(values):
        row = value if isinstance(value, tuple) else (value,)
        one = value if hasattr(value, "marks") else pytest.param(*row)
        made.append(pytest.param(*one.values, id=one.id, marks=[*one.marks, *[pytest.mark.slow] * (i % every > 0)]))
    return made
