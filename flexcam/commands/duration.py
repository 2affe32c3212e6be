"""How long a command may take, as it is written on the command line: ``90s``, ``5min30s``, ``2h``."""

from __future__ import annotations

import math
import re

from flexcam.checks import InputError, refuse

_UNITS = {"h": 3600.0, "min": 60.0, "s": 1.0, "ms": 1e-3}
_PART = re.compile(r"\s*(\d+\.?\d*|\.\d+)\s*([A-Za-z]+)\s*")
_BARE = re.compile(r"\s*(\d+\.?\d*|\.\d+)\s*$")
_ALLOWED = "a time above zero with its unit, such as 90s, 5min30s or 2h"


def duration(where: str, text: str) -> float:
    """Return a duration."""
    whole = 0.0
    position = 0
    while found := _PART.match(text, position):
        if found[2] not in _UNITS:
            raise _refusal(where, text, f"{found[2]!r} is none of {', '.join(_UNITS)}")
        whole += float(found[1]) * _UNITS[found[2]]
        position = found.end()
    if position < len(text) or not position:
        raise _refusal(where, text, _why(text[position:]))
    if not 0.0 < whole < math.inf:
        raise _refusal(where, text, "nothing is done in no time" if whole == 0.0 else "the number is not finite")
    return whole


def _why(rest: str) -> str:
    """Return why what is left of a text is no duration."""
    if _BARE.match(rest):
        return f"{rest.strip()} without a unit could be anything"
    return "time does not run backwards" if rest.lstrip().startswith("-") else f"{rest!r} is no number with a unit"


def _refusal(where: str, text: str, why: str) -> InputError:
    bare = _BARE.match(text)
    remedy = (
        f"write {bare[1]}s or {bare[1]}min" if bare else "write a number and h, min or s; leave it out for no limit"
    )
    return refuse(where, text or "nothing", _ALLOWED, why, remedy)
