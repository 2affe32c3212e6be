"""Selection of the solver engine of a problem.

*modal*: a linear system in modal coordinates, many steps at once, only numpy. *kernel*: modal coordinates and local
forces in compiled code. *direct*: factorized matrices, every system and every method. The choice depends on the problem
alone, not on whether compiled code is cached; `Problem.engine` forces one, and the statistics of a run name it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from flexcam.core.errors import refuse
from flexcam.dynamics.active_dofs import basis_of, reduce_problem
from flexcam.dynamics.basis import Basis
from flexcam.dynamics.blocks import SaveAt
from flexcam.dynamics.collocation import Collocation, collocation
from flexcam.dynamics.direct_engine import DirectEngine, Pilot
from flexcam.dynamics.engine import Engine, KinematicEngine
from flexcam.dynamics.generalized_alpha import Scheme, newmark
from flexcam.dynamics.integrator import Method
from flexcam.dynamics.kernel_engine import KernelEngine
from flexcam.dynamics.kernel_step import PROGRAM, contact_stiffness_ratio
from flexcam.dynamics.law_data import ForceLaw
from flexcam.dynamics.local_forces import LocalForces
from flexcam.dynamics.modal_coordinates import ModalCoordinates, diagonal, find_modal_coordinates, modal_problem
from flexcam.dynamics.modal_engine import ModalEngine, ProbeEngine, probe_rows
from flexcam.dynamics.problem import EngineName, Problem

MAX_MODES = 500
"""Number of unknowns up to which all modes are computed, within half a second."""

_MODAL_STEPS, _SQUARED = 1000, 15
"""Minimum number of steps for which modes are worthwhile: a constant plus the squared unknowns over a number."""

_STEP, _LAW, _SQUARE = 1.0e-4, 1.2e-4, 4.0e-9
"""Measured time of a step of the direct engine, s: at least, per force law, and per square of the unknowns."""
_COMPILER = 2.5
"""Time, s, of the direct engine for all runs to come above which the kernel engine is chosen. Compiled code takes some
seconds to compile once per installation, and half a second to load afterwards."""

_DIVISIONS = 4
"""Parts of a step that are short enough for the contacts of runs that take the collocation by default."""

_SELDOM = 10
"""Smallest interval of saved fields for which the motion between them is not computed."""
_FEW = 24
"""Number of probe scalars up to which they are computed without the motion."""


@dataclass(frozen=True, eq=False)
class SelectedEngine:
    """Engine of a problem."""

    engine: EngineName
    problem: Problem  #: the problem that the engine integrates
    bases: tuple[Basis, ...]  #: from the integrated to the output unknowns, innermost first


def select_engine(problem: Problem, method: Method) -> SelectedEngine:
    """Return the requested engine, or the fastest suitable one."""
    if problem.system.prescribed_motion is not None:
        if problem.engine not in ("auto", "direct"):
            why, remedy = "the cam prescribes the motion of a rigid model", "leave run.engine out"
            raise refuse("run.engine", problem.engine, "no engine", why, remedy)
        return SelectedEngine("direct", problem, ())
    basis = basis_of(problem)
    reduced = problem if basis is None else reduce_problem(problem, basis)
    if refusal := method.refusal(reduced.system, reduced.step):
        raise refusal
    bases = () if basis is None else (basis,)
    refusals: list[str] = []
    for engine in candidate_engines(reduced, method):
        if engine == "direct":
            return SelectedEngine("direct", reduced, bases)
        try:
            coordinates, transformed = _modal_problem(reduced, method, engine)
        except _UnsuitableEngineError as unfit:
            refusals.append(str(unfit))
        else:
            return SelectedEngine(engine, transformed, (coordinates, *bases))
    if isinstance(method, Collocation):
        raise refuse("run.integrator.method", "collocation", "newmark, hht, generalized-alpha", refusals[-1])
    remedy = "leave run.engine out: flexcam then chooses the fastest solver engine that fits"
    raise refuse("run.engine", problem.engine, "another solver engine", refusals[-1], remedy)


def default_method(problem: Problem) -> Method:
    """Return the collocation for a system with local forces if it suits the steps, else the average acceleration."""
    return collocation() if collocation_refinement(problem, 1) else newmark()


def collocation_refinement(problem: Problem, most: int = 4096) -> int | None:
    """Return the smallest power of two by which to divide the steps of a problem for the collocation.

    None if the collocation does not suit the problem, or its contacts even with a division by `most`.
    """
    system = problem.system
    if not system.local_forces or system.prescribed_motion is not None or problem.engine not in ("auto", "kernel"):
        return None
    basis = basis_of(problem)
    try:
        _, transformed = _modal_problem(
            problem if basis is None else reduce_problem(problem, basis), collocation(), "kernel"
        )
    except _UnsuitableEngineError:
        return None
    powers = (2**k for k in range(most.bit_length()))
    step = problem.step / _DIVISIONS
    return next((parts for parts in powers if contact_stiffness_ratio(transformed, step / parts) <= 1.0), None)


def candidate_engines(problem: Problem, method: Method) -> tuple[EngineName, ...]:
    """Return the requested engine, or those worthwhile for the length of the run, best first."""
    if problem.engine != "auto":
        return (problem.engine,)
    system = problem.system
    if isinstance(method, Collocation):
        return ("kernel",) if system.size else ("direct",)
    if system.local_forces:
        return ("kernel", "direct") if PROGRAM.is_available() and direct_time(problem) > _COMPILER else ("direct",)
    if problem.steps < max(_MODAL_STEPS, system.size**2 // _SQUARED):
        return ("direct",)
    damped = bool(system.damping.values.any())
    return ("modal", "kernel", "direct") if damped and direct_time(problem) > _COMPILER else ("modal", "direct")


def direct_time(problem: Problem) -> float:
    """Return the predicted time of the direct engine for a problem and its future runs, s."""
    laws = sum(len(force.groups) for force in problem.system.local_forces)
    step = _STEP + _LAW * laws + _SQUARE * min(problem.system.size, MAX_MODES) ** 2
    return problem.runs * problem.steps * step


class _UnsuitableEngineError(ValueError):
    """Reason why an engine cannot integrate a problem."""


def _modal_problem(problem: Problem, method: Method, engine: EngineName) -> tuple[ModalCoordinates, Problem]:
    system = problem.system
    if not isinstance(method, Scheme) and not (engine == "kernel" and isinstance(method, Collocation)):
        raise _UnsuitableEngineError("it integrates only with newmark, hht and generalized-alpha")
    if problem.adaptive is not None:
        raise _UnsuitableEngineError("it has no adaptive steps")
    if not 0 < system.size <= MAX_MODES:
        raise _UnsuitableEngineError(
            f"the system has {system.size} unknowns; all modes of 1 to {MAX_MODES} are computed"
        )
    if engine == "modal" and system.local_forces:
        raise _UnsuitableEngineError(f"the force {system.local_forces[0].name} depends on the motion")
    if engine == "kernel" and not PROGRAM.is_available():
        raise _UnsuitableEngineError("numba is not installed, or NUMBA_DISABLE_JIT is set")
    for force in system.local_forces:
        if not isinstance(force.law, ForceLaw):
            raise _UnsuitableEngineError(f"the law of {force.name} is a Python object")
    coordinates = find_modal_coordinates(system)
    if coordinates is None:
        raise _UnsuitableEngineError("mass or stiffness are not symmetric and positive, or modes coincide")
    transformed = modal_problem(problem, coordinates)
    if engine == "modal" and diagonal(transformed.system.damping) is None:
        raise _UnsuitableEngineError("the damping couples the modes")
    return coordinates, transformed


def forces_of(selected: SelectedEngine, method: Method) -> LocalForces:
    """Return the local forces of a problem, their energies evaluated by compiled code where the kernel engine runs."""
    compiled = PROGRAM.compile() if selected.engine == "kernel" else None
    return LocalForces(selected.problem.system, compiled, impacts_only=not method.locates_contacts)


def create_engine(
    selected: SelectedEngine, method: Method, forces: LocalForces, save: SaveAt, stop: Callable[[], bool], pilot: Pilot
) -> Engine:
    """Return the engine, ready to start."""
    if selected.engine != "direct" and isinstance(method, Scheme | Collocation):
        if selected.engine == "modal" and isinstance(method, Scheme):
            sparse = not save.channels and save.field_every >= _SELDOM
            if sparse and 0 < len(probe_rows(selected.problem)) <= _FEW:
                return ProbeEngine(selected.problem, method, save, stop)
            return ModalEngine(selected.problem, method, stop)
        return KernelEngine(selected.problem, method, forces, stop)
    system = selected.problem.system
    if system.prescribed_motion is not None or (not system.size and not forces.count):
        return KinematicEngine(selected.problem, forces, stop)
    return DirectEngine(selected.problem, method, forces, stop, pilot)
