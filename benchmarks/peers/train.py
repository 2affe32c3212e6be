"""The contact benchmark C1: a valve train of three masses in one axis, in numpy alone.

The cam pushes a follower, an elastic push rod connects it to the mass of the rocker, and lash separates the rocker from
the valve, which a spring presses on its seat. Every solver gets these equations and integrates one cam revolution.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.timing import repeated_cpu_time

FloatArray = NDArray[np.float64]
Scalar = Any
"""A number or a symbolic expression of a solver."""


@dataclass(frozen=True)
class Train:
    """A train with displacements x1 (follower), x2 (rocker) and x3 (valve) in the opening direction of the valve; SI.

    The penetrations are ``s(angle) - x1`` at the cam, ``x2 - x3 - lash`` and ``-x3`` at the seat. All three contacts
    follow Hunt and Crossley, ``N = k x max(1 + chi x', 0)`` for x > 0. The angle starts at zero on the base circle, and
    the lift s is a 4-5-6-7 polynomial up to the nose at half a revolution and back to zero.
    """

    frequency: float = 25.0
    instants: int = 900
    lift: float = 8e-3
    half_width: float = math.radians(62.0)
    lash: float = 0.1e-3
    masses: tuple[float, float, float] = (0.06, 0.05, 0.09)
    rod: tuple[float, float] = (1.5e7, 150.0)
    """Stiffness (N/m) and damping (N s/m) between follower and rocker."""
    follower_spring: tuple[float, float, float] = (2e3, 5.0, 40.0)
    """Stiffness, damping and preload (N) of the spring that holds the follower on the cam."""
    valve_spring: tuple[float, float, float] = (3e4, 10.0, 250.0)
    cam: tuple[float, float] = (5e7, 0.2)
    """Contact stiffness (N/m) and dissipation (s/m)."""
    tip: tuple[float, float] = (3e7, 0.2)
    seat: tuple[float, float] = (6e7, 0.4)

    @property
    def speed(self) -> float:
        """Speed of the cam, rad/s."""
        return 2.0 * math.pi * self.frequency

    @property
    def period(self) -> float:
        """Duration of the run, s."""
        return 1.0 / self.frequency

    @property
    def times(self) -> FloatArray:
        """Output instants, shape (instants + 1,)."""
        return np.arange(self.instants + 1) * (self.period / self.instants)

    @property
    def max_step(self) -> float:
        """Maximum step of the adaptive solvers, s: 4 degrees, so that no solver skips the lift."""
        return self.period / 90.0

    @property
    def preload(self) -> FloatArray:
        """Constant forces, shape (3,)."""
        return np.array([-self.follower_spring[2], 0.0, -self.valve_spring[2]])

    @property
    def start(self) -> FloatArray:
        """Displacements and velocities of equilibrium on the base circle, shape (6,)."""
        follower = -self.follower_spring[2] / (self.follower_spring[0] + self.cam[0])
        valve = -self.valve_spring[2] / (self.valve_spring[0] + self.seat[0])
        return np.array([follower, follower, valve, 0.0, 0.0, 0.0])

    def matrices(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return mass, damping and stiffness without the contacts, shape (3, 3) each."""
        pair = np.array([[1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 0.0]])
        C, K = (self.rod[i] * pair + np.diag([self.follower_spring[i], 0.0, self.valve_spring[i]]) for i in (1, 0))
        return np.diag(self.masses), C, K

    def lift_at(self, angle: FloatArray, order: int = 0) -> FloatArray:
        """Return the lift of the cam, m, or its first or second derivative with respect to the angle (rad)."""
        offset = np.asarray(angle) - math.pi
        u = np.clip(1.0 - np.abs(offset) / self.half_width, 0.0, 1.0)
        if order == 0:
            return self.lift * u**4 * (35.0 + u * (-84.0 + u * (70.0 - 20.0 * u)))
        if order == 1:
            return -np.sign(offset) * self.lift / self.half_width * 140.0 * (u * (1.0 - u)) ** 3
        return self.lift / self.half_width**2 * 420.0 * (u * (1.0 - u)) ** 2 * (1.0 - 2.0 * u)

    def cam_force(self, times: FloatArray, motion: FloatArray) -> FloatArray:
        """Return the cam force (n,) at times (n,) for displacements and velocities (n, 6)."""
        angle = self.speed * times
        x = self.lift_at(angle) - motion[:, 0]
        v = self.lift_at(angle, 1) * self.speed - motion[:, 3]
        return self.cam[0] * np.maximum(x, 0.0) * np.maximum(1.0 + self.cam[1] * v, 0.0)


C1 = Train()


@dataclass(frozen=True)
class Equations:
    """Functions of a train for numbers or symbolic expressions."""

    cam_motion: Callable[[Scalar], tuple[Scalar, Scalar]]
    """Lift (m) and its rate (m/s) at a time (s)."""
    contact: Callable[[Scalar, Scalar, float, float], Scalar]
    """Contact force of penetration, its rate, stiffness and dissipation, N."""
    forces: Callable[..., tuple[Scalar, Scalar, Scalar]]
    """Forces on the masses at a time by x1, x2, x3, v1, v2, v3, N."""


def equations(
    train: Train,
    maximum: Callable[..., Scalar] = max,
    absolute: Callable[..., Scalar] = abs,
    sign: Callable[..., Scalar] = np.sign,
    wrap: Callable[[Any], Any] = lambda function: function,
) -> Equations:
    """Return the equations in the functions of a solver; `wrap` compiles them."""
    lift, width, lash, speed, half = train.lift, train.half_width, train.lash, train.speed, math.pi
    slope = 140.0 * lift / width * speed
    (k_rod, c_rod), (k_f, c_f, p_f), (k_v, c_v, p_v) = train.rod, train.follower_spring, train.valve_spring
    (k_cam, chi_cam), (k_tip, chi_tip), (k_seat, chi_seat) = train.cam, train.tip, train.seat

    @wrap
    def cam_motion(t: Scalar) -> tuple[Scalar, Scalar]:
        offset = speed * t - half
        u = maximum(1.0 - absolute(offset) / width, 0.0)
        square, product = u * u, u * (1.0 - u)
        s = lift * (square * square) * (35.0 + u * (u * (70.0 - 20.0 * u) - 84.0))
        return s, -slope * sign(offset) * (product * product * product)

    @wrap
    def contact(x: Scalar, v: Scalar, k: float, chi: float) -> Scalar:
        return k * maximum(x, 0.0) * maximum(1.0 + chi * v, 0.0)

    @wrap
    def forces(
        t: Scalar, x1: Scalar, x2: Scalar, x3: Scalar, v1: Scalar, v2: Scalar, v3: Scalar
    ) -> tuple[Scalar, Scalar, Scalar]:  # fmt: skip
        s, rate = cam_motion(t)
        cam = contact(s - x1, rate - v1, k_cam, chi_cam)
        tip = contact(x2 - x3 - lash, v2 - v3, k_tip, chi_tip)
        seat = contact(-x3, -v3, k_seat, chi_seat)
        rod = k_rod * (x1 - x2) + c_rod * (v1 - v2)
        return (
            cam - rod - k_f * x1 - c_f * v1 - p_f,
            rod - tip,
            tip + seat - k_v * x3 - c_v * v3 - p_v,
        )

    return Equations(cam_motion, contact, forces)


@dataclass(frozen=True)
class Setting:
    """A method of a solver with its steps or tolerance.

    `prepare` returns a function that integrates the revolution and returns displacements and velocities at the output
    instants, shape (instants + 1, 6), or these after a column of times, shape (instants + 1, 7).
    """

    method: str
    name: str
    prepare: Callable[[], Callable[[], FloatArray]]


@dataclass(frozen=True, eq=False)
class TrainResult:
    """Motion and times of a solver, one row per setting."""

    methods: list[str]
    names: list[str]
    motion: FloatArray  #: time, displacements and velocities, shape (settings, instants + 1, 7)
    seconds: FloatArray  #: minimum processor time of a run
    first_seconds: FloatArray  #: processor time of preparation and first run, with compilation


REPEAT_SECONDS = 0.5
"""Total time of the repeats of a run."""


def measure(settings: Iterable[Setting], train: Train, *, seconds: float = REPEAT_SECONDS) -> TrainResult:
    """Run all settings in sequence, each repeatedly for some seconds."""
    methods, names, motions, times, first_times = [], [], [], [], []
    for setting in settings:
        start = time.process_time()
        run = setting.prepare()
        motion = run()
        first_times.append(time.process_time() - start)
        times.append(repeated_cpu_time(run, seconds))
        methods.append(setting.method)
        names.append(setting.name)
        motions.append(motion if motion.shape[1] == 7 else np.column_stack([train.times, motion]))
    return TrainResult(methods, names, np.array(motions), np.array(times), np.array(first_times))
