"""What a profile must not do: undercut, press too much to the side, be too hollow for what cuts it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from flexcam.cam.follower import Follower, RollerFollower, Turn
from flexcam.cam.profile import CamProfile, profile_at, profile_extremes
from flexcam.checks import InputError, positive, refuse
from flexcam.linalg import FloatArray
from flexcam.motion import Event

PRESSURE_ANGLE = math.radians(30.0)
"""Limit of the pressure angle of translating followers in common use (Norton, 2009, ch. 7)."""

_HALVINGS = 60
_ROUNDING = 1e-9
_BESIDE = 1e-8
"""Distance from a joint at which the side before it is looked at, rad."""


@dataclass(frozen=True)
class Finding:
    """Something a profile does that it should not.

    Parameters
    ----------
    what, remedy
        In words.
    angle
        Cam angle where it is worst, rad.
    value, limit
        What was found and what is allowed, SI.
    kind
        What is measured: an angle, rad, or a length, m.
    """

    what: str
    remedy: str
    angle: float
    value: float
    limit: float
    kind: Literal["angle", "length"] = "length"


def findings(
    profile: CamProfile, *, pressure_angle: float = PRESSURE_ANGLE, cutter: float | None = None, base_helps: bool = True
) -> list[Finding]:
    """Return what is wrong with a profile, each with the angle where it is worst, between its points too."""
    found: list[Finding] = []
    if cutter is not None:
        positive("cutter", cutter, "m")
    seen, follower = profile.extremes, profile.follower
    cut = seen.convex.value <= 0.0
    if cut:
        what = "undercut: the profile would cross itself"
        others = ["a smaller roller"] if math.isfinite(follower.roller_radius) else []
        remedy = _remedy([*others, "a longer event"], base_helps=base_helps)
        found.append(Finding(what, remedy, seen.convex.at, seen.convex.value, 0.0))
    steep = seen.pressure_angle
    if abs(steep.value) > pressure_angle * (1.0 + _ROUNDING):
        others = ["an offset"] if isinstance(follower, RollerFollower) else ["another pivot or arm"]
        remedy = _remedy([*others, "a longer event"], base_helps=base_helps)
        found.append(Finding("pressure angle too large", remedy, steep.at, abs(steep.value), pressure_angle, "angle"))
    if cutter is not None and not cut and seen.hollow is not None and seen.hollow.value < cutter:
        what = "the cutter is larger than the hollow it would have to cut"
        found.append(Finding(what, "take a smaller one", seen.hollow.at, seen.hollow.value, cutter))
    return found


def _remedy(others: list[str], *, base_helps: bool) -> str:
    """Return remedies as a sentence, a larger base circle first where it is one."""
    *first, last = [*(["a larger base circle"] if base_helps else []), *others]
    return f"take {', '.join(first)} or {last}" if first else f"take {last}"


def undercut(radius: FloatArray, follower: Follower) -> NDArray[np.bool_]:
    """Tell where a profile is undercut: its pitch curve bends more than the roller, or a flat face meets a hollow."""
    return (radius <= 0.0) & (radius >= -follower.roller_radius)


def minimum_base_radius(
    event: Event, follower: Follower, *, pressure_angle: float = PRESSURE_ANGLE, radius: float = 0.0,
    turn: Turn = 1, count: int = 1440,
) -> float:  # fmt: skip
    """Return the smallest base circle without undercut, within a pressure angle and with convex parts round enough."""
    high = 100.0 * positive("lift", event.height, "m")
    angles = np.union1d(np.linspace(0.0, 2.0 * math.pi, count, endpoint=False), _beside(event.joints))
    motion = event(angles), event(angles, 1), event(angles, 2)

    def fits(base: float) -> bool:
        try:
            made = profile_at(event, follower.with_base(base), angles, turn, motion)
        except InputError:  # the follower does not reach such a circle
            return False
        return _within(made, pressure_angle, radius)

    candidates = np.geomspace(1e-4 * high, high, 81)
    good = [fits(float(base)) for base in candidates]
    if not any(good):
        given = f"no base circle between {candidates[0]:.3g} and {high:.3g} m"
        raise refuse("base_radius", given, "one that meets the limits", "", "a longer event or wider limits")
    first = good.index(True)
    if first == 0:
        return 0.0
    low, high = float(candidates[first - 1]), float(candidates[first])
    least = _bisected(fits, low, high)
    # The worst angles lie between those looked at; they hardly move with the base circle, so one more look is enough.
    seen = profile_extremes(event, follower.with_base(least), turn)
    worst = (seen.convex.at, seen.pressure_angle.at)
    angles = np.union1d(angles, [*worst, *_beside(worst)])
    motion = event(angles), event(angles, 1), event(angles, 2)
    return least if fits(least) else _bisected(fits, least, high)


def _within(made: CamProfile, pressure_angle: float, radius: float) -> bool:
    """Tell whether a profile is within limits at its points."""
    if undercut(made.radius, made.follower).any() or float(np.abs(made.pressure_angle).max()) > pressure_angle:
        return False
    convex = made.radius > -made.follower.roller_radius
    return bool((made.radius[convex] >= radius).all())


def _beside(joints: Sequence[float]) -> list[float]:
    """Return angles on both sides of joints, rad."""
    return [at - step for at in joints for step in (0.0, _BESIDE)]


def _bisected(fits: Callable[[float], bool], low: float, high: float) -> float:
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if fits(middle) else (middle, high)
    return high
