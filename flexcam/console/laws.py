"""Tables about motion laws."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict

from rich.table import Table

from flexcam.console.words import clear
from flexcam.motion import Criteria, Extreme
from flexcam.terminal import facts, table

_CURVES = (("velocity", "s'"), ("acceleration", "s''"), ("jerk", "s'''"), ("moment", "s' s''"))


def law_json(found: Criteria) -> dict[str, object]:
    """Return the criteria of a law as ``--json`` prints them."""
    ends = {f"z={z}": dict(zip(("s", "s'", "s''", "s'''"), end, strict=True)) for z, end in enumerate(found.ends)}
    return {
        "Cv": found.Cv, "Ca": found.Ca, "Cj": found.Cj, "Cm": found.Cm,
        "extremes": {name: [asdict(one) for one in getattr(found, name)] for name, _ in _CURVES},
        "jumps": list(found.jumps), "end_conditions": ends, "rest_at_ends": found.rest_at_ends,
        "symmetric": found.symmetric, "broken": list(found.broken), "rms": list(found.rms),
        "harmonics": list(found.harmonics),
    }  # fmt: skip


def law_facts(name: str, found: Criteria) -> Table:
    """Return the facts of one law."""
    criteria = (("C_v", found.Cv), ("C_a", found.Ca), ("C_j", found.Cj), ("C_m", found.Cm))
    rows = [("criteria", ", ".join(f"{n} {'infinite' if x is None else f'{x:.6g}'}" for n, x in criteria))]
    rows += [
        (f"{symbol} ({curve})", f"{_place(low)}, {_place(high)}")
        for curve, symbol in _CURVES
        for low, high in [getattr(found, curve)]
    ]
    steps = ", ".join(_CURVES[order - 1][0] for order in found.jumps)
    peaks = [1.0, *(max(abs(one.value) for one in getattr(found, curve)) for curve, _ in _CURVES[:3])]
    ends = [", ".join(f"{clear(v, peak):.6g}" for v, peak in zip(end, peaks, strict=True)) for end in found.ends]
    largest = max(found.harmonics, default=0.0)
    rows += [
        ("steps inside", steps or "none"),
        ("s, s', s'', s''' at z = 0", ends[0]),
        ("s, s', s'', s''' at z = 1", ends[1]),
        ("symmetric", "yes" if found.symmetric else "no"),
        ("rms of s', s'', s'''", ", ".join(f"{value:.6g}" for value in found.rms)),
        ("harmonics of s''", ", ".join(f"{clear(value, largest):.3g}" for value in found.harmonics)),
        *(("not met between dwells", said) for said in found.broken),
    ]
    return facts(f"Motion law {name}", rows)


def _place(extreme: Extreme) -> str:
    return f"{extreme.value:.6g} at z = {', '.join(f'{z:.6f}' for z in (extreme.at, *extreme.also))}"


def laws_table(found: Mapping[str, Criteria]) -> Table:
    """Return all laws side by side."""
    rest = ("none", "s'", "s' s''", "s' s'' s'''")
    rows = [
        (name, *(f"{x:.4f}" for x in (c.Cv, c.Ca)), "infinite" if c.Cj is None else f"{c.Cj:.3f}", f"{c.Cm:.4f}",
         rest[c.rest_at_ends])
        for name, c in found.items()
    ]  # fmt: skip
    return table("Motion laws, lift 1 over angle 1", ("law", "C_v", "C_a", "C_j", "C_m", "zero at both ends"), rows)


def spectrum_table(spectra: Mapping[str, Sequence[float]], ratios: Sequence[float]) -> Table:
    """Return residual vibrations side by side."""
    rows = [(name, *(f"{value:.6f}" for value in values)) for name, values in spectra.items()]
    return table("Residual vibration over lift, by rise time over period", ("law", *(f"{r:g}" for r in ratios)), rows)
