"""Tables and sentences about a case, its model, its result and its speed limits."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Sequence
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.table import Table

from flexcam import valvetrain
from flexcam.analysis.comparison import Comparison
from flexcam.analysis.preparation import PreparedRun
from flexcam.analysis.resources import ResourceEstimate, format_size
from flexcam.analysis.run_checks import describe_balance, describe_contact_loss
from flexcam.analysis.run_metrics import SPRING_MARGIN, FigureOfMerit, Margins
from flexcam.cams.lift_event import describe_height
from flexcam.case.builder import build_model
from flexcam.case.case import Case
from flexcam.core import FloatArray
from flexcam.core.units import RPM, format_quantity, shaft_name, shaft_speed, to_display_unit
from flexcam.dynamics import Response, active_dofs_of
from flexcam.dynamics.memory import ExtremesSink
from flexcam.fem.dofs import COMPONENTS, ROTATIONS
from flexcam.io import Result
from flexcam.report.terminal import count_decimals, facts_table, format_decimals, plain_table, remove_noise
from flexcam.valvetrain import Friction, GivenLoad, Metric, Model, ModelModes, Spring, opposed_contacts
from flexcam.valvetrain.springs import spring_curve, spring_frequencies

if TYPE_CHECKING:
    from flexcam.analysis.limits import Limit, Limits

CONTACT_DESCRIPTIONS = {
    "published-load": (
        "Contact model: published load. The cam drives the follower by a force, so that the follower is a mass on the "
        "valve spring, with a resonance that a train with cam contact does not have."
    ),
    "bilateral": (
        "Contact model: bilateral. The follower cannot lose contact; where the contact force is negative, a real "
        "follower would leave its cam."
    ),
    "unilateral": "Contact model: unilateral. Springs press the follower against its cam; contact can be lost.",
    "opposed": "Contact model: unilateral. Opposed cams drive the follower in turn; each loses contact in between.",
}

_CONTACT_KINDS = {
    "CamContact": "cam contacts", "PublishedLoad": "cam contacts", "Seat": "seats", "Lash": "lashes",
    "Adjuster": "adjusters",
}  # fmt: skip
_CURVE_ROWS = 12  # maximum number of printed rows of a spring's curve
_ENGINES = {"modal": ", modal solver", "kernel": ", compiled solver (kernel)"}
_MIN_FRACTION = 5e-4  # fraction from which three decimals are sufficient
_MAX_PARTS = 4  # number of parts, such as valves, up to which a table shows the value of each
# No-break space, and the width of a cell of the figures of merit, characters: with its name it stays within 100
_NO_BREAK, _CELL = "\u00a0", 62
# A probe is at rest if it moves less than this, mm or mrad, and less than this fraction of the largest motion
_REST_AMPLITUDE, _RELATIVE_REST_AMPLITUDE = 5e-5, 1e-5
_FOUR_DECIMAL_AMPLITUDE = 1e-3  # motion, mm or deg, for which four decimals are sufficient
_OMITTED_TEXTS = ("case", "files", "resolved", "overrides", "warnings")  # texts of a result not shown here


def describe_contacts(case: Case, figures: Sequence[Metric] = ()) -> list[str]:
    """Return sentences about the contact formulation of a result."""
    opposed = opposed_contacts(build_model(case))
    models = dict.fromkeys(
        "opposed" if name in opposed and contact.model == "unilateral" else contact.model
        for name, contact in case.record.contacts.items()
    )
    sentences = {model: CONTACT_DESCRIPTIONS[model] for model in models if model in CONTACT_DESCRIPTIONS}
    if loss := describe_contact_loss(figures):  # only unilateral contacts have this metric
        sentences["unilateral"] = f"{sentences['unilateral'].removesuffix('.')}: {loss}."
    return list(sentences.values())


def model_table(ready: PreparedRun, modes: ModelModes, takes: ResourceEstimate | None = None) -> Table:
    """Return the table of a model's contents."""
    model, problem = ready.model, ready.problem
    lowest = [f"{f:.4g}" for f in modes.modes.frequencies[modes.modes.rigid :][:5]]
    per_revolution = 2.0 * math.pi / (ready.case.speed * problem.step)
    members = [f"{n} {format_quantity('kg', m, digits=4)}" for n, m in valvetrain.member_masses(model).items()]
    masses = [f"{name} {format_quantity('kg', part.body.mass)}" for name, part in model.masses.items()]
    stiffness = {  # a bearing has one spring per direction across the shaft, both of its stiffness
        name.partition(", ")[0]: format_quantity(
            "N m/rad" if s.turns else "N/m", spring_curve(s).stiffness_at(0.0) if s.coils else s.stiffness
        )
        for name, s in model.springs.items()
    }
    free = [modes.words(i).removeprefix("free motion: ") for i in range(modes.modes.rigid)]
    factor, unit = to_display_unit("m/s^2")
    weightless = [name for name, part in model.masses.items() if part.at in model.rocker_points]
    omitted = f"; without masses at points of rockers: {', '.join(weightless)}" if weightless else ""
    rows = [
        ("members", ", ".join(members) or "none"),
        ("elements", str(len(model.mesh.elements()))),
        ("degrees of freedom", str(problem.system.size)),
        ("inactive", "; ".join(describe_inactive(ready)) or "nothing"),
        ("masses", ", ".join(masses) or "none"),
        *((f"superelement {n}", _superelement(model, n)) for n in model.superelements),
        *((f"rigid link {n}", _link(model, n)) for n in model.rigid_links),
        ("springs", ", ".join(f"{name} {size}" for name, size in stiffness.items()) or "none"),
        *((f"bearing {n}", f"film of {format_quantity('m', b.radial_clearance)} at {b.at}")
          for n, b in model.bearings.items()),
        ("supports", ", ".join(f"{point}: {' '.join(dofs)}" for point, dofs in model.supports.items()) or "none"),
        *((f"rocker {n}", f"{r.start} to {r.point}, ratio {r.ratio:g}, along {_vector(r.direction)}")
          for n, r in model.rockers.items()),
        *((f"cam {n}", f"at {c.at}, lift {describe_height(c.event)}"
           + (", behind a phaser" if c.phaser else "")) for n, c in model.cams.items()),
        *((f"contact {n}", _contact(model, c)) for n, c in model.contacts.items()),
        *((f"friction {n}", f"{format_quantity(_unit(f), f.force)} "
           + (f"at {f.at}" if f.springs is None else f"between springs {' and '.join(f.springs)}"))
          for n, f in model.friction.items()),
        *((f"load {n}", _load(load)) for n, load in model.loads.items()),
        *([("gravity", f"{_vector(factor * np.array(model.gravity))} {unit}{omitted}")] if any(model.gravity) else []),
        ("speed", ready.case.speed_text),
        ("steps", f"{problem.steps} of {problem.step:.4g} s ({per_revolution:.6g} per revolution)"),
        ("free motions", "; ".join(free) + " (contacts open; shares of the kinetic energy)" if free else "none"),
        ("lowest frequencies", ", ".join(lowest) + " Hz (contacts open)" if lowest else "none"),
    ]  # fmt: skip
    if takes:
        rows.append(("a run needs", f"{format_size(takes.memory)} of memory, {format_size(takes.file)} of disk space"))
    return facts_table(ready.case.title, rows)


def spring_curve_rows(spring: Spring) -> list[dict[str, Any]]:
    """Return the static curve of a spring from the installed length to coil bind, at its corners.

    The stiffness of a row is that beyond its travel, the natural frequencies are those with fixed ends.
    """
    curve, last = spring_curve(spring), math.inf if spring.clash_travel is None else spring.clash_travel
    corners = sorted({0.0, *(travel for travel in curve.travel[1:-1].tolist() if 0.0 < travel <= last)})
    forces: list[float] = np.interp(corners, curve.travel, curve.force).tolist()
    return [
        {"travel_m": travel, "force_n": force, "stiffness_n_per_m": curve.stiffness_at(travel),
         "frequencies_hz": spring_frequencies(spring, travel).tolist()}
        for travel, force in zip(corners, forces, strict=True)
    ]  # fmt: skip


def spring_curve_table(name: str, spring: Spring) -> Table:
    """Return the table of a spring's static curve."""
    rows = spring_curve_rows(spring)
    indices: list[int] = np.unique(np.linspace(0, len(rows) - 1, _CURVE_ROWS).round().astype(int)).tolist()
    (length, mm), (load, newton), (rate, per_mm) = map(to_display_unit, ("m", "N", "N/m"))
    head = (f"{mm} beyond installed", f"force {newton}", f"stiffness {per_mm}", "surge Hz, ends fixed")
    cells = [
        (f"{length * row['travel_m']:.4g}" + " (coil bind)" * (row["travel_m"] == spring.clash_travel),
         f"{load * row['force_n']:.1f}", f"{rate * row['stiffness_n_per_m']:.2f}",
         f"{row['frequencies_hz'][0]:.4g}" if row["frequencies_hz"] else "no mass")
        for row in (rows[i] for i in indices)
    ]  # fmt: skip
    return plain_table(f"Spring {name}", head, cells)


def describe_inactive(ready: PreparedRun) -> list[str]:
    """Return sentences about inactive degrees of freedom that a run omits."""
    problem = ready.problem
    if not problem.prune or problem.system.is_kinematic:
        return []
    return valvetrain.describe_inactive(valvetrain.build_structure(ready.model), active_dofs_of(problem))


def _unit(part: Friction | GivenLoad) -> str:
    return "N" if part.direction[:3].any() else "N m"


def _load(load: GivenLoad) -> str:
    table, turns = load.size, not load.direction[:3].any()
    along = f"along {_vector(load.direction[3:] if turns else load.direction)}"
    if not isinstance(table, valvetrain.LoadTable):
        unit, place = ("N/m", f"over {load.member}") if load.member else (_unit(load), f"at {load.at}")
        return f"{format_quantity(unit, table)} {place} {along}"
    factor, what = (1e3, "ms") if table.over_time else (180.0 / math.pi, "deg of cam angle")
    first, last = (factor * float(table.at[i]) for i in (0, -1))
    over = f"from {first:g} to {last:g} {what}" if table.period is None else f"every {factor * table.period:g} {what}"
    size = format_quantity(_unit(load), table.size.min(), table.size.max(), digits=4)
    return f"{size} at {load.at} {along}, table {over}"


def _contact(model: Model, contact: valvetrain.Contact) -> str:
    match contact:
        case valvetrain.Seat():
            return f"stop of {format_quantity('N/m', contact.stiffness)} at {contact.at}"
        case valvetrain.Lash() | valvetrain.Adjuster():
            ends = contact.ends
            stiffness = format_quantity("N/m", contact.stiffness)
            place = f"from {ends[0]} to {ends[1]}" if ends else f"at rocker {contact.rocker}"
            if isinstance(contact, valvetrain.Lash):
                if contact.turns:
                    return f"lash of {format_quantity('rad', contact.gap)} {place}, {contact.stiffness:g} N m/rad"
                what, opposed = "lash", (model.cam_contacts[name].follower for name in opposed_contacts(model))
                if ends and not {*ends}.isdisjoint(opposed):
                    what, place = "gap", f"{place} with both cams on the base circle"
                return f"{what} of {format_quantity('m', contact.gap)} {place}, {stiffness}"
            return f"hydraulic adjuster {place}, oil {stiffness}, leak {format_quantity('N s/m', contact.leak)}"
        case _:
            what = f"{contact.cam} lifts"
            if isinstance(contact, valvetrain.PublishedLoad):
                what = f"force of the Tayeb-Sliman model, from cam {contact.cam}, acts on"
            return f"{what} {contact.follower} along {_vector(contact.direction)}"


def _superelement(model: Model, name: str) -> str:
    body, (factor, unit) = model.superelements[name], to_display_unit("m")
    masses, centre = body.rigid_body(model.mesh.nodes[[model.mesh.node(node) for node in body.nodes]])
    mass, place = format_quantity("kg", float(masses.mean()), digits=4), _vector(np.round(factor * centre, 6))
    return f"{len(body.nodes)} nodes, {body.modes} modes, {mass}, centre of gravity {place} {unit}"


def _link(model: Model, name: str) -> str:
    first, *others = (model.mesh.node_name(node) for node in model.mesh.links[name].tolist())
    components = model.rigid_links[name]
    subset = f", {' '.join(components)}" if len(components) < len(COMPONENTS) else ""
    return f"{', '.join(others)} with {first}{subset}"


def _vector(direction: FloatArray) -> str:
    return "(" + ", ".join(f"{x:.3g}" for x in direction[:3] + 0.0) + ")"


def mode_table(modes: ModelModes, title: str = "Modes, contacts open", turns: float = 1.0) -> Table:
    """Return the table of frequencies, effective masses and descriptions of modes."""
    factor, unit = to_display_unit("kg")
    effective = factor * modes.effective[:, :3]
    places = count_decimals(float(np.abs(effective).max(initial=0.0)), 4)
    rows = [
        (str(i + 1), f"{frequency:.2f}", f"{60.0 * turns * frequency:.0f}",
         *(format_decimals(mass, places) for mass in effective[i]), modes.words(i))
        for i, frequency in enumerate(modes.modes.frequencies)
    ]  # fmt: skip
    axes = (f"u{axis} {unit}" for axis in "xyz")
    head = ("no.", "Hz", f"{shaft_name(turns)} rpm", *axes, "what moves (share of the kinetic energy)")
    return plain_table(title, head, rows)


def comparison_table(comparison: Comparison, turns: float = 1.0) -> Table:
    """Return the table of the comparison of flexible and rigid models."""
    rows: list[tuple[str, ...]] = []
    for dev in comparison.deviations:
        factor, unit = to_display_unit(dev.unit)
        figures = [f"{factor * v:.4g}" for v in (dev.rigid_peak, dev.flexible_peak, dev.peak, dev.rms)]
        part = dev.relative_peak
        share = format_decimals(part, 3) if part >= _MIN_FRACTION else f"{remove_noise(part, 1.0):.2g}"
        rows.append((f"{dev.quantity}, {unit.replace('²', '^2')}", *figures, share, f"{dev.angle_deg % 360.0:.1f}"))
    name, ref = comparison.names
    head = ("", f"{ref} peak", f"{name} peak", "peak deviation", "rms deviation", f"deviation / {ref}", "at cam deg")
    speed = shaft_speed(comparison.speed_rpm * RPM, turns)
    title = "Flexible" if name == "flexible" else name
    return plain_table(f"{title} against {ref} at {comparison.probe}, {speed}", head, rows)


def describe_comparison(comparison: Comparison, mode_hz: float | None) -> list[str]:
    """Return sentences about a comparison."""
    peak, rms = (f"{100.0 * value:.3g} %" for value in (comparison.peak_deviation, comparison.rms_deviation))
    ratio = format_decimals(comparison.peak_acceleration_ratio, 2)
    other = comparison.names[1]
    of_other = f"of the {other} motion" if other == "rigid" else f"of the motion in '{other}'"
    deviation = f"{comparison.probe} deviates by up to {peak} of the range {of_other} (rms {rms})."
    angle, lift = comparison.peak_acceleration_deg % 360.0, 100.0 * remove_noise(comparison.peak_lift, 1.0)
    acceleration = f"Its peak acceleration, at cam {angle:.1f} deg, is {ratio} times that {of_other}."
    words = [f"{deviation} {acceleration} At this angle the displacement {of_other} is {lift:.3g} % of its range."]
    if comparison.residual is not None:
        factor, unit = to_display_unit(comparison.deviations[0].unit)
        amplitude = f"{factor * comparison.residual:.3g} {unit}"
        words.append(f"Residual vibration, or motion by changing loads, in a dwell {of_other}: up to ±{amplitude}.")
    if mode_hz is not None:
        nearest = "The nearest mode that the cam force excites is at"
        speed, share = f"{mode_hz:.2f} Hz = {60.0 * mode_hz:.0f} camshaft rpm", comparison.speed_rpm / (60.0 * mode_hz)
        words.append(f"{nearest} {speed}; the cam turns at {share:.2f} of this speed.")
    return words


def run_table(case: Case, extremes: ExtremesSink) -> Table:
    """Return the table of the extremes of every probe, without the inner points of springs."""
    ranges = [
        (name if len(components) == 1 else f"{name}.{component}", component in ROTATIONS, 1e3 * np.array(bounds))
        for name, components in extremes.outline.probes
        if not name.startswith("springs.")
        for component, *bounds in zip(components, *extremes.probe(name), strict=True)
    ]
    largest = max((float(np.abs(bounds).max()) for _, turns, bounds in ranges if not turns), default=0.0)
    rows: list[tuple[str, ...]] = []
    for name, turns, bounds in ranges:
        factor, unit = to_display_unit("rad" if turns else "m")
        if float(np.abs(bounds).max()) > min(_REST_AMPLITUDE, _RELATIVE_REST_AMPLITUDE * largest):
            scaled = 1e-3 * factor * bounds
            amplitude = float(np.abs(scaled).max())
            places = 4 if amplitude >= _FOUR_DECIMAL_AMPLITUDE else count_decimals(amplitude, 4)
            rows.append((name, *(f"{format_decimals(float(bound), places)} {unit}" for bound in scaled)))
    message = "no probe moves" if extremes.steps else "no steps were completed"
    return plain_table(f"{case.title}, {case.speed_text}", ("probe", "min", "max"), rows or [(message, "", "")])


def metrics_table(model: Model | None, figures: Sequence[Metric], span: str = "last revolution") -> Table:
    """Return the table of the metrics of a part of a run; metrics of many parts of one kind share a row."""
    rows: dict[tuple[str, ...], list[tuple[float, str, str, str]]] = {}  # value, text, part and place
    for figure in figures:
        factor, unit = to_display_unit(figure.unit, thin=".film." in figure.name or ".wear." in figure.name)
        value = factor * figure.value + 0.0  # the sum removes the sign of a negative zero
        kind, part, *quantity = figure.name.split(".")
        quantity = [word.replace("force", "torque") if unit == "N m" else word for word in quantity]
        place = "" if figure.angle is None else f" at cam {math.degrees(figure.angle):.1f} deg"
        if model is not None and quantity == ["open_on_the_lift"]:
            lift = format_quantity("m", valvetrain.main_lift(model, model.cam_contacts[part].cam), digits=3)
            place = f" (above {lift} of lift)"
        key = _part_kind(model, figure.name), kind, *quantity
        rows.setdefault(key, []).append((value, f"{value:.4g} {unit}".rstrip(), part, place))
    cells: list[tuple[str, str]] = []
    for (parts_kind, kind, *quantity), parts in rows.items():
        if len(parts) > _MAX_PARTS:
            cells.append((_metric_label(parts_kind, quantity), _range_text([part[:3] for part in parts])))
        else:
            cells += [
                (_metric_label(f"{kind.removesuffix('s')} {part}", quantity), text + place)
                for _, text, part, place in parts
            ]
    return facts_table(f"Metrics of the {span}", cells)


def _metric_label(place: str, quantity: Sequence[str]) -> str:
    """Return the label of a metric, such as ``contact intake: max force`` of ``contacts.intake.force.largest``."""
    name = ".".join(quantity)
    for key, words in _METRIC_WORDS.items():
        name = name.replace(key, words)
    name, _, kind = name.rpartition(".")
    label = f"{_METRIC_KINDS[kind]} {name}" if kind in _METRIC_KINDS else f"{name} {kind}".strip()
    return f"{place}: {label.replace('_', ' ')}"


_METRIC_KINDS = {"largest": "max", "least": "min", "mean": "mean"}
_METRIC_WORDS = {
    "open_on_the_lift": "loss of contact during the lift", "leak_down": "leak-down (below zero: extended)",
    "nose_force": "force over the nose", ".nose": ".at the nose", "stress.largest": "shear stress of the wire.largest",
    "wear.largest": "wear in 1e6 revolutions.largest",
}  # fmt: skip


def _part_kind(model: Model | None, metric: str) -> str:
    """Return the kind of the part of a metric, in the plural; empty for a figure of the whole train."""
    kind, _, part = metric.partition(".")
    if model is None or kind != "contacts":
        return kind
    return _CONTACT_KINDS[type(model.contacts[part.partition(".")[0]]).__name__]


def merit_table(model: Model, figures: Sequence[FigureOfMerit], span: str) -> Table:
    """Return the table of the figures of merit: a row per figure with its parts, or the range of many of one kind."""
    rows: dict[str, list[tuple[float, str, str]]] = {}
    count = Counter(fom.name for fom in figures)
    rubs = any(fom.metric.endswith(".friction_power.mean") for fom in figures)
    for fom in figures:
        factor, unit = to_display_unit(fom.unit)
        value = f"{fom.value:.1%}" if fom.name == SPRING_MARGIN else f"{factor * fom.value + 0.0:.4g} {unit}".rstrip()
        kinds = {_part_kind(model, other.metric) for other in figures if other.name == fom.name}
        many = count[fom.name] > _MAX_PARTS and len(kinds) > 1
        name = f"{fom.name}, {_part_kind(model, fom.metric)}" if many else fom.name
        name += " (model without friction)" if fom.name.startswith("mean drive ") and not rubs else ""
        name += " (above the rigid lift)" if fom.metric.endswith(".valve_loft") else ""
        part = f"{fom.metric.partition('.')[0].removesuffix('s')} {fom.part}" if fom.part else ""
        rows.setdefault(name, []).append((fom.value, value, part))
    cells: list[tuple[str, str]] = []
    for name, parts in rows.items():
        text = _range_text(parts)
        if len(parts) <= _MAX_PARTS:  # a line break does not separate a value from its part
            texts = [(f"{value} ({part})" if part else value).replace(" ", _NO_BREAK) for _, value, part in parts]
            text = fill(", ".join(texts), _CELL).replace(_NO_BREAK, " ")
        cells.append((name, text))
    return facts_table(f"Figures of merit, {span}", cells)


def _range_text(parts: list[tuple[float, str, str]]) -> str:
    (_, low, first), (_, high, last) = min(parts), max(parts)
    text = f"{low} (all {len(parts)})" if low == high else f"{low} ({first}) to {high} ({last}) of {len(parts)}"
    return fill(text, _CELL)


_MISSED_SHARE = 0.99  # share of a maximum that the saved instants reach, below which the table of stresses says so


def strength_table(strength: valvetrain.StrengthSink) -> Table:
    """Return the table of the maximum stresses of every member at the saved instants."""
    instants, shares = strength.instants, strength.shares()
    title = f"Stresses at {instants} saved instant{'s' * (instants != 1)}"
    name = min(shares, key=shares.__getitem__, default="")
    if name and shares[name] < _MISSED_SHARE:
        group, part, kind = name.split(".")
        place = f"the shaft at cam {part}" if group == "cams" else f"{group[:-1]} {part}"
        reached = f"the {kind} of {place} reaches only {100.0 * shares[name]:.3g} % of its maximum"
        title += f". The peak stress may be missed: at these instants {reached}"
        title += "; output.field_every = 1 saves all instants"
    factor, unit = to_display_unit("Pa")
    rows = [
        (name, *(f"{factor * value:.4g}" for value in (point.von_mises, point.mean, point.alternating)),
         f"{point.safety:.3g}" if point.safety else "unlimited" if point.rated else "no strength given", point.place)
        for name, point in strength.members().items()
    ]  # fmt: skip
    head = (f"stress, {unit}", "max von Mises", "equivalent mean", "amplitude", "fatigue safety", "at")
    return plain_table(title, head, rows)


def describe_dofs(response: Response) -> str:
    """Return the number of degrees of freedom of a result and how many were integrated, as far as known."""
    size, integrated = response.stats.size or len(response.outline.unknowns), response.stats.unknowns
    if not response.stats.is_complete:
        return f"{response.stats.size} unknowns" if response.stats.size else "unknowns not counted"
    rest = f", {integrated} of them integrated (the others are not loaded, or are computed from these {integrated})"
    count = f"{size} unknowns" + (rest if integrated != size else "")
    method = f"; {response.stats.integrator}" if response.stats.integrator else ""
    return count + method + _ENGINES.get(response.stats.engine, "")


def info_table(result: Result) -> Table:
    """Return the table of a result file's contents."""
    response = result.response
    about = [(name, text) for name, text in result.about.items() if name not in _OMITTED_TEXTS]
    seconds = f", {response.stats.seconds:.3g} s" if response.stats.is_complete else ""
    rows = [("run", str(response.status)), ("steps", f"{response.stats.steps} of {describe_dofs(response)}{seconds}")]
    if response.stats.periodicity >= 0.0:
        rows.append(("periodic within", f"{100.0 * response.stats.periodicity:.2g} % of the amplitude"))
    if balance := describe_balance(ExtremesSink.of(response), response.stats):
        rows.append(("energy balance", balance))
    warnings = dict.fromkeys([*result.warnings, *result.about.get("warnings", "").splitlines()])
    rows += [
        ("saved", f"{len(response.time)} instants of the probes, {len(response.field_time)} of the fields"),
        ("probes", ", ".join(name for name, _ in response.outline.probes) or "none"),
        ("channels", ", ".join(f"{name} [{unit}]" for name, unit in response.outline.channels) or "none"),
        ("fields", ", ".join([*result.field_names, *result.recovered])),
        ("members", ", ".join(f"{name} ({len(line) - 1})" for name, line in result.mesh.lines.items()) or "none"),
        *about,
        *([("warning", warning.removeprefix("Warning: ")) for warning in warnings] or [("warnings", "none")]),
        ("overrides", ", ".join(json.loads(result.about["overrides"])) or "none"),
    ]
    return facts_table("Result", rows)


def _limit_speed(limit: Limit, scale: float, high: float) -> str:
    if limit.rpm is None:
        return f"above {high:.6g}" if limit.known else "not known"
    text = _limit_rpm(limit, scale, limit.rpm)
    return f"{text} or below" if math.isinf(limit.tolerance_rpm) else text


def _limit_rpm(limit: Limit, scale: float, rpm: float) -> str:
    if math.isinf(limit.tolerance_rpm):
        return f"{scale * rpm:.6g}"
    return f"{scale * rpm:.{max(0, -math.floor(math.log10(scale * limit.tolerance_rpm)))}f}"


def _limit_bands(limit: Limit, scale: float) -> str:
    """Return the examined speeds at which the event occurs, such as "6430 to 7313, not at 7679"."""

    def words(begin: float, end: float | None) -> str:
        low, last = (_limit_rpm(limit, scale, rpm) for rpm in (begin, end or limit.examined_rpm or begin))
        if low == last:
            return f"at {low}"
        return f"{low} to {last}" if end else f"{low} to at least {last}"

    text = " and ".join(words(*band) for band in limit.bands_rpm)
    if text and limit.bands_rpm[-1][1] and limit.examined_rpm:
        text += f", not at {_limit_rpm(limit, scale, limit.examined_rpm)}"
    return text


def _limit_range(limit: Limit, scale: float) -> str:
    """Return the range in which the event comes and goes, otherwise in which it begins."""
    if limit.rpm is None or math.isinf(limit.tolerance_rpm):
        return ""
    ends = limit.scatter_rpm or (limit.rpm - limit.tolerance_rpm, limit.rpm)
    return " to ".join(_limit_rpm(limit, scale, rpm) for rpm in ends)


def limits_legend(found: Limits) -> str:
    """Return the explanation of the columns of the speed limits."""
    from flexcam.analysis.limits import SPACING

    text = "A run has six revolutions; an event counts if it occurs in any of the last five revolutions. "
    if any(_limit_range(limit, 1.0) for limit in found.limits.values()):
        text += "uncertainty: range of speeds in which the limit lies; wider if the event is absent at some speeds "
        text += "just above the limit or occurs at some speeds just below it. "
    text += "occurs at: range of examined speeds, from the limit upwards, at which the event occurs. "
    text += f"Only a few speeds above the limit are examined, {100.0 * SPACING:g} % apart; "
    return text + "'at least' or 'not at' says whether the event still occurs at the highest of them"


def limits_table(found: Limits, margins: Margins, scale: float) -> Table:
    """Return the table of the speed limits of a train."""
    high = scale * found.highest_rpm
    ordered = sorted(found.limits.items(), key=lambda item: item[1].rpm or float("inf"))
    rows = [
        (name.replace("_", " "), _limit_speed(limit, scale, high), _limit_range(limit, scale),
         _limit_bands(limit, scale), limit.words)
        for name, limit in ordered
    ]  # fmt: skip
    if margins.rigid_rpm is not None:
        words = "of the rigid train: its inertia force equals its spring force"
        rows.append(("contact loss, rigid", f"{scale * margins.rigid_rpm:.6g}", "", "", words))
    if margins.spring_margin is not None:
        words = "of the rigid train at the speed of the case"
        rows.append(("spring margin", f"{margins.spring_margin:.1%}", "", "", words))
    for name, margin in margins.buckling_margins.items():
        words = "static: buckling load divided by the compression at full lift"
        rows.append((f"buckling margin, {name}", f"{margin:.3g} (ratio)", "", "", words))
    if margins.unknown:
        rows.append(("buckling margins", "not known", "", "", margins.unknown))
    heads = ("limit", f"{shaft_name(scale)} rpm", "uncertainty", "occurs at", "event")
    columns = [i for i in range(len(heads)) if any(row[i] for row in rows)]  # without empty columns
    return plain_table("Speed limits", [heads[i] for i in columns], [[row[i] for i in columns] for row in rows])
