"""Numbers in words: units, and zeros without their rounding."""

from __future__ import annotations

import math
from collections.abc import Sequence

_NOTHING = 1e-12
"""A length (m), an angle (rad), or a part of the largest number of a kind below this is the rounding of a zero."""

NOISE = 1e-9
"""Part of the largest lift below which the least one is not worth a word."""


def mm(value: float, digits: int = 6) -> str:
    """Return a length in millimetres; what is only the rounding of a zero is one."""
    return f"{0.0 if abs(value) < _NOTHING else 1e3 * value:.{digits}g}"


def clear(value: float, scale: float) -> float:
    """Return a number, or zero where it is the rounding of one."""
    return 0.0 if abs(value) < _NOTHING * scale else value


def fixed(value: float, decimals: int) -> str:
    """Return a number with the decimals of its column; a huge one, of a run that diverged, in few digits."""
    return f"{round(value, decimals) + 0.0:.{decimals}f}" if abs(value) < _HUGE else f"{value:.4g}"


def decimals(largest: float, usual: int) -> int:
    """Return how many decimals show four digits of the largest of some numbers."""
    return usual if largest < _NOTHING else max(usual, 3 - math.floor(math.log10(largest)))


_HUGE = 1e7
"""Size from which decimals say nothing."""


def degrees(angle: float) -> str:
    """Return an angle in degrees; what is only the rounding of a zero is one."""
    return f"{0.0 if abs(angle) < _NOTHING else math.degrees(angle):.4g}"


def told_apart(names: Sequence[str], beside: Sequence[str]) -> list[str]:
    """Return names that differ: as they are, with what stands beside them, or with a number."""
    if len(set(names)) == len(names):
        return list(names)
    longer = [f"{name}, {more}" if more else name for name, more in zip(names, beside, strict=True)]
    return longer if len(set(longer)) == len(names) else [f"{name} ({i})" for i, name in enumerate(longer, start=1)]
