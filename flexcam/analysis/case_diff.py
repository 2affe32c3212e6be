"""Differences between two runs by key, line or version; a run can be resumed only without differences."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from itertools import islice, zip_longest
from typing import Any, cast

from flexcam.core.errors import Fault

_WHY = "a run goes on only as it began"
_REMEDY = "restore it, or run the case again with --overwrite"

_MAX_CHARACTERS, _MAX_VALUES = 60, 4
"""Maximum length of a reported value, characters, and maximum number of values."""

_NONE = "nothing"


def find_differences(now: Mapping[str, str], then: Mapping[str, str]) -> list[Fault]:
    """Return the differences between a run and an earlier run that it resumes."""
    return [
        difference_fault(f"{what}{place}", given, allowed)
        for key, (what, parts) in _COMPARED_TEXTS.items()
        if now.get(key, "") != then.get(key, "")
        for place, given, allowed in islice(parts(now.get(key, ""), then.get(key, "")), _MAX_VALUES)
    ]


def difference_fault(what: str, given: str = "another one", allowed: str = "the one it began with") -> Fault:
    """Return a difference as a fault."""
    return Fault(f"--resume: {what}", _shorten(given), _shorten(allowed), _WHY, _REMEDY)


Part = tuple[str, str, str]
"""Position within a text, current value and previous value."""


def _compare_lines(now: str, then: str) -> Iterator[Part]:
    """Yield the first line in which two texts differ; a missing line is reported as the end of the text."""
    pairs = zip_longest(now.split("\n"), then.split("\n"), fillvalue="its end")
    first = next(((i, *pair) for i, pair in enumerate(pairs, start=1) if pair[0] != pair[1]), None)
    number, *both = first or (1, now, then)
    yield f", line {number}", both[0].strip() or "an empty line", both[1].strip() or "an empty line"


def _compare_texts(now: str, then: str) -> Iterator[Part]:
    yield "", now or _NONE, then or _NONE


def _compare_overrides(now: str, then: str) -> Iterator[Part]:
    """Yield the overrides that only one of two runs has; for the same overrides, their order."""
    one, other = (list[str](json.loads(text or "[]")) for text in (now, then))
    own = [[x for x in a if x not in b] for a, b in ((one, other), (other, one))]
    given, allowed = own if any(own) else (one, other)
    yield "", ", ".join(given) or _NONE, ", ".join(allowed) or _NONE


def _compare_values(now: str, then: str) -> Iterator[Part]:
    """Yield the keys that differ between two cases."""
    one, other = ({} if not text else dict(_iterate_values(json.loads(text))) for text in (now, then))
    for key in dict.fromkeys([*one, *other]):
        if one.get(key, _NONE) != other.get(key, _NONE):
            yield f", {key}", one.get(key, _NONE), other.get(key, _NONE)


def _iterate_values(value: object, path: str = "") -> Iterator[tuple[str, str]]:
    """Yield dotted key and text of every value in nested tables."""
    if not isinstance(value, dict):
        yield path, json.dumps(value)
        return
    for name, inner in cast("dict[str, Any]", value).items():
        yield from _iterate_values(inner, f"{path}.{name}".removeprefix("."))


def _shorten(text: str) -> str:
    return text if len(text) <= _MAX_CHARACTERS else f"{text[: _MAX_CHARACTERS - 3]}..."


_COMPARED_TEXTS: dict[str, tuple[str, Callable[[str, str], Iterator[Part]]]] = {
    "case": ("the text of the case", _compare_lines), "overrides": ("--set", _compare_overrides),
    "resolved": ("values of the case", _compare_values),
    **{name: (name, _compare_texts) for name in ("flexcam", "python", "numpy", "scipy", "numba")},
}  # fmt: skip
"""Texts of a result that must be equal for identical numbers, their description and comparison function."""
