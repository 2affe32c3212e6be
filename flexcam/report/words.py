"""A result in sentences: what was modelled, what came out, what is doubtful."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from flexcam.console.cases import comparison_words, couplings, left_out
from flexcam.console.results import unknowns
from flexcam.fidelity import Comparison
from flexcam.limits import Margins
from flexcam.report.subject import Known, Subject
from flexcam.train import Figure
from flexcam.units import RPM, shaft_speed

_SAME_LIFT = 0.01
_SAME_ACCELERATION = 0.1
"""Parts by which a flexible train may differ for a rigid one to tell the same."""

_MODELS = {
    "beams": "flexible beams", "rigid": "rigid members", "sdof": "one mass", "chain": "a chain of masses",
}  # fmt: skip


def modelled(about: Subject, known: Known, figures: Sequence[Figure] = ()) -> list[str]:
    """Return what was modelled, and what was left out of the run."""
    case, ready, response = known.case, known.ready, about.result.response
    record = case.record
    kind = _MODELS.get(record.fidelity.model, record.fidelity.model)
    if record.fidelity.modes is not None:
        kind += f" in {record.fidelity.modes} shapes"
    per = 2.0 * math.pi / (case.speed * ready.problem.step)
    turned = f"{float(np.ptp(response.angle)) / (2.0 * math.pi):.4g}" if len(response.angle) else "0"
    covers = f"{turned} revolution{'' if turned == '1' else 's'}"
    parts = ", ".join(
        _count(len(table), word)
        for word, table in (("member", record.members), ("mass", record.masses), ("spring", record.springs),
                            ("rocker", record.rockers), ("cam", record.cams), ("contact", record.contacts))
        if table
    )  # fmt: skip
    said = [
        f"Modelled with {kind}: {parts}.",
        (
            f"Run at {case.told_speed} for {covers} of the camshaft, in {response.stats.steps} steps "
            f"({per:.6g} per revolution) of {unknowns(known.response)}."
        ),
    ]
    said += couplings(case, figures)
    left = left_out(ready)
    return [*said, f"Left out of the run, as nothing moves it: {'; '.join(left)}."] if left else said


def _count(number: int, word: str) -> str:
    if number == 1:
        return f"1 {word}"
    return f"{number} {word}es" if word.endswith("s") else f"{number} {word}s"


def verdict(compared: Comparison) -> list[str]:
    """Return whether a rigid train would have told the same."""
    off, ratio = compared.peak_deviation, compared.peak_acceleration_ratio
    same = off <= _SAME_LIFT and abs(ratio - 1.0) <= _SAME_ACCELERATION
    bounds = f"{100 * _SAME_LIFT:g} % of the lift, {100 * _SAME_ACCELERATION:g} % of the largest acceleration"
    said = "A rigid train would tell nearly the same" if same else "A rigid train would not tell the same"
    return [f"{said} (held against {bounds}).", *comparison_words(compared, None)]


def left_in_hand(margins: Margins, turns: float) -> list[str]:
    """Return what the train has in hand at its speed."""
    said: list[str] = []
    if margins.rigid_rpm is not None and margins.spring is not None:
        said.append(
            f"A rigid train would leave its cam at {shaft_speed(margins.rigid_rpm * RPM, turns)}; at this speed its "
            f"springs push {1.0 + margins.spring:.3g} times what its inertia asks for."
        )
    said += [
        f"The buckling load of {name} is {margin:.3g} times its compression at full lift, at rest."
        for name, margin in margins.buckling.items()
    ]
    return said
