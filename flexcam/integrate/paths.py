"""Which way through time a problem takes: the general one, or a faster one with the same result.

``general``: every system and method, one step after the other. ``modal``: a linear system in its natural motions, all
side by side and many steps at once. ``compiled``: natural motions, and what acts between them, in machine code: local
forces, damping that couples. The choice is automatic and depends on the problem alone where numba is installed, not on
whether its code is kept already; it is told by the statistics of a run and can be forced by `Problem.path`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from flexcam.checks import refuse
from flexcam.integrate.carried import Carried
from flexcam.integrate.engine import Engine
from flexcam.integrate.generalized_alpha import Scheme
from flexcam.integrate.glancing import Glancing, watched_rows
from flexcam.integrate.jit import is_available
from flexcam.integrate.kernel_engine import KernelEngine, compiled_functions
from flexcam.integrate.local import LocalForces
from flexcam.integrate.method import Method
from flexcam.integrate.problem import Path, Problem
from flexcam.integrate.stepwise import Pilot, Stepwise
from flexcam.integrate.superposed import Superposed
from flexcam.integrate.uncoupled import Natural, diagonal, natural_motions, uncoupled
from flexcam.integrate.within import basis_of, within
from flexcam.response import SaveAt
from flexcam.system import Basis, ForceLaw, System

MOST = 500
"""Unknowns up to which all natural motions are found within half a second."""

_WORTH, _SQUARED = 1000, 15
"""Steps from which natural motions are worth finding: so many, and of more unknowns their square over so many."""

_WORTH_COMPILING, _WORTH_COMPILING_LINEAR = 5_000, 100_000
"""Steps of all runs that cost more elsewhere than the compiler at its first use, with local forces and with damping."""

_SPARSE = 10
"""Steps between saved fields from which every one of them can be gone on from bit by bit."""

_FEW = 24
"""Scalars of probes up to which they are found without the motions."""


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
    """Return how a problem is taken."""
    basis = basis_of(problem)
    plain = problem if basis is None else within(problem, basis)
    if refusal := method.refusal(plain.system, plain.step):
        raise refusal
    outer = () if basis is None else (basis,)
    refusals: list[str] = []
    for path in wanted_paths(plain):
        if path == "general":
            return Way("general", plain, outer)
        try:
            exactly = save.field_every >= _SPARSE and problem.runs == 1  # nobody goes on from one of many runs
            natural, inside = _natural(plain, method, path, exactly=exactly)
        except _UnfitError as unfit:
            refusals.append(str(unfit))
        else:
            return Way(path, inside, (natural, *outer), natural)
    remedy = "leave run.path out, and the fastest way that fits is taken"
    raise refuse("run.path", problem.path, "another path", refusals[-1], remedy)


def wanted_paths(problem: Problem) -> tuple[Path, ...]:
    """Return the way that is asked for, or those that its length makes worthwhile, the best one first."""
    if problem.path != "auto":
        return (problem.path,)
    steps = problem.runs * problem.steps if is_available() else 0
    if problem.system.local_forces:
        return ("compiled", "general") if steps >= _WORTH_COMPILING else ("general",)
    if problem.steps < max(_WORTH, problem.system.size**2 // _SQUARED):
        return ("general",)
    damped = bool(problem.system.damping.values.any())
    return ("modal", "compiled", "general") if damped and steps >= _WORTH_COMPILING_LINEAR else ("modal", "general")


class _UnfitError(ValueError):
    """Why a problem cannot go a way."""


def _natural(problem: Problem, method: Method, path: Path, *, exactly: bool) -> tuple[Natural, Problem]:
    """Return the natural motions of a problem that can be taken in them, and the problem in these."""
    system = problem.system
    if not isinstance(method, Scheme):
        raise _UnfitError("only newmark, hht and generalized-alpha go that way")
    if problem.adaptive is not None:
        raise _UnfitError("its steps adapt")
    if not 0 < system.size <= MOST:
        raise _UnfitError(f"it has {system.size} unknowns, and all motions of 1 to {MOST} are carried")
    if path == "modal" and system.local_forces:
        raise _UnfitError(f"{system.local_forces[0].name} depends on the motion")
    if path == "compiled":
        _refuse_uncompiled(system)
    found = natural_motions(system)
    if found is None:
        raise _UnfitError("mass or stiffness are not symmetric and positive, or natural motions not to be told apart")
    inside = uncoupled(problem, found)
    if path == "modal" and diagonal(inside.system.damping) is None:
        raise _UnfitError("its damping couples the natural motions")
    return replace(found, exactly=exactly), inside


def _refuse_uncompiled(system: System) -> None:
    if not is_available():
        raise _UnfitError("numba is not installed")
    for force in system.local_forces:
        if not isinstance(force.law, ForceLaw):
            raise _UnfitError(f"the law of {force.name} is not known in machine code")


def forces_of(way: Way) -> LocalForces:
    """Return the local forces of a problem, their energies evaluated by compiled code where the kernel engine runs."""
    return LocalForces(way.problem.system, compiled_functions() if way.path == "compiled" else None)


def engine_of(
    way: Way, method: Method, forces: LocalForces, save: SaveAt, stop: Callable[[], bool], pilot: Pilot
) -> Engine:
    """Return what walks through a problem."""
    if way.natural is not None and isinstance(method, Scheme):
        if way.path == "modal":
            seldom = not save.channels and save.field_every >= _SPARSE
            few = seldom and 0 < len(watched_rows(way.problem)) <= _FEW
            return (Glancing if few else Superposed)(way.problem, method, save, stop, way.natural)
        return KernelEngine(way.problem, method, forces, stop)
    if not way.problem.system.size and not forces.count:
        return Carried(way.problem, forces, stop)
    return Stepwise(way.problem, method, forces, save, stop, pilot)
