"""Design of cams for the train of a case: harmonic lifts below its first mode, and polydyne cams.

May import `case` and everything below it; `flexcam synthesize` prints the results.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from flexcam.cams import (
    Event,
    HarmonicFit,
    Polydyne,
    Transfer,
    harmonic_fit,
    harmonics_below,
    off_design_deviation,
    polydyne,
)
from flexcam.case.builder import build_model
from flexcam.case.case import Case
from flexcam.core import ComplexArray, FloatArray
from flexcam.core.errors import refuse, suggest_name
from flexcam.core.units import RPM
from flexcam.valvetrain import Cam, Model, lift_transfer, modes_on_the_lift, valve_ratio

SPEED_RATIOS = (0.25, 0.5, 0.75, 0.9, 1.0, 1.1)
"""Fractions of the design speed at which a polydyne cam is evaluated."""


@dataclass(frozen=True, eq=False)
class HarmonicCam:
    """Harmonic lift for a train.

    Parameters
    ----------
    fit
        Fitted lift and its deviation from the desired one.
    count
        Number of harmonics.
    frequency
        First natural frequency of the train that the cam contact excites, rad/s.
    limit
        Maximum number of harmonics below that frequency at the speed of the case.
    """

    fit: HarmonicFit
    count: int
    frequency: float
    limit: int


@dataclass(frozen=True, eq=False)
class PolydyneCam:
    """Polydyne cam for a train.

    Parameters
    ----------
    design
        Cam.
    speed
        Design speed, rad/s.
    speeds
        Evaluated speeds, rad/s, shape (n,).
    plain, compensated
        Maximum deviation of the train's output from the desired motion at these speeds, m, shape (n,): with the
        original cam and with this one. Infinite at resonance.
    ratio
        Ratio of output displacement to cam lift of the rigid train; 1 for a simple train. The deviations include it.
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
    """Return a harmonic lift below the first mode of a case's train that the cam contact excites.

    A closed contact prescribes a displacement: the modes are those of the train in contact with its cam at full lift
    (C. Li, 2014, eqs. 5-6). Under a published load the follower is free, a mass on its spring.
    """
    model = build_model(case)
    name = _select_cam(model.cams, cam)
    frequency = _first_contact_frequency(model, _contact_name(model, name), case.speed)
    limit = harmonics_below(frequency, case.speed)
    if count is None and limit < 1:
        given = f"{frequency / (2.0 * math.pi):.4g} Hz at {case.speed / RPM:.6g} rpm"
        why = "not one harmonic lies below the first mode"
        raise refuse("count", given, "a lower speed, a stiffer train, or a number of harmonics", why, "give --count")
    number = limit if count is None else count
    fit = harmonic_fit(model.cams[name].event, number, tolerance=tolerance, bound=bound)
    return HarmonicCam(fit, number, frequency, limit)


def _first_contact_frequency(model: Model, contact: str, speed: float) -> float:
    """Return the lowest natural frequency that a contact excites, rad/s."""
    reached = modes_on_the_lift(model, contact, speed)
    if not reached.relevant_modes:
        why = "what is driven has no mode of its own"
        raise refuse(f"contacts.{contact}", "no spring that it moves", "a train on a spring", why, "add a spring")
    return float(reached.found.modes.omegas[reached.relevant_modes[0]])


def polydyne_cam(case: Case, cam: str | None, *, speed: float | None = None, count: int = 60) -> PolydyneCam:
    """Return the cam with which the flexible valve follows the rigid valve lift of the case's cam."""
    model = build_model(case)
    name, at = _select_cam(model.cams, cam), case.speed if speed is None else speed
    return _evaluate_design(
        model.cams[name].event, _valve_transfer(model, name, at), at, valve_ratio(model, name), count
    )


def design_polydyne(
    cams: Mapping[str, Cam], cam: str | None, transfer: Transfer, speed: float, count: int
) -> PolydyneCam:
    """Return the cam with which a train follows the lift of a given cam, from the transfer function of the train."""
    return _evaluate_design(cams[_select_cam(cams, cam)].event, transfer, speed, 1.0, count)


def _evaluate_design(wanted: Event, answer: Transfer, speed: float, ratio: float, count: int) -> PolydyneCam:
    design = polydyne(wanted, answer, speed, count=count)
    plain = Polydyne(design.wanted, design.wanted, 0.0)
    speeds = speed * np.array(SPEED_RATIOS)
    before, after = (ratio * off_design_deviation(cam, answer, speeds.tolist()) for cam in (plain, design))
    return PolydyneCam(design, speed, speeds, before, after, ratio)


def _valve_transfer(model: Model, cam: str, speed: float) -> Transfer:
    """Return the transfer function of the valve: its motion relative to that of the rigid train."""
    contact = _contact_name(model, cam)
    start = model.cam_contacts[contact].follower
    finger = model.rocker_at(start)
    if finger is not None:
        points = [finger.point]
    else:
        follower = model.mesh.connected_nodes(model.mesh.node(start))
        points = [r.point for r in model.rockers.values() if not r.finger and model.mesh.node(r.start) in follower]
    answer = lift_transfer(model, contact, points[0] if points else start, speed)
    ratio = valve_ratio(model, cam)

    def relative(omega: FloatArray) -> ComplexArray:
        return answer(omega) / ratio

    return relative


def _contact_name(model: Model, cam: str) -> str:
    """Return the name of the contact between a cam and its train."""
    contact = next((n for n, c in model.cam_contacts.items() if c.cam == cam), None)
    if contact is None:
        raise refuse(f"cams.{cam}", "no contact", "a contact that drives a train", "", "add one under [contacts]")
    return contact


def _select_cam(cams: Mapping[str, Cam], cam: str | None) -> str:
    if cam is None and len(cams) == 1:
        return next(iter(cams))
    if cam is None or cam not in cams:
        given, known = "no name" if cam is None else repr(cam), ", ".join(cams)
        raise refuse("--cam", given, known or "a cam in the case", "", suggest_name(cam or "", cams))
    return cam
