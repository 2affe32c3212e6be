"""Table of the speed limits of a train."""

from __future__ import annotations

import math

from rich.table import Table

from flexcam.analysis.limits import LIMITS, Limits
from flexcam.core.units import shaft_name
from flexcam.report.terminal import plain_table


def limits_json(found: Limits, scale: float) -> dict[str, object]:
    """Return the speed limits of a train for ``--json``."""
    width = max(one.tolerance_rpm for one in found.limits.values())
    rpm = {name: one.rpm for name, one in found.limits.items()}
    met = {f"{name}_rpm": None if (at := rpm.get(name)) is None else scale * at for name in LIMITS}
    return {
        **met, "first": found.first, "shaft": shaft_name(scale),
        "tolerance_rpm": None if math.isinf(width) else scale * width,
        "rigid_loss_of_contact_rpm": None if found.rigid_rpm is None else scale * found.rigid_rpm,
        "spring_margin": found.spring_margin, "buckling_margins": dict(found.buckling_margins),
        "lowest_rpm": scale * found.lowest_rpm, "highest_rpm": scale * found.highest_rpm,
    }  # fmt: skip


def limits_table(found: Limits, scale: float) -> Table:
    """Return the table of the speed limits of a train."""
    high = scale * found.highest_rpm
    ordered = sorted(found.limits.items(), key=lambda item: item[1].rpm or float("inf"))
    rows = [
        (name.replace("_", " "), f"not up to {high:.6g}" if one.rpm is None else f"{scale * one.rpm:.6g}",
         "" if one.rpm is None or math.isinf(one.tolerance_rpm) else f"{scale * one.tolerance_rpm:.3g}", one.words)
        for name, one in ordered
    ]  # fmt: skip
    if found.rigid_rpm is not None:
        words = "a rigid train would leave its cam: its inertia equals its springs"
        rows.append(("(rigid train)", f"{scale * found.rigid_rpm:.6g}", "", words))
    if found.spring_margin is not None:
        rows.append(("spring margin", f"{found.spring_margin:.1%}", "", "of the rigid train at the case's speed"))
    rows += [
        (f"{name}, margin", f"{margin:.3g}", "", "buckling load by the compression at full lift, at rest")
        for name, margin in found.buckling_margins.items()
    ]
    shaft = shaft_name(scale)
    return plain_table("What gives way, and when", ("limit", f"{shaft} rpm", "within", "what happens"), rows)
