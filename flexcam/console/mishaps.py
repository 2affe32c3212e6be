"""What no valve train may do in a run, in words: leave its cam, bounce, clash its coils, buckle."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from flexcam.train import BOUNCE_HEIGHT, OPEN, Figure


def mishaps(figures: Iterable[Figure]) -> list[str]:
    """Return what a train did in the last revolution of a run that none may do, in words."""
    known = list(figures)
    return [*_left(known), *_bounced(known), *_clashed(known), *_buckled(known)]


def left_words(figures: Iterable[Figure]) -> str:
    """Return which followers left their cams, and for how long, in words."""
    told = _found(figures, ".open_on_the_lift")
    return ", ".join(f"{name!r} left it for {math.degrees(open_):.2g} deg" for name, open_ in told if open_ > OPEN)


def _left(figures: Iterable[Figure]) -> list[str]:
    return [
        f"Warning: the follower of {name!r} leaves its cam for {math.degrees(angle):.3g} deg on the lift: "
        f"what follows is no valve event to design by"
        for name, angle in _found(figures, ".open_on_the_lift")
        if angle > OPEN
    ]


def _bounced(figures: list[Figure]) -> list[str]:
    times = dict(_found(figures, ".bounces"))
    return [
        f"Warning: the valve bounces {_often(times[name])} at {name!r}, to {1e3 * height:.3g} mm above its seat"
        for name, height in _found(figures, ".bounce_height")
        if height > BOUNCE_HEIGHT
    ]


def _often(times: float) -> str:
    return "once" if times == 1.0 else f"{times:.0f} times"


def _clashed(figures: Iterable[Figure]) -> list[str]:
    return [
        f"Warning: coils of {name!r} touch: {-1e3 * clearance:.3g} mm beyond closed"
        for name, clearance in _found(figures, ".clearance.least")
        if clearance < 0.0
    ]


def _buckled(figures: Iterable[Figure]) -> list[str]:
    return [
        f"Warning: member {name!r} bears more than its buckling load, margin {margin:.4g}: "
        f"a straight member bends without end"
        for name, margin in _found(figures, ".buckling_margin")
        if margin < 1.0
    ]


def _found(figures: Iterable[Figure], end: str) -> Iterator[tuple[str, float]]:
    """Yield the name of what a figure belongs to, and the figure."""
    for figure in figures:
        if figure.name.endswith(end):
            yield figure.name.removesuffix(end).partition(".")[2], figure.value
