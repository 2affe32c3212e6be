"""Where a scalar passes zero within a step: in plain numbers, for the steps of every way through time."""

from __future__ import annotations

CLOSE = 1e-9
"""Share of a step within which an event counts as at one of its ends."""

SHARP = 1e-12
"""Share of a step by which an event may be missed."""

ROUNDING = 4.0 * 2.220446049250313e-16
"""Of a time: what differences of times carry."""

TOGETHER = 1e-6
"""Share of a step within which events are one, such as those of two trains that mirror each other."""

MOST_EVENTS = 40
"""Within one step; what chatters beyond is taken as it comes."""

CORRECTIONS = 60

LEAST = 0.01
"""Part of a bracket by which a straight line between its ends narrows it at least."""


def crossing(pressed: bool, gap: float, new_gap: float, rate: float, new_rate: float, length: float) -> float:
    """Return the time in (0, length) at which the cubic through both ends changes sides, by bisection."""
    low, high = 0.0, 1.0
    for _ in range(50):
        x = 0.5 * (low + high)
        y = 1.0 - x
        value = y * y * ((1.0 + 2.0 * x) * gap + x * length * rate) + x * x * (
            (3.0 - 2.0 * x) * new_gap - y * length * new_rate
        )
        if (value > 0.0) == pressed:
            low = x
        else:
            high = x
    return high * length


Bracket = tuple[float, float, float, float, bool]
"""Times between which a scalar changes sides (s), the scalar there (m), and whether the later was the last found."""


def narrowed(
    pressed: bool, after: float, gap: float, rate: float, bracket: Bracket
) -> tuple[float, float, float, float, float, bool]:
    """Return where to look next for the zero of a scalar, and the bracket: Newton's method, kept within it."""
    low, high, near, far, was_beyond = bracket
    beyond = (gap > 0.0) != pressed
    if beyond:
        if was_beyond:  # the same end again: the Illinois rule, lest a stiff contact's side is crept along
            near *= 0.5
        high, far = after, gap
    else:
        low, near = after, gap
    newton = after - gap / rate if rate != 0.0 else high
    if beyond and was_beyond:
        # Behind an event the scalar begins at zero but for rounding, which is not the zero that is looked for.
        newton = max(low - near * (high - low) / (far - near), low + LEAST * (high - low))
    if not low < newton < high:
        newton = 0.5 * (low + high)
    return newton, low, high, near, far, beyond
