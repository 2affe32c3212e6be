"""Why a speed goes unstable: the step, parametric growth, lost contact, or resonance, each by a test of its own.

The motion itself is computed by the case's own integrator where that is stable at any step, else by the average
acceleration: whether the integrator grows is asked of its spectral radius, not of a run that it spoils.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from flexcam.case import Case
from flexcam.checks import InputError
from flexcam.integrate import Floquet, Problem, floquet, periodic, solve
from flexcam.response import Response, RunFailedError, Status, heed
from flexcam.runner import Prepared, prepare
from flexcam.stability.discrete import Discrete, discrete
from flexcam.stability.resonance import Resonance, resonances
from flexcam.starting import broken_orders
from flexcam.train import separation
from flexcam.units import RPM

_NEAR = 0.03
"""Distance of a harmonic from a mode, as a part of its frequency, that counts as resonance."""

_HEARD = 0.01
"""Part of the largest harmonic of a contact's own force from which on one makes a resonance; weaker ones are listed."""

_REACH = 2.0
"""Times the case's speed up to which resonances are told one by one."""

_RETURNS = 1e-3
"""Part of the motion by which one that repeats may miss its beginning."""

_GROWS = 1.0 + 1e-6

_LEAST = 360
"""Steps per revolution that disturbances are followed by, at least: coarse ones step over what makes them grow."""

_MOST = 36_000
"""The same, at most: every one takes a linearization of its own, and a hundredth of a degree leaves nothing to find."""


@dataclass(frozen=True, eq=False)
class Stability:
    """Stability of a case at its speed.

    Parameters
    ----------
    rpm
        Camshaft speed.
    discrete
        Growth by the time integration at the case's step.
    floquet
        Multipliers of the periodic motion; None where there is none to be disturbed.
    why_not
        Why there are no multipliers; empty otherwise.
    resonances
        Nearest to the case's speed first.
    open_on_the_lift
        Cam angle over which a follower is off its cam on the main lift, or would have to be pulled, rad.
    status
        How the run ended that contacts, modes and the integrator are judged by.
    """

    rpm: float
    discrete: Discrete
    floquet: Floquet | None
    why_not: str
    resonances: tuple[Resonance, ...]
    open_on_the_lift: float
    status: Status

    @property
    def resonant(self) -> tuple[Resonance, ...]:
        """Resonances that the case's speed meets, with harmonics that are in the force of their contact."""
        largest: dict[str, float] = {}
        for one in self.resonances:
            largest[one.contact] = max(one.load, largest.get(one.contact, 0.0))
        near = (one for one in self.resonances if abs(one.rpm / self.rpm - 1.0) <= _NEAR)
        return tuple(one for one in near if one.load >= _HEARD * largest[one.contact])

    @property
    def highest(self) -> float:
        """Camshaft speed up to which resonances are told one by one, rpm: twice the case's own."""
        return _REACH * self.rpm

    @property
    def within(self) -> tuple[Resonance, ...]:
        """Resonances up to the highest such speed, nearest to the case's speed first."""
        return tuple(one for one in self.resonances if one.rpm <= self.highest)

    @property
    def beyond(self) -> tuple[Resonance, ...]:
        """Resonances above it, the lowest speed first."""
        return tuple(sorted((one for one in self.resonances if one.rpm > self.highest), key=lambda one: one.rpm))

    @property
    def chatters(self) -> bool:
        """Whether contacts open and close so that small differences grow: single bounces cannot be predicted."""
        return self.floquet is not None and not self.floquet.stable() and self.floquet.events > 0

    @property
    def verdict(self) -> tuple[str, ...]:
        """What endangers the speed, in this order.

        ``broken off`` (the run ended early), ``numerical``, ``parametric``, ``resonance``, ``contact loss``.
        """
        found: list[str] = [] if self.status.ok else ["broken off"]
        if self.discrete.radius > _GROWS:
            found.append("numerical")
        if self.floquet is not None and not self.floquet.stable() and not self.floquet.events:
            found.append("parametric")
        if self.resonant:
            found.append("resonance")
        if self.open_on_the_lift > 0.0:
            found.append("contact loss")
        return tuple(found)


def stability(case: Case) -> Stability:
    """Return what endangers a case at its speed."""
    method = case.record.run.integrator.made()
    limited = method.stable_to() < math.inf
    ready = prepare(case.with_average_acceleration() if limited else case)
    whole = math.ceil(ready.revolution / ready.problem.step)
    problem = replace(ready.problem, steps=max(ready.problem.steps, whole))  # causes are asked of whole revolutions
    response = solve(problem, ready.scheme, save=ready.save)
    heed(response.status)
    opened = _open(ready, response)
    why_not = "the follower leaves its cam, and what impacts follow need not repeat"
    multipliers, why_not = _multipliers(ready) if opened == 0.0 else (None, why_not)
    return Stability(
        rpm=case.speed / RPM,
        discrete=discrete(ready, method, response),
        floquet=multipliers,
        why_not=why_not,
        resonances=resonances(ready, response),
        open_on_the_lift=opened,
        status=response.status,
    )


def _multipliers(ready: Prepared) -> tuple[Floquet | None, str]:
    for key, order in broken_orders(ready.case).items():
        return None, f"what swings at order {order:g} ({key}) does not return with the camshaft"
    one = _revolution(ready)
    try:
        state = periodic(one, ready.scheme, tolerance=1e-7)
        if (missed := state.periodicity or 0.0) > _RETURNS:
            return None, f"no motion that repeats was found: it misses by {missed:.2g}"
        return floquet(replace(one, start=state), ready.scheme), ""
    except InputError as refusal:
        return None, refusal.faults[0].why
    except RunFailedError as failure:
        heed(failure.status)
        return None, failure.status.text


def _revolution(ready: Prepared) -> Problem:
    """Return one revolution, in the case's own steps where whole ones fill it and are neither too long nor too many."""
    given = round(ready.revolution / ready.problem.step)
    steps = min(max(given, _LEAST), _MOST)
    adaptive = ready.problem.adaptive if steps == given else None
    return replace(ready.problem, step=ready.revolution / steps, steps=steps, adaptive=adaptive)


def _open(ready: Prepared, response: Response) -> float:
    if not len(response.time):
        return 0.0
    last = response.latest(ready.revolution)
    return max((separation(ready.model, response, name, last) for name in ready.model.driven), default=0.0)
