"""Cam profiles: geometry from lift and follower, extremes and checks, and the lift from a given profile."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexcam.cams.followers import FlatFollower, Follower, FollowerContact, RollerFollower, Turn
from flexcam.cams.law_criteria import LIMIT_OFFSET, Extreme, curve_minimum, refine_minima
from flexcam.cams.lift_event import Event
from flexcam.core import ComplexArray, FloatArray
from flexcam.core.errors import InputError, finite_array, positive, refuse

_MAX_POINTS = 1_000_000
_STRAIGHT = 1e-9  # relative curvature of a roller's centre path, to that of the roller, that counts as zero


@dataclass(frozen=True, eq=False)
class CamProfile:
    """Cam profile at points in its own frame, which coincides with the fixed frame at cam angle zero."""

    follower: Follower
    turn: Turn  #: sense of rotation: 1 counterclockwise, -1 clockwise
    angle: FloatArray  #: cam angles, rad, shape (n,)
    #: `lift`, `velocity`, `acceleration`: of the follower, m, m/rad, m/rad^2, shape (n,)
    lift: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    touch: FollowerContact  #: contact in the fixed frame
    event: Event  #: lift of the profile

    @cached_property
    def extremes(self) -> ProfileExtremes:
        """Extremes over the whole revolution, including those between the points."""
        return profile_extremes(self.event, self.follower, self.turn)

    @property
    def points(self) -> FloatArray:
        """Profile, m, shape (n, 2), frame of the cam."""
        return self._to_cam_frame(self.touch.point)

    @property
    def pitch(self) -> FloatArray:
        """Path of the roller's centre (the profile itself for a flat face), m, shape (n, 2), frame of the cam."""
        return self._to_cam_frame(self.touch.trace)

    @property
    def normals(self) -> FloatArray:
        """Outward unit normals, shape (n, 2), frame of the cam."""
        return self._to_cam_frame(self.touch.normal)

    @property
    def radius(self) -> FloatArray:
        """Radius of curvature, m, shape (n,): negative where hollow."""
        return self.touch.radius

    @property
    def pressure_angle(self) -> FloatArray:
        """Angle from the normal to the follower's motion on the rise, rad, counterclockwise, shape (n,)."""
        return np.angle(self.touch.motion * np.conj(self.touch.normal))

    @property
    def push(self) -> ComplexArray:
        """Lift per displacement of the cam along the initial lift direction (real part) and to its left, shape (n,)."""
        return self.touch.normal * np.conj(self.follower.lift_direction) / self.touch.reach

    @property
    def push_rate(self) -> ComplexArray:
        """Derivative of `push` by the cam angle, shape (n,)."""
        return self.push * (1j * self.touch.turning - self.touch.reach_rate / self.touch.reach)

    @property
    def offset(self) -> FloatArray:
        """Distance of the contact normal from the cam centre, m: the lever arm of the force; s' for a flat face."""
        return -(self.touch.point * np.conj(1j * self.touch.normal)).real

    def _to_cam_frame(self, fixed: ComplexArray) -> FloatArray:
        z = fixed * np.exp(-1j * self.turn * self.angle)
        return np.column_stack([z.real, z.imag])

    def cutter_path(self, radius: float) -> FloatArray:
        """Return the path of a cutter's or grinding wheel's centre, m, shape (n, 2), frame of the cam."""
        return self.points + positive("cutter", radius, "m") * self.normals


def cam_profile(event: Event, follower: Follower, *, count: int = 720, turn: Turn = 1) -> CamProfile:
    """Return the profile of a cam at equally spaced cam angles."""
    if not 12 <= count <= _MAX_POINTS:
        raise refuse("count", count, f"a whole number from 12 to {_MAX_POINTS}")
    return profile_at(event, follower, np.linspace(0.0, math.tau, count, endpoint=False), turn)


Motion = tuple[FloatArray, FloatArray, FloatArray]
"""Lift, velocity and acceleration at some cam angles, m, m/rad, m/rad^2."""


def profile_at(
    event: Event, follower: Follower, angle: FloatArray, turn: Turn = 1, motion: Motion | None = None
) -> CamProfile:
    """Return the profile of a cam at given cam angles."""
    lift, velocity, acceleration = motion or (event(angle), event(angle, 1), event(angle, 2))
    # A radius is infinite at a point of inflection and at a stationary point of the pitch curve.
    with np.errstate(divide="ignore", invalid="ignore"):
        touch = follower.contact(lift, velocity, acceleration, turn)
    return CamProfile(follower, turn, angle, lift, velocity, acceleration, touch, event)


@dataclass(frozen=True)
class ProfileExtremes:
    """Extremes of a profile, each with its cam angle, rad."""

    convex: Extreme  #: minimum radius of curvature of convex parts, m; zero or negative if undercut
    hollow: Extreme | None  #: radius of the tightest hollow, m, above zero; None without a hollow
    pressure_angle: Extreme  #: largest in magnitude, signed, rad
    offset: tuple[Extreme, Extreme]  #: minimum and maximum offset of the contact, m
    sliding: Extreme  #: largest in magnitude, signed, m/rad


def profile_extremes(event: Event, follower: Follower, turn: Turn = 1) -> ProfileExtremes:
    """Return the extremes of a profile over the whole revolution.

    For a roller the curvature of its centre's path is used: it is continuous at points of inflection and at undercut,
    where the radius of the profile jumps.
    """

    def extreme(measure: Callable[[CamProfile], FloatArray], sign: float = 1.0) -> Extreme:
        minimum = curve_minimum(lambda angle: sign * measure(profile_at(event, follower, angle, turn)), event.joints)
        return Extreme(sign * minimum.value, minimum.at)

    def largest(measure: Callable[[CamProfile], FloatArray]) -> Extreme:
        ends = extreme(measure), extreme(measure, -1.0)
        return max(ends, key=lambda end: abs(end.value))

    def bend(profile: CamProfile) -> FloatArray:
        with np.errstate(divide="ignore"):
            return 1.0 / (profile.radius + roller)

    roller, hollow = follower.roller_radius, None
    if math.isfinite(roller):
        tight, deep = extreme(bend, -1.0), extreme(bend)
        convex = Extreme(1.0 / tight.value - roller, tight.at)
        if deep.value < -_STRAIGHT / roller:
            hollow = Extreme(roller - 1.0 / deep.value, deep.at)
    else:
        convex = extreme(lambda p: p.radius)
    offset = extreme(lambda p: p.offset), extreme(lambda p: p.offset, -1.0)
    steepest, fastest = largest(lambda p: p.pressure_angle), largest(lambda p: p.touch.sliding)
    return ProfileExtremes(convex, hollow, steepest, offset, fastest)


PRESSURE_ANGLE = math.radians(30.0)
"""Limit of the pressure angle of translating followers in common use (Norton, 2009, ch. 7)."""

_HALVINGS = 60
_ROUNDING = 1e-9


@dataclass(frozen=True)
class ProfileFault:
    """Violated limit of a profile."""

    #: `what`, `remedy`: description and remedy, in words
    what: str
    remedy: str
    angle: float  #: cam angle of the worst value, rad
    #: `value`, `limit`: value found and limit, SI
    value: float
    limit: float
    kind: Literal["angle", "length"] = "length"  #: kind of quantity: an angle, rad, or a length, m


def find_profile_faults(
    profile: CamProfile, *, pressure_angle: float = PRESSURE_ANGLE, cutter: float | None = None,
    base_helps: bool = True, width: float | None = None,
) -> list[ProfileFault]:  # fmt: skip
    """Return the violated limits of a profile with the angle of the worst value, including between the points.

    The width of the cam, m, is part of the check for contact at the edge of a round face.
    """
    faults: list[ProfileFault] = []
    if cutter is not None:
        positive("cutter", cutter, "m")
    extremes, follower = profile.extremes, profile.follower
    cut = extremes.convex.value <= 0.0
    if cut:
        what = "undercut: the radius of curvature is too small and the profile would cross itself"
        remedy = _remedy(["a smaller roller"] if math.isfinite(follower.roller_radius) else [], base_helps=base_helps)
        faults.append(ProfileFault(what, remedy, extremes.convex.at, extremes.convex.value, 0.0))
    steep = extremes.pressure_angle
    if abs(steep.value) > pressure_angle * (1.0 + _ROUNDING):
        what = "pressure angle too large"
        hint = "an offset" if isinstance(follower, RollerFollower) else "another pivot or arm"
        remedy = _remedy([hint], base_helps=base_helps)
        faults.append(ProfileFault(what, remedy, steep.at, abs(steep.value), pressure_angle, "angle"))
    if cutter is not None and not cut and extremes.hollow is not None and extremes.hollow.value < cutter:
        what = "the concave radius is smaller than the cutter"
        faults.append(ProfileFault(what, "use a smaller cutter", extremes.hollow.at, extremes.hollow.value, cutter))
    if isinstance(follower, FlatFollower) and follower.face_diameter is not None:
        farthest = max(extremes.offset, key=lambda end: abs(end.value))
        margin = 0.5 * follower.face_diameter - follower.face_radius(farthest.value, width)
        if margin < 0.0:
            what = "the distance from the contact line to the edge of the face is negative"
            faults.append(ProfileFault(what, "use a larger face or a narrower cam", farthest.at, margin, 0.0))
    return faults


def _remedy(others: list[str], *, base_helps: bool) -> str:
    """Return remedies as a sentence, a larger base circle first if it helps."""
    *first, last = [*(["a larger base circle"] if base_helps else []), *others, "a longer event"]
    return f"use {', '.join(first)} or {last}" if first else f"use {last}"


def undercut(radius: FloatArray, follower: Follower) -> NDArray[np.bool_]:
    """Return the undercut points of a profile: a pitch curve sharper than the roller, or a hollow under a flat face."""
    return (radius <= 0.0) & (radius >= -follower.roller_radius)


def minimum_base_radius(
    event: Event, follower: Follower, *, pressure_angle: float = PRESSURE_ANGLE, radius: float = 0.0, turn: Turn = 1
) -> float:
    """Return the smallest base circle without undercut, within limits of pressure angle and convex radius."""
    high = 100.0 * positive("lift", event.height, "m")
    even = np.linspace(0.0, math.tau, 1440, endpoint=False)
    angles = np.union1d(even, [*event.joints, *(joint - LIMIT_OFFSET for joint in event.joints)])
    motion = event(angles), event(angles, 1), event(angles, 2)

    def fits(base: float) -> bool:
        try:
            trial = profile_at(event, follower.with_base(base), angles, turn, motion)
        except InputError:  # the follower does not reach such a circle
            return False
        if undercut(trial.radius, trial.follower).any() or float(np.abs(trial.pressure_angle).max()) > pressure_angle:
            return False
        convex = trial.radius > -trial.follower.roller_radius
        return bool((trial.radius[convex] >= radius).all())

    candidates = np.geomspace(1e-4 * high, high, 81)
    good = [fits(float(base)) for base in candidates]
    if not any(good):
        given = f"no base circle between {candidates[0]:.3g} and {high:.3g} m"
        raise refuse("base_radius", given, "a base circle within the limits", "", "use a longer event or wider limits")
    index = good.index(True)
    if index == 0:
        return 0.0
    low, high = float(candidates[index - 1]), float(candidates[index])
    minimum = _bisect(fits, low, high)
    # The worst angles lie between the samples and hardly move with the base circle, so one more pass suffices.
    extremes = profile_extremes(event, follower.with_base(minimum), turn)
    worst = np.array([extremes.convex.at, extremes.pressure_angle.at])
    angles = np.union1d(angles, [worst, worst - LIMIT_OFFSET])
    motion = event(angles), event(angles, 1), event(angles, 2)
    return minimum if fits(minimum) else _bisect(fits, minimum, high)


def _bisect(fits: Callable[[float], bool], low: float, high: float) -> float:
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if fits(middle) else (middle, high)
    return high


_AT_ONCE = 2_000_000  # number of pairs of angle and point evaluated together


def lift_from_profile(points: ArrayLike, follower: Follower, angle: ArrayLike, *, turn: Turn = 1) -> FloatArray:
    """Return the lift of a follower on a profile given by points.

    The follower rests on the point with the highest lift. Between the points the profile is a periodic spline of degree
    5 over the chord length, so that a roller too large for a hollow bridges it.
    """
    from scipy.interpolate import make_interp_spline

    xy = finite_array("points", points, (None, 2))
    if len(xy) < 12:
        raise refuse("points", f"{len(xy)} points", "12 or more")
    outline = xy[:, 0] + 1j * xy[:, 1]
    outline = np.append(outline, outline[0])
    chord = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(outline)))])
    if (np.diff(chord) <= 0.0).any():
        raise refuse("points", "two equal neighbouring points", "different ones")
    curve = make_interp_spline(chord, np.column_stack([outline.real, outline.imag]), k=5, bc_type="periodic")
    phasor = np.exp(1j * turn * finite_array("angle", np.ravel(angle), (None,)))
    length = float(chord[-1])

    def curve_point(arc: FloatArray) -> ComplexArray:
        x, y = np.moveaxis(np.asarray(curve(np.mod(arc, length)), dtype=float), -1, 0)
        return np.asarray(x + 1j * y, dtype=np.complex128)

    def depth(arc: FloatArray) -> FloatArray:
        return -follower.lift_at(curve_point(arc) * phasor[:, None])

    if not len(phasor):
        return np.zeros(np.shape(angle))
    # Fine enough for a roller much smaller than the cam.
    needed = math.ceil(8.0 * length / min(follower.roller_radius, length))
    count = min(_MAX_SAMPLES, max(len(xy), _MIN_SAMPLES, needed))
    arc = np.linspace(0.0, length, count, endpoint=False)
    starts = _find_highest_peaks(curve_point(arc), arc, follower, phasor)
    lift = -np.min([refine_minima(depth, start - arc[1], start + arc[1])[0] for start in starts.T], axis=0)
    if not np.isfinite(lift).all():
        raise refuse("points", "a profile that the follower misses", "one within its reach", "", "check the unit")
    return lift.reshape(np.shape(angle))


@dataclass(frozen=True)
class Bridge:
    """Hollow that a follower bridges."""

    depth: float  #: largest gap between the follower and the hollow, along its path, m
    point: tuple[float, float]  #: position of the largest gap, m, frame of the cam


def find_bridges(points: ArrayLike, follower: Follower, *, turn: Turn = 1) -> Bridge | None:
    """Return the deepest hollow of a profile that a follower bridges because it is too large or flat; else None."""
    angle = np.linspace(0.0, 2.0 * math.pi, _SAMPLE_ANGLES, endpoint=False)
    lift = lift_from_profile(points, follower, angle, turn=turn)
    xy = finite_array("points", points, (None, 2))
    clearance, points = np.full(len(xy), math.inf), np.asarray(xy[:, 0] + 1j * xy[:, 1], dtype=np.complex128)
    for rows, lifts in _lifts_at_points(points, follower, np.exp(1j * turn * angle)):
        clearance = np.minimum(clearance, (lift[rows, None] - lifts).min(axis=0))
    worst = int(np.argmax(np.where(np.isfinite(clearance), clearance, 0.0)))
    depth = float(clearance[worst])
    return Bridge(depth, (float(xy[worst, 0]), float(xy[worst, 1]))) if depth > _CONTACT_TOLERANCE else None


_SAMPLE_ANGLES = 2880
_CONTACT_TOLERANCE = 1e-6  # m: between sampled cam angles, 1/8 deg apart, a contact is missed by a tenth of this
_MIN_SAMPLES, _MAX_SAMPLES = 360, 20_000
_CANDIDATES = 3  # peaks evaluated per angle: at a jump of the contact two are almost equal


def _lifts_at_points(
    points: ComplexArray, follower: Follower, phasor: ComplexArray
) -> Iterator[tuple[slice, FloatArray]]:
    """Yield slices of the angles with the lifts at which the follower would contact the points at each of them."""
    size = max(1, _AT_ONCE // len(points))
    for i in range(0, len(phasor), size):
        yield slice(i, i + size), follower.lift_at(points * phasor[i : i + size, None])


def _find_highest_peaks(points: ComplexArray, arc: FloatArray, follower: Follower, phasor: ComplexArray) -> FloatArray:
    """Return the positions of the highest peaks on the closed curve, shape (angles, candidates)."""
    peaks: list[FloatArray] = []
    for _, lift in _lifts_at_points(points, follower, phasor):
        peak = (lift >= np.roll(lift, 1, axis=1)) & (lift >= np.roll(lift, -1, axis=1))
        highest = np.argpartition(-np.where(peak, lift, -math.inf), _CANDIDATES, axis=1)
        peaks.append(arc[highest[:, :_CANDIDATES]])
    return np.concatenate(peaks)
