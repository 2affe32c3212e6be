"""Cams designed for the train of a case: few harmonics below its first mode, and polydyne cams.

May import `case` and everything below it; `flexcam synthesize` prints what stands here.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from flexcam.cams import Event, HarmonicFit, Polydyne, Transfer, harmonic_fit, harmonics_below, off_design, polydyne
from flexcam.case.builder import build_model
from flexcam.case.case import Case
from flexcam.core import ComplexArray, FloatArray
from flexcam.core.errors import did_you_mean, refuse
from flexcam.core.units import RPM
from flexcam.valvetrain import Cam, Model, lift_transfer, modes_on_the_lift, valve_ratio

OFF_DESIGN = (0.25, 0.5, 0.75, 0.9, 1.0, 1.1)
"""Parts of the design speed at which a polydyne cam is looked at."""


@dataclass(frozen=True, eq=False)
class HarmonicCam:
    """A cam of few harmonics for a train.

    Parameters
    ----------
    fit
        The lift, and how it keeps to the wanted one.
    count
        Harmonics.
    frequency
        First natural frequency of the train that its contact with the cam feels, rad/s.
    limit
        Harmonics below it at the case's speed.
    """

    fit: HarmonicFit
    count: int
    frequency: float
    limit: int


@dataclass(frozen=True, eq=False)
class PolydyneCam:
    """A polydyne cam for a train.

    Parameters
    ----------
    design
        The cam.
    speed
        It was made for, rad/s.
    speeds
        Others, rad/s, shape (n,).
    plain, compensated
        Largest distance of the train's end from the wanted motion at these speeds, m, shape (n,): on the cam as it was
        and on this one. Infinite in resonance.
    ratio
        What the train's end would move per lift of the cam if rigid; 1 for a simpler train. The distances hold it.
    """

    design: Polydyne
    speed: float
    speeds: FloatArray
    plain: FloatArray
    compensated: FloatArray
    ratio: float


def harmonic_cam(
    case: Case, cam: str | None, *, tolerance: float, count: int | None = None, bound: float | None = None
) -> HarmonicCam:
    """Return a lift of harmonics below the first mode of a case's train that its contact with the cam feels.

    A contact that holds drives its train by a displacement: the modes are those of the train pressed to its cam, at
    full lift (C. Li, 2014, eqs. 5-6). Under a published load the follower is free, a mass on its spring.
    """
    model = build_model(case)
    name = _which(model.cams, cam)
    frequency = _first_felt(model, _contact(model, name), case.speed)
    limit = harmonics_below(frequency, case.speed)
    if count is None and limit < 1:
        given = f"{frequency / (2.0 * math.pi):.4g} Hz at {case.speed / RPM:.6g} rpm"
        why = "not one harmonic lies below the first mode"
        raise refuse("count", given, "a lower speed, a stiffer train, or a number of harmonics", why, "give --count")
    number = limit if count is None else count
    fit = harmonic_fit(model.cams[name].event, number, tolerance=tolerance, bound=bound)
    return HarmonicCam(fit, number, frequency, limit)


def _first_felt(model: Model, contact: str, speed: float) -> float:
    """Return the lowest natural frequency that a contact feels, rad/s."""
    reached = modes_on_the_lift(model, contact, speed)
    if not reached.felt:
        why = "what is driven has no mode of its own"
        raise refuse(f"contacts.{contact}", "no spring that it moves", "a train on a spring", why, "add a spring")
    return float(reached.found.modes.omegas[reached.felt[0]])


def polydyne_cam(case: Case, cam: str | None, *, speed: float | None = None, count: int = 60) -> PolydyneCam:
    """Return the cam that makes the valve of a case follow the lift which the case's cam would give it if rigid."""
    model = build_model(case)
    name, at = _which(model.cams, cam), case.speed if speed is None else speed
    return _designed(model.cams[name].event, _train(model, name, at), at, valve_ratio(model, name), count)


def polydyne_of(cams: Mapping[str, Cam], cam: str | None, transfer: Transfer, speed: float, count: int) -> PolydyneCam:
    """Return the cam that makes a train follow the lift of a cam, from how the train answers; no case is needed."""
    return _designed(cams[_which(cams, cam)].event, transfer, speed, 1.0, count)


def _designed(wanted: Event, answer: Transfer, speed: float, ratio: float, count: int) -> PolydyneCam:
    design = polydyne(wanted, answer, speed, count=count)
    plain = Polydyne(design.wanted, design.wanted, 0.0)
    speeds = speed * np.array(OFF_DESIGN)
    before, after = (ratio * off_design(cam, answer, speeds.tolist()) for cam in (plain, design))
    return PolydyneCam(design, speed, speeds, before, after, ratio)


def _train(model: Model, cam: str, speed: float) -> Transfer:
    """Return the motion of the valve over the one it would have if rigid."""
    contact = _contact(model, cam)
    start = model.driven[contact].follower
    finger = model.rocker_at(start)
    if finger is not None:
        points = [finger.point]
    else:
        follower = model.mesh.connected(model.mesh.node(start))
        points = [r.point for r in model.rockers.values() if not r.finger and model.mesh.node(r.start) in follower]
    answer = lift_transfer(model, contact, points[0] if points else start, speed)
    ratio = valve_ratio(model, cam)

    def relative(omega: FloatArray) -> ComplexArray:
        return answer(omega) / ratio

    return relative


def _contact(model: Model, cam: str) -> str:
    """Return the name of the contact that a cam drives a train through."""
    contact = next((n for n, c in model.driven.items() if c.cam == cam), None)
    if contact is None:
        raise refuse(f"cams.{cam}", "no contact", "a contact that drives a train", "", "add one under [contacts]")
    return contact


def _which(cams: Mapping[str, Cam], cam: str | None) -> str:
    if cam is None and len(cams) == 1:
        return next(iter(cams))
    if cam is None or cam not in cams:
        given, known = "no name" if cam is None else repr(cam), ", ".join(cams)
        raise refuse("--cam", given, known or "a cam in the case", "", did_you_mean(cam or "", cams))
    return cam
