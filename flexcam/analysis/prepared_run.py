"""A prepared run and its default probe."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flexcam.case.case import Case
from flexcam.core.errors import InputError, refuse
from flexcam.dynamics import ConstantSpeed, Drive, Method, Probe, Problem, SaveAt, SpeedByAngle
from flexcam.fem.frames import COMPONENTS
from flexcam.valvetrain import Model, driving_contact, rigid_motion


@dataclass(frozen=True, eq=False)
class PreparedRun:
    """Prepared run for `flexcam.dynamics.solve`."""

    case: Case  #: case
    model: Model  #: model of the case
    problem: Problem  #: system, drive, step and start
    scheme: Method  #: time integration method
    save: SaveAt  #: saved quantities and instants

    def __repr__(self) -> str:
        problem = self.problem
        return f"<Prepared {self.case!r}: {problem.steps} steps of {problem.step:.4g} s, {problem.system!r}>"

    @property
    def revolution(self) -> float:
        """Duration of a camshaft revolution, s."""
        return revolution_time(self.case, self.problem.drive)


def scalar_probe(ready: PreparedRun) -> str:
    """Return the default probe of a case: the point of a rocker, else the first moved by a cam, else the first."""
    points = [rocker.point for rocker in ready.model.rockers.values()]
    probes = [probe for probe in ready.problem.system.probes if probe.name in ready.model.probes]
    if not probes:
        raise refuse("output.probes", "none", "at least one point to compare at", "", 'add probes = ["valve"]')
    ordered = sorted(probes, key=lambda probe: probe.name not in points)
    moved = _driven_probes(ready)
    found = next((moved[probe.name] for probe in ordered if probe.name in moved), None)
    return _follower_component(ready, ordered[0]) if found is None else found.component


@dataclass(frozen=True)
class DrivenProbe:
    """Probe that a cam moves."""

    name: str  #: name of the point
    component: str  #: name of its component of largest motion
    sign: float  #: 1 or -1: the sign of this motion as the cam lifts
    contact: str | None  #: contact of the cam; None if it is not known


def driven_probe(ready: PreparedRun, probe: str | None = None) -> DrivenProbe | None:
    """Return the default probe of a case, or the one with a given name, as far as a cam moves it."""
    moved = _driven_probes(ready)
    if probe is not None:
        return moved.get(probe)
    default = scalar_probe(ready)
    return next((one for one in moved.values() if one.component == default), None)


def _driven_probes(ready: PreparedRun) -> dict[str, DrivenProbe]:
    """Return the probes moved by the rigid train."""
    if not ready.model.cam_contacts:
        return {}
    try:
        motion = ready.problem.system.prescribed_motion or rigid_motion(ready.model)
        rigid = motion.at(ConstantSpeed(1.0).at(_REVOLUTION_ANGLES))[0]
    except InputError:  # no rigid train exists: the first probe is used
        return {}
    found: dict[str, DrivenProbe] = {}
    for probe in ready.problem.system.probes:
        paths = probe.rows @ rigid.T
        i = int(np.argmax(np.ptp(paths, axis=1)))
        if np.ptp(paths[i]) > _MOTIONLESS:
            sign = 1.0 if paths[i].max() > -paths[i].min() else -1.0
            contact = driving_contact(ready.model, probe.name)
            found[probe.name] = DrivenProbe(probe.name, _component_name(probe, i), sign, contact)
    return found


_MOTIONLESS = 1e-12  # motion of a probe that is rounding, m
# angles of a revolution, rad; a lift between two of them would be too short
_REVOLUTION_ANGLES = np.linspace(0.0, 2.0 * np.pi, 361)


def _follower_component(ready: PreparedRun, probe: Probe) -> str:
    """Return the free component of a probe along the direction of the first follower, or its first free one."""
    model = ready.model
    contact = next(iter(model.cam_contacts.values()), None)
    along = "" if contact is None else COMPONENTS[int(np.argmax(np.abs(contact.direction)))]
    nodes = model.mesh.points.get(probe.name, ())
    held = {
        one for point, ones in model.supports.items() if np.isin(nodes, model.mesh.points[point]).any() for one in ones
    }
    free = [one for one in probe.components if one not in held] or list(probe.components)
    return _component_name(probe, probe.components.index(along if along in free else free[0]))


def _component_name(probe: Probe, component: int) -> str:
    """Return the name of a component of a probe; a scalar probe keeps its name."""
    return probe.name if len(probe.components) == 1 else f"{probe.name}.{probe.components[component]}"


def revolution_time(case: Case, drive: Drive) -> float:
    """Return the duration of a camshaft revolution, s."""
    return drive.period if isinstance(drive, SpeedByAngle) else 2.0 * math.pi / case.speed


MASS_CHAINS = {"sdof": 1, "chain": None}
"""Models of few masses, which represent the camshaft only by its compliance; number of masses if it is fixed."""
