"""Speeds at which a harmonic of a cam meets a mode that its contact reaches.

The modes are those of the train as it is on the lift: contacts that are closed at full lift hold with their stiffness.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flexcam.integrate import Tangents
from flexcam.linalg import FloatArray, Triplets
from flexcam.motion import Event, harmonics
from flexcam.response import Response
from flexcam.runner import Prepared
from flexcam.stability.discrete import MOST
from flexcam.train import build_structure, model_modes
from flexcam.units import RPM

_HARMONICS = 24
_SMALL = 1e-3
"""Part of the largest harmonic in the lift below which one is not looked at."""

_REACHED = 1e-2
"""Part of the largest modal force below which a contact does not reach a mode."""


@dataclass(frozen=True)
class Resonance:
    """A harmonic of a cam that meets a mode.

    Parameters
    ----------
    rpm
        Camshaft speed at which it does.
    harmonic
        Which, counted per camshaft revolution.
    amplitude
        Of that harmonic in the lift, m.
    load
        Of that harmonic in the contact's force in the last revolution of the run, N.
    mode
        Position of the mode, from 0.
    frequency
        Of the mode, Hz.
    words
        What moves in it.
    """

    rpm: float
    harmonic: int
    amplitude: float
    load: float
    mode: int
    frequency: float
    words: str


def resonances(ready: Prepared, response: Response) -> tuple[Resonance, ...]:
    """Return where the harmonics of the cams meet the modes.

    Parameters
    ----------
    ready
        A case, prepared.
    response
        Of its run.

    Returns
    -------
    tuple
        Nearest to the case's speed first.

    Raises
    ------
    RunFailedError
        If the train has no modes at full lift: an axial load is beyond buckling.
    """
    met: list[Resonance] = []
    structure = build_structure(ready.model)
    last = response.latest(ready.revolution)
    for name, contact in ready.model.driven.items():
        cam = ready.model.cams[contact.cam]
        found = model_modes(structure, held=_held(ready, response, cam.event))
        push = structure.row(contact.follower, contact.direction) - structure.row(cam.at, contact.direction)
        reached = np.abs(push @ found.modes.shapes)
        modes: list[int] = np.flatnonzero(reached > _REACHED * reached.max(initial=0.0)).tolist()
        lifts = np.abs(harmonics(cam.event, _HARMONICS))[1:]
        loads = _in_force(response.channels.get(f"contacts.{name}.force", np.zeros(0))[last])
        for n in (np.flatnonzero(lifts >= _SMALL * lifts.max()) + 1).tolist():
            amplitudes = float(lifts[n - 1]), float(loads[n - 1])
            for i in modes:
                frequency = float(found.modes.frequencies[i])
                met.append(Resonance(60.0 * frequency / n, n, *amplitudes, i, frequency, found.words(i)))
    rpm = ready.case.speed / RPM
    return tuple(sorted(met, key=lambda one: abs(math.log(one.rpm / rpm)) if one.rpm > 0.0 else math.inf))


def _held(ready: Prepared, response: Response, event: Event) -> Triplets | None:
    """Return the stiffness of what is closed at the saved instant of the largest lift."""
    system = ready.problem.system
    late = response.field_time > response.field_time[-1:] - ready.revolution
    if not late.any() or not system.local_forces or system.size > MOST:
        return None
    at = np.flatnonzero(late)[[int(np.argmax(event(response.field_angle[late], 0)))]]
    motion = ready.problem.drive.at(response.field_time[at])
    tangents = Tangents(system, motion, response.fields.displacement[at], response.fields.velocity[at])
    more = tangents.at(0)[1] - system.stiffness.dense()
    return Triplets.from_dense(0.5 * (more + more.T))


def _in_force(force: FloatArray) -> FloatArray:
    """Return the amplitudes of a force's harmonics over a revolution, N, from the first."""
    found = np.zeros(_HARMONICS)
    if len(force) > 2 * _HARMONICS:
        found[:] = 2.0 * np.abs(np.fft.rfft(force))[1 : _HARMONICS + 1] / len(force)
    return found
