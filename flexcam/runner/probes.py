"""The probe that stands for a case."""

from __future__ import annotations

import numpy as np

from flexcam.checks import InputError, refuse
from flexcam.fem import COMPONENTS
from flexcam.runner.prepared import Prepared
from flexcam.system import Probe
from flexcam.train import ANY_SPEED, build_rigid


def scalar_probe(ready: Prepared) -> str:
    """Return the probe that stands for a case: a rocker's point, else the first that a cam moves, else the first."""
    points = [rocker.point for rocker in ready.model.rockers.values()]
    probes = [probe for probe in ready.problem.system.probes if probe.name in ready.model.probes]
    if not probes:
        raise refuse("output.probes", "none", "at least one point to compare at", "", 'add probes = ["valve"]')
    ordered = sorted(probes, key=lambda probe: probe.name not in points)
    moved = _moved_by_cams(ready)
    return next((moved[probe.name] for probe in ordered if probe.name in moved), _along_follower(ready, ordered[0]))


def _moved_by_cams(ready: Prepared) -> dict[str, str]:
    """Return the probes that the rigid train moves, each with the component that it moves most."""
    if not ready.model.driven:
        return {}
    try:
        rigid = build_rigid(ready.model, ANY_SPEED)
    except InputError:  # no rigid train can be made of it: then the first probe will do
        return {}
    strokes = {probe: [0.0 if one is None else float(np.ptp(one(_ROUND, 0))) for one in probe.offset]
               for probe in rigid.probes}  # fmt: skip
    return {probe.name: _named(probe, int(np.argmax(path))) for probe, path in strokes.items() if max(path) > 0.0}


_ROUND = np.linspace(0.0, 2.0 * np.pi, 361)
"""Angles of a revolution; a lift between two of them would be none."""


def _along_follower(ready: Prepared, probe: Probe) -> str:
    """Return the component of a probe along the first follower's direction, or its first one."""
    contact = next(iter(ready.model.driven.values()), None)
    along = "" if contact is None else COMPONENTS[int(np.argmax(np.abs(contact.direction)))]
    return _named(probe, probe.components.index(along) if along in probe.components else 0)


def _named(probe: Probe, component: int) -> str:
    """Return what a component of a probe is called; a probe of one has its own name."""
    return probe.name if len(probe.components) == 1 else f"{probe.name}.{probe.components[component]}"
