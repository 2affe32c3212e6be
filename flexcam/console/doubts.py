"""What is doubtful about a result, in words, with the number."""

from __future__ import annotations

import math

from flexcam.case import unusual
from flexcam.held import loose, unheld
from flexcam.linalg import share_lost
from flexcam.memory import Extremes
from flexcam.runner import Prepared
from flexcam.train import Figure, ModelModes, coarse_cams

_WORTH_TELLING = 1e-4
"""Part of a deflection: four digits are what tables show."""

_UNACCOUNTED = 0.01
"""Part of the work that the energy balance may miss before it is told."""


def doubts(modes: ModelModes) -> list[str]:
    """Return what is doubtful about modes, in words.

    Parameters
    ----------
    modes
        The modes.

    Returns
    -------
    list
        Sentences; none where nothing is doubtful.
    """
    return [sentence for sentence in (modes.modes.doubt(),) if sentence]


def coarse_steps(ready: Prepared) -> list[str]:
    """Return which cams the steps of a run do not see, in words.

    Parameters
    ----------
    ready
        A prepared case.

    Returns
    -------
    list
        A sentence per cam; none where the steps are short enough.
    """
    turn = ready.case.speed * ready.problem.step
    return [
        f"Warning: too few steps per revolution, {2.0 * math.pi / turn:.4g}: between two of them the lift of cam "
        f"{one.cam} departs from a straight line by up to {100.0 * one.missed:.3g} % of it; take {one.enough} or more"
        for one in coarse_cams(ready.model, turn)
    ]


def input_doubts(ready: Prepared) -> list[str]:
    """Return what is hardly meant in a case, in words: numbers, what acts on nothing, what stands open.

    Parameters
    ----------
    ready
        A prepared case.

    Returns
    -------
    list
        Sentences; none where everything is usual.
    """
    standing = unheld(ready.model, ready.problem, ready.scheme)
    return [*unusual(ready.case), *loose(ready.model), *standing, *coarse_steps(ready)]


def run_doubts(ready: Prepared, extremes: Extremes, figures: list[Figure]) -> list[str]:
    """Return what is doubtful about a run, in words.

    Parameters
    ----------
    ready
        A prepared case.
    extremes
        Of its run.
    figures
        What the train did in it.

    Returns
    -------
    list
        Sentences; none where nothing is doubtful.
    """
    found = [*input_doubts(ready), *_unseen(ready), *_buckled(figures), *_unaccounted(extremes)]
    return [*found, *_rounded(ready, extremes)]


def _unseen(ready: Prepared) -> list[str]:
    """Return what a rigid model or one of few masses does not know."""
    if ready.case.record.fidelity.model == "rigid":
        return ["Warning: rigid members know nothing of what they bear: do not read stresses and section forces off"]
    if ready.case.record.fidelity.model == "beams":
        return []
    left = "the camshaft but what its contacts feel, of surging springs and of bending"
    return [
        f"Warning: masses in the place of members know nothing of {left}: do not read twist, torque and stresses off"
    ]


def _rounded(ready: Prepared, extremes: Extremes) -> list[str]:
    if not extremes.most_bent.any() or not ready.problem.system.size:
        return []
    share = share_lost(ready.problem.system.stiffness, extremes.most_bent)
    if share <= _WORTH_TELLING:
        return []
    return [f"Warning: rounding in the stiffness may have taken up to {100.0 * share:.1g} % of the deflection"]


def _buckled(figures: list[Figure]) -> list[str]:
    return [
        f"Warning: {figure.name.removesuffix('.buckling_margin').replace('.', ' ')} bears more than its buckling load, "
        f"margin {figure.value:.4g}: a straight member bends without end"
        for figure in figures
        if figure.name.endswith(".buckling_margin") and figure.value < 1.0
    ]


def _unaccounted(extremes: Extremes) -> list[str]:
    """Return by how much the energy balance of a run does not close."""
    bounds = {name: extremes.channel(f"energy.{name}") for name in ("work", "kinetic", "strain", "residual")}
    turned_over = max(bounds[name][1] - bounds[name][0] for name in ("work", "kinetic", "strain"))
    share = max(map(abs, bounds["residual"])) / turned_over if turned_over > 0.0 else 0.0
    if share <= _UNACCOUNTED:
        return []
    why = "the steps are too long for what happens within them, or a contact is too stiff for them"
    return [f"Warning: {100.0 * share:.2g} % of the energy does not add up: {why}; take more steps per revolution"]
