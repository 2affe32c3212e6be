"""Unit conversion: text such as ``"40 kN/m"`` becomes an SI number on input.

The table is small because a full unit library takes longer to import than a run. The tests compare it with pint.
"""

from __future__ import annotations

import math
import re
from contextvars import ContextVar
from dataclasses import dataclass
from decimal import Context, Decimal
from typing import Literal, cast

from flexcam.core.errors import InputError, refuse, similar_name

RPM = math.pi / 30.0
"""One revolution per minute, rad/s."""

Exponents = tuple[int, int, int, int, int]
"""Exponents of metre, kilogram, second, kelvin, radian."""

NUMBER = re.compile(r"\s*([+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*)$")
_FACTOR = re.compile(r"([*/]?)\s*(1(?=\s*/)|[A-Za-z%µ°]+)\s*(?:(?:\^|\*\*)\s*([+-]?\d+))?\s*")

_KELVIN = "write K; temperatures are rises above that of assembly"
_FOREIGN = {
    "degC": _KELVIN, "C": _KELVIN, "ppm": "write um/m for 1 ppm",
    "lbm": "write 'lb', a mass", "inch": "write 'in'", "inches": "write 'in'", "gram": "write 'g'",
    "grams": "write 'g'", "degree": "did you mean 'deg'?", "degrees": "did you mean 'deg'?", "sec": "write 's'",
    "lbs": "write 'lb' for a mass, 'lbf' for a force",
}  # fmt: skip
"""Other names of units, and the remedies."""

PLAIN_NUMBER = ", or a number in "
"""Offer of a number in SI in a message, followed by the unit; options of commands need a unit."""

IN_RADIANS = "a number without a unit is in rad: in a case write '{:g} deg'"
"""Remedy for an angle that was probably meant in deg, to be formatted with its number."""

_MAX_UNIT = 40  # length of a unit up to which a similar one is searched
_UNITS = "a unit such as mm, kg, kN/m, GPa, rpm, deg"
"""Allowed units where the quantity is not given, for messages."""

_POUND = re.compile(r"\blb\b")
"""Pounds as a mass, which are often meant as a force."""

_LARGEST = 10**308
"""Limit above which a number counts as infinite: Python integers may exceed the float range."""

_NONE: Exponents = (0, 0, 0, 0, 0)
_PREFIXED: dict[str, tuple[Decimal, Exponents]] = {
    "m": (Decimal(1), (1, 0, 0, 0, 0)),
    "g": (Decimal("1e-3"), (0, 1, 0, 0, 0)),
    "s": (Decimal(1), (0, 0, 1, 0, 0)),
    "N": (Decimal(1), (1, 1, -2, 0, 0)),
    "Pa": (Decimal(1), (-1, 1, -2, 0, 0)),
    "J": (Decimal(1), (2, 1, -2, 0, 0)),
    "W": (Decimal(1), (2, 1, -3, 0, 0)),
    "Hz": (Decimal(1), (0, 0, -1, 0, 0)),
    "rad": (Decimal(1), (0, 0, 0, 0, 1)),
}
_PREFIXES = {
    prefix: Decimal(size)
    for prefix, size in {
        "": "1", "G": "1e9", "M": "1e6", "k": "1e3", "d": "1e-1", "c": "1e-2", "m": "1e-3", "u": "1e-6", "µ": "1e-6",
        "n": "1e-9",
    }.items()
}  # fmt: skip
_PLAIN: dict[str, tuple[Decimal, Exponents]] = {
    "1": (Decimal(1), _NONE),
    "%": (Decimal("0.01"), _NONE),
    "t": (Decimal("1e3"), (0, 1, 0, 0, 0)),
    "bar": (Decimal("1e5"), (-1, 1, -2, 0, 0)),
    "deg": (Decimal(math.pi / 180.0), (0, 0, 0, 0, 1)),
    "°": (Decimal(math.pi / 180.0), (0, 0, 0, 0, 1)),
    "rev": (Decimal(2.0 * math.pi), (0, 0, 0, 0, 1)),
    "rpm": (Decimal(RPM), (0, 0, -1, 0, 1)),
    "min": (Decimal(60), (0, 0, 1, 0, 0)),
    "h": (Decimal(3600), (0, 0, 1, 0, 0)),
    "in": (Decimal("0.0254"), (1, 0, 0, 0, 0)),
    "ft": (Decimal("0.3048"), (1, 0, 0, 0, 0)),
    "thou": (Decimal("2.54e-5"), (1, 0, 0, 0, 0)),
    "mil": (Decimal("2.54e-5"), (1, 0, 0, 0, 0)),
    "lb": (Decimal("0.45359237"), (0, 1, 0, 0, 0)),
    "oz": (Decimal("0.028349523125"), (0, 1, 0, 0, 0)),
    "lbf": (Decimal("4.4482216152605"), (1, 1, -2, 0, 0)),
    "psi": (Decimal("6894.757293168361"), (-1, 1, -2, 0, 0)),
    "ksi": (Decimal("6894757.293168361"), (-1, 1, -2, 0, 0)),
    "hp": (Decimal("745.69987158227022"), (2, 1, -3, 0, 0)),
    "K": (Decimal(1), (0, 0, 0, 1, 0)),
}
"""Units that are an exact decimal multiple of SI, so that a text converts to the same float as its SI number."""

_EXACT = Context(prec=60, traps=[])
"""Decimal precision of unit arithmetic, so that only the conversion to float rounds. Overflow gives infinity."""


@dataclass(frozen=True)
class Dimension:
    """Physical dimension: exponents, the SI unit for display, and an example text.

    Parameters
    ----------
    name
        Name for messages.
    exponents
        Exponents of metre, kilogram, second, kelvin, radian.
    si
        Symbol of the SI unit.
    example
        A valid text, for messages.
    least, most
        Plausible range in SI for a mechanism; zero is always allowed. The range also avoids overflow and underflow.
    """

    name: str
    exponents: Exponents
    si: str
    example: str
    least: float
    most: float

    @property
    def indefinite(self) -> str:
        """Name with its article, such as ``an angle``."""
        return f"{'an' if self.name[0] in 'aeiou' else 'a'} {self.name}"


def _table(*rows: tuple[str, Exponents, str, str, float, float]) -> dict[str, Dimension]:
    return {row[0]: Dimension(*row) for row in rows}


DIMENSIONS = _table(
    ("number", _NONE, "", "0.5", 1e-12, 1e12),
    ("length", (1, 0, 0, 0, 0), "m", "25 mm", 1e-09, 100000),
    ("area", (2, 0, 0, 0, 0), "m^2", "490 mm^2", 1e-18, 1e10),
    ("second moment", (4, 0, 0, 0, 0), "m^4", "19000 mm^4", 1e-36, 1e20),
    ("mass", (0, 1, 0, 0, 0), "kg", "0.15 kg", 1e-15, 1e12),
    ("inertia", (2, 1, 0, 0, 0), "kg m^2", "1e-4 kg m^2", 1e-24, 1e20),
    ("density", (-3, 1, 0, 0, 0), "kg/m^3", "7800 kg/m^3", 1e-09, 1e09),
    ("stress", (-1, 1, -2, 0, 0), "Pa", "207 GPa", 0.001, 1e15),
    ("pressure", (-1, 1, -2, 0, 0), "Pa", "0.4 MPa", 0.001, 1e15),
    ("bulk modulus", (-1, 1, -2, 0, 0), "Pa", "1.5 GPa", 0.001, 1e15),
    ("force", (1, 1, -2, 0, 0), "N", "300 N", 1e-12, 1e15),
    ("moment", (2, 1, -2, 0, 0), "N m", "5 N m", 1e-15, 1e15),
    ("stiffness", (0, 1, -2, 0, 0), "N/m", "40 kN/m", 1e-12, 1e18),
    ("rotational stiffness", (2, 1, -2, 0, -1), "N m/rad", "5 kN m/rad", 1e-15, 1e18),
    ("damping", (0, 1, -1, 0, 0), "N s/m", "2 kN s/m", 1e-15, 1e15),
    ("rotational damping", (2, 1, -1, 0, -1), "N m s/rad", "1 N m s/rad", 1e-15, 1e15),
    ("time", (0, 0, 1, 0, 0), "s", "20 us", 1e-15, 1e09),
    ("rate", (0, 0, -1, 0, 0), "1/s", "5.36 1/s", 1e-12, 1e15),
    ("frequency", (0, 0, -1, 0, 0), "Hz", "5 kHz", 1e-12, 1e15),
    ("angle", (0, 0, 0, 0, 1), "rad", "180 deg", 1e-09, 1e06),
    ("speed", (0, 0, -1, 0, 1), "rad/s", "3000 rpm", 1e-06, 1e08),
    ("velocity", (1, 0, -1, 0, 0), "m/s", "0.5 m/s", 1e-12, 1e6),
    ("inverse velocity", (-1, 0, 1, 0, 0), "s/m", "0.3 s/m", 1e-9, 1e9),
    ("acceleration", (1, 0, -2, 0, 0), "m/s^2", "9.81 m/s^2", 1e-09, 1e09),
    ("viscosity", (-1, 1, -1, 0, 0), "Pa s", "10 mPa s", 1e-09, 1e09),
    ("pressure-viscosity coefficient", (1, -1, 2, 0, 0), "1/Pa", "15 1/GPa", 1e-12, 1e-06),
    ("wear coefficient", (1, -1, 2, 0, 0), "m^2/N", "1e-18 m^2/N", 1e-30, 1e-09),
    ("thermal conductivity", (1, 1, -3, -1, 0), "W/m/K", "46 W/m/K", 1e-06, 1e06),
    ("thermal expansion", (0, 0, 0, -1, 0), "1/K", "12e-6 1/K", 1e-12, 1.0),
    ("temperature", (0, 0, 0, 1, 0), "K", "80 K", 1e-09, 1e04),
    ("specific heat", (2, 0, -2, -1, 0), "J/kg/K", "470 J/kg/K", 1e-06, 1e09),
)


def _unit(symbol: str) -> tuple[Decimal, Exponents] | None:
    if symbol in _PLAIN:
        return _PLAIN[symbol]
    for base, (factor, exponents) in _PREFIXED.items():
        prefix = symbol.removesuffix(base)
        if symbol.endswith(base) and prefix in _PREFIXES:
            return _EXACT.multiply(_PREFIXES[prefix], factor), exponents
    return None


def is_unit(symbol: str) -> bool:
    """Return whether a text is the symbol of a unit, such as ``mm``."""
    return _unit(symbol) is not None


def _unit_product(text: str) -> tuple[Decimal, Exponents] | str:
    """Return factor and dimension of a unit, or its first part that is unknown."""
    factor, exponents, position, divide = Decimal(1), _NONE, 0, False
    while position < len(text):
        match = _FACTOR.match(text, position)
        unit = _unit(match[2]) if match else None
        if match is None or unit is None:
            return match[2] if match else text[position:]
        # As in print, a '/' applies to all factors up to the next '*' or '/': N s/m, kg/(m s) is kg/m/s.
        divide = match[1] == "/" or (match[1] == "" and divide)
        power = int(match[3] or 1) * (-1 if divide else 1)
        factor = _EXACT.multiply(factor, _EXACT.power(unit[0], power))
        exponents = cast("Exponents", tuple(a + power * b for a, b in zip(exponents, unit[1], strict=True)))
        position = match.end()
    return factor, exponents


def _parse_unit(text: str, where: str, expected: Exponents) -> tuple[Decimal, Exponents]:
    """Return factor and dimension of a unit; the message on an unknown one suggests one of the expected dimension."""
    product = _unit_product(text)
    if not isinstance(product, str):
        return product
    near = _similar_unit(text.strip(), product, expected)
    examples = (kind.example.partition(" ")[2] for kind in DIMENSIONS.values() if kind.exponents == expected)
    hint = f"did you mean {near!r}?" if near else f"use a known unit, such as {next(filter(None, examples), 'mm')}"
    given, why = f"unit {product!r} in {text!r}", f"the unit {product!r} is unknown"
    raise refuse(where, given, _UNITS, why, _FOREIGN.get(product, hint))


def _similar_unit(text: str, symbol: str, expected: Exponents) -> str:
    """Return the meaning of an unknown part of a unit, preferably one of a dimension; empty if unclear."""
    if symbol[0].isdigit():
        power = re.sub(r"(?<=[A-Za-z])(?=\d)", "^", text)
        product = _unit_product(power)
        return "" if isinstance(product, str) or product[1] != expected else power
    if len(text) > _MAX_UNIT:
        return ""
    bases = [*_PREFIXED, *(kind.si for kind in DIMENSIONS.values() if kind.exponents == expected)]
    units = [*_PLAIN, *(prefix + base for base in bases for prefix in ("", "k", "M", "G", "c", "m", "u"))]
    products = {unit: _unit_product(text.replace(symbol, unit)) for unit in units}
    fitting = [unit for unit, product in products.items() if not isinstance(product, str) and product[1] == expected]
    alike = [symbol.lower()] if symbol.lower() in fitting else list[str]()
    alike += [unit for unit in fitting if len(unit) == len(symbol) == 2 and unit[0] == symbol[0]]  # "mn": "mm"
    alike += [unit for unit in fitting if unit.lower() == symbol.lower()]
    if alike:
        return alike[0]
    if len(symbol) > 2 and (near := similar_name(symbol, fitting)):  # "Nm" is not "MN"
        return near
    compounds = [text.replace(symbol, f"{symbol[:i]} {symbol[i:]}") for i in range(1, len(symbol))]
    return next((unit for unit in compounds if not isinstance(p := _unit_product(unit), str) and p[1] == expected), "")


def _equal_dimension(actual: Exponents, expected: Exponents) -> bool:
    """Return whether two dimensions agree; the radian may be omitted only in moments and derived quantities."""
    of_moments = expected[:2] == (2, 1)
    return actual[:4] == expected[:4] if of_moments else actual == expected


def parse(
    value: float | str, dimension: str, where: str = "value", *, noise: bool = False, plain: bool = True
) -> float:
    """Parse a quantity and return its SI value; messages offer a number in SI if a plain number is allowed."""
    kind = DIMENSIONS[dimension]
    allowed = f"{kind.indefinite} such as {kind.example!r}"
    allowed += f"{PLAIN_NUMBER}{kind.si}" if kind.si and plain else ""
    no_unit = "the value is dimensionless", "leave the unit out, or write a percentage such as '5 %'"
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):  # pyright: ignore[reportUnnecessaryIsInstance] - file content
        raise refuse(where, value, allowed)
    if not isinstance(value, str):
        number, text = Decimal(value) if abs(value) < _LARGEST else Decimal("inf"), ""
    elif match := NUMBER.match(value.rstrip()):
        number, text = _EXACT.create_decimal(match[1]), match[2]
        if re.match(r"\s*[:#]\s*[-+.\d]", text):
            why, remedy = "it is a range of values", "give one value; flexcam sweep runs a range"
            raise refuse(where, repr(value), allowed, why, remedy)
        if re.match(r",\d", text):
            given = value.strip()
            meant = [f"{given.replace(',', '')!r} if it separates thousands"] if re.match(r",\d{3}(?!\d)", text) else []
            meant += [] if re.search(r"[.,]\d", text[1:]) else [f"{given.replace(',', '.')!r} if it is a decimal comma"]
            remedy = f"write {', '.join(meant) or 'a point'}"
            raise refuse(where, repr(value), allowed, "a comma is not allowed", remedy)
    else:
        raise refuse(where, repr(value), allowed, "it does not begin with a number")
    try:
        factor, exponents = _parse_unit(text, where, kind.exponents) if text else (Decimal(1), kind.exponents)
    except InputError as refusal:
        fault = refusal.faults[0]
        why, remedy = (fault.why, fault.remedy) if kind.si else no_unit
        raise refuse(where, repr(value), allowed, why, remedy) from None
    if not _equal_dimension(exponents, kind.exponents):
        why, remedy = no_unit
        if kind.si:
            why = f"{text!r} is not a unit of {kind.name}"
            remedy = f"use a unit such as {kind.example.partition(' ')[2]}"
        force = _POUND.sub("lbf", text)
        if force != text and _equal_dimension(_parse_unit(force, where, kind.exponents)[1], kind.exponents):
            remedy = f"use {force!r}, because 'lb' is a mass"
        raise refuse(where, repr(value), allowed, why, remedy)
    si = float(_EXACT.multiply(number, factor))
    if isinstance(value, float) and not math.isfinite(value):
        raise refuse(where, repr(value), allowed, "the number is not finite")
    if noise and abs(si) < kind.least:
        return 0.0
    if si != 0.0 and not kind.least <= abs(si) <= kind.most:
        minimum, maximum = (limit / float(factor) for limit in (kind.least, kind.most))
        why = f"between {minimum:g} and {maximum:g} {text or kind.si}".rstrip()
        raise refuse(where, repr(value), allowed, f"no mechanism has such {kind.indefinite}: {why}", "check the unit")
    return si


def conversion_factor(unit: str, si: str, where: str) -> float:
    """Return the factor from a unit, such as ``kN``, to an SI unit of the same quantity, such as ``N``."""
    divisor, expected = _parse_unit(si, where, _NONE) if si not in ("", "1") else (Decimal(1), _NONE)
    factor, exponents = _parse_unit(unit, where, expected) if unit not in ("", "1") else (Decimal(1), _NONE)
    if exponents != expected:
        given, remedy = (
            (repr(unit), "") if unit else ("no unit", f"write it in brackets after the name, such as [{si}]")
        )
        raise refuse(where, given, unit_of(si), "", remedy)
    return float(_EXACT.divide(factor, divisor))


def is_convertible(unit: str, si: str) -> bool:
    """Return whether a unit is one of the quantity of an SI unit."""
    try:
        return conversion_factor(unit, si, "") > 0.0
    except InputError:
        return False


def unit_of(si: str) -> str:
    """Return the allowed units of a quantity for messages, such as ``a unit of length such as mm``."""
    kind = next((dimension for dimension in DIMENSIONS.values() if dimension.si == si), None)
    if kind is None or not si:
        return f"a unit of the same quantity as {si}" if si not in ("", "1") else "no unit"
    return f"a unit of {kind.name} such as {kind.example.partition(' ')[2]}"


def shaft_name(turns: float) -> str:
    """Return the name of the shaft whose speed is given, as written before ``rpm``."""
    return "crank" if turns == 2.0 else "camshaft"


def shaft_speed(speed: float, turns: float) -> str:
    """Format the speed of the reference shaft; for the crankshaft also that of the camshaft."""
    camshaft = f"camshaft {round(speed / RPM, 9):g} rpm"
    return camshaft if turns == 1.0 else f"crankshaft {round(turns * speed / RPM, 9):g} rpm ({camshaft})"


_DISPLAY_UNITS = {
    "metric": {
        "m": "mm", "m/rad": "mm/rad", "m/rad^2": "mm/rad^2", "m/rad^3": "mm/rad^3", "rad": "deg", "Pa": "MPa",
        "N/m": "N/mm",
    },
    "imperial": {
        "m": "in", "m/rad": "in/rad", "m/rad^2": "in/rad^2", "m/rad^3": "in/rad^3", "m/s": "ft/s", "m/s^2": "ft/s^2",
        "rad": "deg", "N": "lbf", "N m": "lbf ft", "N/m": "lbf/in", "N m/rad": "lbf ft/rad", "N s/m": "lbf s/in",
        "Pa": "ksi", "W": "hp", "kg": "lb",
    },
}  # fmt: skip
"""Units of displayed quantities by their SI unit; others stay in SI."""

UnitSystem = Literal["metric", "imperial"]
_unit_system: ContextVar[UnitSystem] = ContextVar("unit_system", default="metric")


def set_unit_system(system: UnitSystem) -> None:
    """Set the units in which tables and plots show quantities in this context."""
    _unit_system.set(system)


def to_display_unit(unit: str, *, thin: bool = False) -> tuple[float, str]:
    """Return the factor from an SI unit to the one in which engineers show the quantity, and its symbol.

    Thin lengths, such as those of oil films, are shown in micrometres.
    """
    symbol = "µm" if thin and unit == "m" else _DISPLAY_UNITS[_unit_system.get()].get(unit, unit)
    factor = 1.0 if symbol == unit else 1.0 / conversion_factor(symbol, unit, "unit")
    return factor, "" if symbol == "1" else symbol.replace("^2", "²").replace("^3", "³")


def input_unit(unit: str) -> tuple[float, str]:
    """Return factor and symbol of `to_display_unit`, as a case or an option spells the unit; rpm for a speed."""
    factor, symbol = (1.0 / RPM, "rpm") if unit == "rad/s" else to_display_unit(unit)
    return factor, symbol.replace("²", "^2").replace("³", "^3")


def format_quantity(unit: str, *values: float, digits: int = 6, separator: str = " to ") -> str:
    """Return SI values in their displayed unit, such as ``0.2 to 9 mm``; rounding noise gives zero."""
    factor, symbol = to_display_unit(unit)
    numbers = [f"{0.0 if abs(value) < ROUNDING else factor * value:.{digits}g}" for value in values]
    return f"{separator.join(numbers)} {symbol}"


ROUNDING = 1e-12
"""SI value, or fraction of the largest value of a kind, below which a displayed value is a rounded zero."""
