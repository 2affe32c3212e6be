"""Tables about laws and lifts that were found."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rich.table import Table

from flexcam.console.words import NOISE, mm
from flexcam.design import HarmonicCam, PolydyneCam
from flexcam.linalg import FloatArray
from flexcam.motion import event_extremes
from flexcam.synthesis import Synthesized
from flexcam.terminal import facts, table
from flexcam.units import RPM


def synthesis_json(found: Synthesized) -> dict[str, object]:
    """Return a law found as ``--json`` prints it."""
    c = found.criteria
    return {
        "family": found.family, "objective": found.objective, "family_bound": found.bound, "gap": found.gap,
        "bound_over_all_laws": found.bound_all, "Cv": c.Cv, "Ca": c.Ca, "Cj": c.Cj, "Cm": c.Cm, "rms": c.rms[1],
        "broken": list(c.broken), "converged": found.converged, "not_converged": list(found.open),
    }  # fmt: skip


LEGEND = (
    "C_v, C_a, C_j: largest velocity, acceleration and jerk of the law, lift 1 over angle 1; "
    "C_m: largest product of velocity and acceleration, which the torque of inertia follows"
)
"""What the heads of the tables of laws mean."""


def synthesis_table(found: Synthesized) -> Table:
    """Return a law found, and how good it is."""
    c = found.criteria
    bound = "none: this objective is not convex, the law is the best nearby"
    if found.bound is not None and found.gap is not None:
        bound = f"{found.bound:.9g}; the law is at most {found.gap:.1e} above it (duality gap)"
    every = "not known"
    if found.bound_all:
        above = 100.0 * (found.objective / found.bound_all - 1.0)
        every = f"{found.bound_all:.6g}; the law is {above:.2f} % above it"
    rows = [
        ("objective", f"{found.objective:.9g}"),
        *(("not converged", said) for said in found.open),
        ("no law of the family has less than", bound),
        ("no law at all has less than", every),
        ("C_v, C_a, C_j, C_m", ", ".join("infinite" if x is None else f"{x:.6g}" for x in (c.Cv, c.Ca, c.Cj, c.Cm))),
        *(("not met", said) for said in c.broken),
    ]
    return facts(f"Best of {found.family}", rows)


def pareto_table(front: Sequence[Synthesized]) -> Table:
    """Return a front of laws."""
    rows = [
        (str(i), *(f"{x:.5g}" if x is not None else "infinite" for x in (c.Cv, c.Ca, c.Cj, c.Cm)),
         "-" if one.gap is None else f"{one.gap:.0e}", "yes" if one.converged else "no")
        for i, one in enumerate(front, start=1) for c in [one.criteria]
    ]  # fmt: skip
    return table(f"Pareto front of {front[0].family}", ("no.", "C_v", "C_a", "C_j", "C_m", "gap", "converged"), rows)


def harmonic_table(found: HarmonicCam) -> Table:
    """Return a cam of few harmonics."""
    fit = found.fit
    rows = [
        (
            "harmonics",
            f"{found.count}; {found.limit} lie below the first mode, {found.frequency / (2.0 * math.pi):.4g} Hz",
        ),
        ("distance in the dwells", f"{1e6 * fit.strict_deviation:.4g} um"),
        ("distance elsewhere", f"{1e6 * fit.deviation:.4g} um, {1e6 * fit.rms_deviation:.4g} um rms"),
        ("lift", " to ".join(mm(end.value) for end in event_extremes(fit.event)) + " mm"),
    ]
    return facts("Lift of few harmonics", rows)


def polydyne_table(found: PolydyneCam) -> Table:
    """Return a polydyne cam at its speed and off it."""
    rows = [
        (f"{speed / RPM:.6g}", _micrometres(plain), _micrometres(compensated))
        for speed, plain, compensated in zip(
            found.speeds.tolist(), found.plain.tolist(), found.compensated.tolist(), strict=True
        )
    ]
    head = ("camshaft rpm", "plain cam, um", "polydyne cam, um")
    title = "Distance of the train's end from the wanted motion"
    return table(f"{title}; design speed: camshaft {found.speed / RPM:.6g} rpm", head, rows)


def _micrometres(value: float) -> str:
    return f"{1e6 * value:.4g}" if math.isfinite(value) else "resonance"


def polydyne_facts(found: PolydyneCam) -> Table:
    """Return what a polydyne cam is by itself."""
    design = found.design
    lift, bend, count = event_extremes(design.event), event_extremes(design.event, 2), len(design.event.cosine)
    rows = [
        ("lift", f"{mm(lift[0].value)} to {mm(lift[1].value)} mm"),
        ("acceleration", f"{mm(bend[0].value, 5)} to {mm(bend[1].value, 5)} mm/rad^2"),
        ("left out", f"{1e6 * design.left_out:.3g} um of the wanted motion, at the cam, by {count} harmonics"),
    ]  # fmt: skip
    if lift[0].value < -NOISE * lift[1].value:
        below = f"the cam is cut {mm(-lift[0].value, 4)} mm into its base circle"
        rows.append(("attention", f"{below}; put as much on the base circle's radius, or ask for a smoother motion"))
    return facts("Polydyne cam", rows)


def or_null(values: FloatArray) -> list[float | None]:
    """Return numbers for JSON, which knows no infinite ones."""
    return [value if math.isfinite(value) else None for value in values.tolist()]
