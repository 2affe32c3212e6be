"""Speeds at which a harmonic of a cam meets a mode that its contact reaches.

The modes are those of the train as it is on the lift: contacts that are closed at full lift hold with their stiffness.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flexcam.motion import Event, harmonics
from flexcam.response import Response
from flexcam.runner import Prepared
from flexcam.stability.reached import force_harmonics, reached_modes
from flexcam.train import build_structure
from flexcam.units import RPM

_HARMONICS = 24
_SMALL = 1e-3
"""Part of the largest harmonic in the lift below which one is not looked at."""


@dataclass(frozen=True)
class Resonance:
    """A harmonic of a cam that meets a mode.

    Parameters
    ----------
    contact
        Name of the contact whose cam and force it is in.
    rpm
        Camshaft speed at which it does.
    harmonic
        Which, counted per camshaft revolution.
    amplitude
        Of that harmonic in the lift, m.
    load
        Of that harmonic in the contact's force in the last revolution of the run, N; zero where its steps are too few
        to tell.
    mode
        Position of the mode, from 0.
    frequency
        Of the mode, Hz.
    words
        What moves in it.
    """

    contact: str
    rpm: float
    harmonic: int
    amplitude: float
    load: float
    mode: int
    frequency: float
    words: str


def resonances(ready: Prepared, response: Response) -> tuple[Resonance, ...]:
    """Return where the harmonics of the cams meet the modes."""
    met: list[Resonance] = []
    structure = build_structure(ready.model)
    for name, contact in ready.model.driven.items():
        reached = reached_modes(ready, response, name, structure)
        lifts = lift_harmonics(ready.model.cams[contact.cam].event, _HARMONICS)
        loads = np.nan_to_num(force_harmonics(response, name, _HARMONICS))
        for n, amplitude in lifts.items():
            for i in reached.felt:
                frequency, words = float(reached.found.modes.frequencies[i]), reached.found.words(i)
                rpm, load = 60.0 * frequency / n, float(loads[n - 1])
                met.append(Resonance(name, rpm, n, amplitude, load, i, frequency, words))
    own = ready.case.speed / RPM
    return tuple(sorted(met, key=lambda one: abs(math.log(one.rpm / own))))


def lift_harmonics(event: Event, count: int) -> dict[int, float]:
    """Return the harmonics of a lift that are worth looking at."""
    sizes = np.abs(harmonics(event, count))[1:]
    return {n: float(size) for n, size in enumerate(sizes, start=1) if size >= _SMALL * sizes.max()}
