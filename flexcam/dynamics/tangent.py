"""Exact derivatives of a run by parameters: one run, and the evolution of the disturbances by all parameters.

A run with a parameter near its value is, to first order, the motion plus the disturbances by this parameter.
All results of such neighbouring runs are evaluated from these motions as from any other, so that their differences are
derivatives. Differences of two integrated runs would contain the noise of contact events; these do
not.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from flexcam.core import FloatArray, IntArray
from flexcam.core.errors import refuse
from flexcam.dynamics.active_dofs import basis_of, reduce_problem
from flexcam.dynamics.basis import DofSubset
from flexcam.dynamics.blocks import SaveAt
from flexcam.dynamics.disturbances import Disturbances
from flexcam.dynamics.engine import iterate_tracks
from flexcam.dynamics.engine_selection import SelectedEngine, create_engine, forces_of, select_engine
from flexcam.dynamics.generalized_alpha import Scheme
from flexcam.dynamics.integrator import Method
from flexcam.dynamics.linearization import split_state
from flexcam.dynamics.local_forces import LocalForces
from flexcam.dynamics.parameter_forces import ParameterForces, Variation, VariedProblem
from flexcam.dynamics.periodic import FREE
from flexcam.dynamics.problem import Problem
from flexcam.dynamics.response import Response
from flexcam.dynamics.solve import Recorder, pilot
from flexcam.dynamics.step_state import SensedTrajectory, Trajectory
from flexcam.dynamics.system import System


@dataclass(frozen=True, eq=False)
class TangentRun:
    """A run and its neighbours by parameters."""

    response: Response  #: results at the values of the parameters: probes and channels, without energies
    #: Results half the change of each parameter before and after the run, to first order. The former have the equations
    #: of the run, the latter those of the variation: contacts about to open or close are treated alike on both sides.
    neighbours: tuple[tuple[Response, Response], ...]
    instants: IntArray  #: those of the response that the neighbours have
    #: Factor by which a small disturbance of the initial state grows over the run, in the energy norm. Above some
    #: thousands the motion is chaotic: the derivatives hold for very small changes only.
    growth: float


def tangent_run(
    problem: Problem, method: Method, variations: Sequence[Variation], *, period: int | None = None,
    accelerations: bool = True, first: int = 0, select: Callable[[Response], NDArray[np.bool_]] | None = None,
) -> TangentRun:  # fmt: skip
    """Integrate a problem together with the disturbances by parameters.

    Parameters
    ----------
    problem
        The problem; a basis is not permitted.
    method
        The average acceleration (`newmark`).
    variations
        The problem with a changed value of each parameter. Step and drive may differ as well.
    period
        Steps of a revolution if the run begins with a periodic state, which then depends on the parameters; None if
        the variations give the initial state.
    accelerations
        Whether probes or channels of the neighbours need accelerations; otherwise these are NaN.
    first
        First step of the results; those of a few steps before it may be added.
    select
        Function that returns at which instants of some results of the run the neighbours are evaluated; all by default.

    Returns
    -------
    TangentRun
        The results and their neighbours.

    Raises
    ------
    InputError
        If the method is another one, or a parameter changes the number of unknowns or forces.
    RunFailedError
        If the run fails.

    Examples
    --------
    The stiffness of an oscillator under a constant force; its deflection is (1 - cos(omega t))/k:

    >>> from flexcam.core import Triplets
    >>> from flexcam.dynamics import ConstantSpeed, Load, Probe, Problem, System, newmark
    >>> def oscillator(k):
    ...     one = Triplets.from_dense([[1.0]])
    ...     push = Load("push", np.ones(1), lambda motion: np.ones_like(motion.angle))
    ...     probe = Probe("x", ("x",), np.eye(1), (None,))
    ...     system = System(one, Triplets.zeros(1), one.scale(k), ("x",), (push,), probes=(probe,))
    ...     return Problem(system, ConstantSpeed(1.0), step=1e-3, steps=1000)
    >>> found = tangent_run(oscillator(4.0), newmark(), [Variation(oscillator(4.001), 0.001)])
    >>> low, high = (one["x"].displacement[-1] for one in found.neighbours[0])
    >>> exact = (np.sin(2.0) / 4.0 - (1.0 - np.cos(2.0)) / 4.0) / 4.0
    >>> bool(abs((high - low) / 0.001 - exact) < 1e-6)
    True
    """
    if not isinstance(method, Scheme) or not method.average:
        raise refuse("run.integrator", "another method", "newmark with beta 1/4 and gamma 1/2", "its steps are derived")
    if problem.adaptive is not None or problem.basis is not None:
        raise refuse("case", "adaptive steps or a reduced basis", "constant steps in all unknowns", "")
    problem = _without_acceleration(problem)
    variations = [replace(variation, problem=_without_acceleration(variation.problem)) for variation in variations]
    selected = select_engine(replace(problem, prune=_same_active_dofs(problem, variations)), method)
    reduced = [replace(variation, problem=_project(variation.problem, selected)) for variation in variations]
    forces = forces_of(selected, method)
    parameters = ParameterForces(_project(problem, selected), reduced, forces.compiled)
    _check_structure(selected.problem, parameters)
    initial = _initial_disturbances(selected.problem, forces, parameters)
    if period is not None:
        initial = _periodic_disturbances(selected, method, forces, parameters, initial, period)

    def neighbour(side: VariedProblem, parameter: int, width: float) -> _Neighbour:
        recorder = Recorder(side.problem, side.forces, method, selected.bases)
        return _Neighbour(side, parameter, width, recorder, accelerations=accelerations)

    center = neighbour(parameters.original, 0, 0.0)
    pairs = [
        (neighbour(parameters.original, i, -0.5 * width), neighbour(side, i, 0.5 * width))
        for i, (side, width) in enumerate(zip(parameters.sides, parameters.widths.tolist(), strict=True))
    ]
    done, sizes, instants, count = 0, list[FloatArray](), list[IntArray](), 0
    for track, changes in _integrate(selected, method, forces, initial, parameters):
        steps, done = np.arange(done, done + len(changes)), done + len(changes)
        sizes.append(_energies(selected.problem.system, changes[:, :, -1]))
        if done > first:
            results = center.write(steps, track, changes)
            chosen = np.arange(len(steps)) if select is None else np.flatnonzero(select(results))
            instants, count = [*instants, count + chosen], count + len(steps)
            part = track.at_ends(chosen)
            part = replace(part, cam=parameters.original.inputs(part)[0].cam)
            for run in chain.from_iterable(pairs):
                run.write(steps[chosen], part, changes[chosen])
    energy = np.concatenate(sizes)
    growth = float(np.sqrt(energy.max() / energy[0])) if energy[0] > 0.0 else 1.0
    neighbours = tuple((low.response(), high.response()) for low, high in pairs)
    indices = np.concatenate(instants) if instants else np.zeros(0, dtype=np.intp)
    return TangentRun(center.response(), neighbours, indices, growth)


def _without_acceleration(problem: Problem) -> Problem:
    """Return a problem whose first acceleration follows from equilibrium: that of a result would be constant."""
    return replace(problem, start=problem.start and replace(problem.start, acceleration=None))


def _same_active_dofs(problem: Problem, variations: Sequence[Variation]) -> bool:
    """Return whether the parameters change neither which unknowns move nor the displacement of the others."""
    basis = basis_of(problem)
    if not isinstance(basis, DofSubset):
        return False
    bases = [basis_of(variation.problem) for variation in variations]
    return all(
        isinstance(dofs, DofSubset)
        and np.array_equal(dofs.kept, basis.kept)
        and np.array_equal(dofs.offset, basis.offset)
        for dofs in bases
    )


def _project(problem: Problem, selected: SelectedEngine) -> Problem:
    """Return a problem in the unknowns of the engine; differences of such problems have no rounding of the modes."""
    for basis in reversed(selected.bases):
        if problem.system.size != basis.offset.size:
            remedy = "use differences of runs"
            raise refuse("parameter", "a number that changes the unknowns", "another one", "", remedy)
        problem = reduce_problem(problem, basis)
    return problem


def _check_structure(problem: Problem, parameters: ParameterForces) -> None:
    """Raise an error if a parameter changes the number of unknowns, local forces or steps, or the ramp of a damping."""

    def size(varied: Problem) -> tuple[int, ...]:
        return (varied.system.size, varied.steps, *(len(force.sense) for force in varied.system.local_forces))

    why, remedy = "the equations must keep their structure", "use differences of runs (--method differences)"
    if any(size(side.problem) != size(problem) for side in parameters.sides):
        raise refuse("parameter", "a number that changes the unknowns, contacts or steps", "another one", why, remedy)
    ramps = parameters.original.forces.ramps
    if not all(np.array_equal(side.forces.ramps, ramps) for side in parameters.sides):
        why = "steps end where the damping of a contact is complete"
        raise refuse("parameter", "a number that changes a damping_depth", "another one", why, remedy)


def _initial_disturbances(problem: Problem, forces: LocalForces, parameters: ParameterForces) -> FloatArray:
    """Return the disturbances of the initial state by the parameters, and by a velocity of all masses."""
    begin, n = parameters.initial_state(), problem.system.size
    velocity = np.zeros((len(begin), 1))
    mass = problem.system.mass.diagonal()
    velocity[n : 2 * n, 0] = np.where(mass > 0.0, 1.0 / np.sqrt(np.where(mass > 0.0, mass, 1.0)), 0.0)
    return np.hstack([begin, velocity])


def _energies(system: System, disturbance: FloatArray) -> FloatArray:
    """Return twice the energies of a disturbance at m instants, shape (m, 2n + s)."""
    d, v, _ = split_state(disturbance.T, system.size)
    return (v * system.mass.multiply(v)).sum(axis=0) + (d * system.stiffness.multiply(d)).sum(axis=0)


def _integrate(
    selected: SelectedEngine, method: Method, forces: LocalForces, initial: FloatArray, parameters: ParameterForces
) -> Iterator[tuple[Trajectory, FloatArray]]:
    """Yield the motion of a problem block by block with the disturbances by its parameters, see `Disturbances`."""
    problem = selected.problem
    engine = create_engine(selected, method, forces, SaveAt(field_every=problem.steps + 1), lambda: False, pilot)
    disturbances = Disturbances(problem, forces, initial, parameters)
    for track in iterate_tracks(engine, problem.steps):
        yield disturbances.follow(track)


def _periodic_disturbances(
    selected: SelectedEngine, method: Method, forces: LocalForces, parameters: ParameterForces, initial: FloatArray,
    period: int,
) -> FloatArray:  # fmt: skip
    """Return the disturbances of a periodic initial state: those that a revolution returns.

    With the derivative Phi of a revolution by its initial state and the disturbances b that the parameters add within
    it, the periodic state changes by x = Phi x + b.
    """
    size, count = len(initial), parameters.count
    revolution = replace(selected, problem=replace(selected.problem, steps=period))
    begin = np.hstack([np.zeros((size, count)), np.eye(size)])
    *_, (_, changes) = _integrate(revolution, method, forces, begin, parameters)
    end = changes[-1]
    result = initial.copy()
    result[:, :count] = np.linalg.lstsq(np.eye(size) - end[:, count:], end[:, :count], rcond=FREE)[0]
    return result


class _Neighbour:
    """Results of a run with a parameter near its value, to first order."""

    def __init__(
        self, side: VariedProblem, parameter: int, width: float, recorder: Recorder, *, accelerations: bool
    ) -> None:
        self._side, self._parameter, self._width = side, parameter, width
        self._recorder, self._accelerations = recorder, accelerations
        self.response = recorder.response

    def write(self, steps: IntArray, track: Trajectory, changes: FloatArray) -> Response:
        """Add and return the instants of some steps with the disturbances at their ends; others stay undisturbed."""
        side, n, forces = self._side, self._side.problem.system.size, self._side.forces
        motion, inputs = side.inputs(track)
        change = np.zeros((len(track.time), changes.shape[1]))
        change[track.ends] = self._width * changes[:, :, self._parameter]
        d, v, state = track.d + change[:, :n], track.v + change[:, n : 2 * n], track.state + change[:, 2 * n :]
        sensed, rate, _ = forces.sense_motion(d, v, inputs)
        local = forces.evaluate(sensed, state, inputs.functions, rate=rate)[1]
        a = track.a if self._width == 0.0 else np.full_like(d, np.nan)
        if self._width != 0.0 and self._accelerations:
            a = side.accelerations.accelerations(side.forces_without_inertia(motion, inputs, d, v, local).T).T
        new = Trajectory(
            motion.time, d, v, a, local, state, np.zeros_like(local), track.pressed, track.ends, motion.cam
        )
        return self._recorder.write(steps, SensedTrajectory(new, inputs, sensed, rate))
