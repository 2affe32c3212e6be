"""Table of what endangers a speed."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from flexcam.linalg import FloatArray
from flexcam.stability import Discrete, Resonance, Stability
from flexcam.terminal import facts, table
from flexcam.units import RPM, shaft_name, shaft_speed

_SHOWN = 5

_WORDS = {
    "broken off": "the run at this speed ended early, so contacts are judged by what there is of it",
    "numerical": "the time integration itself grows: take a smaller step or an unconditionally stable integrator",
    "parametric": "disturbances of the periodic motion grow from revolution to revolution",
    "resonance": "a harmonic of the cam meets a mode",
    "contact loss": "the follower is off its cam on the lift, or would have to be pulled",
}


def stability_table(found: Stability, scale: float) -> Table:
    """Return what endangers a speed."""
    rows = [
        ("integrator", _integrated(found.discrete)),
        ("periodic motion", _grows(found)),
        ("off the cam", f"{math.degrees(found.open_on_the_lift):.3g} deg of the lift"),
        ("resonances", _counted(found, scale)),
        *((_named(found, one), _met(one, scale)) for one in found.within[:_SHOWN]),
        ("verdict", "; ".join(f"{one}: {_WORDS[one]}" for one in found.verdict) or _calm(found)),
    ]  # fmt: skip
    return facts(f"Stability at {shaft_speed(found.rpm * RPM, scale)}", rows)


def _calm(found: Stability) -> str:
    skipped = [] if found.discrete.looked_at else ["the integrator"]
    skipped += ["the growth of disturbances"] if found.floquet is None else []
    return "nothing endangers this speed" + (f", but {' and '.join(skipped)} could not be looked at" if skipped else "")


def _integrated(found: Discrete) -> str:
    if not found.looked_at:
        return "not looked at"
    words = f"spectral radius {found.radius:.9g}, largest at {found.frequency:.5g} Hz ({', '.join(found.moving)})"
    return words + (f"; steps up to {found.critical_step:.4g} s" if math.isfinite(found.critical_step) else "")


def _named(found: Stability, one: Resonance) -> str:
    """Return a harmonic, and where there are several cams, the contact whose it is."""
    several = len({other.contact for other in found.resonances}) > 1
    return f"harmonic {one.harmonic}" + (f", {one.contact}" if several else "")


def _met(one: Resonance, scale: float) -> str:
    sizes = f"{1e3 * one.amplitude:.3g} mm, {one.load:.3g} N"
    return f"{scale * one.rpm:.5g} {shaft_name(scale)} rpm, {one.frequency:.5g} Hz, {sizes}: {one.words}"


def _counted(found: Stability, scale: float) -> str:
    """Return how many resonances there are up to the highest speed that is asked for, and above."""
    count = len(found.within)
    rpm = f"{shaft_name(scale)} rpm"
    words = f"{count or 'none'} up to {scale * found.highest:.5g} {rpm}"
    if count > _SHOWN:
        words += f", of which the nearest {_SHOWN} are listed"
    if not found.beyond:
        return words
    return f"{words}; {len(found.beyond)} above, the lowest at {scale * found.beyond[0].rpm:.6g} {rpm}"


def _grows(found: Stability) -> str:
    if found.floquet is None:
        return f"not looked at: {found.why_not}"
    largest, moving = abs(complex(found.floquet.multipliers[0])), ", ".join(found.floquet.moving())
    if found.chatters:
        events = found.floquet.events
        return f"chatters: with {events} openings and closings small differences grow by {largest:.3g} ({moving})"
    return f"largest multiplier {largest:.6g}, growth {found.floquet.growth:.4g} 1/s ({moving})"


def stability_json(found: Stability, scale: float) -> dict[str, object]:
    """Return the same as ``--json`` prints it."""
    multipliers = [] if found.floquet is None else [[one.real, one.imag] for one in found.floquet.multipliers.tolist()]
    return {
        "shaft": shaft_name(scale), "rpm": scale * found.rpm,
        "run": str(found.status.cause), "spectral_radius": found.discrete.radius,
        "endangered_mode_hz": found.discrete.frequency, "endangered_moves": list(found.discrete.moving),
        "critical_step_s": found.discrete.critical_step if math.isfinite(found.discrete.critical_step) else None,
        "multipliers": multipliers, "growth": None if found.floquet is None else found.floquet.growth,
        "chatters": found.chatters, "note": found.why_not, "open_on_the_lift_deg": math.degrees(found.open_on_the_lift),
        "resonances": [
            {"contact": one.contact, "rpm": scale * one.rpm, "harmonic": one.harmonic, "amplitude_m": one.amplitude,
             "load_n": one.load, "frequency_hz": one.frequency, "moves": one.words}
            for one in found.within[: 4 * _SHOWN]
        ],
        "resonances_up_to_rpm": scale * found.highest, "resonances_within": len(found.within),
        "resonances_above": len(found.beyond),
        "next_resonance_rpm": scale * found.beyond[0].rpm if found.beyond else None,
        "verdict": list(found.verdict),
    }  # fmt: skip


def growth_table(found: Sequence[Stability], scale: float) -> Table:
    """Return what endangers each of several speeds."""
    heads = (f"{shaft_name(scale)} rpm", "spectral radius", "multiplier", "growth, 1/s", "off the cam, deg", "verdict")
    return table("Stability over speed", heads, (_row(one, scale) for one in found))


def _row(one: Stability, scale: float) -> list[str]:
    largest = "" if one.floquet is None else f"{abs(complex(one.floquet.multipliers[0])):.6g}"
    growth = "" if one.floquet is None else f"{one.floquet.growth:.4g}"
    opened = f"{math.degrees(one.open_on_the_lift):.3g}"
    words = ", ".join([*one.verdict, *(["chatter"] if one.chatters else [])]) or "-"
    return [f"{scale * one.rpm:.6g}", f"{one.discrete.radius:.9g}", largest, growth, opened, words]


def growths(found: Sequence[Stability]) -> FloatArray:
    """Return the growth rates of several speeds."""
    return np.array([math.nan if one.floquet is None else one.floquet.growth for one in found])


def dangers(found: Sequence[Stability]) -> dict[str, NDArray[np.bool_]]:
    """Return which of several speeds each cause endangers."""
    named = {cause: np.array([cause in one.verdict for one in found]) for cause in _WORDS}
    return {**named, "chatter": np.array([one.chatters for one in found])}
