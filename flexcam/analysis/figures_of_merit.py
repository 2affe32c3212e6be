"""Figures of merit of a valve train in the words of the trade."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from flexcam.analysis.limits import rigid_margin
from flexcam.case.case import Case
from flexcam.core.errors import FlexcamError
from flexcam.valvetrain import Metric

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
