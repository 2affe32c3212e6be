"""What a profile must not do: undercut, press too much to the side, be too hollow for what cuts it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexcam.cam.follower import Follower, Turn
from flexcam.cam.profile import CamProfile, cam_profile
from flexcam.checks import InputError, positive, refuse
from flexcam.linalg import FloatArray
from flexcam.motion import Event

PRESSURE_ANGLE = math.radians(30.0)
"""Limit of the pressure angle of translating followers in common use (Norton, 2009, ch. 7)."""

_HALVINGS = 60


@dataclass(frozen=True)
class Finding:
    """Something a profile does that it should not.

    Parameters
    ----------
    what
        In words, with the remedy.
    angle
        Cam angle where it is worst, rad.
    value, limit
        What was found and what is allowed, SI.
    """

    what: str
    angle: float
    value: float
    limit: float


def findings(
    profile: CamProfile, *, pressure_angle: float = PRESSURE_ANGLE, cutter: float | None = None
) -> list[Finding]:
    """Return what is wrong with a profile, each with the angle where it is worst.

    Parameters
    ----------
    profile
        The profile.
    pressure_angle
        Largest allowed, rad.
    cutter
        Radius of the cutter or grinding wheel, m; None for no check of it.

    Returns
    -------
    list
        Empty if nothing is.

    Examples
    --------
    >>> from flexcam.cam import FlatFollower
    >>> from flexcam.motion import LAWS, LiftEvent
    >>> steep = cam_profile(LiftEvent(LAWS["cycloidal"], 0.008, 0.8, 0.8), FlatFollower(0.012))
    >>> findings(steep)[0].what
    'undercut: the profile would cross itself; take a larger base circle or a longer event'
    """
    found: list[Finding] = []
    if cutter is not None:
        positive("cutter", cutter, "m")
    radius = profile.radius
    cut = undercut(radius, profile.follower)
    if cut.any():
        what = "undercut: the profile would cross itself; take a larger base circle or a longer event"
        found.append(_worst(what, profile.angle, np.where(cut, radius, np.inf), 0.0))
    press = np.abs(profile.pressure_angle)
    if float(press.max()) > pressure_angle:
        what = "pressure angle too large; take a larger base circle, an offset or a longer event"
        at = int(np.argmax(press))
        found.append(Finding(what, float(profile.angle[at]), float(press[at]), pressure_angle))
    if cutter is not None and not cut.any():
        hollow = np.where(radius < 0.0, -radius, np.inf)
        if float(hollow.min()) < cutter:
            what = "the cutter is larger than the hollow it would have to cut; take a smaller one"
            found.append(_worst(what, profile.angle, hollow, cutter))
    return found


def undercut(radius: FloatArray, follower: Follower) -> NDArray[np.bool_]:
    """Tell where a profile is undercut: its pitch curve bends more than the roller, or a flat face meets a hollow.

    Parameters
    ----------
    radius
        Radius of curvature of the profile, m.
    follower
        Its follower.

    Returns
    -------
    ndarray
        Shape as `radius`.
    """
    return (radius <= 0.0) & (radius >= -follower.roller_radius)


def _worst(what: str, angle: FloatArray, value: FloatArray, limit: float) -> Finding:
    at = int(np.argmin(value))
    return Finding(what, float(angle[at]), float(value[at]), limit)


def minimum_base_radius(
    event: Event, follower: Follower, *, pressure_angle: float = PRESSURE_ANGLE, radius: float = 0.0,
    turn: Turn = 1, count: int = 1440,
) -> float:  # fmt: skip
    """Return the smallest base circle without undercut, within a pressure angle and with convex parts round enough.

    Parameters
    ----------
    event
        Lift of the follower.
    follower
        Its base circle is varied, all else kept.
    pressure_angle
        Largest allowed, rad.
    radius
        Smallest radius of curvature allowed on convex parts, m.
    turn
        Sense of rotation.
    count
        Cam angles looked at.

    Returns
    -------
    float
        m.

    Raises
    ------
    InputError
        If no base circle up to a hundred lifts will do.

    Examples
    --------
    >>> from flexcam.cam import FlatFollower
    >>> from flexcam.motion import HarmonicLift
    >>> event = HarmonicLift(0.003, (-0.002,), (0.0,))
    >>> round(minimum_base_radius(event, FlatFollower(0.018), radius=0.002), 9)  # radius = base + 3 mm everywhere
    0.0
    """
    high = 100.0 * positive("lift", event.height, "m")

    def fits(base: float) -> bool:
        try:
            made = cam_profile(event, follower.with_base(base), count=count, turn=turn)
        except InputError:  # the follower does not reach such a circle
            return False
        convex = made.radius > -made.follower.roller_radius
        return not findings(made, pressure_angle=pressure_angle) and bool((made.radius[convex] >= radius).all())

    candidates = np.geomspace(1e-4 * high, high, 81)
    good = [fits(float(base)) for base in candidates]
    if not any(good):
        given = f"no base circle between {candidates[0]:.3g} and {high:.3g} m"
        raise refuse("base_radius", given, "one that meets the limits", "", "a longer event or wider limits")
    first = good.index(True)
    if first == 0:
        return 0.0
    low, high = float(candidates[first - 1]), float(candidates[first])
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if fits(middle) else (middle, high)
    return high
