"""Figures of merit of a valve train in the words of the trade, and its spring margin."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from flexcam.analysis.preparation import prepare
from flexcam.case.case import Case
from flexcam.core import FloatArray
from flexcam.core.errors import FlexcamError
from flexcam.core.units import RPM
from flexcam.dynamics import solve
from flexcam.valvetrain import Metric, main_lift

_WORDS = {
    "valve_float": "valve float over the nose",
    "seating_velocity": "seating velocity",
    "bounces": "bounces",
    "bounce_height": "highest bounce",
    "nose_force.least": "min contact force over the nose",
    "torque.mean": "mean drive torque",
    "torque.largest": "peak drive torque",
    "power.mean": "mean drive power",
    "friction_power.mean": "mean friction power",
    "clearance.least": "coil-bind clearance",
}
"""Words of the trade by the end of a metric's name, in the order of the table."""

SPRING_MARGIN = "spring margin of the rigid train"
"""Name of the excess of the spring force over the inertia of the rigid train, relative to the inertia."""


@dataclass(frozen=True)
class FigureOfMerit:
    """Figure of merit.

    Parameters
    ----------
    name
        Name, such as ``seating velocity``.
    part
        Contact, spring or drive, such as ``seat``; empty for the train.
    metric
        Name among the metrics of the run, such as ``contacts.seat.seating_velocity``; empty for a figure of the case.
    value, unit
        Value in its SI unit.
    """

    name: str
    part: str
    metric: str
    value: float
    unit: str


def figures_of_merit(case: Case, metrics: Sequence[Metric]) -> list[FigureOfMerit]:
    """Return the figures of merit of a run.

    Parameters
    ----------
    case
        Case of the run.
    metrics
        Metrics of its last revolution, of `flexcam.analysis.preparation.compute_metrics`.

    Returns
    -------
    list of FigureOfMerit
        Those that the train has, sorted by kind.

    Examples
    --------
    ``figures_of_merit(case, compute_metrics(prepare(case), flexcam.run(case)))``
    """
    found = [
        FigureOfMerit(words, metric.name.split(".")[1], metric.name, metric.value, metric.unit)
        for end, words in _WORDS.items()
        for metric in metrics
        if metric.name.split(".", 2)[2:] == [end]
    ]
    margin = _spring_margin(case)
    return found if margin is None else [*found, FigureOfMerit(SPRING_MARGIN, "", "", margin, "1")]


def _spring_margin(case: Case) -> float | None:
    """Return the spring margin of a train whose follower may leave its cam, if it can be computed."""
    if all(contact.model != "unilateral" for contact in case.record.contacts.values()):
        return None
    try:
        return rigid_margin(case)[1]
    except FlexcamError:  # no rigid train exists
        return None


_ANGLES = np.linspace(0.0, 2.0 * math.pi, 7201)
"""Cam angles, rad, at which the contact force of the rigid train is evaluated."""


def rigid_margin(case: Case) -> tuple[float | None, float | None]:
    """Return the speed at which the rigid train loses contact, rpm, and the spring margin at the speed of the case."""
    rigid = _rigid_limit_speed(case)
    return rigid, None if rigid is None else (rigid * RPM / case.speed) ** 2 - 1.0


def _rigid_limit_speed(case: Case) -> float | None:
    """Return the camshaft speed at which the inertia of the rigid train first equals its springs and loads, rpm."""
    one = prepare(case.at_speed(1.0), rigid=True)
    worst: list[float] = []
    for name, contact in one.model.cam_contacts.items():
        lifted = one.model.cams[contact.cam].event(_ANGLES) > main_lift(one.model, contact.cam)
        still, _, inertia = _force_coefficients(case, name)[:, lifted]
        pulls = inertia < 0.0
        if pulls.any():
            worst.append(float(np.sqrt((np.maximum(still[pulls], 0.0) / -inertia[pulls]).min())))
    return min(worst) / RPM if worst else None


def _force_coefficients(case: Case, contact: str) -> FloatArray:
    """Return the coefficients of the rigid contact force: constant, per rad/s and per (rad/s)^2, shape (3, angles)."""
    speeds = [factor * case.speed for factor in (0.5, 1.0, 2.0)]
    forces: list[FloatArray] = []
    for speed in speeds:
        ready = prepare(case.at_speed(speed), rigid=True)
        steps = replace(ready.problem, step=(_ANGLES[1] - _ANGLES[0]) / speed, steps=len(_ANGLES) - 1)
        forces.append(solve(steps, ready.scheme).channels[f"contacts.{contact}.force"])
    return np.asarray(np.linalg.solve(np.vander(speeds, increasing=True), forces), dtype=np.float64)
