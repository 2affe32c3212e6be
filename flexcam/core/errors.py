"""Input validation errors: the place, the given value, the allowed values, the reason and the remedy."""

from __future__ import annotations

import difflib
import operator
import re
from dataclasses import asdict, dataclass
from datetime import date, time
from importlib.util import find_spec
from pathlib import PurePath
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from numpy.typing import ArrayLike, NDArray

ParsedValue = TypeVar("ParsedValue")
OtherValue = TypeVar("OtherValue")
"""Types of values read from text."""


def printable(text: str) -> str:
    r"""Return a text with control characters escaped, so that text from a file cannot control a terminal."""
    return _CONTROL.sub(lambda match: f"\\x{ord(match[0]):02x}", text)


NAME = r"^[A-Za-z0-9_][A-Za-z0-9_ -]*$"
"""Pattern of a name in a case or a mesh. Results use it as an HDF5 name and in channel names, separated by dots."""

NAMES = "a name of letters A to Z and a to z, digits, '_', '-' and spaces"
"""Description of valid names, for messages."""

_MAX_PART = 1000
"""Maximum length of a part of a message, characters."""

_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]")


_PLAIN_START = re.compile(r"(?!flexcam|pip|asammdf|pymoo|pandas)(?:a|[a-z]{2,})(?:'s)?(?:,? |$)")


def capitalize(text: str) -> str:
    """Return a sentence with a capital letter, unless it begins with a name, a key or an option."""
    return text[:1].upper() + text[1:] if _PLAIN_START.match(text) else text


def end_sentence(text: str) -> str:
    """Return a text with a period, unless it ends a sentence already."""
    return text.rstrip(".") + "." if text[-1] not in "?!" and not text.endswith("...") else text


@dataclass(frozen=True)
class Fault:
    """A fault in an input: its message is one sentence on the fault, one on the reason and one on the remedy."""

    where: str  #: location in the input: a key path with its line, a node, a parameter
    given: str  #: value found there
    allowed: str  #: allowed values; empty if the reason alone describes the fault
    why: str  #: reason for the limit
    remedy: str  #: how to correct it

    def __str__(self) -> str:
        where, given, allowed, why, remedy = (
            part if len(part) <= _MAX_PART else f"{part[:_MAX_PART]}..."
            for part in (self.where, self.given, self.allowed, self.why, self.remedy)
        )
        head = f"{where}: {why}"
        if allowed:
            actual = "missing" if given == "nothing" else f"got {given}"
            head = f"{where}: {actual}, expected {allowed}. {capitalize(why)}"
        text = " ".join(end_sentence(part.strip()) for part in (head, capitalize(remedy)) if part.strip())
        return printable(text.replace("\n", "\\n"))

    def as_dict(self) -> dict[str, str]:
        """Return the five facts by name, as ``--json`` prints them."""
        return asdict(self)


class FlexcamError(Exception):
    """Base class of all errors that flexcam raises deliberately."""


class InputError(FlexcamError, ValueError):
    """Invalid input, with all faults found.

    Parameters
    ----------
    faults
        One or more faults.

    Examples
    --------
    >>> try:
    ...     positive("diameter", -1.0, "m")
    ... except InputError as refusal:
    ...     print(refusal.faults[0].where)
    diameter
    """

    def __init__(self, faults: Iterable[Fault]) -> None:
        self.faults: tuple[Fault, ...] = tuple(faults)
        super().__init__("\n".join(map(str, self.faults)))


def refuse(where: str, given: object, allowed: str, why: str = "", remedy: str = "") -> InputError:
    """Return the error for a single invalid value, to be raised by the caller."""
    text = given if isinstance(given, str) else format_value(given)
    return InputError([Fault(where, text, allowed, why, remedy)])


def require_packages(where: str, given: str, extra: str, *names: str) -> None:
    """Raise an error if packages of an extra of flexcam are not installed."""
    if missing := [name for name in names if find_spec(name) is None]:
        why, remedy = f"cannot import {' and '.join(missing)}", f"run pip install 'flexcam[{extra}]'"
        raise refuse(where, given, "installed packages", why, remedy)


def parse_all(
    read: Callable[[str], ParsedValue], given: Iterable[str],
    check: Callable[[list[ParsedValue]], Iterable[Fault]] | None = None,
) -> list[ParsedValue]:  # fmt: skip
    """Return the values read from texts; all their faults, and those that `check` finds, are in one error."""
    values, faults = list[ParsedValue](), list[Fault]()
    for text in given:
        try:
            values.append(read(text))
        except InputError as refusal:
            faults += refusal.faults
    if faults := [*faults, *(check(values) if check else ())]:
        raise InputError(faults)
    return values


def collect_errors(
    first: Callable[[], ParsedValue], second: Callable[[], OtherValue], *others: Callable[[], object]
) -> tuple[ParsedValue, OtherValue]:
    """Run several checks, collect their faults, and return the results of the first two."""
    results, faults = list[Any](), list[Fault]()
    for check in (first, second, *others):
        try:
            results.append(check())
        except InputError as refusal:
            faults += refusal.faults
    if faults:
        raise InputError(faults)
    return results[0], results[1]


def format_value(value: object) -> str:
    """Format a value as in a case file, without Python notation."""
    if value is None or isinstance(value, bool):
        return "nothing" if value is None else str(value).lower()
    if isinstance(value, dict):
        pairs = cast("dict[object, object]", value).items()
        return "{ " + ", ".join(f"{key} = {_format_inner(item)}" for key, item in pairs) + " }" if pairs else "{}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(_format_inner, cast("list[object]", value))) + "]"
    if isinstance(value, (np.ndarray, np.generic)):
        return format_value(cast("Any", value).tolist())
    return str(value) if isinstance(value, (PurePath, date, time)) else repr(value)


def _format_inner(value: object) -> str:
    return f'"{value}"' if isinstance(value, str) else format_value(value)


def system_message(fault: Exception) -> str:
    """Return the operating system's reason for an error, without its number and path."""
    return (fault.strerror if isinstance(fault, OSError) else None) or str(fault)


def format_shape(shape: Iterable[int | None]) -> str:
    """Format an array shape; None means any length."""
    return " x ".join("any" if n is None else str(n) for n in shape) or "of a single number"


def positive(where: str, value: float, unit: str, *, zero: bool = False) -> float:
    """Return `value` if it is finite and above zero (or zero, where allowed)."""
    number = float(value)
    if np.isfinite(number) and (number > 0.0 or (zero and number == 0.0)):
        return number
    allowed = f"a finite number, {'zero or more' if zero else 'above zero'}"
    raise refuse(where, f"{number:g} {unit}".rstrip(), allowed, remedy="check sign and unit")


def finite_array(where: str, values: ArrayLike, shape: tuple[int | None, ...]) -> NDArray[np.float64]:
    """Return a read-only copy of `values` as a finite float array of the given shape."""
    try:
        array = np.array(values, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise refuse(where, values, "an array of numbers") from None
    fits = array.ndim == len(shape) and all(n is None or n == m for n, m in zip(shape, array.shape, strict=True))
    if not fits:
        raise refuse(where, f"shape {format_shape(array.shape)}", f"shape {format_shape(shape)}")
    if not np.isfinite(array).all():
        first = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise refuse(f"{where}{list(first)}", str(array[first]), "only finite numbers")
    array.setflags(write=False)
    return array


_MAX_ALIKE = 5  # maximum number of names in a suggestion
_SIMILARITY = 0.7  # least ratio of common letters of a typing error; words of different meaning have up to 0.67


def similar_name(name: str, known: Iterable[str]) -> str:
    """Return the closest known name, or an empty text.

    A file suffix that all names share does not make them similar.
    """
    others, suffix = [other for other in known if other != name], PurePath(name).suffix
    if not all(other.endswith(suffix) for other in others):
        suffix = ""
    stem, stems = name.removesuffix(suffix), [other.removesuffix(suffix) for other in others]
    near = [other for other in stems if sorted(other.lower()) == sorted(stem.lower())]
    near = near or difflib.get_close_matches(stem, stems, n=1, cutoff=_SIMILARITY)
    near = near or [
        other for other in stems if len(stem) == len(other) == 3 and sum(map(operator.ne, stem, other)) == 1
    ]
    return near[0] + suffix if near else ""


def suggest_name(name: str, known: Iterable[str]) -> str:
    """Return a suggestion of the closest known name, or an empty text.

    For ``contacts.exhaust.force`` only other contacts with a force are close: one with a similar name, or else all.
    """
    names, (kind, _, rest) = list(known), name.partition(".")
    part, dot, ending = rest.partition(".")
    if name in names:
        return ""
    alike = [other for other in names if dot and other.startswith(f"{kind}.") and other.split(".", 2)[2:] == [ending]]
    near = similar_name(name, names)
    if alike:
        near = similar_name(part, [other.split(".")[1] for other in alike])
        near = f"{kind}.{near}.{ending}" if near else ""
        if not near and len(alike) <= _MAX_ALIKE:
            return f"did you mean {' or '.join(map(repr, alike))}?"
    return f"did you mean {near!r}?" if near else ""
