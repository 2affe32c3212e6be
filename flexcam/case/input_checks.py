"""Checks of input values: typical ranges of keys, with margins, contradictory keys, missing units and unused parts."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, cast

import numpy as np

from flexcam.case.case import Case
from flexcam.case.fault_report import resolve_record, si_unit
from flexcam.case.toml_lines import parse_toml
from flexcam.core.units import RPM
from flexcam.fem.mesh import Mesh


@dataclass(frozen=True)
class TypicalRange:
    """Typical range of a key.

    Parameters
    ----------
    key
        Path of the key, ``*`` for any name.
    what
        Name of the quantity for messages.
    least, most
        Limits, SI.
    meant
        Units the user may have intended, with their size in SI, the most likely first.
    si
        Unit, if the path of the key does not determine it.
    zero
        Whether zero is reported too.
    """

    key: str
    what: str
    least: float
    most: float
    meant: Mapping[str, float]
    si: str = ""
    zero: bool = False


_LENGTH = {"mm": 1e-3, "um": 1e-6, "in": 0.0254, "m": 1.0}
_STRESS = {"GPa": 1e9, "MPa": 1e6, "kPa": 1e3}
_STIFF = {"kN/m": 1e3, "N/mm": 1e3, "MN/m": 1e6, "N/m": 1.0}
_INERTIA = {"g mm^2": 1e-9, "kg mm^2": 1e-6}
_MASS = {"g": 1e-3, "kg": 1.0}
_ANGULAR = {"rpm": RPM}

TYPICAL_RANGES = (
    TypicalRange("materials.*.E", "Young's modulus of a solid", 1e6, 1.5e12, _STRESS),
    TypicalRange("materials.*.density", "density of a solid", 500.0, 2.5e4, {"g/cm^3": 1e3}, zero=True),
    TypicalRange("materials.*.ultimate_strength", "strength", 1e5, 2e10, {"MPa": 1e6, "GPa": 1e9}),
    TypicalRange("materials.*.endurance_limit", "strength", 1e5, 2e10, {"MPa": 1e6, "GPa": 1e9}),
    TypicalRange("nodes.*", "coordinate of a machine", 0.0, 20.0, _LENGTH),
    TypicalRange("sections.*.diameter", "diameter", 1e-5, 3.0, _LENGTH),
    TypicalRange("sections.*.outer_diameter", "diameter", 1e-5, 3.0, _LENGTH),
    TypicalRange("sections.*.inner_diameter", "diameter", 1e-5, 3.0, _LENGTH),
    TypicalRange("sections.*.width_y", "width of a section", 1e-5, 3.0, _LENGTH),
    TypicalRange("sections.*.width_z", "width of a section", 1e-5, 3.0, _LENGTH),
    TypicalRange("sections.*.A", "area of a section", 1e-10, 10.0, {"mm^2": 1e-6, "cm^2": 1e-4}),
    TypicalRange("sections.*.Iy", "second moment of a section", 1e-20, 10.0, {"mm^4": 1e-12, "cm^4": 1e-8}),
    TypicalRange("sections.*.Iz", "second moment of a section", 1e-20, 10.0, {"mm^4": 1e-12, "cm^4": 1e-8}),
    TypicalRange("sections.*.J", "second moment of a section", 1e-20, 10.0, {"mm^4": 1e-12, "cm^4": 1e-8}),
    TypicalRange("masses.*.mass", "mass in a valve train", 1e-7, 20.0, _MASS),
    TypicalRange("masses.*.inertia", "inertia in a valve train", 1e-14, 1e5, _INERTIA),
    TypicalRange("masses.*.offset", "offset of a mass", 0.0, 10.0, _LENGTH),
    TypicalRange("springs.*.damping", "damping of a spring", 1e-9, 1e8, {"N s/mm": 1e3, "N s/m": 1.0}),
    TypicalRange("springs.*.installed_force", "force of a spring", 1e-4, 1e6, {"N": 1.0, "mN": 1e-3}),
    TypicalRange("springs.*.installed_compression", "travel of a spring", 1e-7, 2.0, _LENGTH),
    TypicalRange("springs.*.clash_travel", "travel of a spring", 1e-7, 2.0, _LENGTH),
    TypicalRange("springs.*.clash_stiffness", "stiffness of coils that touch", 10.0, 1e13, _STIFF),
    TypicalRange("springs.*.mass", "mass of a spring", 1e-8, 20.0, _MASS),
    TypicalRange("springs.*.wire.diameter", "diameter of a wire", 1e-6, 0.3, _LENGTH),
    TypicalRange("springs.*.wire.coil_diameter", "diameter of a coil", 1e-5, 3.0, _LENGTH),
    TypicalRange("springs.*.wire.shear_modulus", "shear modulus of a solid", 1e6, 1e12, _STRESS),
    TypicalRange("bearings.*.stiffness", "stiffness of a bearing", 1.0, 1e13, _STIFF),
    TypicalRange("loads.*.force", "force on a mechanism", 1e-6, 1e8, {"N": 1.0, "kN": 1e3}),
    TypicalRange("rockers.*.arms", "arm of a rocker", 1e-4, 5.0, _LENGTH),
    TypicalRange("rockers.*.inertia", "inertia of a rocker", 1e-14, 1e3, _INERTIA),
    TypicalRange("rockers.*.stiffness", "stiffness of a rocker", 1.0, 1e13, _STIFF),
    TypicalRange("cams.*.lift", "lift of a cam", 1e-6, 0.5, _LENGTH, "m"),
    TypicalRange("cams.*.base_radius", "base radius", 1e-5, 2.0, _LENGTH),
    TypicalRange("cams.*.width", "width of a cam", 1e-5, 2.0, _LENGTH),
    TypicalRange("cams.*.ramps.height", "height of a ramp", 1e-8, 0.05, _LENGTH),
    TypicalRange("cams.*.follower.radius", "radius of a roller", 1e-5, 2.0, _LENGTH),
    TypicalRange("cams.*.follower.offset", "offset of a follower", 0.0, 2.0, _LENGTH),
    TypicalRange("cams.*.follower.arm", "arm of a follower", 1e-4, 5.0, _LENGTH),
    TypicalRange("cams.*.follower.distance", "distance of a pivot", 1e-4, 5.0, _LENGTH),
    TypicalRange("contacts.*.stiffness", "stiffness of a contact", 10.0, 1e13, _STIFF),
    TypicalRange("contacts.*.gap", "play", 1e-8, 0.02, _LENGTH),
    TypicalRange("contacts.*.friction", "coefficient of friction", 0.0, 1.0, {"%": 0.01}),
    TypicalRange("contacts.*.dissipation", "dissipation of a contact", 0.0, 1e4, {}),
    TypicalRange("contacts.*.preload_factor", "factor of a preload", 0.0, 100.0, {}),
    TypicalRange("contacts.*.plunger_force", "force of a plunger", 1e-3, 1e4, {"N": 1.0}),
    TypicalRange("run.speed", "camshaft speed", 1e-3, 1250.0, _ANGULAR),
    TypicalRange("run.crank_speed", "crankshaft speed", 1e-3, 2500.0, _ANGULAR),
    TypicalRange("members.*.bow", "bow of a member", 0.0, 0.05, _LENGTH),
    TypicalRange("run.damping.modal", "damping ratio", 0.0, 0.5, {"%": 0.01}),
    TypicalRange("run.damping.alpha", "Rayleigh factor of the mass", 0.0, 1e5, {}),
    TypicalRange("run.damping.beta", "Rayleigh factor of the stiffness", 0.0, 0.1, {"ms": 1e-3, "us": 1e-6}),
    TypicalRange("run.gravity", "acceleration of gravity", 0.0, 100.0, {"mm/s^2": 1e-3}),
)  # fmt: skip
"""Typical ranges by key."""

SPRING_RANGE = TypicalRange("springs.*.stiffness", "stiffness of a spring", 100.0, 1e12, _STIFF, "N/m")
"""Range for translational springs: retaining springs are stiffer, and a bare 50 is unlikely to mean 50 N/m."""

TORSION_SPRING_RANGE = TypicalRange(
    "springs.*.stiffness", "stiffness of a spring", 1e-3, 1e12, {"kN m/rad": 1e3}, "N m/rad"
)
"""Range for torsional springs."""


_IMPLAUSIBLE_SPEED = 300.0
"""Speed, rad/s, from which a bare integer is unlikely to be meant in rad/s: it is 2865 rpm."""


def check_keys(case: Case) -> Iterator[str]:
    """Yield descriptions of keys that contradict each other, lack a unit or have no effect."""
    yield from _check_speed_unit(case)
    yield from _check_materials(case)
    yield from _check_sections(case)
    yield from _check_fidelity(case)
    yield from _check_unused_parts(case)


def _check_speed_unit(case: Case) -> Iterator[str]:
    """Yield a warning for an integer speed without unit that was probably meant in rpm."""
    for key in ("speed", "crank_speed"):
        taken = getattr(case.record.run, key)
        if (
            taken is not None
            and taken >= _IMPLAUSIBLE_SPEED
            and _raw_value(case, key) == taken
            and taken == round(taken)
        ):
            place, turned = case.place(("run", key)), taken / RPM
            yield (
                f"Warning: {place}: {taken:g} without a unit is in rad/s, {turned:.6g} rpm: did you mean {taken:g} rpm?"
                f" Write the unit"
            )


def _raw_value(case: Case, key: str) -> object:
    """Return the raw value of a key of ``[run]``."""
    pairs = [one.partition("=") for one in case.overrides]
    laid = [text for name, _, text in pairs if name.strip() == f"run.{key}"]
    try:
        if laid:
            return float(laid[-1])
        run = cast("dict[str, Any]", parse_toml(case.text).get("run", {}))
        return run.get(key)
    except ValueError:  # a text with a unit
        return None


def _check_materials(case: Case) -> Iterator[str]:
    for name, one in case.record.materials.items():
        if one.nu < 0.0:
            place = case.place(("materials", name, "nu"))
            yield f"Warning: {place}: {one.nu:g} is below zero: such a solid grows thicker when it is pulled"


def _check_sections(case: Case) -> Iterator[str]:
    """Yield sections with impossible properties: bounds that hold for every plane figure."""
    for name, record in case.record.sections.items():
        made, place = record.part, case.place(("sections", name))
        polar = made.Iy + made.Iz
        if _ROUNDING_MARGIN * polar < made.J:
            yield f"Warning: {place}: J = {made.J:g} m^4 is above Iy + Iz = {polar:g} m^4, which no shape has"
        if _ROUNDING_MARGIN * 2.0 * math.pi * polar < made.A**2:
            least = made.A**2 / (2.0 * math.pi)
            yield f"Warning: {place}: Iy + Iz = {polar:g} m^4 is below that of a circle of its area, {least:g} m^4"
        for key in ("kappa_y", "kappa_z"):
            if getattr(made, key) > _ROUNDING_MARGIN:
                yield f"Warning: {place}: {key} = {getattr(made, key):g} is above 1: no more than A bears shear"


def _check_fidelity(case: Case) -> Iterator[str]:
    """Yield keys of a model that is not run, and tolerances that every model meets."""
    asked, whole = case.record.fidelity, [name for name, one in case.record.fidelity.tolerances.items() if one >= 1.0]
    place = {key: case.place(("fidelity", key)) for key in ("masses", "modes", "tolerance")}
    if "masses" in asked.model_fields_set and asked.model != "chain":
        yield f"Warning: {place['masses']}: it counts the masses of a chain, and the model is {asked.model}"
    if asked.modes is not None and asked.tolerances:
        yield f"Warning: {place['modes']}: it asks for nothing, for fidelity.tolerance chooses the model"
    if whole:
        yield f"Warning: {place['tolerance']}: any model is within 100 % of {', '.join(whole)}: did you mean percent?"


def _check_unused_parts(case: Case) -> Iterator[str]:
    """Yield parts that nothing refers to, which suggests a misspelled name."""
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


_ROUNDING_MARGIN = 1.02
"""Margin for published properties, which are rounded to a percent."""


_MAX_SLENDERNESS = 2000.0
_MIN_SLENDERNESS = 0.2
"""Limits of the ratio of length to section size outside of which a member's units are probably inconsistent."""


def check_values(case: Case) -> list[str]:
    """Return descriptions of implausible values of a case."""
    tables = resolve_record(case.record)
    found = [
        _format_warning(case, path, value, one)
        for one in TYPICAL_RANGES
        for path, value in _values_out_of_range(tables, one)
    ]
    others = (
        check_keys,
        _check_spring_stiffness,
        _check_double_supports,
        _check_fixed_spring_nodes,
        _check_proportions,
    )
    return list(dict.fromkeys([*found, *(said for one in others for said in one(case))]))


def _values_out_of_range(tables: Mapping[str, Any], usual: TypicalRange) -> Iterator[tuple[tuple[str, ...], float]]:
    """Yield path and number of the values outside a typical range, one per key."""
    for path, value in _matching_values(tables, tuple(usual.key.split(".")), ()):
        several = cast("list[object]", value) if isinstance(value, list) else [value]
        numbers = [abs(float(x)) for x in several if isinstance(x, int | float) and not isinstance(x, bool)]
        if beyond := [x for x in numbers if (x or usual.zero) and not usual.least <= x <= usual.most]:
            yield path, beyond[0]


def _matching_values(
    table: object, steps: tuple[str, ...], path: tuple[str, ...]
) -> Iterator[tuple[tuple[str, ...], object]]:
    """Yield path and value of every key that matches a pattern."""
    if not steps:
        yield path, table
    elif isinstance(table, dict):
        inner = cast("dict[str, Any]", table)
        for name in inner if steps[0] == "*" else [one for one in inner if one == steps[0]]:
            yield from _matching_values(inner[name], steps[1:], (*path, name))


def _format_warning(case: Case, path: tuple[str, ...], value: float, usual: TypicalRange) -> str:
    unit = si_unit(path) or usual.si
    bounds = f"{usual.least:g} to {usual.most:g}" if usual.least else f"up to {usual.most:g}"
    near = [f"{value:g} {name}" for name, size in usual.meant.items() if usual.least <= value * size <= usual.most]
    meant = f": did you mean {near[0]}?" if near else ""
    given, outside = f"{value:g} {unit}".rstrip(), f"{bounds} {unit}".rstrip()
    return f"Warning: {case.place(path)}: {given} is no usual {usual.what} ({outside}){meant}"


def _check_spring_stiffness(case: Case) -> Iterator[str]:
    """Yield springs with implausibly low or high stiffness; the limits depend on whether they are torsional."""
    tables = resolve_record(case.record)
    twist = {name for name, one in case.record.springs.items() if one.part.turns}
    for usual, turning in ((SPRING_RANGE, False), (TORSION_SPRING_RANGE, True)):
        for path, value in _values_out_of_range(tables, usual):
            if (path[1] in twist) == turning:
                yield _format_warning(case, path, value, usual)


def _check_double_supports(case: Case) -> Iterator[str]:
    """Yield components fixed twice at one node, by two supports or by one."""
    seen: dict[tuple[int, str], str] = {}
    for point, held in case.record.supports.items():
        place = case.place(("supports", point))
        for component in sorted({one for one in held if held.count(one) > 1}):
            yield f"Warning: {place}: {component} is listed {held.count(component)} times"
        for node, component in product(_nodes(case, point), dict.fromkeys(held)):
            other = seen.setdefault((node, component), point)
            if other != point:
                yield f"Warning: {place}: {component} is held by support {other!r} already, at a node of both"


def _nodes(case: Case, point: str) -> list[int]:
    if case.mesh is None:
        names = list(case.record.nodes)
        return [names.index(point)] if point in names else []
    return case.mesh.points[point].tolist() if point in case.mesh.points else []


def _check_fixed_spring_nodes(case: Case) -> Iterator[str]:
    """Yield springs to ground that have no effect because a support fixes their node."""
    held = {
        (node, one)
        for point, several in case.record.supports.items()
        for node in _nodes(case, point)
        for one in several
    }
    for name, spring in case.record.springs.items():
        along = spring.direction.lstrip("+-") if isinstance(spring.direction, str) else ""
        nodes = _nodes(case, spring.at)
        if spring.to is None and along and nodes and all((node, along) in held for node in nodes):
            place = case.place(("springs", name))
            yield f"Warning: {place}: a support holds {along} of {spring.at!r}, so that the spring acts on nothing"


def _check_proportions(case: Case) -> Iterator[str]:
    """Yield members with an implausible ratio of length to thickness."""
    for name, member in case.record.members.items():
        size = 2.0 * case.record.sections[member.section].part.radius
        length = _length(case.mesh, name) if case.mesh is not None else _length_of_nodes(case, member.nodes or [])
        ratio = length / size
        if not _MIN_SLENDERNESS <= ratio <= _MAX_SLENDERNESS:
            sizes = f"{length:g} m long and {size:g} m thick, {ratio:.2g} to one"
            question = "do lengths and sections have the same unit?"
            yield f"Warning: {case.place(('members', name))}: {sizes}: {question}"


def _length(mesh: Mesh, name: str) -> float:
    return _along(mesh.nodes[mesh.lines[name]])


def _length_of_nodes(case: Case, names: Sequence[str]) -> float:
    return _along([case.record.nodes[name] for name in names])


def _along(points: Any) -> float:  # noqa: ANN401 - any array-like
    return float(np.linalg.norm(np.diff(np.asarray(points, dtype=float), axis=0), axis=1).sum())
