"""Tables and sentences about a case and its model."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict

import numpy as np
from rich.table import Table

from flexcam.analysis.comparison import Comparison
from flexcam.analysis.preparation import PreparedRun
from flexcam.analysis.published_claims import Claim
from flexcam.analysis.resources import ResourceEstimate, format_size
from flexcam.case.case import Case
from flexcam.case.records import resolve_record
from flexcam.core import FloatArray
from flexcam.core.units import RPM, shaft_speed
from flexcam.dynamics import active_dofs_of
from flexcam.io import format_toml
from flexcam.report.formatting import count_decimals, format_fixed, remove_noise
from flexcam.report.run_checks import describe_contact_loss
from flexcam.report.terminal import create_table, facts_table, plain_table
from flexcam.valvetrain import Adjuster, Contact, Lash, Metric, ModelModes, Seat, Spring, build_structure, member_masses
from flexcam.valvetrain import describe_inactive as words_of

CONTACT_DESCRIPTIONS = {
    "published-load": (
        "This result comes from the published load: the cam drives the follower by a force, so the follower is a mass "
        "on the retaining spring. A train held in contact does not behave like this near that resonance."
    ),
    "bilateral": (
        "This result comes from a bilateral contact: the follower can neither leave its cam nor press deeper than the "
        "contact's stiffness lets it. Where its force is negative a real train would part."
    ),
    "unilateral": "This result comes from true contact: springs press the follower to its cam, and it may leave it.",
}
"""Descriptions of the contact formulations."""


def resolved_toml(case: Case) -> str:
    """Return the case with all defaults as TOML in SI."""
    return format_toml(resolve_record(case.record))


def describe_contacts(case: Case, figures: Sequence[Metric] = ()) -> list[str]:
    """Return sentences about the contact formulation of a result."""
    models = dict.fromkeys(contact.model for contact in case.record.contacts.values())
    said = {model: CONTACT_DESCRIPTIONS[model] for model in models if model in CONTACT_DESCRIPTIONS}
    if left := describe_contact_loss(figures):  # only unilateral contacts have this metric
        said["unilateral"] = f"{said['unilateral'].removesuffix('.')}: {left}."
    return list(said.values())


def model_table(ready: PreparedRun, modes: ModelModes, takes: ResourceEstimate | None = None) -> Table:
    """Return the table of a model's contents."""
    model, problem = ready.model, ready.problem
    lowest = [f"{f:.4g}" for f in modes.modes.frequencies[modes.modes.rigid :][:5]]
    per_revolution = 2.0 * math.pi / (ready.case.speed * problem.step)
    rows = [
        ("members", ", ".join(f"{name} {mass:.4g} kg" for name, mass in member_masses(model).items()) or "none"),
        ("elements", str(len(model.mesh.elements()))),
        ("degrees of freedom", str(problem.system.size)),
        ("left out of the run", "; ".join(describe_inactive(ready)) or "nothing"),
        ("masses", ", ".join(f"{name} {part.body.mass:g} kg" for name, part in model.masses.items()) or "none"),
        ("springs", ", ".join(f"{name} {_stiffness(s)}" for name, s in model.springs.items()) or "none"),
        ("supports", ", ".join(f"{point}: {' '.join(held)}" for point, held in model.supports.items()) or "none"),
        *(
            (f"rocker {n}", f"{r.start} to {r.point}, ratio {r.ratio:g}, along {_vector(r.direction)}")
            for n, r in model.rockers.items()
        ),
        *((f"cam {n}", f"at {c.at}, lift {1e3 * c.event.height:g} mm") for n, c in model.cams.items()),
        *((f"contact {n}", _contact(c)) for n, c in model.contacts.items()),
        *_weight(ready),
        ("speed", ready.case.speed_text),
        ("steps", f"{problem.steps} of {problem.step:.4g} s ({per_revolution:.6g} per revolution)"),
        ("free motions", _free_motions(modes)),
        ("lowest frequencies", ", ".join(lowest) + " Hz" if lowest else "none"),
        *(
            [("a run takes", f"{format_size(takes.memory)} of memory, a result of {format_size(takes.file)}")]
            if takes
            else []
        ),
    ]
    return facts_table(ready.case.title, rows)


def _stiffness(spring: Spring) -> str:
    return f"{spring.stiffness:g} {'N m/rad' if spring.turns else 'N/m'}"


def describe_inactive(ready: PreparedRun) -> list[str]:
    """Return sentences about inactive degrees of freedom that a run omits."""
    problem = ready.problem
    if not problem.prune or not problem.system.size:
        return []
    return words_of(build_structure(ready.model), active_dofs_of(problem))


def _contact(contact: Contact) -> str:
    match contact:
        case Seat():
            return f"stop of {contact.stiffness:g} N/m at {contact.at}"
        case Lash():
            return f"play of {1e3 * contact.gap:g} mm {_place(contact)}, {contact.stiffness:g} N/m"
        case Adjuster():
            return f"hydraulic adjuster {_place(contact)}, oil {contact.stiffness:g} N/m, leak {contact.leak:g} N s/m"
        case _:
            return f"{contact.cam} lifts {contact.follower} along {_vector(contact.direction)}"


def _place(contact: Lash | Adjuster) -> str:
    return f"from {contact.ends[0]} to {contact.ends[1]}" if contact.ends else f"at rocker {contact.rocker}"


def _weight(ready: PreparedRun) -> list[tuple[str, str]]:
    model = ready.model
    if not any(model.gravity):
        return []
    left_out = [name for name, part in model.masses.items() if model.rocker_at(part.at) is not None]
    told = f"; not counted, at a rocker's point: {', '.join(left_out)}" if left_out else ""
    return [("gravity", f"{_vector(np.array(model.gravity))} m/s^2{told}")]


def _vector(direction: FloatArray) -> str:
    return "(" + ", ".join(f"{x:.3g}" for x in direction[:3] + 0.0) + ")"


def _free_motions(modes: ModelModes) -> str:
    free = [modes.words(i).removeprefix("free motion: ") for i in range(modes.modes.rigid)]
    return "; ".join(free) if free else "none"


def mac_table(likeness: FloatArray) -> Table:
    """Return a table of the modal assurance criterion."""
    rows = [(str(i + 1), *(f"{value:.2f}" for value in row)) for i, row in enumerate(likeness)]
    return plain_table("Modal assurance criterion", ("here / there", *map(str, range(1, likeness.shape[1] + 1))), rows)


def describe_mac(likeness: FloatArray, nodes: int) -> str:
    """Return a sentence with the number of nodes used to compare shapes."""
    few = nodes < max(likeness.shape)
    doubt = "; fewer than modes: different shapes may look alike, refine both in the same places" if few else ""
    return f"Compared at {nodes} moving node{'s' * (nodes != 1)} that both models have{doubt}."


def mode_table(modes: ModelModes, of: str = "") -> Table:
    """Return the table of frequencies, effective masses and descriptions of modes."""
    places = count_decimals(float(np.abs(modes.effective[:, :3]).max(initial=0.0)), 4)
    made = plain_table(f"{of}: modes" if of else "Modes", ("no.", "Hz", "camshaft rpm", "ux kg", "uy kg", "uz kg"), ())
    made.add_column("what moves (share of the kinetic energy)", justify="left")
    for i, frequency in enumerate(modes.modes.frequencies):
        masses = [format_fixed(m, places) for m in modes.effective[i, :3]]
        made.add_row(str(i + 1), f"{frequency:.2f}", f"{60.0 * frequency:.0f}", *masses, modes.words(i))
    return made


def comparison_table(comparison: Comparison, turns: float = 1.0) -> Table:
    """Return the table of the comparison of flexible and rigid models."""
    units = {"displacement": ("mm", 1e3), "velocity": ("m/s", 1.0), "acceleration": ("m/s^2", 1.0)}
    rows: list[tuple[str, ...]] = []
    for one in comparison.deviations:
        unit, scale = units[one.quantity]
        figures = [f"{scale * v:.4g}" for v in (one.rigid_peak, one.flexible_peak, one.peak, one.rms)]
        rows.append((f"{one.quantity}, {unit}", *figures, _format_fraction(one.relative_peak), f"{one.angle_deg:.1f}"))
    one, other = comparison.names
    head = ("", f"{other} peak", f"{one} peak", "peak deviation", "rms deviation", f"of {other} peak", "at cam deg")
    speed = shaft_speed(comparison.speed_rpm * RPM, turns)
    return plain_table(f"{one[:1].upper()}{one[1:]} against {other} at {comparison.probe}, {speed}", head, rows)


def comparison_json(comparison: Comparison) -> dict[str, object]:
    """Return a comparison for ``--json``."""
    return {
        "status": str(comparison.status.cause), "probe": comparison.probe, "speed_rpm": comparison.speed_rpm,
        "peak_deviation": comparison.peak_deviation, "rms_deviation": comparison.rms_deviation,
        "peak_acceleration_ratio": comparison.peak_acceleration_ratio,
        "deviations": [{**asdict(one), "of_rigid": one.relative_peak} for one in comparison.deviations],
    }  # fmt: skip


def _format_fraction(value: float) -> str:
    """Format a fraction with enough decimals for values of about a thousandth."""
    return format_fixed(value, 3) if value >= _MIN_FRACTION else f"{remove_noise(value, 1.0):.2g}"


_MIN_FRACTION = 5e-4
"""Fraction from which three decimals are sufficient."""


def describe_comparison(comparison: Comparison, mode_hz: float | None) -> list[str]:
    """Return sentences about a comparison."""
    deviation = (
        f"The {comparison.probe} deviates by up to {_format_fraction(comparison.peak_deviation)} of its lift "
        f"(rms {_format_fraction(comparison.rms_deviation)}); its peak acceleration is "
        f"{format_fixed(comparison.peak_acceleration_ratio, 2)} "
        f"times the {comparison.names[1]} one."
    )
    if mode_hz is None:
        return [deviation]
    share = comparison.speed_rpm / (60.0 * mode_hz)
    mode = (
        f"The loaded mode nearest the cam speed is {mode_hz:.2f} Hz = {60.0 * mode_hz:.0f} camshaft rpm; "
        f"the cam turns at {share:.2f} of that."
    )
    return [deviation, mode]


def claim_table(claims: Iterable[Claim]) -> Table:
    """Return the table of the paper's claims and the computed results."""
    made = create_table("What the paper says, and this computation")
    for head in ("the paper", "reproduced", "computed"):
        made.add_column(head, justify="left")
    for claim in claims:
        made.add_row(claim.statement, "yes" if claim.reproduced else "no", claim.finding)
    return made
