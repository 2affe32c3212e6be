"""What is doubtful about a result, in words, with the number."""

from __future__ import annotations

import math

from flexcam.case import unusual
from flexcam.console.lobes import lobe_doubts
from flexcam.console.mishaps import mishaps
from flexcam.console.watched import Watched
from flexcam.held import idle_loads, loose, overshot, struck, unheld
from flexcam.integrate import newmark
from flexcam.linalg import share_lost
from flexcam.memory import Extremes
from flexcam.response import Stats
from flexcam.runner import Prepared
from flexcam.train import Figure, Fineness, ModelModes, coarse_cams, compressed, stiff_struts
from flexcam.untold import pressed_shut, shared

_WORTH_TELLING = 1e-4
"""Part of a deflection: four digits are what tables show."""

_LEAST_STEPS = 20
"""In a period: below it the usual schemes miss more than a percent of the period."""

_LEAST_ELEMENTS = 4
"""In a wave of bending: below it cubic elements miss half a percent of its frequency."""

_LEAST_IMPACT = 5
"""Steps of an impact: below it the largest force may lie a twentieth above the largest that is seen."""

_UNBALANCED = 0.01
"""Part of the largest force that may be out of balance: some schemes balance forces between the instants."""

_UNACCOUNTED = 0.01
"""Part of the work that the energy balance may miss, or the time integration dissipate, before it is told."""


def doubts(modes: ModelModes) -> list[str]:
    """Return what is doubtful about modes, in words."""
    return [sentence for sentence in (modes.modes.doubt(),) if sentence]


def coarse_steps(ready: Prepared) -> list[str]:
    """Return which cams the steps of a run do not see, in words."""
    turn = ready.case.speed * ready.problem.step
    return [
        f"Warning: too few steps per revolution, {2.0 * math.pi / turn:.4g}: between two of them the lift of cam "
        f"{one.cam} departs from a straight line by up to {100.0 * one.missed:.3g} % of it; take {one.enough} or more"
        for one in coarse_cams(ready.model, turn)
    ]


def input_doubts(ready: Prepared) -> list[str]:
    """Return what is hardly meant in a case, in words: numbers, lobes, what acts on nothing, what stands open."""
    standing = [*unheld(ready.model, ready.problem, ready.scheme), *struck(ready.case, ready.model, ready.problem)]
    standing += overshot(ready.problem, ready.scheme)
    idle = [*loose(ready.model), *idle_loads(ready.model, ready.problem)]
    rigid = [] if ready.problem.system.size else [one(ready.model, ready.case.speed) for one in (shared, pressed_shut)]
    untold = [sentence for told in rigid for sentence in told]
    coarse = [*coarse_steps(ready), *_stiff(ready)]
    return [*unusual(ready.case), *lobe_doubts(ready.model), *idle, *standing, *untold, *coarse]


def _stiff(ready: Prepared) -> list[str]:
    """Return which members have too few elements for their geometric stiffness."""
    return [
        f"Warning: too few elements in member {one.member} for its geometric stiffness: {_borne(one.excess)}; "
        f"take {one.elements}"
        for one in (stiff_struts(ready.model) if _bodies(ready) else [])
    ]


def _borne(excess: float) -> str:
    if math.isinf(excess):
        return "its supports leave no node that could bend it"
    return f"before it bends away it bears {100.0 * excess:.2g} % more than its buckling load"


def run_doubts(ready: Prepared, watched: Watched, figures: list[Figure], stats: Stats) -> list[str]:
    """Return what is doubtful about a run, in words."""
    found = [*input_doubts(ready), *unseen(ready), *mishaps(figures), *_unaccounted(watched.extremes)]
    found += [*_integrated_away(ready, watched.extremes), *_unbalanced(stats), *_rounded(ready, watched.extremes)]
    return found + _coarse(watched.fineness.found()) if _bodies(ready) else found


def unseen(ready: Prepared) -> list[str]:
    """Return what a rigid model or one of few masses does not know, in words."""
    if ready.case.record.fidelity.model == "rigid":
        return ["Warning: rigid members know nothing of what they bear: do not read stresses and section forces off"]
    if ready.case.record.fidelity.model == "beams":
        return []
    left = "the camshaft but what its contacts feel, of surging springs and of bending"
    return [
        f"Warning: masses in the place of members know nothing of {left}: do not read twist, torque and stresses off",
        *_unfelt(ready),
    ]


def _unfelt(ready: Prepared) -> list[str]:
    """Return of which members few masses do not know the compression."""
    told = {channel.name for channel in ready.problem.system.channels}
    missing = [name for name in compressed(ready.model) if f"members.{name}.compression" not in told]
    if not missing:
        return []
    why = "no mass stands behind, so that springs would be all that is borne, and nothing of the inertia there"
    remedy = 'take fidelity.model = "chain" with two masses or more'
    return [f"Warning: compression and buckling of {', '.join(missing)} are not told: {why}; {remedy}"]


def _rounded(ready: Prepared, extremes: Extremes) -> list[str]:
    if not extremes.most_bent.any() or not ready.problem.system.size:
        return []
    share = share_lost(ready.problem.system.stiffness, extremes.most_bent)
    if share <= _WORTH_TELLING:
        return []
    return [f"Warning: rounding in the stiffness may have taken up to {100.0 * share:.1g} % of the deflection"]


def lost_energy(extremes: Extremes) -> float:
    """Return how much of the energy does not add up."""
    return abs(_largest_share(extremes, "residual"))


def numerical_energy(extremes: Extremes) -> float:
    """Return how much of the energy the time integration dissipates; below zero where it adds energy."""
    return _largest_share(extremes, "numerical")


def _largest_share(extremes: Extremes, part: str) -> float:
    """Return the largest value of a part of the energy balance, by the largest range of work and stored energies."""
    bounds = (extremes.channel(f"energy.{name}") for name in ("work", "kinetic", "strain"))
    turned_over = max(largest - least for least, largest in bounds)
    return max(extremes.channel(f"energy.{part}"), key=abs) / turned_over if turned_over > 0.0 else 0.0


def balances(extremes: Extremes, stats: Stats) -> str:
    """Return how well energy and forces of a run add up, in words."""
    if not extremes.energies:
        return ""
    forces = f"forces within {stats.imbalance:.1e} of the largest" if stats.imbalance >= 0.0 else "forces not looked at"
    residual, numerical = lost_energy(extremes), numerical_energy(extremes)
    return f"residual {residual:.1e}, numerical dissipation {numerical:.2g} of the external work; {forces}"


def _bodies(ready: Prepared) -> bool:
    """Tell whether a run has the unknowns of its members."""
    return ready.case.record.fidelity.model == "beams" and ready.problem.system.size > 0


def _coarse(found: Fineness) -> list[str]:
    """Return what steps and elements are too coarse for."""
    at = f"at the {found.frequency:.4g} Hz of the accelerations"
    more = math.ceil(10.0 * _LEAST_STEPS / found.steps) / 10.0
    steps = f"Warning: a period has {found.steps:.3g} steps {at}; take {more:.2g} times as many"
    elements = [
        f"Warning: a wave of bending of member {name} has {count:.2g} of its elements {at}; "
        f"take {math.ceil(_LEAST_ELEMENTS / count)} times as many"
        for name, count in found.elements.items()
        if count < _LEAST_ELEMENTS
    ]
    impacts = [
        f"Warning: the largest force of contact {name} is that of an impact of {count} step{'s' if count > 1 else ''}: "
        f"take more steps per revolution, or a softer contact"
        for name, count in found.impacts.items()
        if count < _LEAST_IMPACT
    ]
    return [*([steps] if found.steps < _LEAST_STEPS else []), *elements, *impacts]


def _unbalanced(stats: Stats) -> list[str]:
    if stats.imbalance <= _UNBALANCED:
        return []
    why = "the steps are too long for the motion; take more steps per revolution"
    return [f"Warning: forces are out of balance by up to {100.0 * stats.imbalance:.2g} % of the largest: {why}"]


def _unaccounted(extremes: Extremes) -> list[str]:
    """Return by how much the energy balance of a run does not close."""
    share = lost_energy(extremes)
    if share <= _UNACCOUNTED:
        return []
    why = "the steps are too long for what happens within them, or a contact is too stiff for them"
    return [f"Warning: {100.0 * share:.2g} % of the energy does not add up: {why}; take more steps per revolution"]


def _integrated_away(ready: Prepared, extremes: Extremes) -> list[str]:
    """Return how much energy the time integration dissipates or adds, where it counts."""
    share = numerical_energy(extremes)
    if abs(share) <= _UNACCOUNTED:
        return []
    does = "dissipates" if share > 0.0 else "adds"
    other = "" if ready.scheme == newmark() else ', or integrator = { method = "newmark" }'
    told = f"{100.0 * abs(share):.2g} % of the external work: the steps are too long for what happens within them"
    return [f"Warning: the time integration {does} {told}; take more steps per revolution{other}"]
