"""Warnings before a run: implausible values, keys and parts without effect, contacts and loads of the model.

Each check is a function; docs/long-runs.md has a row for each. A warning does not stop a run.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import chain, permutations, product
from typing import Any, cast

import numpy as np

from flexcam.cams import DelayedEvent, LiftEvent, valve_event
from flexcam.case.case import Case, resolve_record, si_unit
from flexcam.case.fault_report import iterate_values, value_at
from flexcam.case.reader import case_tables, template_tables
from flexcam.core.units import RPM, format_quantity
from flexcam.dynamics import Method, Problem, RunFailedError, SaveAt, Scheme, equilibrium, newmark, solve
from flexcam.fem.dofs import direction
from flexcam.valvetrain import (
    Adjuster,
    CamContact,
    Lash,
    LoadTable,
    Model,
    Seat,
    build_structure,
    connected_nodes,
    driving_contact,
    largest_lashes,
    nest_interference,
    opposed_contacts,
    pulling_contacts,
    share_ends,
    shared_forces,
    touching_coils,
    undriven_shafts,
)


@dataclass(frozen=True)
class TypicalRange:
    """Typical range of some keys."""

    keys: str  #: paths of the keys, separated by spaces; ``*`` for any name
    least: float  #: limits, SI
    most: float
    meant: Mapping[str, float] = field(default_factory=dict[str, float])
    """Units the user may have intended, with their size in SI, the most likely first."""
    si: str = ""  #: unit, if the path of the key does not determine it
    zero: bool = False  #: whether zero is reported too
    turns: bool | None = None  #: whether it applies to parts about an axis or to those along a line; None for both


_LENGTH = {"mm": 1e-3, "um": 1e-6, "in": 0.0254, "m": 1.0}
_MIN_NUMBER = 0.01  # number from which flexcam suggests another unit
_STRESS = {"GPa": 1e9, "MPa": 1e6}
_STIFFNESS = {"kN/m": 1e3, "N/mm": 1e3, "MN/m": 1e6, "N/m": 1.0}
_MAX_SPEED = 1250.0  # usual maximum of the camshaft, rad/s
_FORCE = {"N": 1.0, "kN": 1e3, "mN": 1e-3}

TYPICAL_RANGES = (
    TypicalRange("materials.*.E springs.*.wire.shear_modulus", 1e9, 1.5e12, _STRESS),
    TypicalRange("materials.*.ultimate_strength materials.*.endurance_limit", 1e5, 2e10, {"MPa": 1e6, "GPa": 1e9}),
    TypicalRange("materials.*.density springs.*.wire.density", 500.0, 3e4, {"g/cm^3": 1e3}, zero=True),
    TypicalRange("materials.*.expansion", 1e-7, 1e-3, {"um/m/K": 1e-6}),
    TypicalRange("nodes.*", 0.0, 20.0, _LENGTH),
    TypicalRange(
        "sections.*.diameter sections.*.outer_diameter sections.*.inner_diameter sections.*.width_y sections.*.width_z "
        "springs.*.wire.diameter springs.*.wire.coil_diameter springs.*.coils.*.diameter cams.*.base_radius "
        "cams.*.follower.radius cams.*.follower.face_diameter bearings.*.film.diameter "
        "bearings.*.film.length contacts.*.oil.plunger_diameter",
        1e-6, 3.0, _LENGTH,
    ),
    TypicalRange(
        "masses.*.offset springs.*.installed_compression springs.*.clash_travel springs.*.coils.*.pitch "
        "springs.*.force_table.*.0 cams.*.follower.offset cams.*.follower.axial_offset",
        0.0, 2.0, _LENGTH,
    ),
    TypicalRange("rockers.*.arms cams.*.follower.arm cams.*.follower.distance", 1e-4, 5.0, _LENGTH),
    TypicalRange("cams.*.width", 1e-3, 0.3, _LENGTH),
    TypicalRange("cams.*.lift", 1e-6, 0.5, _LENGTH, "m"),
    TypicalRange("cams.*.ramps.height", 0.0, 0.05, _LENGTH),
    TypicalRange("members.*.temperature", 0.0, 700.0),
    TypicalRange("members.*.bow", 0.0, 5e-3, {"mm": 1e-3}),
    TypicalRange("contacts.*.gap", 0.0, 0.05, _LENGTH, "m", turns=False),  # that of a desmodromic pair is its lift
    TypicalRange("contacts.*.gap", 0.0, 2.0 * math.pi, {"deg": math.radians(1.0)}, "rad", turns=True),
    TypicalRange("sections.*.A", 1e-10, 10.0, {"mm^2": 1e-6, "cm^2": 1e-4}),
    TypicalRange("sections.*.Iy sections.*.Iz sections.*.J", 1e-20, 10.0, {"mm^4": 1e-12, "cm^4": 1e-8}),
    TypicalRange("springs.*.mass", 1e-4, 20.0, {"g": 1e-3, "kg": 1.0}),
    TypicalRange("masses.*.mass", 5e-4, 20.0, {"g": 1e-3, "kg": 1.0}, zero=True),
    TypicalRange("masses.*.inertia", 1e-14, 1e3, {"g mm^2": 1e-9, "kg mm^2": 1e-6}),
    TypicalRange("rockers.*.inertia", 1e-7, 1e-2, {"g mm^2": 1e-9, "kg mm^2": 1e-6}),
    TypicalRange("springs.*.damping", 1e-9, 1e8, {"N s/mm": 1e3, "N s/m": 1.0}),
    TypicalRange("springs.*.installed_force", 0.5, 1e5, _FORCE, turns=False),  # a few N hold a follower
    # Retaining springs are stiffer than valve springs, and a bare 50 is unlikely to mean 50 N/m.
    TypicalRange("springs.*.stiffness", 100.0, 1e12, _STIFFNESS, "N/m", turns=False),
    TypicalRange("springs.*.stiffness", 1e-3, 1e12, {"kN m/rad": 1e3}, "N m/rad", turns=True),
    TypicalRange("contacts.*.plunger_force loads.*.force", 1e-4, 1e8, _FORCE),
    TypicalRange("springs.*.force_table.*.1", 1e-4, 1e6, _FORCE, "N"),
    TypicalRange("springs.*.clash_stiffness bearings.*.stiffness rockers.*.stiffness", 10.0, 1e13, _STIFFNESS),
    TypicalRange("contacts.*.stiffness", 1e3, 1e13, _STIFFNESS, turns=False),
    TypicalRange("contacts.*.friction friction.*.coefficient", 0.0, 1.0, {"%": 0.01}),
    TypicalRange("friction.*.interference", 0.0, 2e-3, {"um": 1e-6, "mm": 1e-3}),
    TypicalRange("bearings.*.film.radial_clearance", 1e-7, 1e-3, {"um": 1e-6}),
    TypicalRange(
        "bearings.*.film.viscosity contacts.*.oil.viscosity contacts.*.lubrication.viscosity", 1e-4, 5.0,
        {"mPa s": 1e-3},
    ),
    TypicalRange("fidelity.tolerance fidelity.tolerance.*", 0.0, 0.99, {"%": 0.01}),
    TypicalRange("run.speed", 1e-3, _MAX_SPEED, {"rpm": RPM}),
    TypicalRange("run.crank_speed", 1e-3, 2.0 * _MAX_SPEED, {"rpm": RPM}),
    TypicalRange("run.damping.modal", 0.0, 0.5, {"%": 0.01}),
    # 1e-4 s damps the lowest bending frequencies of valve trains, 300 to 500 Hz, with ratios of 9 to 16 %. Bolted steel
    # structures have up to 7 % (US NRC, Regulatory Guide 1.61, 2007).
    TypicalRange("run.damping.beta", 0.0, 1e-4, {"us": 1e-6, "ns": 1e-9}),
    TypicalRange("run.gravity", 0.0, 100.0, {"mm/s^2": 1e-3}),
)  # fmt: skip
"""Typical ranges by key."""


def check_values(case: Case) -> list[str]:
    """Return warnings about implausible values of a case, and about keys and parts without effect."""
    tables = resolve_record(case.record)
    warnings = [warning for usual in TYPICAL_RANGES for warning in _range_warnings(case, tables, usual)]
    checks = (
        _bare_number_warnings, _section_warnings, _fidelity_warnings, _lift_table_warnings, _unused_part_warnings,
        _support_warnings, _nest_warnings, _slenderness_warnings,
    )  # fmt: skip
    warnings += [warning for check in checks for warning in check(case)]
    return list(dict.fromkeys(f"Warning: {warning}" for warning in warnings))


def _range_warnings(case: Case, tables: Mapping[str, Any], usual: TypicalRange) -> Iterator[str]:
    """Yield the values outside a typical range, one per key."""
    if usual.turns is not None:
        kind = usual.keys.split(".")[0]
        rotary = {name: not direction(table.get("direction", "uy"))[:3].any() for name, table in tables[kind].items()}
        tables = {kind: {name: table for name, table in tables[kind].items() if rotary[name] == usual.turns}}
    keys = usual.keys.split()
    for path, value in (pair for key in keys for pair in _matching_values(tables, tuple(key.split(".")), ())):
        items = cast("list[object]", value) if isinstance(value, list) else [value]
        numbers = [abs(float(x)) for x in items if isinstance(x, int | float) and not isinstance(x, bool)]
        outside = [x for x in numbers if (x or usual.zero) and not usual.least <= x <= usual.most]
        if outside:
            unit, x = si_unit(path) or usual.si, outside[0]
            bounds = (f"{usual.least:g} to " if usual.least else "up to ") + f"{usual.most:g} {unit}".rstrip()
            given, raw = f"{x:g} {unit}".rstrip(), value_at(case_tables(case), path)
            text = cast("list[object]", raw)[numbers.index(x)] if isinstance(raw, list) else raw
            if isinstance(text, str) and (number := re.match(r"[-+]?([\d.]+([eE][-+]?\d+)?)", text)):
                x = float(number[1])
                given = text if text.lstrip("+-") == given else f"{text} ({given})"
            units = usual.meant.items() if x >= _MIN_NUMBER else ()
            near = [f"{x:g} {name}" for name, size in units if usual.least <= x * size <= usual.most]
            hint = f": did you mean {near[0]}?" if near else ""
            yield f"{case.place(path)}: {given} is unusual (usually {bounds}){hint}"


def _matching_values(
    table: object, steps: tuple[str, ...], path: tuple[str, ...]
) -> Iterator[tuple[tuple[str, ...], object]]:
    """Yield path and value of every key that matches a pattern."""
    if not steps:
        yield path, table
    elif isinstance(table, list):
        rows = {str(i): row for i, row in enumerate(cast("list[object]", table))}
        yield from _matching_values(rows, steps, path)
    elif isinstance(table, dict):
        inner = cast("dict[str, Any]", table)
        for name in inner if steps[0] == "*" else [key for key in inner if key == steps[0]]:
            yield from _matching_values(inner[name], steps[1:], (*path, name))


_IMPLAUSIBLE_SPEED = 300.0  # speed, rad/s, from which a bare integer is unlikely to be meant in rad/s: it is 2865 rpm
_IMPLAUSIBLE_ANGLE = 2.0 * math.pi  # angle, rad, above which a bare number is unlikely to be meant in rad


def _bare_number_warnings(case: Case) -> Iterator[str]:
    """Yield speeds and angles without unit that were probably meant in rpm and deg."""
    run = case_tables(case)["run"]
    for key, maximum in (("speed", _MAX_SPEED), ("crank_speed", 2.0 * _MAX_SPEED)):  # above it is unusual in any unit
        speed = run.get(key)
        if isinstance(speed, int | float) and _IMPLAUSIBLE_SPEED <= speed <= maximum and speed == round(speed):
            yield _bare_number(case, ("run", key), speed, "rad/s", "rpm", RPM)
    for path, value in chain(iterate_values(template_tables(case)), iterate_values(case_tables(case))):
        if isinstance(value, int | float) and abs(value) > _IMPLAUSIBLE_ANGLE and si_unit(path) == "rad":
            yield _bare_number(case, path, value, "rad", "deg", math.radians(1.0))


def _bare_number(case: Case, path: tuple[str, ...], value: float, si: str, unit: str, size: float) -> str:
    hint = f"did you mean {value:g} {unit}? Write the unit"
    return f"{case.place(path)}: {value:g} without a unit is in {si}, {value / size:.6g} {unit}: {hint}"


_ROUNDING_MARGIN = 1.02  # margin for published properties, which are rounded to a percent


def _section_warnings(case: Case) -> Iterator[str]:
    """Yield sections with impossible properties: bounds that hold for every plane figure."""
    for name, record in case.record.sections.items():
        section, place = record.part.at(0.5), case.place(("sections", name))
        polar = section.Iy + section.Iz
        if _ROUNDING_MARGIN * polar < section.J:
            yield f"{place}: J = {section.J:g} m^4 is above Iy + Iz = {polar:g} m^4, which no shape has"
        if _ROUNDING_MARGIN * 2.0 * math.pi * polar < section.A**2:
            circle = section.A**2 / (2.0 * math.pi)
            yield f"{place}: Iy + Iz = {polar:g} m^4 is below that of a circle of its area, {circle:g} m^4"
        for key in ("kappa_y", "kappa_z"):
            if getattr(section, key) > _ROUNDING_MARGIN:
                yield f"{place}: {key} = {getattr(section, key):g} is above 1: the shear area cannot exceed A"


def _lift_table_warnings(case: Case) -> Iterator[str]:
    """Yield outliers of lift tables, and changes by smoothing that are larger than their scatter."""
    for name, cam in case.record.cams.items():
        if cam.lift_table is not None and cam.lift_table.report is not None:
            yield from (f"{case.place(('cams', name, 'lift_table'))}: {text}" for text in cam.lift_table.report.remarks)


def _fidelity_warnings(case: Case) -> Iterator[str]:
    """Yield keys of a model that is not run."""
    record = case.record.fidelity
    if "masses" in record.model_fields_set and record.model != "chain":
        yield f"{case.place(('fidelity', 'masses'))}: it counts the masses of a chain, and the model is {record.model}"
    if record.modes is not None and record.tolerances:
        yield f"{case.place(('fidelity', 'modes'))}: it has no effect, because fidelity.tolerance chooses the model"
    for name, member in case.record.members.items():
        if record.model == "rigid" and member.temperature:
            where = case.place(("members", name, "temperature"))
            yield f"{where}: it has no effect, because rigid members do not expand"


def _unused_part_warnings(case: Case) -> Iterator[str]:
    """Yield parts that nothing refers to, which suggests a misspelled name."""
    record, members = case.record, case.record.members.values()
    cams = {getattr(contact, "cam", None) for contact in record.contacts.values()}
    for table, used, why in (
        ("materials", {member.material for member in members}, "no member is made of it"),
        ("sections", {member.section for member in members}, "no member has it"),
        ("cams", cams, "no contact names it: it moves nothing"),
    ):
        for name in getattr(record, table):
            if name not in used:
                yield f"{case.place((table, name))}: {why}"


def _support_warnings(case: Case) -> Iterator[str]:
    """Yield springs to ground at nodes that a support fixes."""
    fixed = {
        (node, component)
        for point, components in case.record.supports.items()
        for node, component in product(_nodes(case, point), components)
    }
    for name, spring in case.record.springs.items():
        component = spring.direction.lstrip("+-") if isinstance(spring.direction, str) else ""
        nodes = _nodes(case, spring.at)
        if spring.to is None and component and nodes and all((node, component) in fixed for node in nodes):
            place = case.place(("springs", name))
            yield f"{place}: a support fixes {component} of {spring.at!r}, so that the spring acts on nothing"


def _nest_warnings(case: Case) -> Iterator[str]:
    """Yield springs whose coils overlap those of a spring around them, without friction between both."""
    nests = {(friction.spring, friction.inside) for friction in case.record.friction.values()}
    springs = {name: spring.part for name, spring in case.record.springs.items() if spring.part.wire is not None}
    for (name, inner), (around, outer) in permutations(springs.items(), 2):
        same = share_ends(inner, outer)
        narrower = inner.wire and outer.wire and inner.wire.coil_diameter < outer.wire.coil_diameter
        if same and narrower and (name, around) not in nests and (overlap := nest_interference(inner, outer)) > 0.0:
            what = f"by their diameters its coils overlap those of {around!r} by {1e3 * overlap:.3g} mm"
            remedy = f"add friction.NAME = {{ spring = {name!r}, inside = {around!r}, coefficient = ... }}"
            yield f"{case.place(('springs', name))}: {what}; correct the diameters, or {remedy}"


def _nodes(case: Case, point: str) -> list[int]:
    if case.mesh is None:
        names = list(case.record.nodes)
        return [names.index(point)] if point in names else []
    return case.mesh.points[point].tolist() if point in case.mesh.points else []


_SECTION_CHANGE = 1.3  # ratio of second moments over a tapered element above which deflections are some percent wrong
# Limits of the ratio of length to section size outside of which a member's units are probably inconsistent.
_MIN_SLENDERNESS, _MAX_SLENDERNESS = 0.2, 2000.0


def _slenderness_warnings(case: Case) -> Iterator[str]:
    for name, member in case.record.members.items():
        place, section = case.place(("members", name)), case.record.sections[member.section].part
        points = np.array([case.record.nodes[node] for node in member.nodes or []])
        if case.mesh is not None:
            points = case.mesh.nodes[case.mesh.lines[name]]
        length, size = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum()), 2.0 * section.at(0.5).radius
        ends = [section.at(share) for share in (0.0, 1.0)]
        change = max(max(pair) / min(pair) for pair in zip(*((end.Iy, end.Iz) for end in ends), strict=True))
        count = member.elements * (len(points) - 1)
        per_element = change ** (1.0 / count)
        if per_element > _SECTION_CHANGE:
            elements = math.ceil(math.log(change) / math.log(_SECTION_CHANGE) / (len(points) - 1))
            share = f"{100.0 * (per_element - 1.0):.3g} %"
            why = f"its second moment changes by {share} per element, which has one section"
            yield f"{place}: {why}; use elements = {elements}"
        if not _MIN_SLENDERNESS <= length / size <= _MAX_SLENDERNESS:
            sizes = f"{length:g} m long and {size:g} m thick (length / thickness = {length / size:.2g})"
            yield f"{place}: {sizes}: do lengths and sections have the same unit?"


def check_model(case: Case, model: Model, problem: Problem, scheme: Method) -> Iterator[str]:
    """Yield warnings about the connections of parts, and about contacts, loads and cams before a run."""
    yield from _check_connectivity(model)
    yield from _check_loose_masses(model)
    yield from check_oblique_springs(model)
    yield from _check_loads(model, problem)
    yield from _check_open_contacts(model, problem)
    yield from _check_start_impact(case, model, problem)
    yield from check_overshoot(problem, scheme)
    yield from check_drives(model)
    yield from _check_rotating_masses(model)
    yield from _check_lash(model)
    yield from _check_valve_angles(model)
    if problem.system.is_kinematic:
        yield from check_shared_seat_load(model)
        yield from check_coil_bind(model, case.speed)
        yield from _check_pulling_contacts(model)


_MAX_DOFS = 3000  # maximum number of degrees of freedom for which the start of a run is computed to check its contacts

_MIN_COSINE = 0.98  # cosine of the angle of a spring to the motion of a point, below which the spring is oblique
_CONTACT_DEPTH = 0.02  # compression of a seat or cam relative to the lift, from which it is reported
_BASE_LIFT = 1e-3  # lift relative to its maximum up to which a cam is on its base circle: measured lifts have noise
_OVERSHOOT_TOLERANCE = 0.01  # overshoot relative to the initial motion from which it is reported: flexcam's choice


def _check_open_contacts(model: Model, problem: Problem) -> Iterator[str]:
    """Yield warnings about contacts on the base circle at the start: open cam contacts and seats, closed lashes."""
    contacts = {name: c for name, c in model.contacts.items() if isinstance(c, CamContact) and c.unilateral}
    seats = [name for name, contact in model.contacts.items() if isinstance(contact, Seat)]
    lashes = [] if seats else _cam_lashes(model)
    adjusters = [name for name, part in model.contacts.items() if isinstance(part, Adjuster)]
    for name in adjusters if contacts and not seats else ():
        why = "the adjuster always sinks: without a seat the spring force goes through it on the base circle as well"
        yield f"Warning: contacts.{name}: {why}; add the seat of the valve, such as [contacts.seat]"
    if not (contacts or seats or lashes) or problem.system.is_kinematic or problem.system.size > _MAX_DOFS:
        return
    try:
        if problem.start is not None and problem.start.periodicity is not None:  # a follower may fly there
            problem = replace(problem, start=equilibrium(problem.system, problem.drive))
        first = solve(replace(problem, steps=1, engine="direct", adaptive=None), newmark())
    except RunFailedError:
        return  # the run reports it
    if not len(first.time):
        return
    starts = [first]
    if any(isinstance(load.history, LoadTable) for load in problem.system.loads):
        with suppress(RunFailedError):  # gas presses a valve on its seat that its spring opens
            starts.append(solve(_without_tables(problem), newmark()))
    forces = [start.channels for start in starts if len(start.time)]

    def force(name: str) -> float:
        return min(float(channels[f"contacts.{name}.force"][0]) for channels in forces)

    lost = False
    closed = {
        name: abs(float(cam.lift(first.angle[:1], 0)[0])) <= _BASE_LIFT * cam.event.height
        for name, cam in model.cams.items()
    }
    for name, contact in contacts.items():
        if closed[contact.cam] and force(name) <= 0.0:
            why, lost = "no spring pushes the follower against its cam on the base circle", True
            remedy = "check the direction of the contact, and the installed_force and direction of the springs"
            yield f"Warning: contacts.{name}: {why}; {remedy}"
        depth = -float(first.channels[f"contacts.{name}.gap"][0])
        if closed[contact.cam] and depth > _CONTACT_DEPTH * model.cams[contact.cam].event.height:
            why = f"on the base circle the follower sinks {format_quantity('m', depth, digits=3)} into its cam"
            yield f"Warning: contacts.{name}: {why}; check its stiffness, the loads and their units"
    for name in seats if closed and all(closed.values()) and not lost else ():
        if force(name) <= 0.0:
            why = "nothing holds the valve on its seat with the cams on their base circles"
            causes = ["the direction and installed_force of the spring that closes the valve"]
            if any(member.temperature for member in model.members.values()):
                causes.append("the temperature of the members, which may expand by more than the lash")
            causes += ["the direction of the loads"] if model.loads else []
            yield f"Warning: contacts.{name}: {why}; check {', or '.join(causes)}"
        lift = max(cam.event.height for cam in model.cams.values())
        depth = -float(first.channels[f"contacts.{name}.gap"][0])
        if depth > _CONTACT_DEPTH * lift:
            why = f"the closed valve sinks {format_quantity('m', depth, digits=3)} into its seat"
            yield f"Warning: contacts.{name}: {why}; check its stiffness, the loads and their units"
    for name in lashes if closed and all(closed.values()) else ():
        if float(first.channels[f"contacts.{name}.force"][0]) > 0.0:
            why = "the lash stays closed: without a seat the spring force always goes through the cam"
            yield f"Warning: contacts.{name}: {why}; add the seat of the valve, such as [contacts.seat]"


def _without_tables(problem: Problem) -> Problem:
    """Return a step of a problem from equilibrium without its loads from tables."""
    system, zero = problem.system, np.zeros(problem.system.size)
    loads = (replace(load, vector=zero) if isinstance(load.history, LoadTable) else load for load in system.loads)
    system = replace(system, loads=tuple(loads))
    start = equilibrium(system, problem.drive)
    return replace(problem, system=system, start=start, steps=1, engine="direct", adaptive=None)


def _cam_lashes(model: Model) -> list[str]:
    """Return the lashes that lifts take up."""
    opposed = {model.cam_contacts[contact].cam for contact in opposed_contacts(model)}  # their lash is the lift
    if not any(lash for name, lash in largest_lashes(model).items() if name not in opposed):
        return []
    return [name for name, contact in model.contacts.items() if isinstance(contact, Lash) and not contact.turns]


def check_overshoot(problem: Problem, scheme: Method) -> Iterator[str]:
    """Yield a warning about an initial velocity that decays within the first step and overshoots."""
    start, system = problem.start, problem.system
    if not isinstance(scheme, Scheme) or start is None or system.is_kinematic or system.size > _MAX_DOFS:
        return
    if not scheme.overshoot or not start.velocity.any():
        return
    scale = max(float(np.abs(motion).max()) for motion in (start.displacement, problem.step * start.velocity))
    try:
        first = solve(replace(problem, steps=1, engine="direct", adaptive=None), scheme, save=SaveAt(field_every=1))
    except RunFailedError:
        return  # the run reports it
    overshoot = scheme.overshoot * problem.step**2 * np.abs(first.fields.acceleration[0])
    if float(overshoot.max()) > _OVERSHOOT_TOLERANCE * scale:
        size, name = f"{100.0 * float(overshoot.max()) / scale:.3g} %", system.names[int(np.argmax(overshoot))]
        what = f"the first step overshoots at {name} by {size} of the largest motion of the start"
        yield f"Warning: {what}: the step does not resolve its damping; use newmark, bathe or smaller steps"


def _check_start_impact(case: Case, model: Model, problem: Problem) -> Iterator[str]:
    """Yield warnings about cams that already lift when a run starts from rest, which causes an impact."""
    if case.record.run.start != "rest" or problem.system.is_kinematic:
        return
    start = problem.drive.at(np.zeros(1))
    for name in dict.fromkeys(contact.cam for contact in model.cam_contacts.values()):
        cam = model.cams[name]
        lift, slope = (float(cam.lift(start.angle, order)[0]) for order in (0, 1))
        if abs(lift) > _BASE_LIFT * cam.event.height:
            motion = f"{1e3 * lift:.3g} mm and {slope * float(start.speed[0]):.3g} m/s"
            what = f"the run starts in the middle of its lift, at {motion}, and strikes a train at rest"
            remedy = 'turn it onto its base circle (phase), or use start = "equilibrium" or "periodic"'
            yield f"Warning: cams.{name}: {what}; {remedy}"


def _check_loads(model: Model, problem: Problem) -> Iterator[str]:
    """Yield warnings about loads without a movable degree of freedom."""
    vectors = {load.name: load.vector for load in problem.system.loads} if not problem.system.is_kinematic else {}
    for name, load in model.loads.items():
        if load.size and not vectors.get(f"loads.{name}", np.ones(1)).any():
            why = "it has no effect: a support fixes the point it acts at, or no member and no mass is there"
            yield f"Warning: loads.{name}: {why}"


def check_oblique_springs(model: Model) -> Iterator[str]:
    """Yield warnings about springs at an angle to the motion of a rocker's point, which take a part of its motion."""
    for name, spring in model.springs.items():
        rocker = model.rocker_points.get(spring.at)
        if rocker is None:
            continue
        cosine = abs(float(spring.direction[:3] @ rocker.direction[:3]))
        if cosine < _MIN_COSINE:
            line = [round(float(x), 4) for x in rocker.direction[:3]]
            angle = f"{math.degrees(math.acos(cosine)):.3g} deg"
            what = f"its direction is at {angle} to that in which the rocker moves point {spring.at!r}"
            yield f"Warning: springs.{name}: {what}; use direction = {line}"


def _check_connectivity(model: Model) -> Iterator[str]:
    """Yield warnings about members not connected to any support, spring, rocker, cam or contact."""
    mesh = model.mesh
    connected = {int(node) for name in _connection_points(model) for node in mesh.points.get(name, ())}
    connected |= {node for nodes in mesh.links.values() for node in nodes.tolist()}
    for part in (set(part.tolist()) for part in mesh.parts):
        if not part & connected:
            names = ", ".join(n for n, line in {**mesh.lines, **mesh.bodies}.items() if int(line[0]) in part)
            yield f"Warning: members {names}: no support, spring, rocker, cam or contact touches them"


def _connection_points(model: Model) -> Iterator[str]:
    """Yield the points that connect members to other parts."""
    yield from model.supports
    for spring in model.springs.values():
        yield from (spring.at, spring.to or "")
    for rocker in model.rockers.values():
        yield from (rocker.start, rocker.point)
    for part in (*model.bearings.values(), *model.cams.values()):
        yield part.at
    for contact in model.contacts.values():
        match contact:
            case Seat():
                yield contact.at
            case Lash() | Adjuster():
                yield from contact.ends or ()
            case _:
                yield contact.follower


def check_shared_seat_load(model: Model) -> list[str]:
    """Return warnings about cams that share the spring force with a closed seat: rigid, this is indeterminate."""
    return [
        f"Warning: contacts.{name}: no lash separates the cam from a closed seat, and both share the {force:.4g} N of "
        "the springs in proportion to their stiffness; the rigid model assigns it all to the seat on the base circle"
        for name, force in shared_forces(model).items()
    ]


def _check_pulling_contacts(model: Model) -> Iterator[str]:
    """Yield warnings about contacts that would have to pull in the rigid model."""
    for name, force in pulling_contacts(model).items():
        why = "the rigid model moves parts between springs that are not linear by their stiffness as installed"
        yield f"Warning: contacts.{name} pulls with up to {force:.4g} N: {why}; use fidelity.model = beams"


def check_coil_bind(model: Model, speed: float) -> list[str]:
    """Return warnings about springs that the rigid train compresses to solid length."""
    warnings, why = list[str](), "reaches coil bind before full lift: full lift needs"
    for name, excess in touching_coils(model, speed).items():
        key = "travel; give its coils more turns or pitch" if model.springs[name].coils else "clash_travel"
        more = math.ceil(1e5 * excess - 1e-6) / 100.0  # so that this travel is enough
        warnings.append(f"Warning: spring {name!r} {why} {more:g} mm more {key}")
    return warnings


# Crank angle of lift above a tenth of its maximum from which cam angles of a valve may be crank angles, rad.
_MAX_OPENING = math.radians(400.0)


def _check_valve_angles(model: Model) -> Iterator[str]:
    """Yield warnings about cams that hold a valve open for so long that their angles may be crank angles."""
    drivers = [driving_contact(model, seat.at) for seat in model.contacts.values() if isinstance(seat, Seat)]
    opposed = opposed_contacts(model)
    for name in dict.fromkeys(model.cam_contacts[driver].cam for driver in drivers if driver and driver not in opposed):
        event = model.cams[name].event
        opening = valve_event(event, 0.1 * event.height)
        if opening and opening.duration > _MAX_OPENING:
            span = f"{math.degrees(opening.duration):.4g} deg of the crank"
            why = "did you give crank angles? Angles of a cam are those of the camshaft, half as large"
            yield f"Warning: cams.{name}: its lift exceeds a tenth of the maximum for {span}: {why}"


def _check_loose_masses(model: Model) -> Iterator[str]:
    """Yield warnings about masses between lashes that no spring or other part holds."""
    contacts = {name: part for name, part in model.contacts.items() if not isinstance(part, Lash)}
    points = set(_connection_points(replace(model, supports={}, contacts=contacts)))
    for name, mass in model.masses.items():
        lashes = {lash: contact for lash, contact in model.contacts.items() if isinstance(contact, Lash)}
        touching = [lash for lash, contact in lashes.items() if contact.ends and mass.at in contact.ends]
        if len(touching) > 1 and mass.at not in points and len(connected_nodes(model, model.mesh.node(mass.at))) == 1:
            what = f"only the lashes {' and '.join(touching)} touch it, and it moves freely while they are open"
            yield f"Warning: masses.{name}: {what}; hold it with a soft spring"


def _check_lash(model: Model) -> Iterator[str]:
    """Yield warnings about a lash that the ramp of its cam does not take up, or not even its lift."""
    opposed = {model.cam_contacts[contact].cam for contact in opposed_contacts(model)}  # their lash is the lift
    for name, lash in largest_lashes(model).items():
        whole = model.cams[name].event
        event = whole.event if isinstance(whole, DelayedEvent) else whole
        ramp = event.ramp if isinstance(event, LiftEvent) else None
        begin = f"Warning: cams.{name}: the lash of {1e3 * lash:.3g} mm at the follower exceeds the"
        if name not in opposed and lash >= whole.height:
            yield f"{begin} lift of {1e3 * whole.height:.3g} mm: the cam never takes it up; check gap and its unit"
        elif ramp and lash > ramp.height:
            yield f"{begin} ramp height of {1e3 * ramp.height:.3g} mm: it is taken up only after the ramp"


def _check_rotating_masses(model: Model) -> Iterator[str]:
    """Yield warnings about bodies whose inertia forces change with the rotation of their shaft, which are missing."""
    mesh, contacts = model.mesh, {contact.cam: contact for contact in model.cam_contacts.values()}
    places = {cam: mesh.node(model.cams[cam].at) for cam in contacts}
    for name, mass in model.masses.items():
        nodes = mesh.points.get(mass.at, np.zeros(0, dtype=int))
        turning = (cam for cam, at in places.items() if np.isin(nodes, mesh.connected_nodes(at, turning=True)).any())
        if (cam := next(turning, None)) is None:
            continue
        across = np.linalg.svd(contacts[cam].shaft_axis[None])[2][1:].T
        centre = mesh.nodes[nodes[0]] + np.array(mass.body.offset) - mesh.nodes[places[cam]]
        offset = float(np.linalg.norm(centre @ across))
        moments = np.linalg.eigvalsh(across.T @ mass.body.tensor @ across)
        why = f"the shaft of cam {cam!r} turns, and the body keeps its orientation in flexcam"
        if offset > _OFF_AXIS:
            what = f"its centre is {1e3 * offset:.3g} mm off the axis"
            yield f"Warning: masses.{name}: {what}, but {why}: it causes no centrifugal force"
        elif float(np.ptp(moments)) > _UNEQUAL * float(moments.sum()):
            yield f"Warning: masses.{name}: its transverse moments of inertia differ, but {why}; use their mean"


# Distance of a body from the axis of its shaft, m, and difference of its transverse moments of inertia, relative to
# their sum, from which they are reported.
_OFF_AXIS, _UNEQUAL = 1e-6, 0.005


def check_drives(model: Model) -> Iterator[str]:
    """Yield warnings about camshafts whose rotation is free: no support, spring or lash ties it to the drive."""
    for cams, component, is_loose in undriven_shafts(build_structure(model)):
        what = "nothing drives the shaft, and contact forces turn it"
        remedy = f"add {component} to the support of its drive end, or a spring about its axis"
        if is_loose:
            what = "nothing holds the shaft, and contact forces push it away"
            remedy = f"add supports: bearings of the shaft, {component} at its drive end, and guides of the followers"
        yield f"Warning: cams.{', cams.'.join(cams)}: {what}; {remedy}"
