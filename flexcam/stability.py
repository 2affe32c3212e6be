"""Why a speed goes unstable: the step, parametric growth, lost contact, or resonance, each by a test of its own.

May import `runner` and everything below it; `flexcam stability` prints what stands here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from flexcam.case import Case
from flexcam.checks import InputError
from flexcam.integrate import Floquet, floquet, periodic, solve
from flexcam.motion import harmonics
from flexcam.response import RunFailedError
from flexcam.runner import Prepared, modes, prepare
from flexcam.train import ModelModes, build_structure, separation
from flexcam.units import RPM

_HARMONICS = 24
_NEAR = 0.03
"""Distance of a harmonic from a mode, as a part of its frequency, that counts as resonance."""

_SMALL = 1e-4
"""Part of the lift below which a harmonic is not looked at."""

_REACHED = 1e-6
"""Part of the largest modal force below which a contact does not reach a mode."""

_GROWS = 1.0 + 1e-6


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
    mode: int
    frequency: float
    words: str


@dataclass(frozen=True, eq=False)
class Stability:
    """Stability of a case at its speed.

    Parameters
    ----------
    rpm
        Camshaft speed.
    radius
        Largest spectral radius of the integrator over the modes, at the case's step.
    endangered
        Frequency of the mode it belongs to, Hz.
    floquet
        Multipliers of the periodic motion; None where there is none to be disturbed.
    why_not
        Why there are no multipliers; empty otherwise.
    resonances
        Nearest to the case's speed first.
    open_on_the_lift
        Cam angle over which a follower is off its cam on the main lift, or would have to be pulled, rad.
    """

    rpm: float
    radius: float
    endangered: float
    floquet: Floquet | None
    why_not: str
    resonances: tuple[Resonance, ...]
    open_on_the_lift: float

    @property
    def resonant(self) -> tuple[Resonance, ...]:
        """Resonances that the case's speed meets."""
        return tuple(one for one in self.resonances if abs(one.rpm / self.rpm - 1.0) <= _NEAR)

    @property
    def verdict(self) -> tuple[str, ...]:
        """What endangers the speed: ``numerical``, ``parametric``, ``resonance``, ``contact loss``, in this order."""
        found: list[str] = []
        if self.radius > _GROWS:
            found.append("numerical")
        if self.floquet is not None and not self.floquet.stable():
            found.append("parametric")
        if self.resonant:
            found.append("resonance")
        if self.open_on_the_lift > 0.0:
            found.append("contact loss")
        return tuple(found)


def stability(case: Case) -> Stability:
    """Return what endangers a case at its speed.

    Parameters
    ----------
    case
        The case.

    Returns
    -------
    Stability
        Each cause by a test of its own: the spectral radius of the discrete system, the Floquet multipliers of the
        periodic motion, the cam's harmonics against the modes, and the contact force of a run.

    Raises
    ------
    InputError
        If parts do not fit together.
    RunFailedError
        If the run cannot even start.
    """
    ready, found = prepare(case), modes(case)
    omega = 2.0 * math.pi * found.modes.frequencies
    radii = [ready.scheme.spectral_radius(float(w) * ready.problem.step) for w in omega]
    worst = int(np.argmax(radii)) if radii else 0
    opened = _open(ready)
    why_not = "the follower leaves its cam, and what impacts follow need not repeat"
    multipliers, why_not = _multipliers(ready) if opened == 0.0 else (None, why_not)
    return Stability(
        rpm=case.speed / RPM,
        radius=float(radii[worst]) if radii else 0.0,
        endangered=float(found.modes.frequencies[worst]) if radii else 0.0,
        floquet=multipliers,
        why_not=why_not,
        resonances=_resonances(ready, found),
        open_on_the_lift=opened,
    )


def _multipliers(ready: Prepared) -> tuple[Floquet | None, str]:
    steps = round(ready.revolution / ready.problem.step)
    one = replace(ready.problem, steps=steps)
    try:
        state = periodic(one, ready.scheme, tolerance=1e-7)
        found = floquet(replace(one, start=state), ready.scheme)
    except InputError as refusal:
        return None, refusal.faults[0].why
    except RunFailedError as failure:
        return None, failure.status.text
    if (state.periodicity or 0.0) > 1e-3:
        return found, f"the motion returns only within {state.periodicity:.2g}: multipliers are those of a near miss"
    return found, ""


def _resonances(ready: Prepared, found: ModelModes) -> tuple[Resonance, ...]:
    met: list[Resonance] = []
    rpm = ready.case.speed / RPM
    structure = build_structure(ready.model)
    for contact in ready.model.driven.values():
        event = ready.model.cams[contact.cam].event
        push = structure.row(contact.follower, contact.direction) - structure.row(
            ready.model.cams[contact.cam].at, contact.direction
        )
        reached = np.abs(push @ found.modes.shapes)
        for n, amplitude in enumerate(np.abs(harmonics(event, _HARMONICS))[1:].tolist(), start=1):
            if amplitude < _SMALL * event.height:
                continue
            for i in np.flatnonzero(reached > _REACHED * reached.max(initial=0.0)).tolist():
                frequency = float(found.modes.frequencies[i])
                met.append(Resonance(60.0 * frequency / n, n, amplitude, i, frequency, found.words(i)))
    return tuple(sorted(met, key=lambda one: abs(math.log(one.rpm / rpm)) if one.rpm > 0.0 else math.inf))


def _open(ready: Prepared) -> float:
    response = solve(ready.problem, ready.scheme, save=ready.save)
    if not len(response.time):
        return 0.0
    last = response.time > response.time[-1] - ready.revolution * (1.0 - 1e-9)
    return max((separation(ready.model, response, name, last) for name in ready.model.driven), default=0.0)
