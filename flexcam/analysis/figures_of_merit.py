"""Figures of merit of a valve train by their usual names, and its spring margin."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
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
    "valve_loft": "valve loft over the nose",
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
"""Usual names by the end of a metric's name, in the order of the table."""

SPRING_MARGIN = "spring margin of the rigid train"
"""Name of the excess of the spring force over the inertia of the rigid train, relative to the inertia."""


@dataclass(frozen=True)
class FigureOfMerit:
    """Figure of merit."""

    name: str  #: name, such as ``seating velocity``
    part: str  #: contact, spring or drive, such as ``seat``; empty for the train
    #: name among the metrics of the run, such as ``contacts.seat.seating_velocity``; empty for a figure of the case
    metric: str
    #: `value`, `unit`: value in its SI unit
    value: float
    unit: str


def figures_of_merit(case: Case, metrics: Sequence[Metric]) -> list[FigureOfMerit]:
    """Return the figures of merit that a train has, sorted by kind, from the metrics of `compute_metrics`."""
    found = [
        FigureOfMerit(words, metric.name.split(".")[1], metric.name, metric.value, metric.unit)
        for end, words in _WORDS.items()
        for metric in metrics
        if metric.name.split(".", 2)[2:] == [end]
    ]
    if any(contact.model == "unilateral" for contact in case.record.contacts.values()):
        with suppress(FlexcamError):  # no rigid train exists
            if (margin := rigid_margin(case)[1]) is not None:
                found.append(FigureOfMerit(SPRING_MARGIN, "", "", margin, "1"))
    return found


_ANGLES = np.linspace(0.0, 2.0 * math.pi, 7201)
"""Cam angles, rad, at which the contact force of the rigid train is evaluated."""


def rigid_margin(case: Case) -> tuple[float | None, float | None]:
    """Return the speed at which the rigid train loses contact, rpm, and the spring margin at the speed of the case."""
    rigid = _rigid_limit_speed(case)
    return rigid, None if rigid is None else (rigid * RPM / case.speed) ** 2 - 1.0


def _rigid_limit_speed(case: Case) -> float | None:
    """Return the camshaft speed at which the inertia of the rigid train first equals its springs and loads, rpm.

    Friction and damping do not count. None if the inertia never pulls, or if a load is given over time.
    """
    if any(load.table is not None and load.table.over_time for load in case.record.loads.values()):
        return None
    bare = replace(case, record=case.record.model_copy(update={"friction": {}}))
    speeds = [factor * case.speed for factor in (0.5, 1.0, 2.0)]
    trains = [prepare(bare.at_speed(speed), rigid=True) for speed in speeds]
    channels: list[Mapping[str, FloatArray]] = []
    for speed, ready in zip(speeds, trains, strict=True):
        problem = replace(ready.problem, step=(_ANGLES[1] - _ANGLES[0]) / speed, steps=len(_ANGLES) - 1)
        channels.append(solve(problem, ready.scheme).channels)
    model, worst = trains[0].model, list[float]()
    for name, contact in model.cam_contacts.items():
        lifted = model.cams[contact.cam].event(_ANGLES) > main_lift(model, contact.cam)
        forces = [one[f"contacts.{name}.force"][lifted] for one in channels]
        still, _, inertia = np.linalg.solve(np.vander(speeds, increasing=True), forces)
        pulls = inertia < 0.0
        if pulls.any():
            worst.append(float(np.sqrt((np.maximum(still[pulls], 0.0) / -inertia[pulls]).min())))
    return min(worst) / RPM if worst else None
