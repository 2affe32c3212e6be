"""Motion of the camshaft: angle, speed and angular acceleration over time."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from flexcam.core import FloatArray
from flexcam.core.errors import positive, refuse
from flexcam.dynamics.angle_functions import AngleFunction, CamFunctionCache


@dataclass(frozen=True, eq=False)
class CamMotion:
    """Cam angle and its time derivatives at given instants, arrays of one shape.

    Parameters
    ----------
    angle, speed, rate
        rad, rad/s, rad/s^2.
    known
        Cache of functions of the cam at these angles, if available.
    """

    angle: FloatArray
    speed: FloatArray
    rate: FloatArray
    known: CamFunctionCache | None = None

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
        """Return angle, speed and a zero rate.

        Parameters
        ----------
        time
            s, shape (n,).

        Returns
        -------
        CamMotion
            rad, rad/s and rad/s^2, shape (n,) each.
        """
        time = np.asarray(time, dtype=float)
        return CamMotion(self.start + self.speed * time, np.full_like(time, self.speed), np.zeros_like(time))


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
            raise refuse("fluctuation", f"amplitudes {list(self.amplitudes)}", "together below 1", why)

    def at(self, time: FloatArray) -> CamMotion:
        """Return angle, speed and rate at the given times, s."""
        mean = self.speed * np.asarray(time, dtype=float)
        angle, speed, rate = self.start + mean, np.full_like(mean, self.speed), np.zeros_like(mean)
        for k, a, phase in zip(self.orders, self.amplitudes, self.phases, strict=True):
            angle += a / k * (np.sin(k * mean + phase) - np.sin(phase))
            speed += self.speed * a * np.cos(k * mean + phase)
            rate -= self.speed**2 * a * k * np.sin(k * mean + phase)
        return CamMotion(angle, speed, rate)


class SpeedByAngle:
    """Camshaft speed as a periodic function of the cam angle.

    Parameters
    ----------
    speed
        omega over the cam angle, rad/s, above zero; the first derivative is used too.
    start, time
        Initial cam angle, rad, and its time, s.
    points
        Number of points of the inverted time table; Newton's method refines its values.
    """

    def __init__(self, speed: AngleFunction, start: float = 0.0, time: float = 0.0, points: int = 7201) -> None:
        self._speed, self._start = speed, start
        self._angles = np.linspace(0.0, 2.0 * np.pi, points)
        if float(speed(self._angles, 0).min()) <= 0.0:
            raise refuse("speed", "zero or less at some angle", "above zero at every cam angle")
        self._times = np.concatenate([[0.0], np.cumsum(self._travel_times(self._angles[:-1], np.diff(self._angles)))])
        self._first = float(self._time_at(np.array([start % (2.0 * np.pi)]))[0]) - time

    @property
    def period(self) -> float:
        """Time of a revolution, s."""
        return float(self._times[-1])

    def at(self, time: FloatArray) -> CamMotion:
        """Return angle, speed and rate at the given times, s."""
        turns, within = np.divmod(np.asarray(time, dtype=float) + self._first, self.period)
        angle = np.interp(within, self._times, self._angles)
        for _ in range(3):
            angle = angle + (within - self._time_at(angle)) * self._speed(angle, 0)
        speed = self._speed(angle, 0)
        whole = angle + 2.0 * np.pi * (turns + np.floor(self._start / (2.0 * np.pi)))
        return CamMotion(whole, speed, self._speed(angle, 1) * speed)

    def _time_at(self, angle: FloatArray) -> FloatArray:
        """Return the time of an angle within the revolution."""
        step = self._angles[1]
        i = np.clip(np.floor(angle / step).astype(int), 0, len(self._angles) - 2)
        return self._times[i] + self._travel_times(self._angles[i], angle - self._angles[i])

    def _travel_times(self, angle: FloatArray, width: FloatArray) -> FloatArray:
        """Return the times to advance by given widths from given angles, by four-point Gauss quadrature."""
        x, w = np.polynomial.legendre.leggauss(4)
        at = angle[:, None] + 0.5 * width[:, None] * (1.0 + x)
        return 0.5 * width * (w / self._speed(at.ravel(), 0).reshape(at.shape)).sum(axis=1)
