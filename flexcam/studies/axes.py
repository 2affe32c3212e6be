"""Axis of a sweep, from ``--set KEY=SPEC``: a range, a list, an interval to be sampled, or one value.

========================  ==================================================================
``1000:8000:50rpm``       start, stop and step; the stop is included if it is on the grid
``8000:1000:-50rpm``      descending
``1000:8000#141rpm``      number of values, evenly spaced from start to stop
``30,40,50 kN/m``         a list; a unit at its end applies to all numbers without one
``newmark,bathe``         a list of words or of other TOML values
``30:60 kN/m``            an interval, for sampled plans
``2``                     one value, set in every variant
========================  ==================================================================

Numbers are decimal, so that 0.1:0.5:0.1 ends with 0.5. The values remain texts such as ``1050rpm``, which the case
checks.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Context, Decimal
from typing import NamedTuple

from flexcam.core.errors import Fault, InputError, refuse

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_UNIT = r"\s*((?:[A-Za-z%µ°]|(?<=\s)1\s*/)[^:#,]*?)?\s*"
_QUANTITY = re.compile(rf"\s*({_NUMBER}){_UNIT}$")
_RANGE = re.compile(rf"\s*({_NUMBER}){_UNIT}:\s*({_NUMBER}){_UNIT}(?::\s*({_NUMBER}){_UNIT}|#\s*(\d{{1,15}}){_UNIT})?$")
_LIKE_A_RANGE = re.compile(rf"\s*{_NUMBER}[^,:]*:")
_DIGITS = Context(prec=17)
_SAMPLED = Context(prec=10)
_MAX_EXPONENT = 300
"""Maximum exponent of a number."""
_MIN_FIXED_EXPONENT, _MAX_FIXED_EXPONENT = -6, 16
"""Range of decimal exponents written in fixed notation."""
_FEWEST = 2
_MANY = 10**15

MAX_VARIANTS = 10_000
"""Default maximum number of variants."""

FORMS = "a range 1000:8000:50rpm or 1000:8000#141rpm, a list 30,40,50 kN/m, an interval 30:60 kN/m, or one value"


class Value(NamedTuple):
    """Value of an axis: the text of the override, and its number in the unit of the axis if it is numeric."""

    text: str
    number: float | None


@dataclass(frozen=True)
class Axis:
    """Values of one key of a case in a sweep.

    Parameters
    ----------
    key
        Key, such as ``run.crank_speed``.
    where
        Source for messages: ``--set run.crank_speed=1000:8000:50rpm``, or a line of the case.
    values
        Values; for an interval, its two ends.
    unit
        Unit of the numbers as given; empty for SI or for words.
    interval
        Whether values between the two ends are allowed.
    """

    key: str
    where: str
    values: tuple[Value, ...]
    unit: str = ""
    interval: bool = False

    @property
    def is_varied(self) -> bool:
        """Return whether the axis has more than one value."""
        return len(self.values) > 1

    @property
    def is_numeric(self) -> bool:
        """Return whether every value is a number in the unit of the axis."""
        return all(value.number is not None for value in self.values)

    def at(self, part: float) -> Value:
        """Return the value at a fraction of the axis, for a sampled plan."""
        if not self.interval:
            return self.values[min(int(part * len(self.values)), len(self.values) - 1)]
        low, high = (Decimal(repr(value.number)) for value in self.values)
        return _quantity(_SAMPLED.plus(low + Decimal(part) * (high - low)), self.unit)


def parse_axis(key: str, spec: str, *, where: str = "", limit: int = MAX_VARIANTS) -> Axis:
    """Return the axis of one key."""
    place = where or f"--set {key}={spec}"
    if not spec.strip():
        raise refuse(place, repr(spec), FORMS, "the range is empty")
    if match := _RANGE.match(spec):
        return _range(key, place, match, limit)
    if _LIKE_A_RANGE.match(spec):
        raise refuse(place, repr(spec), FORMS, "", "write start:stop:step, start:stop#count or start:stop, then a unit")
    return _list(key, place, spec, limit)


def parse_axes(settings: Sequence[str], *, limit: int = MAX_VARIANTS) -> tuple[Axis, ...]:
    """Return the axes of several ``key=spec``."""
    found, faults = dict[str, Axis](), list[Fault]()
    for setting in settings:
        key, equals, spec = setting.partition("=")
        key, where = key.strip(), f"--set {setting}"
        if not equals or not key:
            faults.append(Fault(where, repr(setting), f"key=values: {FORMS}", "", "such as run.speed=1000:4000:50rpm"))
        elif key in found:
            faults.append(Fault(where, repr(key), "every key once", "it is given twice", "write a list"))
        else:
            try:
                found[key] = parse_axis(key, spec, limit=limit)
            except InputError as refusal:
                faults += refusal.faults
    if faults:
        raise InputError(faults)
    return tuple(found.values())


def _range(key: str, where: str, match: re.Match[str], limit: int) -> Axis:
    start, stop, step = (Decimal(match[i] or 0) for i in (1, 3, 5))
    if any(abs(number.adjusted()) > _MAX_EXPONENT for number in (start, stop, step)):
        raise refuse(where, match[0].strip(), FORMS, "no mechanism has such numbers")
    units = {unit for unit in match.group(2, 4, 6, 8) if unit}
    if len(units) > 1:
        raise refuse(where, " and ".join(sorted(units)), "one unit, at the end", "numbers of a range belong together")
    unit = "".join(units)
    if match[7]:
        numbers = _evenly_spaced(where, start, stop, int(match[7]), limit)
    elif match[5]:
        numbers = _range_values(where, start, stop, step, limit)
    elif start >= stop:
        raise refuse(where, match[0].strip(), "an interval that rises, such as 30:60 kN/m", "the interval is empty")
    else:
        return Axis(key, where, (_quantity(start, unit), _quantity(stop, unit)), unit, interval=True)
    return Axis(key, where, tuple(_quantity(number, unit) for number in numbers), unit)


def _evenly_spaced(where: str, start: Decimal, stop: Decimal, count: int, limit: int) -> list[Decimal]:
    if count < _FEWEST or start == stop:
        given = f"{count} values from {start} to {stop}"
        raise refuse(where, given, "two values or more, from a start to another stop", "the range is empty")
    check_count(where, count, limit)
    return [_DIGITS.plus(start + (stop - start) * i / (count - 1)) for i in range(count)]


def _range_values(where: str, start: Decimal, stop: Decimal, step: Decimal, limit: int) -> list[Decimal]:
    if step == 0:
        raise refuse(where, "a step of zero", "a step that leads from start to stop", "the range never ends")
    steps = (stop - start) / step
    if steps < 0:
        given = f"a step of {step} to a stop {'below' if step > 0 else 'above'} the start"
        remedy = f"swap them, or take a step of {-step}"
        raise refuse(where, given, "a step towards the stop", "the range is empty", remedy)
    check_count(where, int(steps) + 1, limit)
    return [_DIGITS.plus(start + i * step) for i in range(int(steps) + 1)]


def check_count(where: str, count: int, limit: int) -> None:
    """Raise an error if the number of runs exceeds the limit."""
    if count > limit:
        given = f"{count} variants" if count < _MANY else "more variants than could ever be run"
        remedy = f"take fewer values, or allow them with --limit {count}" if count < _MANY else "take fewer values"
        raise refuse(where, given, f"up to {limit}", "each is a run", remedy)


def _list(key: str, where: str, spec: str, limit: int) -> Axis:
    parts = [part.strip() for part in _split(spec)]
    if not all(parts):
        raise refuse(where, repr(spec), FORMS, "a value between the commas is missing")
    check_count(where, len(parts), limit)
    found = [_QUANTITY.match(part) for part in parts]
    units = [one[2] if one else None for one in found]
    unit = units[-1] or ""
    if all(found) and any(units) and not unit:
        raise refuse(
            where, repr(spec), FORMS, "some numbers have a unit and the last one has none", "give each its unit"
        )
    texts = [_join_unit(part, unit) if one and not one[2] else part for part, one in zip(parts, found, strict=True)]
    if all(found) and set(units) <= {None, unit or None}:
        numbers = [float(one[1]) for one in found if one]
        return Axis(key, where, tuple(map(Value, texts, numbers)), unit)
    return Axis(key, where, tuple(Value(text, None) for text in texts))


def _split(spec: str) -> list[str]:
    """Split a text at commas outside of brackets and quotes."""
    parts, depth, quote = [""], 0, ""
    for sign in spec:
        if quote or sign in "\"'":
            quote = "" if sign == quote else quote or sign
        else:
            depth += (sign in "[{") - (sign in "]}")
        if sign == "," and not depth and not quote:
            parts.append("")
        else:
            parts[-1] += sign
    return parts


def _quantity(number: Decimal, unit: str) -> Value:
    """Return a number with its unit, in fixed notation up to sixteen digits, so that integers remain integers."""
    plain = number.normalize() if number else Decimal(0)
    text = f"{plain:f}" if _MIN_FIXED_EXPONENT <= plain.adjusted() < _MAX_FIXED_EXPONENT else f"{plain}"
    return Value(_join_unit(text, unit), float(plain))


def _join_unit(number: str, unit: str) -> str:
    """Join a number and its unit; a blank is required before "1/s"."""
    return f"{number} {unit}" if unit[:1] == "1" else f"{number}{unit}"
