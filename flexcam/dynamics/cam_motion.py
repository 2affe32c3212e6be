"""Cam motion over time, functions of the cam angle, and the inputs of the local forces that follow from them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import accumulate, pairwise
from typing import TYPE_CHECKING, Protocol, TypeVar, cast

import numpy as np

from flexcam.core import FloatArray, IntArray
from flexcam.core.errors import positive, refuse

if TYPE_CHECKING:
    from scipy.interpolate import PchipInterpolator

AngleFunction = Callable[[FloatArray, int], FloatArray]
"""A scalar function of the cam angle (rad) and of the order of its derivative."""


@dataclass(frozen=True)
class Constant:
    """Constant function of the cam angle, distinguishable from other functions."""

    value: float

    def __call__(self, angle: FloatArray, order: int) -> FloatArray:
        """Return the value at every angle; derivatives are zero."""
        return np.full_like(angle, self.value if order == 0 else 0.0)


@dataclass(frozen=True)
class Derivative:
    """The derivative of a function of the cam angle."""

    function: AngleFunction

    def __call__(self, angle: FloatArray, order: int) -> FloatArray:
        """Return it, or a derivative of it."""
        return self.function(angle, order + 1)


@dataclass(frozen=True, eq=False)
class AngleVector:
    """Vector that depends on the cam angle: constant vectors times scalar functions."""

    vectors: FloatArray  #: shape (k, n)
    #: One function of the angle per vector; none for a single vector that does not depend on it.
    functions: tuple[AngleFunction, ...]

    @classmethod
    def constant(cls, vector: FloatArray) -> AngleVector:
        """Return a vector that does not depend on the angle, shape (n,)."""
        return cls(vector[None, :], ())


def constant(value: float) -> AngleFunction:
    """Return the function of the cam angle that is `value` everywhere."""
    return Constant(value)


def derivative(function: AngleFunction) -> AngleFunction:
    """Return the derivative of a function of the cam angle."""
    return Derivative(function)


def cam_angle(angle: FloatArray, order: int) -> FloatArray:
    """Return the cam angle itself, as a function of it."""
    return angle if order == 0 else np.full_like(angle, order == 1)


ONE = Constant(1.0)
"""Constant function 1, such as the cosine of a contact without inclination."""


T = TypeVar("T")


class DerivedCamFunction(ABC):
    """Function of the cam angle derived from others, evaluated once for all derived functions."""

    def __call__(self, angle: FloatArray, order: int) -> FloatArray:
        """Return the function or its derivative."""
        return self.of(CamFunctionCache(angle), order)

    @abstractmethod
    def of(self, cam: CamFunctionCache, order: int) -> FloatArray:
        """Return the function at angles where other functions are cached."""


class CamFunctionCache:
    """Cache of functions of the cam angle at given angles, rad, of any shape."""

    def __init__(self, angle: FloatArray) -> None:
        self.angle = angle
        self._values: dict[tuple[int, int], tuple[AngleFunction, FloatArray]] = {}  # keeps the ids valid
        self._lookups: dict[object, object] = {}

    def __call__(self, function: AngleFunction, order: int) -> FloatArray:
        """Return a function or its derivative."""
        while isinstance(function, Derivative):
            function, order = function.function, order + 1
        entry = self._values.get((id(function), order))
        if entry is None:
            value = (
                function.of(self, order) if isinstance(function, DerivedCamFunction) else function(self.angle, order)
            )
            entry = self._values[id(function), order] = function, value
        return entry[1]

    def lookup(self, key: object, make: Callable[[], T]) -> T:
        """Return the cached value of a key at these angles, computed if missing."""
        if key not in self._lookups:
            self._lookups[key] = make()
        return cast("T", self._lookups[key])


@dataclass(frozen=True, eq=False)
class CamMotion:
    """Cam angle and its time derivatives at given instants, arrays of one shape."""

    angle: FloatArray  #: rad
    speed: FloatArray  #: rad/s
    rate: FloatArray  #: rad/s^2
    time: FloatArray  #: s
    known: CamFunctionCache | None = None  #: cache of functions of the cam at these angles, if available

    @cached_property
    def cam(self) -> CamFunctionCache:
        """Cache of functions of the cam at these angles."""
        return self.known or CamFunctionCache(self.angle)


class Drive(Protocol):
    """Interface of the prescribed motion of the camshaft."""

    def at(self, time: FloatArray) -> CamMotion:
        """Return the motion at the given times, s."""
        ...


@dataclass(frozen=True)
class ConstantSpeed:
    """Camshaft at constant speed.

    Parameters
    ----------
    speed
        rad/s, above zero.
    start
        Cam angle at time zero, rad.

    Examples
    --------
    >>> ConstantSpeed(2.0).at(np.array([0.5])).angle
    array([1.])
    """

    speed: float
    start: float = 0.0

    def __post_init__(self) -> None:
        positive("speed", self.speed, "rad/s")

    def at(self, time: FloatArray) -> CamMotion:
        """Return angle, speed, a zero rate and the time.

        Parameters
        ----------
        time
            s, shape (n,).

        Returns
        -------
        CamMotion
            rad, rad/s, rad/s^2 and s, shape (n,) each.
        """
        time = np.asarray(time, dtype=float)
        return CamMotion(self.start + self.speed * time, np.full_like(time, self.speed), np.zeros_like(time), time)


@dataclass(frozen=True, eq=False)
class FluctuatingSpeed:
    """Camshaft speed with harmonic fluctuation in orders of the rotation.

    ``omega = omega_0 (1 + sum a_k cos(k omega_0 t + phi_k))``: the phase follows the mean rotation.

    Parameters
    ----------
    speed
        Mean, rad/s, above zero.
    orders, amplitudes, phases
        k, a_k (fractions of the mean speed, sum below 1) and phi_k, rad; shape (m,) each.
    start
        Cam angle at time zero, rad.
    """

    speed: float
    orders: tuple[float, ...]
    amplitudes: tuple[float, ...]
    phases: tuple[float, ...]
    start: float = 0.0

    def __post_init__(self) -> None:
        positive("speed", self.speed, "rad/s")
        for order in self.orders:
            positive("order", order, "per revolution")
        if sum(abs(a) for a in self.amplitudes) >= 1.0:
            why = "the shaft must keep turning"
            raise refuse("fluctuation", f"amplitudes {list(self.amplitudes)}", "amplitudes with a sum below 1", why)

    def at(self, time: FloatArray) -> CamMotion:
        """Return angle, speed and rate at the given times, s."""
        time = np.asarray(time, dtype=float)
        mean = self.speed * time
        angle, speed, rate = self.start + mean, np.full_like(mean, self.speed), np.zeros_like(mean)
        for k, a, phase in zip(self.orders, self.amplitudes, self.phases, strict=True):
            angle += a / k * (np.sin(k * mean + phase) - np.sin(phase))
            speed += self.speed * a * np.cos(k * mean + phase)
            rate -= self.speed**2 * a * k * np.sin(k * mean + phase)
        return CamMotion(angle, speed, rate, time)


_AFTER_ROW = 1e-9
"""Angle, rad, above the rounding of an instant at a row of a phaser."""


@dataclass(frozen=True, eq=False)
class Phaser:
    """Phaser that turns a shaft against its drive: ``psi = theta + phi(theta)``, theta the angle of the drive.

    The rotation phi is interpolated by F. N. Fritsch and R. E. Carlson's monotone cubic, SIAM J. Numer. Anal. 17
    (1980), and is constant before the first and after the last row. As theta grows over all revolutions of a run, phi
    is a schedule and not a periodic function.

    Parameters
    ----------
    angles, shifts
        Rows of theta, ascending, and phi, rad; shape (m,) each.

    Raises
    ------
    InputError
        If the shaft would stop or turn back.

    Examples
    --------
    >>> Phaser((0.0, 10.0), (0.0, 0.5))(np.array([0.0, 10.0, 20.0]))
    array([ 0. , 10.5, 20.5])
    """

    angles: tuple[float, ...]
    shifts: tuple[float, ...]

    def __post_init__(self) -> None:
        angles = np.concatenate([np.linspace(begin, end, 21) for begin, end in pairwise(self.angles)])
        slowest = float(self(angles, 1).min())
        if slowest <= 0.0:
            given, why = f"a shaft at {slowest:.3g} times the speed of its drive", "the shaft must keep turning"
            raise refuse("phaser", given, "a speed above zero", why, "shift it slower")

    @cached_property
    def _shift(self) -> PchipInterpolator:
        from scipy.interpolate import PchipInterpolator

        edge = self.angles[-1] - self.angles[0]  # rows of equal shift beyond both ends make the ends smooth
        angles = [self.angles[0] - edge, *self.angles, self.angles[-1] + edge]
        return PchipInterpolator(angles, [self.shifts[0], *self.shifts, self.shifts[-1]])

    def __call__(self, angle: FloatArray, order: int = 0) -> FloatArray:
        """Return the angle of the shaft, rad, or a derivative by the angle of the drive."""
        at = angle + _AFTER_ROW if order > 1 else angle  # the second derivative jumps at rows: that after a row
        clipped = np.clip(at, self.angles[0], self.angles[-1])
        shift = np.asarray(self._shift(clipped, order), dtype=float)
        return angle + shift if order == 0 else np.where(clipped == at, shift, 0.0) + float(order == 1)

    def drive_angle(self, angle: float) -> float:
        """Return the angle of the drive at an angle of the shaft, rad."""
        from scipy.optimize import brentq

        span = max(map(abs, self.shifts)) + 1.0
        return float(brentq(lambda at: float(self(np.array([at]))[0]) - angle, angle - span, angle + span, xtol=1e-13))

    def cache(self, cam: CamFunctionCache) -> CamFunctionCache:
        """Return the cache of functions of the angle of the shaft at the angles of another cache."""
        return cam.lookup(self, lambda: CamFunctionCache(self(cam.angle)))

    def motion(self, drive: CamMotion) -> CamMotion:
        """Return the motion of the shaft."""
        cache, slope, bend = self.cache(drive.cam), self(drive.angle, 1), self(drive.angle, 2)
        rate = slope * drive.rate + bend * drive.speed**2
        return CamMotion(cache.angle, slope * drive.speed, rate, drive.time, cache)


@dataclass(frozen=True)
class ShiftedFunction(DerivedCamFunction):
    """Function of the angle of a shaft behind a phaser, over the angle of its drive; two derivatives."""

    function: AngleFunction
    phaser: Phaser

    def of(self, cam: CamFunctionCache, order: int) -> FloatArray:
        """Return the function or its derivative by the angle of the drive."""
        shaft = self.phaser.cache(cam)
        if order == 0:
            return shaft(self.function, 0)
        slope = self.phaser(cam.angle, 1)
        if order == 1:
            return shaft(self.function, 1) * slope
        return shaft(self.function, 2) * slope**2 + shaft(self.function, 1) * self.phaser(cam.angle, 2)


class SpeedByAngle:
    """Camshaft speed as a periodic function of the cam angle.

    Parameters
    ----------
    speed
        omega over the cam angle, rad/s, above zero; the first derivative is used too.
    start, time
        Initial cam angle, rad, and its time, s.
    """

    def __init__(self, speed: AngleFunction, start: float = 0.0, time: float = 0.0) -> None:
        self._speed, self._start = speed, start
        #: Angles of the inverted time table; Newton's method refines its values.
        self._angles = np.linspace(0.0, 2.0 * np.pi, 7201)
        if float(speed(self._angles, 0).min()) <= 0.0:
            raise refuse("speed", "a speed of zero or less at some angle", "a speed above zero at every cam angle")
        self._times = np.concatenate([[0.0], np.cumsum(self._travel_times(self._angles[:-1], np.diff(self._angles)))])
        self._first = float(self._time_at(np.array([start % (2.0 * np.pi)]))[0]) - time

    @property
    def period(self) -> float:
        """Time of a revolution, s."""
        return float(self._times[-1])

    def at(self, time: FloatArray) -> CamMotion:
        """Return angle, speed and rate at the given times, s."""
        time = np.asarray(time, dtype=float)
        turns, remainder = np.divmod(time + self._first, self.period)
        angle = np.interp(remainder, self._times, self._angles)
        for _ in range(3):
            angle = angle + (remainder - self._time_at(angle)) * self._speed(angle, 0)
        speed = self._speed(angle, 0)
        total = angle + 2.0 * np.pi * (turns + np.floor(self._start / (2.0 * np.pi)))
        return CamMotion(total, speed, self._speed(angle, 1) * speed, time)

    def _time_at(self, angle: FloatArray) -> FloatArray:
        step = self._angles[1]
        i = np.clip(np.floor(angle / step).astype(int), 0, len(self._angles) - 2)
        return self._times[i] + self._travel_times(self._angles[i], angle - self._angles[i])

    def _travel_times(self, angle: FloatArray, width: FloatArray) -> FloatArray:
        """Return the times to advance by given widths from given angles, by four-point Gauss quadrature."""
        x, w = np.polynomial.legendre.leggauss(4)
        points = angle[:, None] + 0.5 * width[:, None] * (1.0 + x)
        return 0.5 * width * (w / self._speed(points.ravel(), 0).reshape(points.shape)).sum(axis=1)


@dataclass(frozen=True, eq=False)
class PrescribedInputs:
    """Prescribed inputs of the local forces at m instants.

    The rows contain, side by side, the weights of the k sensing vectors, their time derivatives, the weights of the a
    acting vectors, the prescribed parts of the c sensed scalars, their time derivatives, and the functions of the laws.
    """

    angle: FloatArray  #: cam angle, rad, shape (m,)
    rows: FloatArray
    senses: FloatArray  #: 1 where a sensing vector belongs to a scalar, shape (c, k)
    acts: FloatArray  #: 1 where an acting vector belongs to a force, shape (c, a)
    cam: CamFunctionCache  #: functions of the cam angle at these instants
    # The parts of the rows, which are views.
    sensing_weights: FloatArray = field(init=False)  #: weights of the sensing vectors, shape (m, k)
    sensing_rates: FloatArray = field(init=False)  #: their time derivatives, shape (m, k)
    acting_weights: FloatArray = field(init=False)  #: weights of the acting vectors, shape (m, a)
    offset: FloatArray = field(init=False)  #: prescribed parts of the sensed scalars, shape (m, c)
    offset_rate: FloatArray = field(init=False)  #: their time derivatives, shape (m, c)
    functions: FloatArray = field(init=False)  #: functions of the laws, shape (m, f)

    def __post_init__(self) -> None:
        (c, k), a = self.senses.shape, self.acts.shape[1]
        cuts = [0, *accumulate([k, k, a, c, c]), self.rows.shape[1]]
        names = ("sensing_weights", "sensing_rates", "acting_weights", "offset", "offset_rate", "functions")
        for name, (begin, end) in zip(names, pairwise(cuts), strict=True):
            object.__setattr__(self, name, self.rows[:, begin:end])

    @property
    def parts(self) -> tuple[FloatArray, ...]:
        """The parts of the rows."""
        weights = self.sensing_weights, self.sensing_rates, self.acting_weights
        return (*weights, self.offset, self.offset_rate, self.functions)

    def followed_by(self, later: PrescribedInputs) -> PrescribedInputs:
        """Return the instants and later ones."""
        angle = np.concatenate([self.angle, later.angle])
        return replace(self, angle=angle, rows=np.vstack([self.rows, later.rows]), cam=CamFunctionCache(angle))

    def at(self, instants: IntArray | slice) -> PrescribedInputs:
        """Return some of the instants."""
        angle = self.angle[instants]
        return PrescribedInputs(angle, self.rows[instants], self.senses, self.acts, CamFunctionCache(angle))

    def row(self, i: int) -> PrescribedInputs:
        """Return one of the instants."""
        return self.at(slice(i, i + 1))

    def sensing_matrix(self, i: int) -> FloatArray:
        """Return the weights of the sensing vectors in every scalar at an instant, shape (c, k)."""
        return self.senses * self.sensing_weights[i]

    def sensing_rate_matrix(self, i: int) -> FloatArray:
        """Return their time derivatives, shape (c, k)."""
        return self.senses * self.sensing_rates[i]

    def acting_matrix(self, i: int) -> FloatArray:
        """Return the weights of the acting vectors in every force at an instant, shape (c, a)."""
        return self.acts * self.acting_weights[i]
