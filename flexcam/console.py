"""Tables and words of every command; `commands` prints what these functions return."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict

import numpy as np
import tomli_w
from rich.table import Table

from flexcam.case import Case
from flexcam.fidelity import Claim, Comparison
from flexcam.io import Result
from flexcam.linalg import FloatArray
from flexcam.motion import Criteria
from flexcam.response import Response
from flexcam.runner import Prepared
from flexcam.terminal import bare, facts, table
from flexcam.train import MemberStrength, ModelModes, member_masses

COUPLINGS = {
    "published-load": (
        "This result comes from the published load: the cam drives the follower by a force, so the follower is a mass "
        "on the retaining spring. A train held in contact does not behave like this near that resonance."
    ),
}
"""Which formulation a result comes from, in words."""


def resolved(case: Case) -> str:
    """Return the case with every default filled in, as TOML, SI.

    Parameters
    ----------
    case
        The case.

    Returns
    -------
    str
        TOML text.
    """
    return tomli_w.dumps(case.record.model_dump(mode="json", by_alias=True, exclude_none=True))


def strength_table(members: Mapping[str, MemberStrength]) -> Table:
    """Return the most stressed place of every member.

    Parameters
    ----------
    members
        From a `StrengthSink`.

    Returns
    -------
    Table
        For rich.
    """
    rows = [
        (name, f"{one.von_mises / 1e6:.4g}", f"{one.mean / 1e6:.4g}", f"{one.alternating / 1e6:.4g}",
         "not stated" if one.safety is None else f"{one.safety:.3g}", one.place)
        for name, one in members.items()
    ]  # fmt: skip
    head = ("stress, MPa", "von Mises", "mean", "alternating", "fatigue safety", "at")
    return table("Stresses at the saved instants", head, rows)


def mac_table(likeness: FloatArray) -> Table:
    """Return a table of the modal assurance criterion.

    Parameters
    ----------
    likeness
        Shape (modes here, modes there).

    Returns
    -------
    Table
        For rich.
    """
    rows = [(str(i + 1), *(f"{value:.2f}" for value in row)) for i, row in enumerate(likeness)]
    return table("Modal assurance criterion", ("here / there", *map(str, range(1, likeness.shape[1] + 1))), rows)


def info_table(result: Result) -> Table:
    """Return what a result file holds.

    Parameters
    ----------
    result
        The result.

    Returns
    -------
    Table
        For rich.
    """
    response = result.response
    about = [(name, text) for name, text in result.about.items() if name not in ("case", "resolved", "overrides")]
    rows = [
        ("run", str(response.status)),
        ("steps", f"{response.stats.steps} of {response.stats.unknowns} unknowns, {response.stats.seconds:.3g} s"),
        ("saved", f"{len(response.time)} instants of the probes, {len(response.field_time)} of the fields"),
        ("probes", ", ".join(name for name, _ in response.outline.probes) or "none"),
        ("channels", ", ".join(f"{name} [{unit}]" for name, unit in response.outline.channels) or "none"),
        ("fields", ", ".join([*result.field_names, *result.recovered])),
        ("members", ", ".join(f"{name} ({len(line) - 1})" for name, line in result.mesh.lines.items())),
        *about,
        ("overrides", ", ".join(json.loads(result.about["overrides"])) or "none"),
    ]
    return facts("Result", rows)


def couplings(case: Case) -> list[str]:
    """Return which formulation of the contact a result comes from, in words.

    Parameters
    ----------
    case
        The case.

    Returns
    -------
    list
        A sentence per kind of contact.
    """
    return [COUPLINGS[m] for m in dict.fromkeys(contact.model for contact in case.record.contacts.values())]


def model_table(ready: Prepared, modes: ModelModes) -> Table:
    """Return what a model contains.

    Parameters
    ----------
    ready
        A prepared case.
    modes
        Its lowest modes.

    Returns
    -------
    Table
        For rich.
    """
    model, problem = ready.model, ready.problem
    lowest = [f"{f:.4g}" for f in modes.modes.frequencies[modes.modes.rigid :][:5]]
    per_revolution = 2.0 * math.pi / (ready.case.speed * problem.step)
    rows = [
        ("members", ", ".join(f"{name} {mass:.4g} kg" for name, mass in member_masses(model).items())),
        ("elements", str(len(model.mesh.elements()))),
        ("degrees of freedom", str(problem.system.size)),
        ("masses", ", ".join(f"{name} {part.body.mass:g} kg" for name, part in model.masses.items()) or "none"),
        ("springs", ", ".join(f"{name} {s.stiffness:g} N/m" for name, s in model.springs.items()) or "none"),
        ("supports", ", ".join(f"{point}: {' '.join(held)}" for point, held in model.supports.items()) or "none"),
        *(
            (f"rocker {n}", f"{r.start} to {r.point}, ratio {r.ratio:g}, along {_vector(r.direction)}")
            for n, r in model.rockers.items()
        ),
        *((f"cam {n}", f"at {c.at}, lift {1e3 * c.event.lift:g} mm") for n, c in model.cams.items()),
        *(
            (f"contact {n}", f"{c.cam} lifts {c.follower} along {_vector(c.direction)}")
            for n, c in model.contacts.items()
        ),
        *_weight(ready),
        ("camshaft speed", f"{rpm(ready.case):g} rpm"),
        ("steps", f"{problem.steps} of {problem.step:.4g} s ({per_revolution:.6g} per revolution)"),
        ("free motions", _free_motions(modes)),
        ("lowest frequencies", ", ".join(lowest) + " Hz" if lowest else "none"),
    ]
    return facts(ready.case.record.title or ready.case.name, rows)


def _weight(ready: Prepared) -> list[tuple[str, str]]:
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


def rpm(case: Case) -> float:
    """Return the camshaft speed of a case.

    Parameters
    ----------
    case
        The case.

    Returns
    -------
    float
        rpm, free of rounding in the last digits.
    """
    return round(case.speed * 30.0 / math.pi, 9)


def mode_table(modes: ModelModes) -> Table:
    """Return frequencies, effective masses and what moves.

    Parameters
    ----------
    modes
        The modes.

    Returns
    -------
    Table
        For rich.
    """
    made = table("Modes", ("no.", "Hz", "rpm", "ux kg", "uy kg", "uz kg"), ())
    made.add_column("what moves (share of the kinetic energy)", justify="left")
    for i, frequency in enumerate(modes.modes.frequencies):
        masses = [f"{m:.4f}" for m in modes.effective[i, :3]]
        made.add_row(str(i + 1), f"{frequency:.2f}", f"{60.0 * frequency:.0f}", *masses, modes.words(i))
    return made


def run_table(case: Case, response: Response) -> Table:
    """Return the extremes of every probe.

    Parameters
    ----------
    case
        The case.
    response
        Its response.

    Returns
    -------
    Table
        For rich.
    """
    rows: list[tuple[str, ...]] = []
    for name, components in response.outline.probes:
        for component in components:
            full = name if len(components) == 1 else f"{name}.{component}"
            moved = response[full].displacement
            unit = "mrad" if component.startswith("r") else "mm"
            if len(moved) and round(1e3 * float(np.abs(moved).max()), 4) > 0.0:
                rows.append((full, *(f"{round(1e3 * x, 4) + 0.0:.4f} {unit}" for x in (moved.min(), moved.max()))))
    title = f"{case.record.title or case.name}, {rpm(case):g} rpm"
    return table(title, ("probe", "least", "largest"), rows or [("no probe moves", "", "")])


def comparison_table(comparison: Comparison) -> Table:
    """Return flexible against rigid.

    Parameters
    ----------
    comparison
        The comparison.

    Returns
    -------
    Table
        For rich.
    """
    units = {"displacement": ("mm", 1e3), "velocity": ("m/s", 1.0), "acceleration": ("m/s^2", 1.0)}
    rows: list[tuple[str, ...]] = []
    for one in comparison.deviations:
        unit, scale = units[one.quantity]
        figures = [f"{scale * v:.4g}" for v in (one.rigid_peak, one.flexible_peak, one.peak, one.rms)]
        rows.append((f"{one.quantity}, {unit}", *figures, f"{one.of_rigid:.3f}", f"{one.angle_deg:.1f}"))
    head = ("", "rigid peak", "flexible peak", "peak deviation", "rms deviation", "of rigid peak", "at cam deg")
    return table(f"Flexible against rigid at {comparison.probe}, {comparison.speed_rpm:g} rpm", head, rows)


def comparison_words(comparison: Comparison, mode_hz: float | None) -> list[str]:
    """Return the comparison in words.

    Parameters
    ----------
    comparison
        The comparison.
    mode_hz
        The loaded mode nearest the cam speed, Hz; None where nothing is loaded.

    Returns
    -------
    list
        Sentences.
    """
    deviation = (
        f"The {comparison.probe} deviates by up to {comparison.peak_deviation:.3f} of its lift "
        f"(rms {comparison.rms_deviation:.3f}); its peak acceleration is {comparison.peak_acceleration_ratio:.2f} "
        "times the rigid one."
    )
    if mode_hz is None:
        return [deviation]
    share = comparison.speed_rpm / (60.0 * mode_hz)
    mode = (
        f"The loaded mode nearest the cam speed is {mode_hz:.2f} Hz = {60.0 * mode_hz:.0f} rpm; "
        f"the cam turns at {share:.2f} of that."
    )
    return [deviation, mode]


def claim_table(claims: Iterable[Claim]) -> Table:
    """Return the paper's claims and what was computed.

    Parameters
    ----------
    claims
        The claims.

    Returns
    -------
    Table
        For rich.
    """
    made = bare("What the paper says, and this computation")
    for head in ("the paper", "reproduced", "computed"):
        made.add_column(head, justify="left")
    for claim in claims:
        made.add_row(claim.statement, "yes" if claim.reproduced else "no", claim.finding)
    return made


_CURVES = (("velocity", "s'"), ("acceleration", "s''"), ("jerk", "s'''"), ("moment", "s' s''"))


def law_json(found: Criteria) -> dict[str, object]:
    """Return the criteria of a law as ``--json`` prints them.

    Parameters
    ----------
    found
        The criteria.

    Returns
    -------
    dict
        Keys ``Cv Ca Cj Cm extremes end_conditions symmetric``; an infinite jerk is null.
    """
    ends = {f"z={z}": dict(zip(("s", "s'", "s''", "s'''"), end, strict=True)) for z, end in enumerate(found.ends)}
    return {
        "Cv": found.Cv, "Ca": found.Ca, "Cj": found.Cj, "Cm": found.Cm,
        "extremes": {name: [asdict(one) for one in getattr(found, name)] for name, _ in _CURVES},
        "jumps": list(found.jumps), "end_conditions": ends, "rest_at_ends": found.rest_at_ends,
        "symmetric": found.symmetric,
    }  # fmt: skip


def law_facts(name: str, found: Criteria) -> Table:
    """Return the facts of one law.

    Parameters
    ----------
    name
        Of the law.
    found
        Its criteria.

    Returns
    -------
    Table
        For rich.
    """
    rows = [
        (f"{symbol} ({curve})", f"{low.value:.6g} at z = {low.at:.6f}, {high.value:.6g} at z = {high.at:.6f}")
        for curve, symbol in _CURVES
        for low, high in [getattr(found, curve)]
    ]
    steps = ", ".join(_CURVES[order - 1][0] for order in found.jumps)
    ends = [", ".join(f"{value:.6g}" for value in end) for end in found.ends]
    rows += [
        ("steps inside", steps or "none"),
        ("s, s', s'', s''' at z = 0", ends[0]),
        ("s, s', s'', s''' at z = 1", ends[1]),
        ("symmetric", "yes" if found.symmetric else "no"),
    ]
    return facts(f"Motion law {name}", rows)


def laws_table(found: Mapping[str, Criteria]) -> Table:
    """Return all laws side by side.

    Parameters
    ----------
    found
        Criteria by law.

    Returns
    -------
    Table
        For rich.
    """
    rest = ("none", "s'", "s' s''", "s' s'' s'''")
    rows = [
        (name, *(f"{x:.4f}" for x in (c.Cv, c.Ca)), "infinite" if c.Cj is None else f"{c.Cj:.3f}", f"{c.Cm:.4f}",
         rest[c.rest_at_ends])
        for name, c in found.items()
    ]  # fmt: skip
    return table("Motion laws, lift 1 over angle 1", ("law", "C_v", "C_a", "C_j", "C_m", "zero at both ends"), rows)
