"""units.parse: every symbol and composed unit against pint, invalid values, and round trips."""

# ruff: noqa: E501 - tables, a row to a line

from __future__ import annotations

import math
from contextvars import copy_context
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flexcam.core.errors import InputError
from flexcam.core.units import DIMENSIONS, parse, set_unit_system, to_display_unit

EXACT = 1e-15
"""Relative tolerance: a few roundings of a double, of the factor, the product and the text."""

PREFIXES = ("", "G", "M", "k", "d", "c", "m", "u", "µ", "n")
PREFIXED = {
    "m": "length",
    "g": "mass",
    "s": "time",
    "N": "force",
    "Pa": "stress",
    "J": "moment",
    "Hz": "rate",
    "rad": "angle",
}
PLAIN = {
    "t": "mass", "bar": "stress", "deg": "angle", "°": "angle", "rev": "angle", "rpm": "speed", "min": "time",
    "h": "time", "in": "length", "ft": "length", "lb": "mass", "oz": "mass", "lbf": "force", "psi": "stress", "%": "number",
    "thou": "length", "mil": "length",
}  # fmt: skip
SYMBOLS = [(p + s, kind) for s, kind in PREFIXED.items() for p in PREFIXES] + list(PLAIN.items())
COMPOSED = [
    ("kg/m^3", "density"), ("g/cm^3", "density"), ("lb/in^3", "density"), ("t/m**3", "density"),
    ("kN/m", "stiffness"), ("N/mm", "stiffness"), ("lbf/in", "stiffness"), ("MN / m", "stiffness"),
    ("N s/m", "damping"), ("kN*s/m", "damping"), ("N*s/mm", "damping"), ("kg/s", "damping"),
    ("1/s", "rate"), ("1/min", "rate"), ("s^-1", "rate"), ("kg m^2", "inertia"), ("g*mm^2", "inertia"),
    ("mm^2", "area"), ("in^2", "area"), ("mm^4", "second moment"), ("m/s^2", "acceleration"), ("ft/s^2", "acceleration"),
    ("kg m/s^2", "force"), ("N/mm^2", "stress"), ("lbf/in^2", "stress"), ("N m", "moment"), ("lbf ft", "moment"),
    ("rev/min", "speed"), ("deg/s", "speed"), ("N m/deg", "rotational stiffness"), ("N m s/rad", "rotational damping"),
    ("W s", "moment"), ("kW h", "moment"), ("J/m", "force"), ("mPa s", "viscosity"), ("1/GPa", "pressure-viscosity coefficient"),
    ("mm^3/N/m", "wear coefficient"), ("mm^2/N", "wear coefficient"), ("W/m/K", "thermal conductivity"), ("J/g/K", "specific heat"),
    ("um/m/K", "thermal expansion"), ("K", "temperature"),
]  # fmt: skip
FOR_PINT = {"mil": "thou", "°": "deg", "%": "percent", "rev": "turn", "rev/min": "turn/min"}


def size(kind, share):
    """Return a value between the minimum and maximum of a kind, in SI."""
    least, most = DIMENSIONS[kind].least, DIMENSIONS[kind].most
    return least * (most / least) ** share


def factor(unit, kind):
    """Return the factor of a unit from a number of that unit in the valid range."""
    number = 10.0 ** next(n for n in range(-30, 31) if is_valid(f"1e{n} {unit}", kind))
    return parse(f"{number!r} {unit}", kind) / number


def is_valid(text, kind):
    try:
        return parse(text, kind) > 0.0
    except InputError:
        return False


UNIT_FACTOR = {unit: factor(unit, kind) for unit, kind in [*SYMBOLS, *COMPOSED]}


@pytest.fixture(scope="module")
def pint_si():
    """Return a function that converts to SI with pint; it reads rev/min as rad/s and drops radians, as flexcam does."""
    pint = pytest.importorskip("pint")
    registry = pint.UnitRegistry()
    return lambda number, unit: registry.Quantity(number, FOR_PINT.get(unit, unit)).to_base_units().magnitude


def test_agrees_with_pint(pint_si):
    """Values in the middle of the range; pint multiplies in another order and has fewer digits of psi: 1e-12."""
    numbers = {(unit, kind): size(kind, 0.5) / pint_si(1.0, unit) for unit, kind in [*SYMBOLS, *COMPOSED]}
    found = {row: parse(f"{number!r} {row[0]}", row[1]) for row, number in numbers.items()}
    assert found == pytest.approx({row: pint_si(number, row[0]) for row, number in numbers.items()}, rel=1e-12)


def test_plain_number_is_si():
    middle = {kind: size(kind, 0.5) for kind in DIMENSIONS}
    for sign in (1.0, -1.0, 0.0):
        wanted = {kind: sign * number for kind, number in middle.items()}
        assert {kind: parse(number, kind) for kind, number in wanted.items()} == wanted


def test_symbol_of_si_unit_has_factor_one():
    middle = {kind.name: size(kind.name, 0.5) for kind in DIMENSIONS.values() if kind.si}
    assert {kind: parse(f"{number!r} {DIMENSIONS[kind].si}", kind) for kind, number in middle.items()} == middle


def test_examples_in_messages_are_valid():
    assert [kind.name for kind in DIMENSIONS.values() if not math.isfinite(parse(kind.example, kind.name))] == []


@pytest.mark.parametrize(
    ("text", "kind", "expected"),
    [("25mm", "length", 0.025), (" 25  mm ", "length", 0.025), ("+2.5e1 mm", "length", 0.025), (".5 m", "length", 0.5),
     ("3000rpm", "speed", 100.0 * math.pi), ("1e-4 kg m^2", "inertia", 1e-4), ("2%", "number", 0.02), ("0.5", "number", 0.5)],
)  # fmt: skip
def test_notations_of_quantity(text, kind, expected):
    assert parse(text, kind) == pytest.approx(expected, rel=EXACT)


DECIMAL = [
    ("mm", "length", Fraction(1, 10**3)), ("um", "length", Fraction(1, 10**6)), ("in", "length", Fraction(254, 10**4)),
    ("mm^2", "area", Fraction(1, 10**6)), ("mm^4", "second moment", Fraction(1, 10**12)),
    ("g/cm^3", "density", Fraction(10**3)), ("kg/m^3", "density", Fraction(1)), ("g", "mass", Fraction(1, 10**3)),
    ("kN/mm", "stiffness", Fraction(10**6)), ("N/mm^2", "stress", Fraction(10**6)), ("us", "time", Fraction(1, 10**6)),
    ("km/h", "velocity", Fraction(10, 36)), ("%", "number", Fraction(1, 100)), ("lb", "mass", Fraction("0.45359237")),
]  # fmt: skip


@pytest.mark.parametrize(("unit", "kind", "size"), DECIMAL)
def test_result_is_nearest_float(unit, kind, size):
    """0.62 g/cm^3 is exactly 620 kg/m^3 and is shown so; a product of two floats may differ by one bit."""
    for hundredths in range(1, 3000, 7):
        text = f"{hundredths // 100}.{hundredths % 100:02d}"
        assert parse(f"{text} {unit}", kind) == float(Fraction(text) * size), text


def test_units_after_slash_are_in_denominator():
    """As in print, N/mm mm is N/(mm mm); pint evaluates from left to right, which the second assertion excludes."""
    assert parse("207 N/mm mm", "stress") == pytest.approx(207e6, rel=EXACT)
    with pytest.raises(InputError):
        parse("207 N/mm mm", "force")


WRONG_DIMENSION = [
    ("25 kg", "length"), ("25 mm^2", "length"), ("3000 1/min", "speed"), ("50 Hz", "speed"), ("5 rad/s", "rate"),
    ("180 mm", "angle"), ("5 mm", "number"), ("40 kN m", "stiffness"), ("300 N s", "force"), ("7800 kg", "density"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "kind"), WRONG_DIMENSION)
def test_unit_of_wrong_dimension_raises_error(text, kind):
    with pytest.raises(InputError) as refusal:
        parse(text, kind, "cams.intake.lift")
    fault = refusal.value.faults[0]
    assert fault.where == "cams.intake.lift"
    assert text in fault.given
    assert kind in fault.allowed
    assert fault.why


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("300 N deg", "force"),
        ("5 kg rad", "mass"),
        ("207 GPa/deg", "stress"),
        ("40 kN/m deg", "stiffness"),
        ("5 J K", "moment"),
    ],
)
def test_angle_in_force_or_mass_raises_error(text, kind):
    """Only moments and rotational stiffness and damping may omit the radian."""
    with pytest.raises(InputError):
        parse(text, kind)


@pytest.mark.parametrize(
    ("text", "kind", "near"), [("207 Gpa", "stress", "GPa"), ("3000 rpms", "speed", "rpm"),
                               ("180 degree", "angle", "deg"), ("4 knm", "length", "km"), ("6 mn", "length", "mm"), ("50 kNm", "stiffness", "kN/m"),
                               ("50 N/mmm", "stiffness", "'mm'"), ("40 N/mM", "stiffness", "'mm'"), ("7800 kg/m3", "density", "kg/m^3"),
                               ("2 kNs/m", "damping", "kN s/m")],
)  # fmt: skip
def test_unknown_unit_error_suggests_unit(text, kind, near):
    with pytest.raises(InputError) as refusal:
        parse(text, kind)
    fault = refusal.value.faults[0]
    assert fault.given == repr(text), "the whole value, not its unit alone"
    assert "did you mean" in fault.remedy, "the hint is what to do, not why"
    assert near in fault.remedy


@pytest.mark.parametrize(
    ("text", "kind", "example"), [("400 Nm", "force", "N"), ("2 kNm/rad", "stiffness", "kN/m"), ("5 nM", "force", "N")]
)
def test_unknown_unit_of_other_quantity_has_no_suggestion(text, kind, example):
    """Nm is a torque and not the mega-newton with the same letters."""
    with pytest.raises(InputError) as refusal:
        parse(text, kind)
    assert refusal.value.faults[0].remedy == f"use a known unit, such as {example}"


def test_unit_on_dimensionless_number_raises_error():
    with pytest.raises(InputError) as refusal:
        parse("5x", "number")
    assert refusal.value.faults[0].remedy.startswith("leave the unit out")


@pytest.mark.parametrize(("plain", "offered"), [(True, True), (False, False)])
def test_error_offers_si_number_where_valid(plain, offered):
    with pytest.raises(InputError) as refusal:
        parse("5 xyz", "speed", plain=plain)
    assert ("or a number in rad/s" in refusal.value.faults[0].allowed) is offered


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, "1e400 mm", "nan", "inf mm", "nan mm"])
def test_non_finite_value_raises_error(value):
    with pytest.raises(InputError):
        parse(value, "length")


def test_integer_beyond_double_range_raises_error():
    with pytest.raises(InputError):
        parse(10**400, "length")


@pytest.mark.parametrize("value", [True, False, None, [], {}, (1.0,), np.array([1.0]), 1j])
def test_non_numeric_value_raises_error(value):
    with pytest.raises(InputError):
        parse(value, "length")


@pytest.mark.parametrize("text", ["", " ", "mm", "mm 25", "1,5 mm", "1 2 mm", "25 mm mm^", "25 /", "25 mm/", "25 (mm)", "--5 mm", "0x10 mm", "1_000 mm"])  # fmt: skip
def test_malformed_text_raises_error(text):
    with pytest.raises(InputError):
        parse(text, "length")


def test_values_out_of_range_raise_error():
    for kind in DIMENSIONS.values():
        for number in (kind.least, -kind.most):
            assert parse(number, kind.name) == number
        for number in (0.99 * kind.least, -1.01 * kind.most):
            with pytest.raises(InputError, match="No mechanism"):
                parse(number, kind.name)


@given(share=st.floats(0.01, 0.99), row=st.sampled_from([*SYMBOLS, *COMPOSED]), sign=st.sampled_from([1, -1]))
def test_round_trip(share, row, sign):
    """Text to SI and back by the factor of the unit: a quotient of two rounded products."""
    unit, kind = row
    number = sign * size(kind, share) / UNIT_FACTOR[unit]
    assert parse(f"{number!r} {unit}", kind) / UNIT_FACTOR[unit] == pytest.approx(number, rel=EXACT, abs=0.0)


def test_pound_mass_instead_of_force_raises_error():
    with pytest.raises(InputError, match="Use 'lbf/in', because 'lb' is a mass"):
        parse("320 lb/in", "stiffness")
    with pytest.raises(InputError, match="Use 'lbf', because 'lb' is a mass"):
        parse("80 lb", "force")
    with pytest.raises(InputError, match="Write 'lb', a mass"):
        parse("0.2 lbm", "mass")


@pytest.mark.parametrize(("given", "kind", "unit"), [("90 grams", "mass", "g"), ("0.25 inches", "length", "in")])
def test_unit_name_error_suggests_symbol(given, kind, unit):
    with pytest.raises(InputError, match=f"Write '{unit}'"):
        parse(given, kind)


def test_display_units():
    """Factors and symbols, in the unit system of the context only."""
    assert to_display_unit("m") == (1e3, "mm")
    assert to_display_unit("1") == (1.0, "")

    def imperial() -> dict[str, tuple[float, str]]:
        set_unit_system("imperial")
        return {unit: to_display_unit(unit) for unit in ("m", "N m", "Pa", "W", "rad/s^2")}

    shown = copy_context().run(imperial)
    assert {unit: symbol for unit, (_, symbol) in shown.items()} == {
        "m": "in", "N m": "lbf ft", "Pa": "ksi", "W": "hp", "rad/s^2": "rad/s²",
    }  # fmt: skip
    assert shown["m"][0] * 25.4e-3 == pytest.approx(1.0, rel=1e-15)
    assert shown["W"][0] * 745.69987158227022 == pytest.approx(1.0, rel=1e-15)
    assert to_display_unit("m") == (1e3, "mm")


def test_suggested_unit_gives_dimension_of_quantity():
    with pytest.raises(InputError) as refusal:
        parse("7.8 g/ccm", "density")
    assert refusal.value.faults[0].remedy == "use a known unit, such as kg/m^3"
