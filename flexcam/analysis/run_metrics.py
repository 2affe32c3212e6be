"""Metrics of the last revolution of a run, its difference from the one before, figures of merit and margins."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from flexcam.analysis.preparation import PreparedRun, build_problem, prepare, scalar_probe
from flexcam.cams import event_extremes
from flexcam.case.builder import build_model
from flexcam.case.case import Case
from flexcam.case.problem_builder import MASS_CHAINS
from flexcam.core import FloatArray
from flexcam.core.errors import FlexcamError
from flexcam.core.units import RPM
from flexcam.dynamics import ConstantSpeed, Problem, Response, RunFailedError, SaveAt, equilibrium, newmark, solve
from flexcam.valvetrain import (
    Metric,
    PublishedLoad,
    StrengthSink,
    cam_forces,
    main_lift,
    omit_coil_stops,
    opposed_contacts,
    train_metrics,
)

CHATTER = 0.1
"""Difference of a contact force between two revolutions, rms, from which the contact chatters."""

GROWTH = 0.05
"""Relative difference of a stress between two revolutions from which the motion is not steady."""


@dataclass(frozen=True)
class RevolutionChange:
    """Difference of the last revolution of a run from the one before."""

    motion: float  #: maximum difference of the default probe, relative to its range
    #: root mean square of the difference of a contact force on the main lift of its cam, relative to the force's
    force: float
    contact: str = ""  #: contact of this force; empty without a cam
    member: str = ""  #: member whose maximum von Mises stress changes most; empty without members
    #: its stress in the last but one and in the last revolution at the saved instants, Pa
    stress: tuple[float, float] = (0.0, 0.0)

    @property
    def stress_change(self) -> float:
        """Relative change of the stress."""
        return abs(self.stress[1] - self.stress[0]) / (max(self.stress) or 1.0)


def revolution_change(
    ready: PreparedRun, response: Response, strength: StrengthSink | None = None
) -> RevolutionChange | None:
    """Return the deviation of the last revolution of a run from periodic; None without two revolutions."""
    time, period = response.time, ready.revolution
    if not len(time) or time[-1] - time[0] < (2.0 - _ROUNDING) * period - ready.problem.step:
        return None
    last = response.latest(period)

    def difference(values: FloatArray) -> FloatArray:
        return values[last] - np.interp(time[last] - period, time, values)

    history = response[scalar_probe(ready)].displacement if ready.model.probes else np.zeros(len(time))
    changes = dict[str, float]()
    for name, contact in ready.model.cam_contacts.items():
        if (force := response.channels.get(f"contacts.{name}.force")) is not None:
            lift = ready.model.cams[contact.cam].lift(response.angle[last], 0)
            lifted = lift > main_lift(ready.model, contact.cam)
            changes[name] = _relative(np.linalg.norm(difference(force)[lifted]), np.linalg.norm(force[last][lifted]))
    contact = max(changes, key=lambda name: changes[name], default="")
    motion = _relative(np.abs(difference(history)).max(), np.ptp(history[last]))
    member, before, now = (strength and strength.change()) or ("", 0.0, 0.0)
    return RevolutionChange(motion, changes.get(contact, 0.0), contact, member, (before, now))


def _relative(part: float | np.floating, whole: float | np.floating) -> float:
    if part <= _ROUNDING * whole:
        return 0.0
    return float(part / whole) if whole > 0.0 else 1.0


_ROUNDING = 1e-9  # relative size of rounding errors


def compute_metrics(ready: PreparedRun, response: Response, names: Sequence[str] | None = None) -> list[Metric]:
    """Return the metrics of the last revolution of a run, without those that its model cannot compute.

    With names, costly metrics that are not among them are left out.
    """
    metrics = train_metrics(ready.model, response, ready.revolution, names)
    if ready.case.record.fidelity.model not in MASS_CHAINS:
        return metrics

    def changes(metric: Metric) -> bool:
        values = response.channels[metric.name.rpartition(".")[0].replace(".power", ".torque")]
        return bool(np.ptp(values) > _ROUNDING * np.abs(values).max())

    return [metric for metric in metrics if not metric.name.startswith(("cams.", "supports.")) or changes(metric)]


def has_whole_revolution(ready: PreparedRun, steps: int) -> bool:
    """Return whether some steps of a run cover a revolution."""
    return steps * ready.problem.step > ready.revolution * (1.0 - _ROUNDING)


def describe_span(ready: PreparedRun, steps: int) -> str:
    """Return the part of a run that its metrics cover: ``last revolution``, or ``first 0.53 revolutions``."""
    if has_whole_revolution(ready, steps):
        return "last revolution"
    return f"first {steps * ready.problem.step / ready.revolution:.4g} revolutions"


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
    free = {f"contacts.{name}.nose_force.least" for name in opposed_contacts(build_model(case))}
    figures = [
        FigureOfMerit(usual_name(metric), metric.name.split(".")[1], metric.name, metric.value, metric.unit)
        for metric in metrics
        if usual_name(metric) and metric.name not in free  # over the nose of such a cam the other one drives
    ]
    figures.sort(key=lambda figure: [*_WORDS.values()].index(figure.name))
    if any(contact.model == "unilateral" for contact in case.record.contacts.values()):
        with suppress(FlexcamError):  # no rigid train exists
            if (margin := _rigid_margin(case)[1]) is not None:
                figures.append(FigureOfMerit(SPRING_MARGIN, "", "", margin, "1"))
    return figures


def usual_name(metric: Metric) -> str:
    """Return the usual name of a metric that is a figure of merit; empty for others."""
    return _WORDS.get(".".join(metric.name.split(".")[2:]), "")


@dataclass(frozen=True)
class Margins:
    """Margins of a train at its speed, from the rigid train and statics."""

    #: camshaft speed at which a rigid train loses contact, as its inertia equals its spring forces; None if never
    rigid_rpm: float | None
    #: minimum excess of the spring force over the inertia of the rigid train at the case's speed, relative to the
    #: inertia; None if the inertia never pulls
    spring_margin: float | None
    buckling_margins: Mapping[str, float]  #: ratio of buckling load to compression at full lift at rest, by member
    unknown: str = ""  #: why buckling margins are missing: no equilibrium was found


def compute_margins(case: Case) -> Margins:
    """Return the margins of spring force and buckling load."""
    rigid = _rigid_margin(case)
    try:
        return Margins(*rigid, _buckling_margins(case))
    except RunFailedError as failure:
        return Margins(*rigid, {}, failure.status.text)


# cam angles, rad, at which the contact force of the rigid train is evaluated, and then those near its minima
_ANGLES = np.linspace(0.0, 2.0 * math.pi, 721)
_NEAR = np.linspace(-1.0, 1.0, 21) * _ANGLES[1]
_NEARLY = 1.01  # ratio to the lowest speed up to which other minima are refined


def _rigid_margin(case: Case) -> tuple[float | None, float | None]:
    """Return the speed at which the rigid train loses contact, rpm, and the spring margin at the speed of the case."""
    rigid = _rigid_limit_speed(case)
    return rigid, None if rigid is None else (rigid * RPM / case.speed) ** 2 - 1.0


def _rigid_limit_speed(case: Case) -> float | None:
    """Return the camshaft speed at which the inertia of the rigid train first equals its springs and loads, rpm.

    Friction, damping and the force of touching coils do not count. None if the inertia never pulls, if a load is given
    over time, or if opposed cams or a published preload hold the followers.
    """
    if any(load.table is not None and load.table.over_time for load in case.record.loads.values()):
        return None
    frictionless = replace(case, record=case.record.model_copy(update={"friction": {}}))
    ready = prepare(frictionless, rigid=True, model=omit_coil_stops(build_model(frictionless)))
    limits = _rigid_limits(ready, case.speed, _ANGLES)
    if not limits:
        return None
    near = np.unique(np.concatenate([(angles[:, None] + _NEAR).ravel() for _, angles in limits.values()]))
    return min(speed for speed, _ in _rigid_limits(ready, case.speed, near).values()) / RPM


def _rigid_limits(ready: PreparedRun, speed: float, angles: FloatArray) -> dict[str, tuple[float, FloatArray]]:
    """Return the camshaft speed, rad/s, at which inertia first equals spring force, by contact.

    The angles, rad, are those of the minimum and of local minima that are nearly as low.
    """
    motion, model = ready.problem.drive.at(angles / speed), ready.model
    factors = 0.5, 1.0, 2.0
    motions = [replace(motion, speed=k * motion.speed, rate=k**2 * motion.rate, known=motion.cam) for k in factors]
    channels, opposed = cam_forces(model, speed, motions), opposed_contacts(model)
    results: dict[str, tuple[float, FloatArray]] = {}
    for name, contact in model.cam_contacts.items():
        if name in opposed or isinstance(contact, PublishedLoad) or not contact.unilateral:
            continue
        lifted = model.cams[contact.cam].lift(motion.angle, 0) > main_lift(model, contact.cam)
        forces = [table[name][lifted] for table in channels]
        static, _, inertia = np.linalg.solve(np.vander(factors, increasing=True), forces)
        pulls = inertia < 0.0
        if pulls.any():
            limits = np.sqrt(np.maximum(static[pulls], 0.0) / -inertia[pulls])
            padded = np.pad(limits, 1, constant_values=np.inf)
            low = (limits <= padded[:-2]) & (limits <= padded[2:]) & (limits <= _NEARLY * limits.min())
            results[name] = float(limits.min()) * speed, angles[lifted][pulls][low]
    return results


def _buckling_margins(case: Case) -> dict[str, float]:
    """Return the ratio of buckling load to compression of every member with its cam at full lift at rest."""
    model, system = build_problem(case)
    uses = tuple(channel for channel in system.channels if channel.name.endswith(".buckling_use"))
    system = replace(system, channels=uses, probes=())
    margins: dict[str, float] = {}
    angles = (cam.drive_angle(event_extremes(cam.event)[1].at) for cam in model.cams.values())
    for angle in dict.fromkeys(angles):  # valves of a cylinder share one
        drive = ConstantSpeed(case.speed, angle)
        problem = Problem(system, drive, 1e-6 / case.speed, 1, equilibrium(system, drive))
        for name, use in solve(problem, newmark(), save=SaveAt(energies=False)).channels.items():
            if float(use[0]) > _ROUNDING:
                member = name.split(".")[1]
                margins[member] = min(1.0 / float(use[0]), margins.get(member, math.inf))
    return margins
