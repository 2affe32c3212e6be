"""Numbers that are usual by themselves, but not as they were given or beside each other."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, cast

from flexcam.case.case import Case
from flexcam.case.toml import toml
from flexcam.units import RPM

_ROUND = 300.0
"""From here on, rad/s, a whole number without a unit is hardly meant in rad/s: that is 2865 rpm."""


def odd(case: Case) -> Iterator[str]:
    """Yield which keys of a case contradict each other, lack their unit or have no part in it, in words."""
    yield from _bare_speeds(case)
    yield from _materials(case)
    yield from _sections(case)
    yield from _models(case)
    yield from _spare(case)


def _bare_speeds(case: Case) -> Iterator[str]:
    """Yield the speed if it is a whole number without a unit that is likely meant in rpm."""
    for key in ("speed", "crank_speed"):
        taken = getattr(case.record.run, key)
        if taken is not None and taken >= _ROUND and _given(case, key) == taken and taken == round(taken):
            place, turned = case.place(("run", key)), taken / RPM
            yield (
                f"Warning: {place}: {taken:g} without a unit is in rad/s, {turned:.6g} rpm: did you mean {taken:g} rpm?"
                f" Write the unit"
            )


def _given(case: Case, key: str) -> object:
    """Return what stands at a key of the run, as it was given."""
    pairs = [one.partition("=") for one in case.overrides]
    laid = [text for name, _, text in pairs if name.strip() == f"run.{key}"]
    try:
        if laid:
            return float(laid[-1])
        run = cast("dict[str, Any]", toml(case.text).get("run", {}))
        return run.get(key)
    except ValueError:  # a text with its unit
        return None


def _materials(case: Case) -> Iterator[str]:
    for name, one in case.record.materials.items():
        if one.nu < 0.0:
            place = case.place(("materials", name, "nu"))
            yield f"Warning: {place}: {one.nu:g} is below zero: such a solid grows thicker when it is pulled"


def _sections(case: Case) -> Iterator[str]:
    """Yield the sections that no shape has: bounds that hold for every plane figure."""
    for name, record in case.record.sections.items():
        made, place = record.made(), case.place(("sections", name))
        polar = made.Iy + made.Iz
        if _ABOVE * polar < made.J:
            yield f"Warning: {place}: J = {made.J:g} m^4 is above Iy + Iz = {polar:g} m^4, which no shape has"
        if _ABOVE * 2.0 * math.pi * polar < made.A**2:
            least = made.A**2 / (2.0 * math.pi)
            yield f"Warning: {place}: Iy + Iz = {polar:g} m^4 is below that of a circle of its area, {least:g} m^4"
        for key in ("kappa_y", "kappa_z"):
            if getattr(made, key) > _ABOVE:
                yield f"Warning: {place}: {key} = {getattr(made, key):g} is above 1: no more than A bears shear"


def _models(case: Case) -> Iterator[str]:
    """Yield what is asked of a model that is not run, and a tolerance that any model meets."""
    asked, whole = case.record.fidelity, [name for name, one in case.record.fidelity.tolerances.items() if one >= 1.0]
    place = {key: case.place(("fidelity", key)) for key in ("masses", "modes", "tolerance")}
    if "masses" in asked.model_fields_set and asked.model != "chain":
        yield f"Warning: {place['masses']}: it counts the masses of a chain, and the model is {asked.model}"
    if asked.modes is not None and asked.tolerances:
        yield f"Warning: {place['modes']}: it asks for nothing, for fidelity.tolerance chooses the model"
    if whole:
        yield f"Warning: {place['tolerance']}: any model is within 100 % of {', '.join(whole)}: did you mean percent?"


def _spare(case: Case) -> Iterator[str]:
    """Yield the parts that nothing is made of or moved by: under a name beside the one that was meant."""
    record = case.record
    users = {
        "materials": ({one.material for one in record.members.values()}, "no member is made of it"),
        "sections": ({one.section for one in record.members.values()}, "no member has it"),
        "cams": (
            {getattr(one, "cam", None) for one in record.contacts.values()},
            "no contact names it: it moves nothing",
        ),
    }
    for table, (used, why) in users.items():
        for name in getattr(record, table):
            if name not in used:
                yield f"Warning: {case.place((table, name))}: {why}"


_ABOVE = 1.02
"""Published properties are rounded to a percent."""
