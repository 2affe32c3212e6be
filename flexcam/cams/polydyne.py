"""Polydyne cams: lift that gives a prescribed motion of an elastic train at one speed.

Each harmonic of the target motion is divided by the train's frequency response. Reference: D. A. Stoddart, Polydyne Cam
Design, Machine Design 25 (1953), for one mass, where it gives s = y + (w/w0)^2 y''; here for any linear train.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from flexcam.cams.lift_event import Event
from flexcam.cams.periodic_lift import HarmonicLift, harmonics
from flexcam.core import ComplexArray, FloatArray, IntArray
from flexcam.core.errors import positive, refuse
from flexcam.core.units import RPM

Transfer = Callable[[FloatArray], ComplexArray]
"""Frequency response: motion of the follower's end per lift of the cam, by circular frequency (rad/s, zero included).
"""

_MIN_RESPONSE = 1e-9
"""Frequency response, relative to the static one, below which a harmonic cannot be prescribed."""

_ROUNDING = 1e-12
_MOST = 1000
_GRID = np.linspace(0.0, 2.0 * math.pi, 1441)


@dataclass(frozen=True)
class SingleMass:
    """Mass on a spring driven by the cam's lift: y'' + 2 D w0 (y' - s') + w0^2 (y - s) = 0.

    Parameters
    ----------
    frequency
        w0, rad/s.
    damping
        D, part of the critical damping.
    """

    frequency: float
    damping: float = 0.0

    def __post_init__(self) -> None:
        positive("frequency", self.frequency, "rad/s")
        positive("damping", self.damping, "", zero=True)

    def __call__(self, omega: FloatArray) -> ComplexArray:
        """Return the frequency response."""
        r = omega / self.frequency
        drive = 1.0 + 2j * self.damping * r
        with np.errstate(divide="ignore", invalid="ignore"):
            answer = drive / (drive - r**2)
        return np.where(np.abs(drive - r**2) <= _ROUNDING * (1.0 + r**2), np.inf, answer)


@dataclass(frozen=True, eq=False)
class Polydyne:
    """A polydyne cam.

    Parameters
    ----------
    event
        Lift of the cam.
    wanted
        Target motion, as harmonics.
    left_out
        Largest deviation of the target motion from its harmonics, m.
    """

    event: HarmonicLift
    wanted: HarmonicLift
    left_out: float


def polydyne(wanted: Event, transfer: Transfer, speed: float, *, count: int = 60) -> Polydyne:
    """Return the cam that gives the end of a train a target motion at a design speed."""
    positive("speed", speed, "rad/s")
    if not 1 <= count <= _MOST:
        raise refuse("count", count, f"a whole number from 1 to {_MOST}")
    amplitude = harmonics(wanted, count)
    answer = transfer(speed * np.arange(count + 1.0))
    silent = ~np.isfinite(answer[:1]) if not np.isfinite(answer[0]) else np.abs(answer) < _MIN_RESPONSE * abs(answer[0])
    if silent.any():
        given = f"a train that does not answer to harmonic {int(np.argmax(silent))} at {_rpm(speed):g} rpm"
        raise refuse("speed", given, "one that answers to every harmonic", "", "another speed, or some damping")
    goal = _lift(amplitude)
    # A harmonic in resonance must be absent from the cam.
    resonant = ~np.isfinite(answer)
    cam = np.where(resonant, 0.0, amplitude / np.where(resonant, 1.0, answer))
    return Polydyne(_lift(cam), goal, float(np.abs(goal(_GRID) - wanted(_GRID)).max()))


def motion_at(cam: Event, transfer: Transfer, speed: float, *, count: int = 60) -> HarmonicLift:
    """Return the steady motion of the train's end on a cam at any speed."""
    amplitude, resonant = _response_harmonics(cam, transfer, positive("speed", speed, "rad/s"), count)
    if resonant.size:
        given = f"{_rpm(speed):g} rpm, where harmonic {resonant[0]} is in resonance"
        raise refuse(
            "speed", given, "one with a steady motion", "the train has no damping", "another speed, or damping"
        )
    return _lift(amplitude)


def _response_harmonics(cam: Event, transfer: Transfer, speed: float, count: int) -> tuple[ComplexArray, IntArray]:
    """Return the harmonics of the motion on a cam, and which of the cam's harmonics are in resonance."""
    amplitude, answer = harmonics(cam, count), transfer(speed * np.arange(count + 1.0))
    held = np.abs(amplitude) > _ROUNDING * np.abs(amplitude).max()
    return amplitude * np.where(np.isfinite(answer), answer, 0.0), np.flatnonzero(held & ~np.isfinite(answer))


def off_design_deviation(design: Polydyne, transfer: Transfer, speeds: Sequence[float]) -> FloatArray:
    """Return the largest deviation from the target motion at other speeds."""
    count, wanted = len(design.event.cosine), design.wanted(_GRID)

    def away(speed: float) -> float:
        amplitude, resonant = _response_harmonics(design.event, transfer, speed, count)
        return math.inf if resonant.size else float(np.abs(_lift(amplitude)(_GRID) - wanted).max())

    return np.array([away(positive("speed", float(speed), "rad/s")) for speed in speeds])


def _rpm(speed: float) -> float:
    return speed / RPM


def _lift(amplitude: ComplexArray) -> HarmonicLift:
    cosine, sine = amplitude[1:].real.tolist(), (-amplitude[1:].imag).tolist()
    return HarmonicLift(float(amplitude[0].real), tuple(cosine), tuple(sine))
