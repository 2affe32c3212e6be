"""Closed-form model of one mass between a train and a valve spring, for valve spring settings.

Source: F. I. T. Petrescu and R. V. V. Petrescu, Settings of the valve spring (2013), the algorithm's rows 10 to 43.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from flexcam.cams import Event, curve_minimum
from flexcam.core import FloatArray
from flexcam.core.errors import positive, refuse
from flexcam.dynamics import AngleFunction


@dataclass(frozen=True, eq=False)
class SingleMassModel:
    """Mass driven by a cam through an elastic train, against a valve spring.

    Parameters
    ----------
    event
        Lift of the cam, s.
    mass
        Mass m_T, kg.
    train_stiffness
        Stiffness K of the train, N/m.
    spring_stiffness
        Stiffness k of the valve spring, N/m.
    compression
        Compression x_0 of the installed spring, m.
    """

    event: Event
    mass: float
    train_stiffness: float
    spring_stiffness: float
    compression: float

    def __post_init__(self) -> None:
        positive("mass", self.mass, "kg")
        positive("train_stiffness", self.train_stiffness, "N/m")
        positive("spring_stiffness", self.spring_stiffness, "N/m")
        positive("compression", self.compression, "m")

    @property
    def preload(self) -> float:
        """Force of the installed spring, k x_0, N."""
        return self.spring_stiffness * self.compression

    @property
    def preload_deflection(self) -> float:
        """Deflection of the train under the preload, k x_0/(K + k), m: the lift it absorbs."""
        return self.preload / (self.train_stiffness + self.spring_stiffness)

    @property
    def opens_valve(self) -> bool:
        """Return whether the train force at full lift exceeds the preload; otherwise a seated valve does not open."""
        return self.train_stiffness * self.event.height > self.preload

    def motion(self, angle: FloatArray, speed: FloatArray, order: int = 0) -> FloatArray:
        """Return the paper's x, or its derivative by the cam angle at constant speed, as in its spreadsheet.

        ``x = s - ((K + k) m_T w^2 s'^2 + (k^2 + 2 k K) s^2 + 2 k x_0 (K + k) s)/(2 (K + k)^2 (s + k x_0/(K + k)))``
        """
        if order not in (0, 1, 2):
            raise refuse("order", order, "0, 1 or 2")
        s, s1, s2, s3 = (self.event(angle, k) for k in range(4))
        K, k = self.train_stiffness, self.spring_stiffness
        inertia, square, linear = (K + k) * self.mass * speed**2, k * (k + 2.0 * K), 2.0 * self.preload * (K + k)
        N = inertia * s1**2 + square * s**2 + linear * s
        D, whole = s + self.preload_deflection, 2.0 * (K + k) ** 2
        if order == 0:
            return s - N / (whole * D)
        N1 = 2.0 * inertia * s1 * s2 + 2.0 * square * s * s1 + linear * s1
        slope = (N1 * D - N * s1) / D**2
        if order == 1:
            return s1 - slope / whole
        N2 = 2.0 * inertia * (s2**2 + s1 * s3) + 2.0 * square * (s1**2 + s * s2) + linear * s2
        return s2 - ((N2 * D - N * s2) / D**2 - 2.0 * s1 * slope / D) / whole

    def kinematic_acceleration(self, angle: FloatArray, omega: AngleFunction) -> FloatArray:
        """Return spp = s'' w^2 + s' eps, m/s^2, shape (n,)."""
        w = omega(angle, 0)
        return self.event(angle, 2) * w**2 + self.event(angle, 1) * w * omega(angle, 1)

    def dynamic_acceleration(self, angle: FloatArray, omega: AngleFunction) -> FloatArray:
        """Return xpp = x'' w^2 + x' eps, m/s^2, shape (n,)."""
        w = omega(angle, 0)
        return self.motion(angle, w, 2) * w**2 + self.motion(angle, w, 1) * w * omega(angle, 1)


@dataclass(frozen=True)
class Setting:
    """Results of a speed and a valve spring for a given lift.

    Parameters
    ----------
    name
        Name of the setting.
    speed
        Camshaft speed, rad/s.
    stiffness, compression, preload
        k, N/m, x_0, m, and k x_0, N.
    kinematic, dynamic
        Maximum and minimum acceleration of the lift (spp) and of the valve (xpp), m/s^2.
    lift, opening
        Maximum s and x, m.
    wound_up
        Deflection of the train under the preload, m.
    lifts_off
        Whether the train force at full lift exceeds the preload.
    speed_ratio
        Ratio of maximum to minimum speed within a revolution.
    """

    name: str
    speed: float
    stiffness: float
    compression: float
    preload: float
    kinematic: tuple[float, float]
    dynamic: tuple[float, float]
    lift: float
    opening: float
    wound_up: float
    lifts_off: bool
    speed_ratio: float

    @property
    def lift_loss(self) -> float:
        """Fraction of the lift by which the valve does not open."""
        return 1.0 - self.opening / self.lift


def evaluate_setting(name: str, one: SingleMassModel, omega: AngleFunction, speed: float) -> Setting:
    """Return the results of a setting over a revolution."""
    joints = one.event.joints

    def span(curve: Callable[[FloatArray], FloatArray]) -> tuple[float, float]:
        return -curve_minimum(lambda angle: -curve(angle), joints).value, curve_minimum(curve, joints).value

    fastest, slowest = span(lambda angle: omega(angle, 0))
    return Setting(
        name, speed, one.spring_stiffness, one.compression, one.preload,
        span(lambda angle: one.kinematic_acceleration(angle, omega)),
        span(lambda angle: one.dynamic_acceleration(angle, omega)),
        one.event.height, span(lambda angle: one.motion(angle, omega(angle, 0)))[0],
        one.preload_deflection, one.opens_valve, fastest / slowest,
    )  # fmt: skip
