"""Least and largest values of a lift and of its derivatives."""

from __future__ import annotations

from functools import lru_cache

from flexcam.motion.criteria import Extreme
from flexcam.motion.event import Event
from flexcam.motion.extremes import lowest


def event_extremes(event: Event, order: int = 0) -> tuple[Extreme, Extreme]:
    """Return the least and the largest value of a lift or of a derivative of it."""
    return _known_extremes(event, order) if _hashable(event) else _extremes(event, order)


def _hashable(event: Event) -> bool:
    """Tell whether an event can be a key: one that holds arrays cannot."""
    try:
        hash(event)
    except TypeError:
        return False
    return True


def _extremes(event: Event, order: int) -> tuple[Extreme, Extreme]:
    high = lowest(lambda angle: -event(angle, order), event.joints)
    return lowest(lambda angle: event(angle, order), event.joints), Extreme(-high.value, high.at)


_known_extremes = lru_cache(maxsize=64)(_extremes)
"""The same cam is asked at every speed."""
