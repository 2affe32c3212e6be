"""The one voice for refused input: where, what was given, what is allowed, why, what to do."""

from __future__ import annotations

import difflib
import re
from dataclasses import asdict, dataclass
from datetime import date, time
from pathlib import PurePath
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from numpy.typing import ArrayLike, NDArray

Read = TypeVar("Read")
"""What is read of a text."""


def printable(text: str) -> str:
    r"""Return a text in which control characters are told, so that one from a file cannot command a terminal.

    Parameters
    ----------
    text
        Any; line ends and tabs stay.

    Returns
    -------
    str
        With ``\\x1b`` for an escape, and so on.

    Examples
    --------
    >>> print(printable("a\x1b[31mb"))
    a\x1b[31mb
    """
    return _CONTROL.sub(lambda found: f"\\x{ord(found[0]):02x}", text)


_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]")


@dataclass(frozen=True)
class Fault:
    """One thing that is wrong with an input.

    Parameters
    ----------
    where
        The place in the user's own terms: a key path with its line, a node, a parameter.
    given
        What stands there.
    allowed
        What may stand there.
    why
        The reason for the limit.
    remedy
        What to do about it.

    Examples
    --------
    >>> print(Fault("run.speed", "-5 rpm", "a speed above zero", "the cam turns forward", "give the speed as positive"))
    run.speed: given -5 rpm; allowed: a speed above zero; the cam turns forward; give the speed as positive
    """

    where: str
    given: str
    allowed: str
    why: str
    remedy: str

    def __str__(self) -> str:
        head = f"{self.where}: given {self.given}; allowed: {self.allowed}"
        return printable("; ".join(part for part in (head, self.why, self.remedy) if part))

    def as_dict(self) -> dict[str, str]:
        """Return the five facts by name, as ``--json`` prints them."""
        return asdict(self)


class FlexcamError(Exception):
    """Base of every error that flexcam raises on purpose."""


class InputError(FlexcamError, ValueError):
    """Refused input, with every fault that was found.

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
    """Return the refusal of a single value, to be raised by the caller.

    Parameters
    ----------
    where, given, allowed, why, remedy
        As in `Fault`; `given` is shown as `told` does, unless it is text.

    Returns
    -------
    InputError
        The error with one fault.

    Examples
    --------
    >>> str(refuse("elements", 0, "a whole number from 1"))
    'elements: given 0; allowed: a whole number from 1'
    """
    shown = given if isinstance(given, str) else told(given)
    return InputError([Fault(where, shown, allowed, why, remedy)])


def gathered(read: Callable[[str], Read], given: Iterable[str]) -> tuple[list[Read], list[Fault]]:
    """Return what is read of texts, and the faults of all those that cannot be read.

    Parameters
    ----------
    read
        Reads one; raises `InputError` for what it cannot.
    given
        The texts.

    Returns
    -------
    tuple
        What was read, in the order given, and the faults, which the caller raises together.

    Examples
    --------
    >>> def read(text):
    ...     return positive("length", float(text), "m")
    >>> found, faults = gathered(read, ["1", "-2", "3"])
    >>> found, [fault.given for fault in faults]
    ([1.0, 3.0], ['-2 m'])
    """
    found, faults = list[Read](), list[Fault]()
    for one in given:
        try:
            found.append(read(one))
        except InputError as refusal:
            faults += refusal.faults
    return found, faults


def together(first: Callable[[], Read], *others: Callable[[], object]) -> Read:
    """Return what the first of several checks returns, once all of them have been made.

    Parameters
    ----------
    first, others
        Each raises `InputError` for what it refuses; none needs what another one returns.

    Returns
    -------
    Read
        Of the first.

    Raises
    ------
    InputError
        With the faults of all.

    Examples
    --------
    >>> together(lambda: positive("length", 1.0, "m"), lambda: positive("width", 2.0, "m"))
    1.0
    >>> try:
    ...     together(lambda: positive("length", -1.0, "m"), lambda: positive("width", -2.0, "m"))
    ... except InputError as refusal:
    ...     [fault.where for fault in refusal.faults]
    ['length', 'width']
    """
    found, faults = list[Read](), list[Fault]()
    for i, check in enumerate((first, *others)):
        try:
            value = check()
        except InputError as refusal:
            faults += refusal.faults
        else:
            found += [cast("Read", value)] if i == 0 else []
    if faults:
        raise InputError(faults)
    return found[0]


def told(value: object) -> str:
    """Return a value as it would stand in a case file: nobody who writes one needs to read Python.

    Parameters
    ----------
    value
        What was given; arrays and their numbers as lists.

    Returns
    -------
    str
        A text in quotes, nothing for None.

    Examples
    --------
    >>> told((0.5, True, None)), told({"id": "scca", "b": 1})
    ('[0.5, true, nothing]', '{ id = "scca", b = 1 }')
    >>> told("uy")
    "'uy'"
    """
    if value is None or isinstance(value, bool):
        return "nothing" if value is None else str(value).lower()
    if isinstance(value, dict):
        pairs = cast("dict[object, object]", value).items()
        return "{ " + ", ".join(f"{key} = {_inner(one)}" for key, one in pairs) + " }" if pairs else "{}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(_inner, cast("list[object]", value))) + "]"
    if isinstance(value, (np.ndarray, np.generic)):
        return told(cast("Any", value).tolist())
    return str(value) if isinstance(value, (PurePath, date, time)) else repr(value)


def _inner(value: object) -> str:
    return f'"{value}"' if isinstance(value, str) else told(value)


def said(fault: Exception) -> str:
    """Return why something went wrong, in the system's own words: without its number and the path, told elsewhere.

    Parameters
    ----------
    fault
        Such as an `OSError`.

    Returns
    -------
    str
        Its reason.

    Examples
    --------
    >>> said(FileNotFoundError(2, "No such file or directory", "case.toml"))
    'No such file or directory'
    """
    return (fault.strerror if isinstance(fault, OSError) else None) or str(fault)


def in_words(shape: Iterable[int | None]) -> str:
    """Return a shape; None stands for any length.

    Parameters
    ----------
    shape
        Of an array.

    Returns
    -------
    str
        Such as ``3 x any``.

    Examples
    --------
    >>> in_words((3, None)), in_words(())
    ('3 x any', 'of a single number')
    """
    return " x ".join("any" if n is None else str(n) for n in shape) or "of a single number"


def positive(where: str, value: float, unit: str, *, zero: bool = False) -> float:
    """Return `value` if it is finite and above zero (or zero, where allowed).

    Parameters
    ----------
    where
        Name of the quantity.
    value
        The number, in SI.
    unit
        SI unit, for the message.
    zero
        Whether zero is allowed.

    Returns
    -------
    float
        The value itself.

    Raises
    ------
    InputError
        If the value is negative, not finite, or zero where zero is not allowed.

    Examples
    --------
    >>> positive("length", 2.0, "m")
    2.0
    """
    number = float(value)
    if np.isfinite(number) and (number > 0.0 or (zero and number == 0.0)):
        return number
    allowed = f"a finite number, {'zero or more' if zero else 'above zero'}"
    raise refuse(where, f"{number:g} {unit}".rstrip(), allowed, remedy="check sign and unit")


def finite_array(where: str, values: ArrayLike, shape: tuple[int | None, ...]) -> NDArray[np.float64]:
    """Return a read-only copy of `values` as a float array of the given shape.

    Parameters
    ----------
    where
        Name of the quantity.
    values
        Numbers, any array-like.
    shape
        Expected shape; None stands for any length.

    Returns
    -------
    ndarray
        Read-only copy, float64.

    Raises
    ------
    InputError
        If the shape differs or a number is not finite.

    Examples
    --------
    >>> finite_array("offset", [0, 0, 1], (3,)).flags.writeable
    False
    """
    try:
        array = np.array(values, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise refuse(where, values, "an array of numbers") from None
    fits = array.ndim == len(shape) and all(n is None or n == m for n, m in zip(shape, array.shape, strict=True))
    if not fits:
        raise refuse(where, f"shape {in_words(array.shape)}", f"shape {in_words(shape)}")
    if not np.isfinite(array).all():
        first = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise refuse(f"{where}{list(first)}", str(array[first]), "finite numbers only")
    array.setflags(write=False)
    return array


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return a hint at the nearest known name, or an empty text.

    Parameters
    ----------
    name
        What was written.
    known
        What exists.

    Returns
    -------
    str
        ``did you mean 'x'?`` or nothing.

    Examples
    --------
    >>> did_you_mean("stifness", ["stiffness", "damping"])
    "did you mean 'stiffness'?"
    """
    names = [other for other in known if other != name]
    swapped = [other for other in names if sorted(other.lower()) == sorted(name.lower())]
    near = swapped or difflib.get_close_matches(name, names, n=1, cutoff=0.6)
    return f"did you mean {near[0]!r}?" if near else ""
