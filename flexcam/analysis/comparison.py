"""Comparison of a flexible with a rigid response: maximum deviation of a probe and its cam angle."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from flexcam.core import FloatArray
from flexcam.core.errors import refuse
from flexcam.dynamics import SLOPES, History, Response, Status, peak, value_range


@dataclass(frozen=True)
class Deviation:
    """Deviation of one quantity from the rigid system.

    Parameters
    ----------
    quantity
        ``displacement``, ``velocity`` or ``acceleration``.
    peak, rms
        Maximum difference, of the dense output, and root mean square difference, SI.
    rigid_peak, flexible_peak
        Maximum absolute value of each system, SI.
    angle_deg
        Cam angle of the maximum difference, deg.
    """

    quantity: str
    peak: float
    rms: float
    rigid_peak: float
    flexible_peak: float
    angle_deg: float

    @property
    def relative_peak(self) -> float:
        """Maximum difference relative to the rigid peak."""
        return self.peak / self.rigid_peak if self.rigid_peak > 0.0 else 0.0


@dataclass(frozen=True)
class Comparison:
    """Comparison of a flexible with a rigid response at one probe.

    Parameters
    ----------
    probe
        Name of the probe.
    speed_rpm
        Camshaft speed, rpm.
    lift
        Lift of the rigid system at the probe, m.
    deviations
        Deviations of displacement, velocity and acceleration.
    status
        Status of the flexible run; the values of an incomplete run cover its finished part.
    names
        Names of the compared systems: the first replaces the flexible, the second the rigid one.
    """

    probe: str
    speed_rpm: float
    lift: float
    deviations: tuple[Deviation, Deviation, Deviation]
    status: Status
    names: tuple[str, str] = ("flexible", "rigid")

    @property
    def peak_deviation(self) -> float:
        """Maximum displacement difference relative to the lift."""
        return self.deviations[0].peak / self.lift

    @property
    def rms_deviation(self) -> float:
        """Root mean square displacement difference relative to the lift."""
        return self.deviations[0].rms / self.lift

    @property
    def peak_acceleration_ratio(self) -> float:
        """Ratio of the maximum accelerations of the flexible and the rigid system."""
        still = self.deviations[2].rigid_peak
        return self.deviations[2].flexible_peak / still if still > 0.0 else 0.0


def compare(flexible: Response, rigid: Response, probe: str, speed_rpm: float) -> Comparison:
    """Compare a flexible with a rigid response at a scalar probe.

    Parameters
    ----------
    flexible, rigid
        Responses at the same instants; an incomplete flexible response is compared over its own length.
    probe
        Name of the probe, such as ``"valve"`` or ``"tappet.uy"``.
    speed_rpm
        Camshaft speed, rpm, stored in the comparison.

    Returns
    -------
    Comparison
        Deviations of displacement, velocity and acceleration.

    Raises
    ------
    InputError
        If the probe is not scalar, or the rigid system does not move there.

    Examples
    --------
    ``compare(flexcam.run(case), flexcam.run(case, rigid=True), "valve", 3000.0).peak_deviation``
    """
    count = len(flexible.time)
    if not np.array_equal(flexible.time, rigid.time[:count]):
        raise refuse(
            "responses", "responses at different instants", "the same instants", "they are compared one by one"
        )
    moved, still = flexible[probe], rigid[probe]
    if moved.displacement.ndim != 1:
        raise refuse("probe", repr(probe), "one scalar: " + ", ".join(f"{probe}.{c}" for c in moved.components))
    lift = value_range(rigid.time, still.displacement, still.velocity)
    if lift == 0.0:
        why, remedy = "nothing moves it in what is compared with", "add a follower's point to output.probes"
        raise refuse("probe", repr(probe), "a point that the cam moves", why, remedy)
    found = [_compute_deviation(name, moved, still, flexible) for name in ("displacement", "velocity", "acceleration")]
    return Comparison(probe, speed_rpm, lift, (found[0], found[1], found[2]), flexible.status)


def compare_responses(
    one: Response, other: Response, probe: str, speed_rpm: float, names: tuple[str, str]
) -> Comparison:
    """Compare two responses over their common time, at the instants of the first."""
    first, last = max(one.time[0], other.time[0]), min(one.time[-1], other.time[-1])
    times = one.time[(one.time >= first) & (one.time <= last)]
    if len(times) < _MIN_INSTANTS:
        raise refuse("responses", "no time in common", "runs that overlap", "they are compared instant by instant")
    both = one.at(times), other.at(times)
    if np.abs(both[0].angle - both[1].angle).max() > _SAME_ANGLE:
        raise refuse("responses", "the cam at different angles", "runs at one speed", "they are compared at one time")
    return replace(compare(*both, probe, speed_rpm), names=names)


_MIN_INSTANTS = 2
_SAME_ANGLE = 1e-6
"""Tolerance for equal cam angles, rad."""


def _compute_deviation(quantity: str, moved: History, still: History, flexible: Response) -> Deviation:
    time = flexible.time
    (flexed, flexing), (rigid, turning) = (_values_and_slopes(one, quantity, len(time)) for one in (moved, still))
    difference = flexed - rigid
    largest, at = peak(time, difference, None if flexing is None or turning is None else flexing - turning)
    return Deviation(
        quantity,
        peak=largest,
        rms=float(np.sqrt(np.mean(difference**2))),
        rigid_peak=peak(time, rigid, turning)[0],
        flexible_peak=peak(time, flexed, flexing)[0],
        angle_deg=float(np.degrees(np.interp(at, time, flexible.angle))),
    )


def _values_and_slopes(history: History, quantity: str, count: int) -> tuple[FloatArray, FloatArray | None]:
    """Return the first `count` values of a quantity, and their slopes if the dense output has them."""
    slopes: FloatArray | None = getattr(history, SLOPES[quantity]) if quantity in SLOPES else None
    return getattr(history, quantity)[:count], None if slopes is None else slopes[:count]
