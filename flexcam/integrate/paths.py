"""Which way through time a problem takes: the general one, or a faster one with the same result.

``general``: every system and method, one step after the other. ``modal``: a linear system in its natural motions, all
side by side. The choice is automatic, told by the statistics of a run, and can be forced by `Problem.path`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from flexcam.checks import refuse
from flexcam.integrate.engine import Engine
from flexcam.integrate.local import LocalForces
from flexcam.integrate.method import Method
from flexcam.integrate.problem import Path, Problem
from flexcam.integrate.scheme import Scheme
from flexcam.integrate.stepwise import Pilot, Stepwise
from flexcam.integrate.superposed import Superposed
from flexcam.integrate.uncoupled import Natural, diagonal, natural_motions, uncoupled
from flexcam.integrate.within import basis_of, within
from flexcam.response import SaveAt
from flexcam.system import Basis

_MOST = 200
"""Unknowns up to which all natural motions are found within a fraction of a second."""

_WORTH = 1000
"""Steps from which the natural motions are worth finding."""

_SPARSE = 10
"""Steps between saved fields from which every one of them can be gone on from bit by bit."""


@dataclass(frozen=True, eq=False)
class Way:
    """How a problem is taken.

    Parameters
    ----------
    path
        Name of the way.
    problem
        What is integrated.
    bases
        How the unknowns shown follow from those integrated, the innermost first.
    natural
        The natural motions, where it is taken in them.
    """

    path: Path
    problem: Problem
    bases: tuple[Basis, ...]
    natural: Natural | None = None


def way_of(problem: Problem, method: Method, save: SaveAt) -> Way:
    """Return how a problem is taken.

    Parameters
    ----------
    problem
        The problem.
    method
        Of the time integration.
    save
        What is kept.

    Returns
    -------
    Way
        The fastest that fits, or the one asked for.

    Raises
    ------
    InputError
        If the method cannot integrate it, or the way asked for is none for it.
    """
    basis = basis_of(problem)
    plain = problem if basis is None else within(problem, basis)
    if refusal := method.refusal(plain.system, plain.step):
        raise refusal
    outer = () if basis is None else (basis,)
    if problem.path == "general" or (problem.path == "auto" and problem.steps < _WORTH):
        return Way("general", plain, outer)
    why, natural = _unfit(plain, method), None
    if not why:
        why, natural = _uncoupled(plain)
    if natural is not None:
        natural = replace(natural, exactly=save.field_every >= _SPARSE)
        return Way("modal", uncoupled(plain, natural), (natural, *outer), natural)
    if problem.path == "auto":
        return Way("general", plain, outer)
    remedy = "leave run.path out, and the fastest way that fits is taken"
    raise refuse("run.path", problem.path, "general", why, remedy)


def _unfit(problem: Problem, method: Method) -> str:
    """Return why a problem cannot be taken in its natural motions; nothing where it may."""
    system = problem.system
    if not isinstance(method, Scheme):
        return "only newmark, hht and generalized-alpha go that way"
    if problem.adaptive is not None:
        return "its steps adapt"
    if system.local_forces:
        return f"{system.local_forces[0].name} depends on the motion"
    if not 0 < system.size <= _MOST:
        return f"it has {system.size} unknowns, and all motions of 1 to {_MOST} are carried"
    return ""


def _uncoupled(problem: Problem) -> tuple[str, Natural | None]:
    """Return the natural motions, or why there are none to be had."""
    found = natural_motions(problem.system)
    if found is None:
        return "mass or stiffness are not positive, or natural motions too close to be told apart", None
    if diagonal(uncoupled(problem, found).system.damping) is None:
        return "its damping couples the natural motions", None
    return "", found


def engine_of(
    way: Way, method: Method, forces: LocalForces, save: SaveAt, stop: Callable[[], bool], pilot: Pilot
) -> Engine:
    """Return what walks through a problem.

    Parameters
    ----------
    way
        How it is taken.
    method
        Of the time integration.
    forces
        The local forces of what is integrated, stacked.
    save
        What is kept.
    stop
        Asked whether to end.
    pilot
        Of a run whose steps adapt.

    Returns
    -------
    Engine
        Ready to begin.
    """
    if way.natural is not None and isinstance(method, Scheme):
        return Superposed(way.problem, method, save, stop, way.natural)
    return Stepwise(way.problem, method, forces, save, stop, pilot)
